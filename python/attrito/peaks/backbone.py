"""The backbone of a mode by the Fortran library, and where it expects peaks. All calls are collective."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from attrito.library.names import AMPLITUDES
from attrito.library.points import LinearModes
from attrito.library.session import Solver
from attrito.library.structures import RawBackbone, omega, pointer
from attrito.peaks.curve import Backbone, BackbonePoint, Found
from attrito.runs.tangent_modes import equal_modes

# Points of the curve are this factor of the mode's coordinate apart.
STEP = 1.05
# The curve ends where its level is that of the last peak, or its amplitude this many times the greatest peak's.
FARTHEST = 3.0
MOST_POINTS = 400
# Of the logarithm of the coordinate, where the level is a peak's.
LEVEL_TOLERANCE = 1e-10


@dataclass(frozen=True)
class LeadingMode:
    """The tangent mode that carries a motion.

    Parameters
    ----------
    number : from 1
    shapes : the mode, then others of its frequency, unit modal mass, `[modes, m]`; of equal modes the mixture in the
        motion is the first
    frequency_hz : of the mode
    amplitude : of the shape in the motion
    """

    number: int
    shapes: np.ndarray
    frequency_hz: float
    amplitude: float


def leading_mode(modes: LinearModes, mass: np.ndarray, motion: np.ndarray) -> LeadingMode:
    """The mode with most of the energy of the first harmonic of a motion `[m, 2 H + 1]`."""
    parts = modes.shapes.conj() @ (mass @ (motion[:, 1] - 1j * motion[:, 2]))
    number = int(np.argmax(modes.natural_hz * abs(parts))) + 1
    equal = np.array(equal_modes(modes.natural_hz, number)) - 1
    mixture = parts[equal] / parts[equal[0]]
    mixture /= np.linalg.norm(mixture)
    basis = np.linalg.qr(np.column_stack([mixture, np.eye(len(equal))]))[0]
    basis[:, 0] = mixture
    amplitude = float(np.linalg.norm(parts[equal]))
    return LeadingMode(number, basis.T @ modes.shapes[equal], float(modes.natural_hz[number - 1]), amplitude)


class BackboneTracker:
    """The backbone of one mode. The solver has followed its static path; it serves nothing else from then on.

    Parameters
    ----------
    solver : stays the caller's
    mode : that it begins at
    monitor : index of the monitor whose amplitude is reported
    amplitude : a name of `AMPLITUDES`
    """

    def __init__(self, solver: Solver, mode: LeadingMode, monitor: int, amplitude: str):
        self._solver, self.mode, self._monitor, self._amplitude = solver, mode, monitor, AMPLITUDES.index(amplitude)

    def begin(self) -> BackbonePoint:
        """The point of the mode's amplitude, or a smaller one and followed there."""
        shapes = np.ascontiguousarray(self.mode.shapes.real), np.ascontiguousarray(-self.mode.shapes.imag)
        place = omega(self.mode.frequency_hz), self._monitor, self._amplitude, self.mode.amplitude, 0
        return self._call("attrito_begin_mode", len(shapes[0]), *map(pointer, shapes), *place)

    def at(self, modal_amplitude: float) -> BackbonePoint:
        """The point of a coordinate of the stuck mode, by as many steps as it takes."""
        return self._call("attrito_backbone_at", modal_amplitude, 0)

    def _call(self, name: str, *arguments: object) -> BackbonePoint:
        raw = RawBackbone()
        self._solver.call(name, *arguments, ctypes.byref(raw))
        point = self._solver.point_of(raw.point)
        return BackbonePoint(
            point, raw.modal_amplitude, raw.excitation, raw.level, raw.amplitude, folded=bool(raw.folded)
        )


def follow_backbone(tracker: BackboneTracker, peaks: list[Found]) -> Backbone:
    """The backbone over the levels of a curve of peaks, and where it first has these levels."""
    known = [one.peak for one in peaks if one.converged]
    levels = {peak.level for peak in known}
    far = FARTHEST * max(peak.amplitude for peak in known)
    last = _below(tracker, min(levels))
    stretches = [[last]] if last.converged else []
    at_levels: dict[float, BackbonePoint | None] = {}
    for _ in range(MOST_POINTS):
        if not last.converged or last.level >= max(levels) or last.amplitude > far:
            break
        point = tracker.at(STEP * last.modal_amplitude)
        if not point.converged:
            break
        if point.folded:
            stretches.append([point])
        else:
            between = [
                level for level in levels - set(at_levels) if (last.level - level) * (point.level - level) <= 0.0
            ]
            found = {level: _at_level(tracker, last, point, level) for level in between}
            at_levels |= found
            passed = [one for one in found.values() if one is not None]
            stretches[-1] += [*sorted(passed, key=lambda one: one.modal_amplitude), point]
            if between:
                tracker.at(point.modal_amplitude)
        last = point
    at_peaks = [at_levels.get(one.peak.level) if one.converged else None for one in peaks]
    return Backbone(tracker.mode.number, stretches, at_peaks)


def lost_in_words(backbone: Backbone | None) -> list[str]:
    """A warning of a backbone without points."""
    if backbone is None or backbone.stretches:
        return []
    return [
        "no backbone was found: no motion without excitation near the tangent mode that carries the first peak was"
        " solved"
    ]


def _below(tracker: BackboneTracker, level: float) -> BackbonePoint:
    """A point of a smaller level, near it."""
    point = tracker.begin()
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
