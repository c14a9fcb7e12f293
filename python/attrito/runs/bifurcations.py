"""Bifurcations of branches: where they turn, and where their multipliers cross the unit circle."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.names import BIFURCATION_KINDS as KINDS
from attrito.library.names import NO_SOLUTION, ORBITS
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.library.structures import RawBifurcation, pointer
from attrito.results.bifurcations import FOLDS, Bifurcation, added, as_rows, narrowest_fold, of_rows
from attrito.runs.stability import METHODS

if TYPE_CHECKING:
    from attrito.runs.progress import Progress


class Finder:
    """Looks for bifurcations on every step of a sweep.

    Parameters
    ----------
    solver : what solves
    job : says whether to look, and how stability is examined
    progress : reports each

    Attributes
    ----------
    found : those of all points so far
    """

    def __init__(self, solver: Solver, job: Job, progress: Progress):
        self._solver, self._progress = solver, progress
        self._looks = job["continuation"]["locate"]
        self._how = METHODS[job["stability"]["method"]], ORBITS[job["stability"]["orbit"]]
        self._narrow = narrowest_fold(job.tables)
        self._points = 0
        self._last: list[Bifurcation] = []
        # A fold that is not said yet: the branch has not gone back from it farther than the curve is drawn.
        self._fold: Bifurcation | None = None
        self.found: list[Bifurcation] = []

    def visit(self, point: Point) -> None:
        """Look at the step that led to a point, which is written already. Collective."""
        number = self._points
        self._points += 1
        self._last = []
        self._confirm(point.branch, point.frequency_hz)
        if not self._looks or not point.followed or point.outcome in NO_SOLUTION:
            return
        for i in range(self._solver.call("attrito_find_bifurcations", *self._how)):
            report, amplitude = RawBifurcation(), np.zeros(len(point.amplitude))
            self._solver.call("attrito_bifurcation", i, ctypes.byref(report), pointer(amplitude))
            new = Bifurcation(
                KINDS[report.kind],
                number,
                point.branch,
                point.level,
                report.frequency_hz,
                report.uncertain_hz,
                complex(report.re, report.im),
                amplitude,
            )
            self._last.append(new)
            self._add(new)
            self._confirm(point.branch, point.frequency_hz)

    def _add(self, new: Bifurcation) -> None:
        self.found = added(self.found, new, self._narrow)
        if not any(one is new for one in self.found):
            self._fold = None
        elif new.kind in FOLDS:
            self._fold = new
        else:
            self._say(new)

    def _confirm(self, branch: int, frequency_hz: float) -> None:
        """Say the last fold once the branch has gone back from it, or has ended."""
        fold = self._fold
        if fold is None:
            return
        if branch != fold.branch or abs(frequency_hz - fold.frequency_hz) > self._narrow * fold.frequency_hz:
            self._say(fold)
            self._fold = None

    def _say(self, one: Bifurcation) -> None:
        self._progress.say(f"{one.kind.replace('_', ' ')} at {one.frequency_hz:.7g} Hz")

    def save_state(self) -> dict[str, np.ndarray]:
        """What was found of the last point."""
        return {"bifurcations": as_rows(self._last)} if self._last else {}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this."""
        for one in of_rows(self._points, found.get("bifurcations", ())):
            self.found = added(self.found, one, self._narrow)
        self._points += 1
