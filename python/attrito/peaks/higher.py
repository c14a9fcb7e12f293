"""Is there a higher peak than the one that is followed? The band of `[sweep]`, swept coarsely from a followed peak.

A peak is followed by itself: nothing is known of the response elsewhere. From the peak's own motion and sliders the
response is followed to either end of the band, at the same loads, by a coarse sweep. An arc of it has a maximum if the
amplitude rises where it begins, or has risen to there, and falls where it ends, or has fallen to there. That is higher
than both ends, by as much as the drawn curve may be wrong, so that all are climbed to that may be the highest. Branches
that are not connected to the peak's are not seen, nor is a rise after a fall within one arc.

One resonance may have several maxima, where contacts begin to slip or to open one after another. A higher maximum is of
the followed one's resonance where the response between does not fall below the followed one's half power, 1/sqrt(2) of
it: of these the highest is climbed to, and followed from there. A peak that was asked for by its frequency may stand on
the flank of a higher one: then the response between must not fall below the higher one's half power. Where the response
comes, above half power, to frequencies at which no motion has the loads' period, and is higher beside them, there is no
peak.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.library.peak_tracker import Peak, PeakTracker, Start
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Error of the curve drawn through the points of such a sweep, part of the largest amplitude
COARSE = 0.1
# A peak is reported that is higher by more than this part, beyond what the height of a point and other sliders change
HIGHER = 0.02
# Of the followed one, or the higher one: what the response between does not fall below where both are of one resonance
HALF_POWER = 2.0**-0.5
# By how much another maximum of the same resonance must be higher: beyond rounding, below what a peak is equal to
SAME = 1e-5
# Points without periodic motion, each a hundredth of a side of the band farther on, beyond which is not looked
WIDEST_GAP = 10
# Of a sweep to one side; of maxima of one resonance, those that are climbed to
MOST_POINTS, MOST_CLIMBS = 200, 3


@dataclass(frozen=True)
class Higher:
    """What was found about a followed peak.

    Parameters
    ----------
    swept_hz : lowest and highest frequency between which the response was solved
    whole : whether that is the whole band
    frequency_hz, amplitude : of the highest peak, Hz and user length; NaN where none is higher than the followed one
    drifts : whether the resonance of the followed peak is highest beside frequencies without periodic motion
    alone_hz : frequencies of half power about a followed peak that stands alone: the response falls to them without a
        shoulder, as that of one oscillator falls, and is below half power in the rest of the band; None of any other
    """

    swept_hz: tuple[float, float]
    whole: bool
    frequency_hz: float
    amplitude: float
    drifts: bool = False
    alone_hz: tuple[float, float] | None = None

    @property
    def exists(self) -> bool:
        """Whether there is a higher peak."""
        return bool(np.isfinite(self.amplitude))


@dataclass(frozen=True)
class Followed:
    """A followed peak with what a session of the same scene and options goes on from: its saved state."""

    peak: Peak
    state: np.ndarray


@dataclass(frozen=True)
class Maximum:
    """A point of a sweep, the higher end of an arc that has a maximum.

    `least`: amplitude below which the response between it and the followed peak does not fall; `start`, `state`: its
    motion and all that a session goes on from, None where it is too low to be of interest; `rises`: whether the
    amplitude rises there, along the sweep, or has risen to there.
    """

    amplitude: float
    frequency_hz: float
    least: float
    start: Start | None
    state: np.ndarray | None
    work: float
    rises: bool


@dataclass(frozen=True)
class Sweep:
    """A sweep from a followed peak.

    `farthest_hz`: to where it was solved; `drifts_at`: the larger amplitude beside frequencies without periodic motion
    within the peak's resonance; -inf if there are none. `frequencies_hz`, `heights`: of its points that are solved.
    """

    maxima: list[Maximum]
    farthest_hz: float
    reached_end: bool
    drifts_at: float
    frequencies_hz: list[float]
    heights: list[float]


class HigherPeaks:
    """Looks for peaks that are higher than followed ones, in sessions of their own. All calls are collective.

    To be used in `with`: the session at preload 1 is kept open.

    Parameters
    ----------
    scene, options : those of the curve
    load_path : `[corners, loads]` at preload 1, followed in `steps`
    monitor, measure : index of the monitor; a name of `AMPLITUDES`
    band_hz : lowest and highest frequency
    chosen : whether the peak was asked for by its frequency
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
        chosen: bool = False,
    ):
        self._comm, self._scene, self._options = comm, scene, replace(options, curve_tolerance=COARSE)
        self._path, self._steps, self._monitor, self._measure = load_path, steps, monitor, measure
        self._band, self._chosen = band_hz, chosen
        self._open, self._session = ExitStack(), None
        # Floating-point operations of all sweeps and climbs
        self.work = 0.0

    def __enter__(self) -> HigherPeaks:
        """Nothing is open yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the session."""
        self._open.close()

    def take(self, scene: ReducedScene, load_path: np.ndarray, steps: int, band_hz: tuple[float, float]) -> bool:
        """Go on with a scene that differs in friction, gaps and preloads of contacts alone; False if in more."""
        if self._session is None or not self._session.take(scene):
            return False
        self._scene, self._path, self._steps, self._band = scene, load_path, steps, band_hz
        return True

    def beside(
        self, followed: Followed, preload: float = 1.0, *, anywhere: bool = False
    ) -> tuple[Higher, Followed | None, Start | None]:
        """What there is beside a peak, whose static loads have a factor `preload`.

        Returns
        -------
        what is higher than the highest maximum of the peak's resonance, or `anywhere` in the band; that maximum and
        its motion, None if it is the followed peak itself
        """
        with self._at_rest(preload) as solver:
            return self._look(solver, followed, preload, anywhere)

    def across(self, level: float, preload: float = 1.0) -> Start | None:
        """The motion at the highest maximum of a sweep over the band from rest; None where that does not arrive."""
        with self._at_rest(preload) as solver:
            start, end = self._band[::-1]
            self.work -= solver.static_work
            swept = self._sweep(solver, solver.sweep(start, end, level, 0, MOST_POINTS), start, end, 0.0, True)
            return self._highest_of_kept(solver, level, 0.0, swept.maxima, preload)[1] if swept.reached_end else None

    @contextmanager
    def _at_rest(self, preload: float) -> Iterator[Solver]:
        """A session at the end of its static path, kept open if that is the whole one."""
        with ExitStack() as stack:
            if self._session is None or preload != 1.0:
                where = self._open if preload == 1.0 else stack
                solver = where.enter_context(Solver(self._comm, self._scene, self._options))
                self._session = solver if preload == 1.0 else self._session
            else:
                solver = self._session
            solver.follow_static_path(self._path * preload, self._steps, self._band[0])
            yield solver

    def _look(
        self, solver: Solver, followed: Followed, preload: float, anywhere: bool
    ) -> tuple[Higher, Followed | None, Start | None]:
        peak, sweeps = followed.peak, []
        for end in self._band:
            solver.load_state(followed.state)
            points = solver.sweep(peak.frequency_hz, end, peak.level, 0, MOST_POINTS, self._band)
            # The state has brought its own count of work along.
            self.work -= peak.point.work
            sweeps.append(self._sweep(solver, points, peak.frequency_hz, end, peak.amplitude, anywhere))
        maxima = [one for swept in sweeps for one in swept.maxima]
        better, start = self._highest_of_kept(solver, peak.level, peak.amplitude, maxima, preload)
        height = (followed if better is None else better).peak.amplitude
        drifts = any(swept.drifts_at > (1.0 + SAME) * height for swept in sweeps)
        swept_hz = (sweeps[0].farthest_hz, sweeps[1].farthest_hz)
        best = max(((one.amplitude, one.frequency_hz) for one in maxima), default=(-np.inf, np.nan))
        found = best[::-1] if best[0] > (1.0 + HIGHER) * height else (np.nan, np.nan)
        whole = all(swept.reached_end for swept in sweeps)
        falls_to = [_falls_to(swept.frequencies_hz, swept.heights) for swept in sweeps]
        alone = (falls_to[0], falls_to[1]) if whole and better is None and np.all(np.isfinite(falls_to)) else None
        return Higher(swept_hz, whole, *found, drifts, alone), better, start

    def _sweep(
        self, solver: Solver, points: Iterator[Point], begin: float, end: float, amplitude: float, anywhere: bool
    ) -> Sweep:
        """From a peak of an amplitude, or anything (0), towards an end of the band, or to where it is not solved."""
        maxima: list[Maximum] = []
        last: Maximum | None = None
        frequencies: list[float] = []
        heights: list[float] = []
        gap, farthest, drifts_at = 0, begin, -np.inf
        for point in points:
            height = self._amplitude(point)
            if not point.is_solved:
                of_resonance = last is not None and last.least >= HALF_POWER * amplitude
                if not of_resonance or point.outcome != "no_period_one_orbit" or gap == WIDEST_GAP:
                    break
                gap, drifts_at = gap + 1, last.amplitude
                continue
            if gap > 0:
                drifts_at = max(drifts_at, height)
                break
            frequencies.append(point.frequency_hz)
            heights.append(height)
            least = height if last is None else min(height, last.least)
            of_one = anywhere or least >= HALF_POWER * (height if self._chosen else min(height, amplitude))
            kept = last is not None and of_one and height > (1.0 - COARSE) * amplitude
            start = Start(point.frequency_hz, solver.coordinates()) if kept else None
            state = solver.save_state() if kept else None
            rate = self._rate(point, 0.0 if last is None else height - last.amplitude)
            rises = last is not None and (rate > 0.0 or height > last.amplitude)
            before, last = last, Maximum(height, point.frequency_hz, least, start, state, point.work, rises)
            farthest = (min if end < begin else max)(farthest, point.frequency_hz)
            if before is None or not before.rises or (rate > 0.0 and height > before.amplitude):
                continue
            highest = max(before, last, key=lambda one: one.amplitude)
            if not maxima or maxima[-1] is not highest:
                maxima.append(highest)
            if _is_back(frequencies, heights, amplitude):
                break
        self.work += point.work
        reached_end = point.is_solved and gap == 0 and point.reached_stop
        return Sweep(maxima, farthest, reached_end, drifts_at, frequencies, heights)

    def _highest_of_kept(
        self, solver: Solver, level: float, amplitude: float, maxima: list[Maximum], preload: float
    ) -> tuple[Followed | None, Start | None]:
        """The highest peak above those maxima that are kept, None if none is higher than an amplitude."""
        tracker = PeakTracker(solver, self._monitor, self._measure, self._band, self._path[-1])
        kept = sorted((one for one in maxima if one.state is not None), key=lambda one: -one.amplitude)
        better, start, height = None, None, (1.0 + SAME) * amplitude
        for one in kept[:MOST_CLIMBS]:
            if one.amplitude < (1.0 - COARSE) * height:
                break
            solver.load_state(one.state)
            climbed = tracker.begin_near(one.start, level, preload)
            self.work += climbed.point.work - one.work
            if climbed.outcome != "not_converged" and climbed.amplitude > height:
                height = climbed.amplitude
                better, start = Followed(climbed, solver.save_state()), tracker.start(climbed.frequency_hz)
        return better, start

    def _rate(self, point: Point, change: float) -> float:
        """How the amplitude changes along the branch; points tell it of half the range, else as it has changed."""
        return float(point.amplitude_rate[self._monitor]) if self._measure == "half_range" else change

    def _amplitude(self, point: Point) -> float:
        if self._measure == "half_range":
            return float(point.amplitude[self._monitor])
        return float(np.hypot(*point.harmonics[self._monitor, 1:3]))


