"""A nonlinear mode by quasi-static loading, point by point; the cycles are the Fortran library's.

K x + B^T lambda(B x) = f_0 + alpha M phi, alpha through whole cycles; Q = (q_max - q_min) / 2 with q = phi^T M x. Here
the load is varied until Q is the amplitude asked for.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from attrito.library.session import Solver
from attrito.library.structures import RawQuasiStatic, omega, pointer
from attrito.modes.mode_point import ModePoint

# Steps of the cycles that the load is found with: a monotonic path needs few, and what these miss the last cycle shows.
TRIAL_STEPS, TRIAL_CYCLES = 8, 6
# Cycles of few steps before the one that is reported, and as many of its own steps, until they close: sliders under a
# normal force that varies creep to where they stay.
SETTLING = 60
# Relative difference of Q from what is asked for: of a trial, of one whose sliders creep, which other steps change more
# than that, of one by cycles like the reported one where a trial does not do, and of the cycle that is reported
TRIAL_TOLERANCE, CREEPING_TOLERANCE, CLOSE_TOLERANCE, AMPLITUDE_TOLERANCE = 1e-9, 1e-4, 2e-4, 1e-3
MOST_TRIALS = 40
# Between the load that carries too little and that which nothing carries: the limit of the contacts
LIMIT = 1e-9


@dataclass(frozen=True)
class _Trial:
    """Cycles that loads are tried with: steps, cycles until one closes, tolerance of Q."""

    steps: int
    settling: int
    tolerance: float


class QuasiStaticTracker:
    """Loads one mode. The solver has followed its static path; it serves nothing else from then on. Collective.

    Parameters
    ----------
    solver : stays the caller's
    contacts : how many there are
    shape : of the tangent mode, unit modal mass, `[m]`
    frequency_hz : of the tangent mode
    steps : of a cycle, a multiple of 4

    Attributes
    ----------
    known : of the last two points, amplitudes of load and Q
    """

    def __init__(self, solver: Solver, contacts: int, shape: np.ndarray, frequency_hz: float, steps: int):
        self._solver, self._contacts, self._steps = solver, contacts, steps
        self._stiffness = omega(frequency_hz) ** 2
        self.known: list[tuple[float, float]] = []
        shape = np.ascontiguousarray(shape, dtype=float)
        self._solver.call("attrito_begin_quasi_static", pointer(shape), omega(frequency_hz))

    def prepare(self) -> None:
        """Nothing: points begin at the static solution."""

    def save_state(self) -> dict[str, np.ndarray]:
        """What the next point starts from."""
        return {"mode_known": np.array(self.known).reshape(-1, 2)}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this."""
        self.known = [(float(a), float(b)) for a, b in found["mode_known"]]

    def at(self, amplitude: float) -> ModePoint:
        """The point of an amplitude, whatever amplitudes came before: each begins at the static solution."""
        load, iterations = self._load_of(amplitude, _Trial(TRIAL_STEPS, TRIAL_CYCLES, TRIAL_TOLERANCE), self.known)
        cycle = self._cycle(load)
        iterations += cycle.point.iterations
        point = self._solver.point_of(cycle.point)
        if point.is_solved and abs(cycle.amplitude / amplitude - 1.0) > AMPLITUDE_TOLERANCE:
            known = [(load, cycle.amplitude)]
            load, more = self._load_of(amplitude, _Trial(self._steps, SETTLING, CLOSE_TOLERANCE), known)
            cycle = self._cycle(load)
            iterations += more + cycle.point.iterations
            point = self._solver.point_of(cycle.point)
        found = cycle.amplitude if point.is_solved else np.nan
        if point.is_solved and abs(found / amplitude - 1.0) > AMPLITUDE_TOLERANCE:
            point = point._replace(outcome="not_converged")
        if point.is_solved:
            self.known = [*self.known[-1:], (load, found)]
        work = np.zeros(self._contacts)
        self._solver.call("attrito_quasi_static_work", pointer(work))
        error = abs(cycle.coarse_work / cycle.work - 1.0) if cycle.work > 0.0 else 0.0
        return ModePoint(
            point,
            found if point.is_solved else amplitude,
            found**2,
            cycle.structural_ratio,
            {
                "load": load,
                "loop_area": abs(cycle.area),
                "masing_hz": cycle.masing_omega / (2.0 * np.pi),
                "masing_damping_ratio": cycle.masing_ratio,
            },
            iterations,
            error_samples=error,
            contact_work=work,
        )

    def _load_of(self, amplitude: float, trial: _Trial, known: list[tuple[float, float]]) -> tuple[float, int]:
        """The load whose cycle has an amplitude, or the largest that was carried; iterations of Newton's method.

        By secants of the logarithms within what is known to be too little and too much.
        """
        known, iterations = [*known], 0
        low, high = 0.0, np.inf
        load = self._guess(known, amplitude)
        for _ in range(MOST_TRIALS):
            found, closed, taken = self._tried(load, trial)
            iterations += taken
            tolerance = trial.tolerance if closed else max(trial.tolerance, CREEPING_TOLERANCE)
            if abs(found / amplitude - 1.0) <= tolerance:
                break
            if found < amplitude:
                low = max(low, load)
            else:
                high = min(high, load)
            if np.isfinite(found):
                known = [*known[-1:], (load, found)]
            if low > 0.0 and high / low - 1.0 < LIMIT:
                break
            guess = self._guess(known, amplitude)
            if not low < guess < high or not np.isfinite(found):
                guess = np.sqrt(low * high) if low > 0.0 else 0.5 * load
            load = float(guess)
        return load, iterations

    def _guess(self, known: list[tuple[float, float]], amplitude: float) -> float:
        """The load on the line through what is known, in logarithms; of the tangent mode where nothing is."""
        if not known:
            return float(self._stiffness * amplitude)
        (load, found), slope = known[-1], 1.0
        if len(known) == 2 and known[0][1] != found and known[0][0] != load:
            slope = np.log(load / known[0][0]) / np.log(found / known[0][1])
        return float(load * (amplitude / found) ** slope)

    def _tried(self, load: float, trial: _Trial) -> tuple[float, bool, int]:
        """Q at a load, infinite where nothing carries it; did the sliders come back; iterations of Newton's method."""
        amplitude, closed, iterations = np.zeros(1), np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32)
        places = pointer(amplitude), pointer(closed), pointer(iterations)
        self._solver.call("attrito_try_quasi_static", load, trial.steps, trial.settling, *places)
        found = float(amplitude[0]) if amplitude[0] >= 0.0 else np.inf
        return found, bool(closed[0]), int(iterations[0])

    def _cycle(self, load: float) -> RawQuasiStatic:
        raw = RawQuasiStatic()
        self._solver.call("attrito_quasi_static_at", load, self._steps, SETTLING, 0, ctypes.byref(raw))
        return raw
