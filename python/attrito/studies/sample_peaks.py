"""Peaks of a study's samples, one after another on one session.

A sample's peak is that of `attrito peak` (`attrito.peaks.first`), which does not depend on what was solved before. It
is looked for by way of the peak of the sample before, if there is one. The band is not swept again for a higher maximum
where a sample that is nearly the same had a peak that stands alone: to be the highest another maximum, which was below
half power, would have to grow by sqrt(2) at least while numbers of the scene change by `NEAR` at most.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.peak_tracker import Peak, Start
from attrito.library.reduced_scene import FREE_OF_MODES, ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks.first import First, band_of, factors, find, looking_for_higher, monitor_of
from attrito.peaks.fixed_series import fixed_series, is_enough
from attrito.peaks.higher import HigherPeaks
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.samples import Samples
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# How a sample's peak was found, see `attrito.peaks.first`: the last two by a model through others
METHODS = ("near", "tracked", "swept", "second_order", "first_order")
# By which part of themselves friction, gaps, preloads, loads and the amplitude of two samples may differ that are taken
# for nearly the same
NEAR = 0.05


@dataclass(frozen=True)
class Alone:
    """A sample whose peak stands alone in the band.

    Parameters
    ----------
    numbers : of the scene, what its modes do not show, and of its loads
    amplitude, half_power_hz : of the peak, user length, and about it, Hz
    """

    numbers: np.ndarray
    amplitude: float
    half_power_hz: tuple[float, float]

    def is_near(self, numbers: np.ndarray) -> bool:
        """Whether another sample is nearly the same."""
        same_shape = self.numbers.shape == numbers.shape
        return same_shape and np.allclose(numbers, self.numbers, rtol=NEAR, atol=0.0, equal_nan=True)

    def has(self, first: First) -> bool:
        """Whether another sample's peak, found near this one's, is the same one."""
        low, high = self.half_power_hz
        as_high = abs(first.peak.amplitude - self.amplitude) <= NEAR * self.amplitude
        return first.found and first.method == "near" and as_high and low < first.peak.frequency_hz < high


class SamplePeaks(Samples):
    """Locates the peaks of samples; modes and session are kept where they are the same."""

    def __init__(self, comm: Comm, base: Scene | None, rom: Rom | None = None):
        super().__init__(comm, base, rom)
        self._solver: Solver | None = None
        self._options: Options | None = None
        self._open = ExitStack()
        self._looking: HigherPeaks | None = None
        # Which of the series the last sample took
        self._length = 0
        # By place among the values of the parameter
        self._starts: dict[int, Start] = {}
        self._alone: dict[int, Alone] = {}

    def close(self) -> None:
        """End the sessions."""
        self._open.close()
        if self._solver is not None:
            self._solver.close()

    def of(self, job: Job, values: list[float]) -> list[dict[str, Any]]:
        """The peaks of a job at values of its parameter."""
        reduced, load_path, options = self.scene_of(job)
        series = fixed_series(options)
        while True:
            self._take(reduced, series[self._length])
            found = self._find(job, reduced, load_path, values)
            if self._length == len(series) - 1 or is_enough(row["outcome"] for row in found):
                return found
            self._length += 1

    def visit(
        self, solver: Solver, peak: Peak | None, place: tuple[int, int], here: tuple[ReducedScene, np.ndarray, Options]
    ) -> dict[str, Any]:
        """What the row of a peak has beside, None where there is none: the solver is at it.

        Parameters
        ----------
        place : of the monitor, and of the peak among the values of the parameter
        here : the scene, its load path, the solver's options
        """
        return {}

    def _find(
        self, job: Job, reduced: ReducedScene, load_path: np.ndarray, values: list[float]
    ) -> list[dict[str, Any]]:
        found = []
        here = reduced, load_path, self._options
        steps, band = job["static"]["steps"], band_of(job)
        if self._looking is None or not self._looking.take(reduced, load_path, steps, band):
            self._open.close()
            looking = looking_for_higher(self._comm, job, self._options, reduced, load_path)
            self._looking = self._open.enter_context(looking)
        for i, value in enumerate(values):
            first = self._first(job, reduced, load_path, value, i)
            touches = any(self._solver.static_states[:3])
            peak = None if first is None else first.peak
            more = self.visit(self._solver, peak, (monitor_of(job, reduced), i), here)
            if first is not None:
                self._starts[i] = first.tracker.start(first.peak.frequency_hz)
            found.append(_row("tracked" if first is None else first.method, peak) | {"touches": touches} | more)
        return found

    def _first(self, job: Job, reduced: ReducedScene, load_path: np.ndarray, value: float, place: int) -> First | None:
        """The peak at a value, by its place; None if there is none, or no static equilibrium."""
        here = self._solver, job, reduced, load_path, value
        near, alone = self._starts.get(place, self._starts.get(place - 1)), self._alone.get(place)
        numbers = _numbers(job, reduced, load_path, value)
        try:
            if alone is not None and alone.is_near(numbers):
                first = find(*here, near=near)
                if alone.has(first):
                    return first
            self._alone.pop(place, None)
            first = find(*here, self._looking, near)
        except NumericsError:
            return None
        if first.higher is not None and first.higher.alone_hz is not None:
            self._alone[place] = Alone(numbers, first.peak.amplitude, first.higher.alone_hz)
        return first if first.found else None

    def _take(self, reduced: ReducedScene, options: Options) -> None:
        """Let the session have a scene; a new one where modes or options differ."""
        if self._solver is not None and options == self._options and self._solver.take(reduced):
            return
        if self._solver is not None:
            self._solver.close()
        self._open.close()
        self._looking = None
        self._alone.clear()
        self._solver, self._options = Solver(self._comm, reduced, options), options


def _numbers(job: Job, scene: ReducedScene, load_path: np.ndarray, value: float) -> np.ndarray:
    """Of a scene, what its modes do not show, and of its loads at a value of the parameter."""
    level, preload = factors(job, value)
    laws = [np.ravel(scene.laws[name]) for name in FREE_OF_MODES if name in scene.laws]
    return np.concatenate([*laws, np.ravel(load_path) * preload, [level], band_of(job)])


def _row(method: str, peak: Peak | None) -> dict[str, Any]:
    return {
        "frequency_hz": None if peak is None else peak.frequency_hz,
        "amplitude": None if peak is None else peak.amplitude,
        "level": None if peak is None else peak.level,
        "amplitude_error": None if peak is None else peak.amplitude_error,
        "frequency_error": None if peak is None else peak.frequency_error,
        "states": [0, 0, 0, 0] if peak is None else list(peak.point.states),
        "method": method,
        "outcome": "not_converged" if peak is None else peak.outcome,
    }
