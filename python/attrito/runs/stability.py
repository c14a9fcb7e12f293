"""Stability of a run's points: each is examined as it is solved, and its Floquet multipliers are written at the end."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito.job.job import Job
from attrito.library import loading
from attrito.library.names import ENGINES, MULTIPLIER_KINDS, ORBITS, VERDICTS
from attrito.library.session import Point, Solver
from attrito.library.structures import RawExamination, pointer
from attrito.support.hdf5_writing import described

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

METHODS = {"none": 0, **ENGINES, "both": 3}
# What the outcome of a converged point becomes by its verdict.
OUTCOMES = {"unstable": "unstable", "stable": "converged", "indeterminate": "indeterminate"}


class Examiner:
    """Examines points as they are solved, and keeps what it found at the root.

    Parameters
    ----------
    comm, solver : what solves
    job : says by which engines

    Attributes
    ----------
    rows : one for each multiplier: point, engine (index), real part, imaginary part, kind (index)
    reasons : why a point, by number, has no verdict
    distances, changes : of a point, by number: how far the event-exact orbit lies from the balance's; what doubling the
        modes last changed of its multipliers
    lows, highs : of an indeterminate point, by number: the interval of its largest multiplier's modulus
    """

    def __init__(self, comm: Comm, solver: Solver, job: Job):
        self._solver, self._root = solver, comm.rank == 0
        self._methods = METHODS[job["stability"]["method"]]
        self._orbit = ORBITS[job["stability"]["orbit"]]
        self._viscous = int(job["integrate"]["equivalent_viscous"])
        self._points = 0
        self.rows: list[tuple[int, int, float, float, int]] = []
        self.reasons: dict[int, str] = {}
        self.distances: dict[int, float] = {}
        self.changes: dict[int, float] = {}
        self.lows: dict[int, float] = {}
        self.highs: dict[int, float] = {}

    def examine(self, point: Point) -> Point:
        """The point with its verdict: the solver stands at it, and it is not written yet. Collective."""
        number = self._points
        self._points += 1
        if not self._methods or point.outcome not in ("converged", "above_tolerance"):
            return point
        report, reason = examine_point(self._solver, self._methods, self._orbit, self._viscous)
        if self._root:
            for index, (name, engine) in enumerate(ENGINES.items()):
                self._fetch(number, index, engine, getattr(report, name))
            if report.distance >= 0.0:
                self.distances[number] = report.distance
            if report.monodromy:
                self.changes[number] = report.change
            if report.high >= report.low:
                self.lows[number], self.highs[number] = report.low, report.high
            if reason:
                self.reasons[number] = reason
        if point.outcome == "above_tolerance":
            return point
        if report.verdict not in range(len(VERDICTS)):
            return point
        return point._replace(outcome=OUTCOMES[VERDICTS[report.verdict]])

    def put_down(self) -> dict[str, np.ndarray]:
        """What was found of the last point, at the root."""
        last = self._points - 1
        rows = [row[1:] for row in self.rows if row[0] == last]
        found = {"stability/multipliers": np.array(rows, dtype=float)} if rows else {}
        if last in self.reasons:
            found["stability/reason"] = np.frombuffer(self.reasons[last].encode(), np.uint8)
        for name, numbers in self._numbers():
            if last in numbers:
                found[f"stability/{name}"] = np.array(numbers[last])
        return found

    def take_up(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `put_down` told this."""
        number = self._points
        self._points += 1
        for engine, real, imaginary, kind in found.get("stability/multipliers", np.empty((0, 4))):
            self.rows.append((number, int(engine), real, imaginary, int(kind)))
        if "stability/reason" in found:
            self.reasons[number] = found["stability/reason"].tobytes().decode()
        for name, numbers in self._numbers():
            if f"stability/{name}" in found:
                numbers[number] = float(found[f"stability/{name}"])

    def _numbers(self) -> tuple[tuple[str, dict[int, float]], ...]:
        return ("distance", self.distances), ("change", self.changes), ("low", self.lows), ("high", self.highs)

    def _fetch(self, number: int, index: int, engine: int, count: int) -> None:
        if not count:
            return
        real, imaginary, kind = fetch_multipliers(self._solver, engine, count)
        self.rows += zip([number] * count, [index] * count, real, imaginary, kind, strict=True)


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


def write_multipliers(file: h5py.File, examiner: Examiner) -> None:
    """Add the multipliers, and why points have no verdict, to a result file that is open."""
    if not examiner.rows and not examiner.reasons:
        return
    columns = np.array(examiner.rows).reshape(-1, 5).T
    data = {
        "point": (np.int32, "number of the point, from 0", ()),
        "method": (np.int32, "engine: index into the attribute names", tuple(ENGINES)),
        "real": (float, "real part of the Floquet multiplier", ()),
        "imag": (float, "its imaginary part", ()),
        "kind": (
            np.int32,
            "index into the attribute names: dynamic; zero of a slider that a period forgets; "
            "one of a slider that stays",
            MULTIPLIER_KINDS,
        ),  # fmt: skip
    }
    for column, (name, (kind, description, names)) in zip(columns, data.items(), strict=True):
        described(file, f"multipliers/{name}", description, names=names, data=column.astype(kind))
    points = len(file["points/stable"])
    real, imaginary, kind = columns[2:]
    largest, distance, change, low, high = np.full((5, points), np.nan)
    decides = kind == MULTIPLIER_KINDS.index("floquet")
    np.fmax.at(largest, columns[0][decides].astype(int), np.hypot(real, imaginary)[decides])
    known = (examiner.distances, examiner.changes, examiner.lows, examiner.highs)
    for column, numbers in zip((distance, change, low, high), known, strict=True):
        column[list(numbers)] = list(numbers.values())
    reasons = [examiner.reasons.get(point, "") for point in range(points)]
    for name, values, kind, description in (
        ("largest_multiplier", largest, float, "largest modulus of the point's dynamic multipliers"),
        (
            "distance",
            distance,
            float,
            "of the event-exact orbit from the balance's, the largest over the period, part of its amplitude",
        ),
        ("change", change, float, "what doubling the modes last changed of the multipliers by the monodromy"),
        ("low", low, float, "of an indeterminate point: its largest multiplier's modulus is at least that"),
        ("high", high, float, "and at most that"),
        ("reason", reasons, h5py.string_dtype(), "why the point has no verdict"),
    ):
        described(file, f"stability/{name}", description, data=values, dtype=kind)