def _is_back(frequencies_hz: list[float], heights: list[float], amplitude: float) -> bool:
    """Whether a sweep from a peak of an amplitude, fallen below half power, has turned and come back to the peak."""
    fallen = next((i for i, height in enumerate(heights) if height < HALF_POWER * amplitude), None)
    if fallen is None or max(heights[-2:]) < (1.0 - COARSE) * amplitude:
        return False
    return abs(frequencies_hz[-1] - frequencies_hz[0]) < abs(frequencies_hz[fallen] - frequencies_hz[0])


def _falls_to(frequencies_hz: list[float], heights: list[float]) -> float:
    """Where a curve first is below half power of its first point; NaN if it has a shoulder on the way or rises later.

    The inverse square of the amplitude of one oscillator is a parabola of the frequency; a shoulder bends it down.
    """
    if not heights:
        return np.nan
    away = np.abs(np.array(frequencies_hz) - frequencies_hz[0])
    inverse = (heights[0] / np.array(heights)) ** 2
    below = np.flatnonzero(inverse > HALF_POWER**-2)
    if not len(below) or below[0] + len(below) < len(inverse):
        return np.nan
    steps, rises = np.diff(away[: below[0] + 1]), np.diff(inverse[: below[0] + 1])
    if np.any(steps <= 0.0) or np.any(np.diff(rises / steps) < 0.0):
        return np.nan
    return frequencies_hz[below[0]]
