"""Derivatives of a nonlinear mode by parameters of its job, at each amplitude Q, which is held.

The balance's part is the library's (`src/peak/mode_slopes.f90`). Q = |phi^T M q_1| is measured by the tangent mode,
which changes with contact stiffnesses: with all tangent modes, of unit modal mass,

    phi_r' = sum over s of phi_s (phi_s^T K' phi_r) / (omega_r^2 - omega_s^2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.family import Family
from attrito.library.points import LinearModes
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.library.structures import omega
from attrito.modes.frequency_slopes import REPEATED, spring_rates
from attrito.modes.mode_point import ModePoint
from attrito.runs.recorder import Recorder
from attrito.runs.sensitivity import CORNER, SERIES, Differentiator
from attrito.scene.scene import Scene

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Of the mode itself
OF_THE_MODE = ("frequency_hz", "damping_ratio", "damping_ratio_structure")
DRIFTS = "sliders creep on and no motion repeats: no derivatives"
EQUAL = "other modes have the mode's frequency, which parameters may part: no derivatives"


class ModeDifferentiator:
    """Derivatives at one point of a mode after another. The solver is at its static solution at first.

    Parameters
    ----------
    comm, solver : what solves
    job, scene, reduced : what is solved; `scene` at the root
    index : of the tangent mode, from 0
    """

    def __init__(self, comm: Comm, solver: Solver, job: Job, scene: Scene | None, reduced: ReducedScene, index: int):
        self._solver, self._root = solver, comm.rank == 0
        self._asked = bool(job["sensitivity"]["to"])
        if not self._asked:
            return
        self._points = Differentiator(comm, solver, job, scene, reduced)
        # Loads of harmonics are none of a mode's.
        self._points.rates.level[:], self._points.rates.harmonic_factors[:] = 0.0, 0.0
        modes = solver.linear_modes("tangent", len(reduced.mass))
        rates = spring_rates(
            reduced.laws["tangents"], self._points.rates.laws, "tangent", solver.closed_contacts().astype(float)
        )
        self._weight = reduced.mass @ modes.shapes[index]
        # Of phi^T M
        self._weight_rates = shape_slopes(modes, index, reduced.directions, rates) @ reduced.mass

    def visit(self, one: ModePoint, recorder: Recorder) -> str:
        """Add the derivatives at the point where the solver stands to its record; what is to be said. Collective."""
        if not self._asked:
            return ""
        motion = self._solver.coordinates()
        first = motion[:, 1] - 1j * motion[:, 2]
        amplitude = self._weight @ first
        own = np.real(amplitude.conj() * (self._weight_rates @ first)) / abs(amplitude)

        def find(family: Family) -> np.ndarray | None:
            return None if family.describe() is None else self._find(family, one, own)

        none = self._why_none(one)
        found = self._points.family.visit(find) if one.converged and not none else None
        point = one.point._replace(outcome="not_converged") if none else one.point
        both = self._points.at_onset(point, find, len(OF_THE_MODE))
        if not self._root:
            return ""
        self._record(recorder, np.vstack(self._points.nothing(len(OF_THE_MODE))) if found is None else found, "")
        for name, there in both.items():
            self._record(recorder, there, f"{name}/")
        if none:
            return none
        return CORNER if np.any(np.isfinite(both["below"])) else ""

    def _why_none(self, one: ModePoint) -> str:
        """Why a point has no derivatives, in words."""
        if one.point.outcome == "indeterminate":
            return DRIFTS
        return EQUAL if np.any(np.isnan(self._weight_rates)) else ""

    def _find(self, family: Family, one: ModePoint, own: np.ndarray) -> np.ndarray | None:
        """Of the mode itself, then of the quantities of a point; `own`: of Q by the tangent mode alone."""
        found = family.differentiate_mode(self._points.rates, self._weight + 0j, own)
        if found is None:
            return None
        (frequency, excitation, structure), quantities = found
        speed = omega(one.point.frequency_hz)
        drive = excitation / (2.0 * speed) - one.drive["excitation"] * omega(1.0) * frequency / (2.0 * speed**2)
        return np.vstack([frequency, drive - structure, structure, quantities])

    def _record(self, recorder: Recorder, found: np.ndarray, folder: str) -> None:
        values = None if folder else self._points.values
        self._points.record(recorder, found[len(OF_THE_MODE) :], values, folder)
        for name, numbers in zip(OF_THE_MODE, found, strict=False):
            recorder.add(f"/sensitivity/{folder}{name}", SERIES[name], np.ascontiguousarray(numbers))


def shape_slopes(modes: LinearModes, index: int, directions: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Derivatives of one mode's shape by parameters, `[parameters, m]`; NaN where its frequency is repeated.

    Parameters
    ----------
    modes : all that there are
    index : of the mode
    directions : rows of B, `[rows, m]`
    rates : of the springs, `[parameters, rows]`
    """
    squares = omega(1.0) ** 2 * modes.natural_hz**2
    apart = squares[index] - squares
    apart[index] = np.inf
    if np.any(np.abs(apart) <= 2.0 * REPEATED * squares[index]):
        return np.full((len(rates), modes.shapes.shape[1]), np.nan)
    travel = modes.shapes @ directions.T
    coupled = (rates * travel[index]) @ travel.T / apart
    return np.asarray(coupled @ modes.shapes)
