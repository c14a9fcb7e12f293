"""Is there a higher peak than the one that is followed? The band of `[sweep]`, swept coarsely from a followed peak.

A peak is followed by itself: nothing is known of the response elsewhere. From the peak's own motion and sliders the
response is followed to either end of the band, at the same loads. A sweep has a point at every peak, which misses its
height by a tenth of the sweep's tolerance at most (docs/method.md, "Getting from point to point"), so a coarse sweep
is enough. Branches that are not connected to the peak's are not seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.library.peak_tracker import Peak
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Error of the curve drawn through the points of such a sweep, part of the largest amplitude; heights miss a tenth of it
COARSE = 0.1
# A peak is reported that is higher by more than this part, beyond what the height of a point and other sliders change
HIGHER = 0.02
# Of a sweep to one side
MOST_POINTS = 200


@dataclass(frozen=True)
class Higher:
    """What was found about a followed peak.

    Parameters
    ----------
    swept_hz : lowest and highest frequency between which the response was solved
    whole : whether that is the whole band
    frequency_hz, amplitude : of the highest peak, Hz and user length; NaN where none is higher than the followed one
    """

    swept_hz: tuple[float, float]
    whole: bool
    frequency_hz: float
    amplitude: float

    @property
    def exists(self) -> bool:
        """Whether there is a higher peak."""
        return bool(np.isfinite(self.amplitude))


@dataclass(frozen=True)
class Followed:
    """A followed peak with what a session of the same scene and options goes on from: its saved state."""

    peak: Peak
    state: np.ndarray


class HigherPeaks:
    """Looks for peaks that are higher than followed ones, in sessions of their own. All calls are collective.

    Parameters
    ----------
    scene, options : those of the curve
    load_path : `[corners, loads]` at preload 1, followed in `steps`
    monitor, measure : index of the monitor; a name of `AMPLITUDES`
    band_hz : lowest and highest frequency
    """

    def __init__(
        self,
        comm: Comm,
        scene: ReducedScene,
        options: Options,
        load_path: np.ndarray,
        steps: int,
        monitor: int,
        measure: str,
        band_hz: tuple[float, float],
    ):
        self._comm, self._scene, self._options = comm, scene, replace(options, curve_tolerance=COARSE)
        self._path, self._steps, self._monitor, self._measure = load_path, steps, monitor, measure
        self._band = band_hz
        # Floating-point operations of all sweeps, and what the present session had counted before
        self.work, self._counted = 0.0, 0.0

    def beside(self, followed: list[Followed], by_preload: bool) -> Iterator[Higher]:
        """For each peak; those followed in the preload each have a static solution of their own."""
        if not by_preload:
            with self._solver(1.0) as solver:
                yield from (self._look(solver, one) for one in followed)
            return
        for one in followed:
            with self._solver(one.peak.parameter) as solver:
                yield self._look(solver, one)

    def _solver(self, preload: float) -> Solver:
        solver = Solver(self._comm, self._scene, self._options)
        solver.follow_static_path(self._path * preload, self._steps, self._band[0])
        self._counted = solver.static_work
        return solver

    def _look(self, solver: Solver, followed: Followed) -> Higher:
        peak = followed.peak
        ends, whole = [], True
        best = (-np.inf, np.nan)
        for end in self._band:
            solver.load_state(followed.state)
            frequency, height = [], []
            for point in solver.sweep(peak.frequency_hz, end, peak.level, 0, MOST_POINTS):
                if not point.is_solved:
                    break
                frequency.append(point.frequency_hz)
                height.append(self._amplitude(point))
            self.work += point.work - self._counted
            self._counted = point.work
            whole = whole and point.is_solved and point.reached_stop
            ends += frequency
            at = highest_inside(np.array(height))
            if at is not None:
                best = max(best, (height[at], frequency[at]))
        swept = (min(ends, default=peak.frequency_hz), max(ends, default=peak.frequency_hz))
        exists = best[0] > (1.0 + HIGHER) * peak.amplitude
        return Higher(swept, whole, *(best[::-1] if exists else (np.nan, np.nan)))

    def _amplitude(self, point: Point) -> float:
        if self._measure == "half_range":
            return float(point.amplitude[self._monitor])
        return float(np.hypot(*point.harmonics[self._monitor, 1:3]))


def highest_inside(height: np.ndarray) -> int | None:
    """The highest of a sweep's points that both neighbours are below; None where there is none."""
    if len(height) < 3:
        return None
    inner = height[1:-1]
    peaks = 1 + np.flatnonzero((inner > height[:-2]) & (inner >= height[2:]))
    return int(peaks[np.argmax(height[peaks])]) if len(peaks) else None
