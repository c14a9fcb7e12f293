"""Which points' families are visited, and what for: the budget of bounds that members are visited for.

A point's other members cost about as much as points do, so that all bounds of a sweep would take many times as long as
the sweep. With "auto" they may take a tenth of the work of all points so far, both counted by formulas and not timed,
so that it depends neither on a machine nor on its load. A level's points are examined when it has come to its end, from
the highest down, until the rest of the budget no longer pays as much as the last one took. The highest point of each
level is examined whatever is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from attrito.library.family import Family
from attrito.library.laws import are_coulomb
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.runs.bounds_by_members import VISITS, Hull, Search
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.runs.recorder import Recorder

# States of contacts that hold their sliders
HOLDING = ("stuck", "shaken_down")
VISITED = ("converged", "unstable", "above_tolerance")
# More contacts than this would cost more than the solve by linear programs.
MOST_CONTACTS = 120
# Of the work of points, what bounds may take besides
SHARE = 0.1


@dataclass(frozen=True)
class Candidate:
    """A point that is not unique, and whose other members can be visited.

    Parameters
    ----------
    number : of the point in the run, from 0
    height : amplitude of the first monitor
    error : estimated, of its balance
    """

    number: int
    height: float
    error: float


@dataclass
class Schedule:
    """Which point is examined next, and what for; works are counted in operations of points.

    Parameters
    ----------
    limited : whether bounds may take no more than `SHARE` of the points' work
    points, earned, spent : number of points, their work, and that of bounds, so far
    last : work of visits to the last point that was examined
    level : that is being swept, from 0
    candidates : of the level, not examined so far
    examined : how many of the level are
    left_out : numbers of the points of earlier levels that are not examined
    """

    limited: bool
    points: int = 0
    earned: float = 0.0
    spent: float = 0.0
    last: float = 0.0
    level: int = 0
    candidates: list[Candidate] = field(default_factory=list)
    examined: int = 0
    left_out: list[int] = field(default_factory=list)

    @property
    def left(self) -> float:
        """What visits to one more point may take; negative if the highest points have taken more."""
        return SHARE * self.earned - self.spent - self.return_work if self.limited else np.inf

    @property
    def return_work(self) -> float:
        """What it takes to return to a point and to factorise again: as much as the mean point."""
        return self.earned / max(self.points, 1)

    @property
    def omitted(self) -> list[int]:
        """Numbers of the points that are not examined."""
        return self.left_out + [one.number for one in self.candidates]

    def add(self, level: int, work: float, candidate: Candidate | None) -> None:
        """A point was solved, at the cost of some work."""
        if level != self.level:
            self.left_out, self.level, self.candidates, self.examined = self.omitted, level, [], 0
        self.points += 1
        self.earned += work
        if candidate is not None:
            self.candidates.append(candidate)

    def next(self) -> Candidate | None:
        """The highest point of the level that is left; none if its bounds are likely not to be paid."""
        if not self.candidates or (self.examined > 0 and self.left <= self.last):
            return None
        return max(self.candidates, key=lambda one: (one.height, -one.number))

    def finish(self, number: int, work: float) -> None:
        """A point was examined, its visits at the cost of some work."""
        self.candidates = [one for one in self.candidates if one.number != number]
        self.examined += 1
        self.spent += work + self.return_work
        self.last = work


class Sampler:
    """Visits the families of points, level by level, and keeps what it found at the root.

    Parameters
    ----------
    comm, solver, scene, options : what solves, and what is solved
    bounds : "auto", "sampled" or "none", as in the job
    interrupted : says why to stop between two visits, or nothing; collective

    Attributes
    ----------
    programs : whether linear programs give the bounds of points at which every contact sticks
    gives_up : whether such points have too many contacts for that, or contacts without friction cones
    hulls : what was found, by number of the point
    """

    def __init__(
        self,
        comm: Comm,
        solver: Solver,
        scene: ReducedScene,
        options: Options,
        bounds: str,
        interrupted: Callable[[], str] | None = None,
    ):
        tangents = scene.laws["tangents"]
        single = bool(np.all(tangents == 1))
        cones = are_coulomb(scene.laws)
        self.programs = bounds == "auto" and len(tangents) <= MOST_CONTACTS and single and cones
        self.gives_up = bounds == "auto" and len(tangents) > MOST_CONTACTS and single
        self.lacks_cones = bounds == "auto" and not cones
        self.hulls: dict[int, Hull] = {}
        self._comm, self._solver = comm, solver
        self._samples = not options.uncoupled and bounds != "none" and cones
        self._search = Search(scene.laws)
        self._schedule = Schedule(limited=bounds == "auto")
        # A point's search within a budget is soon done; others may take minutes.
        may_stop = None if self._schedule.limited else interrupted
        self._family = Family(comm, solver, len(tangents), len(scene.monitors), may_stop)
        self._points, self._work = 0, 0.0
        # What was noted of the last point: level, its work, and number, height and error of a candidate
        self._note: list[float] = []

    def visit(self, point: Point, level: int) -> None:
        """Take note of the next point, and of the number of its level."""
        one = self._candidate(point)
        self._note = [level, point.work - max(self._work, self._solver.static_work)]
        self._note += [] if one is None else [one.number, one.height, one.error]
        self._work = point.work
        self._take_note()

    def _candidate(self, point: Point) -> Candidate | None:
        """What to examine of a point; nothing where it is the only one, or linear programs are for it."""
        slips = sum(point.states[len(HOLDING) :]) > 0
        if (
            not self._samples
            or point.unique
            or point.outcome not in VISITED
            or ((self.programs or self.gives_up) and not slips)
        ):
            return None
        height = float(point.amplitude[0]) if len(point.amplitude) else 0.0
        return Candidate(self._points, height, point.errors[0] + point.errors[1])

    def _take_note(self) -> None:
        level, work, *candidate = self._note
        self._schedule.add(int(level), work, Candidate(int(candidate[0]), *candidate[1:]) if candidate else None)
        self._points += 1

    @property
    def omitted(self) -> list[int]:
        """Numbers of the points that are not examined for their cost."""
        return self._schedule.omitted

    def in_words(self, seconds: float) -> str:
        """What bounds were found for, in a time, and how to change that; empty: they were not sought. At the root."""
        sought = len(self.hulls) + len(self.omitted)
        if not self._samples or sought == 0:
            return ""
        other = ', "sampled" all of them' if self.omitted else ""
        return (
            f"bounds: other members of {len(self.hulls)} of {sought} points that are not unique visited in"
            f' {seconds:.1f} s; [static] bounds = "none" leaves them out{other}'
        )

    def end_level(self, recorder: Recorder, asked: Callable[[], str]) -> None:
        """Examine points of the level that has come to its end; the solver is left as it was. Collective.

        `asked` says why to stop after a point, or nothing.

        Raises
        ------
        NumericsError : the run was stopped; what was found is written, and the rest is to be found
        """
        here = None
        while (one := self._comm.bcast(self._schedule.next())) is not None:
            if here is None:
                here = self._solver.save_state(), self._solver.coefficients
            elif reason := asked():
                raise NumericsError(f"stopped by {reason}")
            recorder.return_to(one.number)
            found = self._examine(one)
            recorder.add_found(self, one.number, found)
            self.load_state(found)
        if here is not None:
            self._solver.load_state(here[0])
            self._solver.coefficients = here[1]

    def _examine(self, one: Candidate) -> dict[str, np.ndarray]:
        """Visit members of a point, at which the solver stands; what was found, for `load_state`."""
        left, least = self._schedule.left, VISITS * self._schedule.return_work
        hull = self._family.visit(lambda family: self._search(family, left, one.error, least))
        if self._family.stopped:
            raise NumericsError(f"stopped by {self._family.stopped}")
        found = {} if hull is None else {f"hull/{name}": np.asarray(value) for name, value in vars(hull).items()}
        return found | {"hull/of": np.array(one.number)}

    def save_state(self) -> dict[str, np.ndarray]:
        """What was noted of the last point, at the root."""
        return {"hull/note": np.array(self._note, dtype=float)}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this, or after one was examined."""
        if "hull/note" in found:
            self._note = found["hull/note"].tolist()
            self._work = float(found["/points/work"])
            self._take_note()
            return
        number, work = int(found["hull/of"]), 0.0
        if "hull/force" in found:
            self.hulls[number] = Hull(
                **{name: found[f"hull/{name}"] for name in ("force", "mean", "amplitude", "visited")},
                members=int(found["hull/members"]),
                accuracy=float(found["hull/accuracy"]),
                complete=bool(found["hull/complete"]),
                work=(work := float(found["hull/work"])),
            )
        self._schedule.finish(number, work)
