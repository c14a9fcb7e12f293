"""A nonlinear mode by the extended periodic motion concept, point by point; the balance is the Fortran library's.

M q'' + (C - xi M) q' + K q = f_0 - B^T lambda(B q): xi makes up for what dissipates. The library follows the coordinate
of one stuck mode, beside equal modes of as many; here it is varied until the mode's amplitude Q = |phi^H M q_1| is the
one asked for. Of a sector the mode is a wave of the nodal diameter of its engine order, and phi is complex.
"""

from __future__ import annotations

import ctypes

import numpy as np

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.library.structures import RawBackbone, omega, pointer
from attrito.modes.mode_point import ModePoint

# Relative difference of Q from what is asked for, and how often it is corrected
AMPLITUDE_TOLERANCE = 1e-9
# The same where sliders creep on, each time a little farther
CREEPING_TOLERANCE = 1e-6
MOST_CORRECTIONS = 12


class ModeTracker:
    """Follows one mode. The solver has followed its static path; it serves nothing else from then on. Collective.

    Parameters
    ----------
    solver : stays the caller's
    scene : what it solves
    shapes : phi of the tangent mode, then of others of its frequency, unit modal mass, `[modes, m]`
    frequency_hz : of the tangent mode

    Attributes
    ----------
    known : of the last two solutions, the stuck mode's coordinate and Q
    """

    def __init__(self, solver: Solver, scene: ReducedScene, shapes: np.ndarray, frequency_hz: float):
        self._solver, self._frequency_hz = solver, frequency_hz
        self._shapes = np.ascontiguousarray(shapes.real), np.ascontiguousarray(-shapes.imag)
        self._weight = scene.mass @ shapes[0].conj()
        self.known: list[tuple[float, float]] = []

    def prepare(self) -> None:
        """Make the solver ready for `load_state`, in place of a first point."""
        count = len(self._shapes[0])
        self._solver.call("attrito_prepare_mode", count, *map(pointer, self._shapes), omega(self._frequency_hz))

    def save_state(self) -> dict[str, np.ndarray]:
        """What the next point starts from, beside the solver's state."""
        return {"mode_known": np.array(self.known).reshape(-1, 2)}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this."""
        self.known = [(float(a), float(b)) for a, b in found["mode_known"]]

    def at(self, amplitude: float) -> ModePoint:
        """The point of an amplitude; the first call begins at the tangent mode."""
        iterations, folded = 0, False
        for _ in range(MOST_CORRECTIONS):
            raw = self._solve(amplitude)
            folded = folded or bool(raw.folded)
            point = self._solver.point_of(raw.point)
            iterations += point.iterations
            found = self._amplitude() if point.is_solved else np.nan
            if not point.is_solved:
                break
            self.known = [*self.known[-1:], (raw.modal_amplitude, found)]
            accepted = CREEPING_TOLERANCE if point.outcome == "indeterminate" else AMPLITUDE_TOLERANCE
            if abs(found / amplitude - 1.0) <= accepted:
                break
        missed = point.is_solved and not abs(found / amplitude - 1.0) <= accepted
        if missed:
            point = point._replace(outcome="not_converged")
        errors = np.full(2, np.nan)
        if point.is_solved:
            self._solver.call("attrito_mode_errors", pointer(errors[:1]))
            errors[1] = 0.0  # Contacts go by events, without samples
        drive = {"excitation": raw.excitation, "drift": raw.drift}
        return ModePoint(
            point, amplitude, raw.kinetic, raw.structural_ratio, drive, iterations, *errors.tolist(), folded=folded
        )

    def _solve(self, amplitude: float) -> RawBackbone:
        """At the coordinate at which the amplitude is expected: on the line through what is known, in logarithms."""
        raw = RawBackbone()
        if not self.known:
            place = omega(self._frequency_hz), amplitude, 0, ctypes.byref(raw)
            self._solver.call("attrito_begin_mode", len(self._shapes[0]), *map(pointer, self._shapes), *place)
            return raw
        (a, q), slope = self.known[-1], 1.0
        if len(self.known) == 2:
            (a0, q0), (a1, q1) = self.known
            if q1 != q0 and a1 != a0:
                slope = float(np.clip(np.log(a1 / a0) / np.log(q1 / q0), 0.2, 5.0))
        self._solver.call("attrito_backbone_at", a * (amplitude / q) ** slope, 0, ctypes.byref(raw))
        return raw

    def _amplitude(self) -> float:
        """Q where the solver is."""
        motion = self._solver.coordinates()
        return float(abs(self._weight @ (motion[:, 1] - 1j * motion[:, 2])))
