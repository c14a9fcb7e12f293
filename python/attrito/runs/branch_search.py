"""Branches that coexist, sought on purpose: starts from elsewhere, and the branches that they lie on.

A start is a frequency and a way to look for a point there. What it finds is held against every branch that is known; if
it lies on none it is followed, first one way in silence to where the branch ends, then from there all the way, so that
its points come in the order of the branch. New branches bring new starts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.names import NO_SOLUTION, STARTS
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.results.bifurcations import FOLDS
from attrito.runs.bifurcations import Finder

if TYPE_CHECKING:
    from attrito.runs.progress import Progress

COLD, IN_TIME, HOMOTOPY = STARTS
# In words
WORDS = {COLD: "a cold start", IN_TIME: "motion in time", HOMOTOPY: "homotopy in the preload"}
# Frequencies, beside the ends, at which starts are made whatever is known; factors on the harmonics of a known motion
# that motion in time begins with, and on the static loads.
FREQUENCIES = 5
KICKS = (0.0, 0.5, 2.0)
PRELOADS = (4.0, 0.25)
# Part of the range beyond a fold at which motion in time leaves the branch.
BEYOND = 0.01
# Runs of points without a stable solution that are looked at; points after which a branch is held against known ones.
RUNS = 6
LOOK_EVERY = 5


@dataclass(frozen=True)
class Start:
    """Where and how to look: `point` is the number of the known point that motion in time begins at."""

    way: str
    frequency_hz: float
    factor: float = 1.0
    point: int = -1


@dataclass(frozen=True)
class Known:
    """A point that is known: `number` among those the library keeps, -1 if it holds no solution."""

    number: int
    branch: int
    frequency_hz: float
    outcome: str


class Search:
    """Keeps what is known at a level, and finds branches beside it.

    Parameters
    ----------
    solver, job : what solves, and what is asked
    load_path : of the static loads, `[corners, loads]`
    finder : of folds, from which branches are left
    progress : reports what is found
    """

    def __init__(self, solver: Solver, job: Job, load_path: np.ndarray, finder: Finder, progress: Progress):
        self._solver, self._finder, self._progress = solver, finder, progress
        self._path, self._steps = load_path, job["static"]["steps"]
        self._most = job["continuation"]["branches"]
        self._max_points = job["continuation"]["max_points"]
        self._points: list[Known] = []
        self._kept = 0
        self._first_bifurcation = 0
        self._level = 1.0

    @property
    def searches(self) -> bool:
        """Whether more than the sweep's own branch is asked for."""
        return self._most > 1

    def begin_level(self, level: float) -> None:
        """Forget the branches of another level."""
        self._level = level
        self._points, self._kept, self._first_bifurcation = [], 0, len(self._finder.found)
        self._solver.call("attrito_remove_points", 0)

    def keep(self, point: Point, first: bool) -> None:
        """Remember a point that is written; `first` of its sweep. Collective."""
        if not self.searches:
            return
        solved = point.outcome not in NO_SOLUTION
        before = self._points[-1] if self._points else None
        follows = not first and before is not None and before.number >= 0 and before.branch == point.branch
        if solved:
            self._solver.call("attrito_keep_point", int(follows))
        number = self._kept if solved else -1
        self._points.append(Known(number, point.branch, point.frequency_hz, point.outcome))
        self._kept += int(solved)

    def branches(self, low: float, high: float, branch: int) -> Iterator[tuple[Point, bool]]:
        """Points of the branches found between two frequencies, the first numbered `branch`; and whether one begins."""
        done: set[Start] = set()
        found = len({known.branch for known in self._points if known.number >= 0})
        while found < self._most:
            start = next((one for one in self._starts(low, high) if one not in done), None)
            if start is None:
                self._progress.say(f"{found} of {self._most} branches found: {len(done)} starts led to no other")
                break
            done.add(start)
            if not self._seek(start, low, high):
                continue
            self._progress.say(f"another branch at {start.frequency_hz:.6g} Hz, by {WORDS[start.way]}")
            yield from self._follow(low, high, branch)
            branch += 1
            found += 1

    def _seek(self, start: Start, low: float, high: float) -> bool:
        """Whether a start leads to a point on no known branch, at which the solver then stands."""
        if start.point >= 0:
            self._solver.call("attrito_start_from_point", start.point)
        else:
            self._solver.follow_static_path(self._path, self._steps, start.frequency_hz)
            self._solver.set_excitation(low, high, self._level)
        if not self._solver.seek(start.way, start.frequency_hz, start.factor):
            return False
        return not self._solver.call("attrito_lies_on_branch", self._kept)

    def _starts(self, low: float, high: float) -> Iterator[Start]:
        """All that can be made of what is known, the most promising first."""
        yield from (Start(COLD, frequency) for frequency in (high, low))
        for fold in self._finder.found[self._first_bifurcation :]:
            if fold.kind not in FOLDS:
                continue
            point = self._nearest(fold.frequency_hz, fold.branch)
            for side in (1.0, -1.0):
                frequency = fold.frequency_hz + side * BEYOND * (high - low)
                if low <= frequency <= high and point >= 0:
                    yield Start(IN_TIME, frequency, 1.0, point)
        for frequency in self._without_stable():
            yield from self._away_from_known(frequency)
        for frequency in np.linspace(low, high, FREQUENCIES + 2)[1:-1].tolist():
            yield Start(COLD, frequency)
            yield from self._away_from_known(frequency)

    def _away_from_known(self, frequency_hz: float) -> Iterator[Start]:
        """Out of motion in time beside the nearest known motion, and from other preloads."""
        point = self._nearest(frequency_hz)
        if point >= 0:
            yield from (Start(IN_TIME, frequency_hz, kick, point) for kick in KICKS)
        yield from (Start(HOMOTOPY, frequency_hz, factor) for factor in PRELOADS)

    def _nearest(self, frequency_hz: float, branch: int | None = None) -> int:
        """Number of the kept point of the first branch nearest in frequency, of a branch if given; -1: none."""
        chosen = [known for known in self._points if known.number >= 0]
        wanted = min((known.branch for known in chosen), default=0) if branch is None else branch
        chosen = [known for known in chosen if known.branch == wanted]
        return min(chosen, key=lambda known: abs(known.frequency_hz - frequency_hz)).number if chosen else -1

    def _without_stable(self) -> list[float]:
        """Middles of the runs of points that are unstable or missing."""
        runs: list[list[float]] = [[]]
        for known in self._points:
            if known.outcome in ("converged", "above_tolerance"):
                runs.append([])
            else:
                runs[-1].append(known.frequency_hz)
        return [run[len(run) // 2] for run in sorted(runs, key=len, reverse=True) if run][:RUNS]

    def _follow(self, low: float, high: float, branch: int) -> Iterator[tuple[Point, bool]]:
        """The branch that the solver stands on: in silence to where it ends, then all of it."""
        known = self._kept
        last = known
        for count, point in enumerate(self._solver.follow(low, high, branch, self._max_points, 1)):
            if point.outcome in NO_SOLUTION or (count % LOOK_EVERY == LOOK_EVERY - 1 and self._meets(known)):
                break
            self._solver.call("attrito_keep_point", int(count > 0))
            last = known + count
        self._solver.call("attrito_start_from_point", last)
        self._solver.call("attrito_remove_points", known)
        for count, point in enumerate(self._solver.follow(low, high, branch, self._max_points, 0)):
            if point.outcome in NO_SOLUTION or (count % LOOK_EVERY == LOOK_EVERY - 1 and self._meets(known)):
                self._progress.say(f"branch {branch} ends at {point.frequency_hz:.6g} Hz")
                break
            yield point, count == 0

    def _meets(self, count: int) -> bool:
        """Whether the solver has come onto one of the first `count` known points' branches."""
        return bool(self._solver.call("attrito_lies_on_branch", count))
