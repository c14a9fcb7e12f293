"""A resonance peak followed in the level or the preload, by the Fortran library. All calls are collective."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from attrito.library.names import AMPLITUDES, ENDINGS, PARAMETERS
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.library.structures import RawPeak, omega, pointer

# Points of the linear response between its ends, besides those at natural frequencies, to find its largest peak.
LINEAR_POINTS = 400
NATURAL_FREQUENCIES = 40
# Then so many between the neighbours of the largest, again and again until these are lower by at most FALL, relative;
# then the vertex of the parabola through the three. Nearer to the peak rounding would choose the largest, and all that
# begins there would depend on it: 1e-8 leaves some 1e-12 of the frequency to either. At a corner, until they are within
# CORNER of the frequency. That takes no longer than one of scipy's minimisers, whose import takes longer than all that.
BETWEEN, FALL, CORNER = 17, 1e-8, 1e-9


@dataclass(frozen=True)
class Peak:
    """A resonance peak.

    Parameters
    ----------
    point : as that of a sweep
    parameter : level or preload
    level : factor on the harmonic loads
    amplitude : of the monitor, user length
    slope : its derivative by the parameter along the peaks
    curvature : its second derivative by angular frequency along the frequency response; negative at a maximum
    amplitude_error, frequency_error : estimated relative errors of the peak's amplitude and frequency; NaN: not known
    evaluations : of the balance, since the session began
    ending : a name of `ENDINGS`, why there is no peak
    at_corner : whether the amplitude rises to it on one side and falls on the other with a corner, where a contact
        changes its state; `slope` and `curvature` are NaN there
    """

    point: Point
    parameter: float
    level: float
    amplitude: float
    slope: float
    curvature: float
    amplitude_error: float
    frequency_error: float
    evaluations: int
    ending: str
    at_corner: bool

    @property
    def frequency_hz(self) -> float:
        """Frequency of the peak, Hz."""
        return self.point.frequency_hz

    @property
    def outcome(self) -> str:
        """`converged`, `not_converged`, `indeterminate`, or `above_tolerance`."""
        return self.point.outcome

    @property
    def response(self) -> float:
        """Amplitude per unit of the harmonic loads."""
        return self.amplitude / self.level


@dataclass(frozen=True)
class Start:
    """A motion near a peak: Fourier coefficients of the model's coordinates `[m, 2 H + 1]`."""

    frequency_hz: float
    coordinates: np.ndarray


class PeakTracker:
    """The peak of one monitor of a solver that has followed its static path.

    Parameters
    ----------
    solver : stays the caller's
    monitor : index of the monitor
    amplitude : a name of `AMPLITUDES`
    band_hz : where the peak is looked for
    static_factors : on the static loads at preload 1, `[loads]`
    """

    def __init__(
        self, solver: Solver, monitor: int, amplitude: str, band_hz: tuple[float, float], static_factors: np.ndarray
    ):
        self._solver, self._monitor, self._amplitude, self._band = solver, monitor, AMPLITUDES.index(amplitude), band_hz
        self._static = np.ascontiguousarray(static_factors, dtype=float)
        self.parameter = PARAMETERS[0]

    def linear_peak_hz(self) -> float:
        """The largest peak of the linear response in the band, contacts open or stuck as they are at rest, Hz.

        If it has none inside, the end of the band at which it is largest.
        """
        low, high = self._band
        natural = self._solver.linear_response("tangent", np.array([low]), NATURAL_FREQUENCIES)[1]
        grid = np.unique(np.concatenate([np.linspace(low, high, LINEAR_POINTS), natural]))
        grid = grid[(grid >= low) & (grid <= high)]
        amplitude = self._solver.linear_response("tangent", grid, 0)[0][self._monitor]
        largest = int(np.nanargmax(amplitude))
        if largest in (0, len(grid) - 1):
            return float(grid[largest])
        while (high := grid[largest + 1]) - (low := grid[largest - 1]) > CORNER * high:
            grid = np.linspace(low, high, BETWEEN)
            amplitude = self._solver.linear_response("tangent", grid, 0)[0][self._monitor]
            largest = int(np.clip(np.nanargmax(amplitude), 1, BETWEEN - 2))
            before, here, after = amplitude[largest - 1 : largest + 2]
            if here - min(before, after) <= FALL * here:
                bend = before - 2.0 * here + after
                share = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
                return float(grid[largest] + np.clip(share, -1.0, 1.0) * (grid[1] - grid[0]))
        return float(grid[largest])

    def begin(self, level: float, near_hz: float, branch: int = 0) -> Peak:
        """The peak at a level, followed there from where all contacts stick at the linear peak's frequency."""
        return self._call(
            "attrito_begin_peak",
            self._monitor,
            self._amplitude,
            len(self._static),
            pointer(self._static),
            omega(near_hz),
            omega(self._band[0]),
            omega(self._band[1]),
            level,
            branch,
        )[0]

    def begin_near(self, start: Start, level: float, preload: float = 1.0, branch: int = 0) -> Peak:
        """The peak near a motion, at a level and a factor on the static loads, sliders going on from where they are."""
        return self._call(
            "attrito_begin_peak_near",
            self._monitor,
            self._amplitude,
            len(self._static),
            pointer(self._static),
            omega(start.frequency_hz),
            omega(self._band[0]),
            omega(self._band[1]),
            level,
            preload,
            start.coordinates.shape[1],
            pointer(start.coordinates),
            branch,
        )[0]

    def start(self, frequency_hz: float) -> Start:
        """The solver's present motion, for `begin_near`."""
        return Start(frequency_hz, self._solver.coordinates())

    def follow_in(self, parameter: str, branch: int = 0) -> Peak:
        """Follow it in one of `PARAMETERS` from here on."""
        self.parameter = parameter
        return self._call("attrito_follow_peak_in", PARAMETERS.index(parameter), branch)[0]

    def follow(self, stop: float, branch: int = 0) -> Iterator[Peak]:
        """Step by step to a value of the parameter; the last peak has it, unless the curve is lost before."""
        finished = False
        while not finished:
            peak, finished = self._call("attrito_next_peak", stop, branch)
            yield peak

    def at(self, value: float, branch: int = 0) -> Peak:
        """The peak at a value of the parameter, by as many steps as it takes."""
        return self._call("attrito_peak_at", value, branch)[0]

    def _call(self, name: str, *arguments: object) -> tuple[Peak, bool]:
        raw = RawPeak()
        self._solver.call(name, *arguments, ctypes.byref(raw))
        at_corner = bool(raw.at_corner)
        peak = Peak(
            self._solver.point_of(raw.point),
            raw.parameter,
            raw.point.level,
            raw.amplitude,
            np.nan if at_corner else raw.slope,
            np.nan if at_corner else raw.curvature,
            raw.amplitude_error,
            raw.frequency_error,
            raw.evaluations,
            ENDINGS[raw.ending],
            at_corner,
        )
        return peak, bool(raw.point.finished)
