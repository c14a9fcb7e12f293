"""Bifurcations of branches: where they turn, and where their multipliers cross the unit circle."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito.job.job import Job
from attrito.library.names import BIFURCATION_KINDS as KINDS
from attrito.library.names import NO_SOLUTION, ORBITS
from attrito.library.session import Point, Solver
from attrito.library.structures import RawBifurcation, pointer
from attrito.runs.stability import METHODS
from attrito.support.hdf5_writing import described

if TYPE_CHECKING:
    from attrito.runs.progress import Progress

FOLDS = KINDS[:2]
FOLD_CROSSINGS = KINDS[4:]
# Steps and part of the frequency between the folds of the balance's orbit and of the event-exact one that multipliers
# may be of: what few harmonics leave out.
FOLD_POINTS = 3
FOLD_WIDTH = 1e-3


@dataclass(frozen=True)
class Bifurcation:
    """A turning point or a crossing on the step that ends at point `point`; `amplitude` of the monitors there."""

    kind: str
    point: int
    branch: int
    level: float
    frequency_hz: float
    uncertain_hz: float
    multiplier: complex
    amplitude: np.ndarray


class Finder:
    """Looks for bifurcations on every step of a sweep, and keeps them.

    Parameters
    ----------
    solver : what solves
    job : says whether to look, and how stability is examined
    progress : told of each
    """

    def __init__(self, solver: Solver, job: Job, progress: Progress):
        self._solver, self._progress = solver, progress
        self._looks = job["continuation"]["locate"]
        self._how = METHODS[job["stability"]["method"]], ORBITS[job["stability"]["orbit"]]
        self._points = 0
        self._last: list[Bifurcation] = []
        self.found: list[Bifurcation] = []

    def visit(self, point: Point) -> None:
        """Look at the step that led to a point, which is written already. Collective."""
        number = self._points
        self._points += 1
        self._last = []
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
            if self._add(new):
                self._progress.say(f"{new.kind.replace('_', ' ')} at {new.frequency_hz:.7g} Hz")

    def put_down(self) -> dict[str, np.ndarray]:
        """What was found of the last point."""
        rows = [
            [KINDS.index(one.kind), one.branch, one.level, one.frequency_hz, one.uncertain_hz, one.multiplier.real,
             one.multiplier.imag, *one.amplitude]
            for one in self._last
        ]  # fmt: skip
        return {"bifurcations": np.array(rows, dtype=float)} if rows else {}

    def take_up(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `put_down` told this."""
        for kind, branch, level, frequency, uncertain, real, imaginary, *amplitude in found.get("bifurcations", ()):
            multiplier = complex(real, imaginary)
            self._add(
                Bifurcation(
                    KINDS[int(kind)],
                    self._points,
                    int(branch),
                    float(level),
                    float(frequency),
                    float(uncertain),
                    multiplier,
                    np.array(amplitude),
                )
            )
        self._points += 1

    def _add(self, new: Bifurcation) -> bool:
        """Keep it, unless it is a fold's own crossing, told by an orbit that turns at another frequency."""
        if any(_is_of_fold(new, fold) for fold in self.found):
            return False
        self.found = [one for one in self.found if not _is_of_fold(one, new)]
        self.found.append(new)
        return True


def _is_of_fold(crossing: Bifurcation, fold: Bifurcation) -> bool:
    """Whether a multiplier that passes 1, or jumps, does so at a fold: of the event-exact orbit, near the balance's."""
    return (
        crossing.kind in FOLD_CROSSINGS
        and fold.kind in FOLDS
        and (crossing.branch, crossing.level) == (fold.branch, fold.level)
        and abs(crossing.point - fold.point) <= FOLD_POINTS
        and abs(crossing.frequency_hz - fold.frequency_hz) < FOLD_WIDTH * fold.frequency_hz
    )


def write_bifurcations(file: h5py.File, found: list[Bifurcation], monitors: list[str]) -> None:
    """Add them to a result file that is open, as `/bifurcations`."""
    columns = {
        "frequency_hz": ("Hz", float, "frequency", [one.frequency_hz for one in found]),
        "uncertain_hz": ("Hz", float, "what is left open of the frequency", [one.uncertain_hz for one in found]),
        "level": ("1", float, "factor on the harmonic loads", [one.level for one in found]),
        "branch": ("1", np.int32, "number of the branch", [one.branch for one in found]),
        "point": ("1", np.int32, "number of the point that its step leads to", [one.point for one in found]),
        "kind": ("1", np.int32, "index into the attribute names", [KINDS.index(one.kind) for one in found]),
        "real": ("1", float, "real part of the multiplier that crosses", [one.multiplier.real for one in found]),
        "imag": ("1", float, "its imaginary part", [one.multiplier.imag for one in found]),
    }
    group = file.create_group("bifurcations")
    for name, (unit, kind, description, values) in columns.items():
        names = KINDS if name == "kind" else ()
        described(group, name, description, unit, names, data=np.array(values, dtype=kind))
    for i, name in enumerate(monitors):
        values = [float(one.amplitude[i]) for one in found]
        described(
            group, f"amplitude/{name}", "half the range of the monitor over the period", "user length", data=values
        )
