"""The points of a job in their order.

For each level the static path, then the sweep, and back if the job says so; then other branches if asked for.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from attrito.job.job import Job
from attrito.library.points import Point, StoredPoint
from attrito.library.session import Solver
from attrito.runs.branch_search import Search
from attrito.runs.position import RunPosition
from attrito.runs.progress import Progress
from attrito.scene.cautions import of_static_solution
from attrito.support.errors import NumericsError


def beginning(job: Job, start: StoredPoint | None) -> float:
    """The frequency at which the first sweep begins, Hz: of a point of an older result, if there is one."""
    sweep = job["sweep"]
    return float((sweep["frequencies_hz"] or [sweep["start_hz"]])[0]) if start is None else start.frequency_hz


class Course:
    """The way through a job.

    Parameters
    ----------
    solver, job, load_path : what solves, and what is asked; factors on the static loads, `[corners, loads]`
    search : for branches beside those of the sweeps
    start : the point of an older result that sweeps begin at, if any
    static_means : of the monitors at the static solution that the solver is at; None: the load path is to be followed
    progress : reports what is done
    """

    def __init__(
        self,
        solver: Solver,
        job: Job,
        load_path: np.ndarray,
        search: Search,
        start: StoredPoint | None,
        static_means: np.ndarray | None,
        progress: Progress,
    ):
        self._solver, self._job, self._path = solver, job, load_path
        self._search, self._start, self._progress = search, start, progress
        self._static_means = static_means
        sweep = job["sweep"]
        self._listed = sweep["frequencies_hz"]
        ends = [(sweep["start_hz"], sweep["stop_hz"])]
        if self._listed:
            ends = [(self._listed[0], self._listed[-1])]
        elif job["continuation"]["both_directions"]:
            ends.append(ends[0][::-1])
        self._range = sorted(ends[0])
        self._sides = len(ends)
        self._stretches = [(level, *both) for level in sweep["levels"] for both in ends]

    def is_done(self, place: RunPosition) -> bool:
        """Whether no point is left."""
        return place.finished and place.stretch + 1 == len(self._stretches) and not self._search.searches

    def levels(self, place: RunPosition) -> Iterator[Iterator[Point]]:
        """Every point that is left, level by level.

        Parameters
        ----------
        place : how far the run has come, the solver standing at its last point; kept up to date but for its `add`
        """
        while place.stretch < len(self._stretches):
            yield self._points(place, place.stretch // self._sides)

    def _points(self, place: RunPosition, level: int) -> Iterator[Point]:
        """What is left of a level."""
        while place.stretch // self._sides == level:
            if not place.finished:
                yield from self._sweep(place)
            if self._search.searches and (place.stretch + 1) % self._sides == 0:
                place.searching = True
                for point, first in self._search.branches(*self._range, place.branch + 1):
                    place.taken = 1 if first else place.taken + 1
                    yield point
                place.searching = False
            place.stretch, place.taken, place.finished, place.branch = place.stretch + 1, 0, False, place.branch + 1

    def _sweep(self, place: RunPosition) -> Iterator[Point]:
        """What is left of a sweep."""
        level, start, stop = self._stretches[place.stretch]
        place.level = place.stretch // self._sides
        begin = start if self._start is None else self._start.frequency_hz
        for point in self._begin(place, begin) if place.taken == 0 else self._go_on(place):
            place.taken += 1
            place.finished = place.taken == len(self._listed) if self._listed else point.finished
            if place.finished and not self._listed and not point.reached_stop:
                place.incomplete.append(
                    f"the sweep of level {level:g} from {begin:g} Hz ended at {point.frequency_hz:.6g} Hz,"
                    f" before its stop at {stop:g} Hz: the branch turned back over its start, closed upon itself or was"
                    " lost, or [continuation] max_points was reached"
                )
            yield point
        if place.incomplete and not self._listed and not point.reached_stop:
            self._progress.say(place.incomplete[-1])

    def _begin(self, place: RunPosition, begin: float) -> Iterator[Point]:
        level, start, stop = self._stretches[place.stretch]
        if place.stretch % self._sides == 0:
            self._search.begin_level(level)
        means, self._static_means = self._static_means, None
        if means is None or place.stretch > 0:
            means = self._solver.follow_static_path(self._path, self._job["static"]["steps"], begin)
        self._progress.static(means)
        for warning in of_static_solution(self._solver.static_states):
            if warning not in place.warnings:
                place.warnings.append(warning)
                self._progress.say(f"warning: {warning}")
        if self._listed:
            return self._solver.solve_at(self._listed, level, place.branch)
        most = self._job["continuation"]["max_points"]
        if self._start is None:
            return self._solver.sweep(start, stop, level, place.branch, most)
        if not self._solver.start_from(self._start, level):
            raise NumericsError(f"the point to start at, {begin:.6g} Hz, is not solved at level {level:g}")
        return self._solver.follow(start, stop, place.branch, most, 1 if stop > start else -1)

    def _go_on(self, place: RunPosition) -> Iterator[Point]:
        if self._listed:
            return self._solver.go_on_at(self._listed[place.taken :], place.branch)
        return self._solver.go_on()
