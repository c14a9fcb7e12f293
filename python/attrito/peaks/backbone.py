"""The backbone of a mode by the Fortran library, and where it expects peaks. All calls are collective."""

from __future__ import annotations

import ctypes

import numpy as np

from attrito.library.names import AMPLITUDES
from attrito.library.session import Solver
from attrito.library.structures import RawBackbone
from attrito.peaks.curve import Backbone, BackbonePoint, Found

# Points of the curve are this factor of the mode's coordinate apart.
STEP = 1.05
# The curve ends where its level is that of the last peak, or its amplitude this many times the greatest peak's.
FARTHEST = 3.0
MOST_POINTS = 400
# Where the curve is lost, as at kinks where it folds: how many points further it is looked for again.
LEAPS = (2, 4, 6, 9, 13, 18, 24)
# Of the logarithm of the coordinate, where the level is a peak's.
LEVEL_TOLERANCE = 1e-10


def leading_mode(solver: Solver) -> tuple[int, float]:
    """The stuck mode (from 1) that carries most of the last point's first harmonic, and its coordinate."""
    mode, amplitude = ctypes.c_int(), ctypes.c_double()
    solver.call("attrito_leading_mode", ctypes.byref(mode), ctypes.byref(amplitude))
    return mode.value, amplitude.value


class BackboneTracker:
    """The backbone of one mode. The solver has followed its static path; it serves nothing else from then on.

    Parameters
    ----------
    solver : stays the caller's
    mode : from 1, ascending, of the system with all contacts stuck
    monitor : index of the monitor whose amplitude is reported
    amplitude : a name of `AMPLITUDES`
    """

    def __init__(self, solver: Solver, mode: int, monitor: int, amplitude: str):
        self._solver, self.mode, self._monitor, self._amplitude = solver, mode, monitor, AMPLITUDES.index(amplitude)

    def begin(self, modal_amplitude: float) -> BackbonePoint:
        """The point of an amplitude, followed there from one at which contacts stick."""
        return self._call("attrito_begin_backbone", self.mode, self._monitor, self._amplitude, modal_amplitude, 0)

    def at(self, modal_amplitude: float) -> BackbonePoint:
        """The point of an amplitude, by as many steps as it takes."""
        return self._call("attrito_backbone_at", modal_amplitude, 0)

    def anew(self, modal_amplitude: float) -> BackbonePoint:
        """The point of an amplitude, by long steps from one at which contacts stick."""
        return self._call("attrito_restart_backbone", modal_amplitude, 0)

    def _call(self, name: str, *arguments: object) -> BackbonePoint:
        raw = RawBackbone()
        self._solver.call(name, *arguments, ctypes.byref(raw))
        point = self._solver.point_of(raw.point)
        return BackbonePoint(point, raw.modal_amplitude, raw.excitation, raw.level, raw.amplitude)


def follow_backbone(tracker: BackboneTracker, modal_amplitude: float, peaks: list[Found]) -> Backbone:
    """The backbone over the levels of a curve of peaks, and where it first has these levels.

    Parameters
    ----------
    modal_amplitude : of the mode at the first peak
    """
    known = [one.peak for one in peaks if one.converged]
    levels = {peak.level for peak in known}
    far = FARTHEST * max(peak.amplitude for peak in known)
    stretches = [[_below(tracker, modal_amplitude, min(levels))]]
    at_levels: dict[float, BackbonePoint | None] = {}
    while sum(map(len, stretches)) < MOST_POINTS:
        last = stretches[-1][-1]
        if not last.converged or last.level >= max(levels) or last.amplitude > far:
            break
        point = tracker.at(STEP * last.modal_amplitude)
        if point.converged:
            between = [
                level for level in levels - set(at_levels) if (last.level - level) * (point.level - level) <= 0.0
            ]
            found = {level: _at_level(tracker, last, point, level) for level in between}
            at_levels |= found
            passed = [one for one in found.values() if one is not None]
            stretches[-1] += [*sorted(passed, key=lambda one: one.modal_amplitude), point]
            if between:
                tracker.at(point.modal_amplitude)
        else:
            anew = (tracker.anew(STEP**leap * last.modal_amplitude) for leap in LEAPS)
            stretches.append([next((point for point in anew if point.converged), point)])
    stretches = [[point for point in stretch if point.converged] for stretch in stretches]
    at_peaks = [at_levels.get(one.peak.level) if one.converged else None for one in peaks]
    return Backbone(tracker.mode, [stretch for stretch in stretches if stretch], at_peaks)


def lost_in_words(backbone: Backbone | None) -> list[str]:
    """A warning of a backbone without points."""
    if backbone is None or backbone.stretches:
        return []
    return [
        "no backbone was found: it begins at the mode with all pairs stuck, those that are open at rest too, which"
        " carries most of the first peak; `attrito mode` begins at the tangent mode"
    ]


def _below(tracker: BackboneTracker, modal_amplitude: float, level: float) -> BackbonePoint:
    """A point of a smaller level, near it."""
    point = tracker.begin(modal_amplitude)
    for _ in range(MOST_POINTS):
        if not point.converged or point.level <= level:
            break
        # Level and amplitude are in proportion where contacts stick.
        point = tracker.at(point.modal_amplitude * min(0.99 * level / point.level, 1.0 / STEP))
    return point


def _at_level(
    tracker: BackboneTracker, before: BackbonePoint, after: BackbonePoint, level: float
) -> BackbonePoint | None:
    """The point of a level between two of one stretch."""
    from scipy.optimize import brentq

    tried: list[BackbonePoint] = []

    def excess(logarithm: float) -> float:
        tried.append(tracker.at(float(np.exp(logarithm))))
        return tried[-1].level / level - 1.0

    ends = np.log([before.modal_amplitude, after.modal_amplitude])
    try:
        brentq(excess, *ends, xtol=LEVEL_TOLERANCE, rtol=1e-14)
    except ValueError:
        # The way back led elsewhere: the two ends do not bracket the level on what the curve has become.
        return None
    nearest = min(tried, key=lambda point: abs(point.level / level - 1.0))
    return nearest if all(point.converged for point in tried) else None
