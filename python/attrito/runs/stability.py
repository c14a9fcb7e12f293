"""Stability of a run's points: each is examined as it is solved."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library import loading
from attrito.library.names import ENGINES, ORBITS
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.library.structures import RawExamination, pointer

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

METHODS = {"none": 0, **ENGINES, "both": 3}


class Examiner:
    """Examines points as they are solved; what it finds of the last is kept at the root until its record is written.

    Parameters
    ----------
    comm, solver : what solves
    job : says by which engines
    """

    def __init__(self, comm: Comm, solver: Solver, job: Job):
        self._solver, self._root = solver, comm.rank == 0
        self._methods = METHODS[job["stability"]["method"]]
        self._orbit = ORBITS[job["stability"]["orbit"]]
        self._viscous = int(job["integrate"]["equivalent_viscous"])
        self._found: dict[str, np.ndarray] = {}

    def examine(self, point: Point) -> Point:
        """The point with its verdict: it is the solver's last, and it is not written yet. Collective."""
        self._found = {}
        if not self._methods or point.outcome not in ("converged", "above_tolerance"):
            return point
        report, reason = examine_point(self._solver, self._methods, self._orbit, self._viscous)
        if self._root:
            self._note(report, reason)
        return point._replace(outcome=self._solver.outcome())

    def _note(self, report: RawExamination, reason: str) -> None:
        """Put what was found as `results.stability_part` reads it."""
        rows = [
            np.column_stack(
                [
                    np.full(count, index),
                    *fetch_multipliers(self._solver, engine, count),
                    fetch_wavenumbers(self._solver, engine, count),
                ]
            )
            for index, (name, engine) in enumerate(ENGINES.items())
            if (count := getattr(report, name))
        ]
        if rows:
            self._found["multipliers"] = np.concatenate(rows)
        if reason:
            self._found["reason"] = np.frombuffer(reason.encode(), np.uint8)
        if report.distance >= 0.0:
            self._found["distance"] = np.array(report.distance)
        if report.monodromy:
            self._found["change"] = np.array(report.change)
        if report.high >= report.low:
            self._found["low"], self._found["high"] = np.array(report.low), np.array(report.high)

    def save_state(self) -> dict[str, np.ndarray]:
        """What was found of the last point, at the root."""
        return {f"stability/{name}": values for name, values in self._found.items()}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Nothing of a point is needed for the next."""


def examine_point(solver: Solver, methods: int, orbit: int, viscous: int = 0) -> tuple[RawExamination, str]:
    """What the library finds at the point where a solver stands, and why it has no verdict. Collective."""
    report, message = RawExamination(), loading.message_buffer()
    status = solver.call("attrito_examine", methods, orbit, viscous, ctypes.byref(report), message, len(message))
    loading.check(status, message)
    return report, message.value.decode()


def fetch_multipliers(solver: Solver, engine: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Real parts, imaginary parts and kinds of the last examination's multipliers by one engine, at the root."""
    real, imaginary, kind = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.int32)
    solver.call("attrito_multipliers", engine, pointer(real), pointer(imaginary), pointer(kind))
    return real, imaginary, kind


def fetch_wavenumbers(solver: Solver, engine: int, count: int) -> np.ndarray:
    """Wavenumbers of the same multipliers in a sector's wheel, at the root; -1 where there is none."""
    wavenumber = np.zeros(count, dtype=np.int32)
    solver.call("attrito_wavenumbers", engine, pointer(wavenumber))
    return wavenumber
