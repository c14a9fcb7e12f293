"""Peaks of a study's samples, one after another on one session.

A sample's peak is where its frequency response is largest when the static path has been followed and the
harmonic ones come on at once: sliders begin where that path leaves them, whatever was solved before. It is looked for
near the peak of the sample before; where that leads to nothing it is followed from the linear peak, and in the end
looked for along the frequency response over the band of the sweep.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.peak_tracker import Peak, PeakTracker, Start
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks.first import begin
from attrito.peaks.fixed_series import fixed_series, is_enough
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.samples import Samples
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# How a sample's peak was found: the last two by a model through others
METHODS = ("near", "tracked", "swept", "second_order", "first_order")
# Of a frequency response over the band
SWEEP_POINTS = 60


class SamplePeaks(Samples):
    """Locates the peaks of samples; modes and session are kept where they are the same."""

    def __init__(self, comm: Comm, base: Scene | None, rom: Rom | None = None):
        super().__init__(comm, base, rom)
        self._solver: Solver | None = None
        self._options: Options | None = None
        # Which of the series the last sample took
        self._length = 0
        # By place among the values of the parameter
        self._starts: dict[int, Start] = {}

    def close(self) -> None:
        """End the session."""
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
        for i, value in enumerate(values):
            search = _Search(self._solver, job, reduced, load_path, value)
            method, peak = search.run(self._starts.get(i, self._starts.get(i - 1)))
            touches = any(self._solver.static_states[:3])
            more = self.visit(self._solver, peak, (search.monitor, i), (reduced, load_path, self._options))
            if peak is not None:
                self._starts[i] = search.tracker.start(peak.frequency_hz)
            found.append(_row(method, peak) | {"touches": touches} | more)
        return found

    def _take(self, reduced: ReducedScene, options: Options) -> None:
        """Let the session have a scene; a new one where modes or options differ."""
        if self._solver is not None and options == self._options and self._solver.take(reduced):
            return
        if self._solver is not None:
            self._solver.close()
        self._solver, self._options = Solver(self._comm, reduced, options), options


class _Search:
    """The peak of one sample at one value of the parameter."""

    def __init__(self, solver: Solver, job: Job, scene: ReducedScene, load_path: np.ndarray, value: float):
        keys = job["peak"]
        by_level = keys["parameter"] == "level"
        self._solver, self._job, self._scene, self._load_path, self._value = solver, job, scene, load_path, value
        self._level, self._preload = (value, 1.0) if by_level else (keys["level"], value)
        self._band = tuple(sorted(job["sweep"][name] for name in ("start_hz", "stop_hz")))
        self.monitor = scene.monitor_names.index(keys["monitor"]) if keys["monitor"] is not None else 0
        self.tracker = PeakTracker(solver, self.monitor, keys["amplitude"], self._band, load_path[-1])

    def run(self, start: Start | None) -> tuple[str, Peak | None]:
        """Method and peak; None if there is none."""
        for method, begin_at in (("near", lambda: start), ("tracked", self._tracked), ("swept", self._swept)):
            try:
                here = begin_at()
                peak = None if here is None else self._near(here)
            except NumericsError:
                # No linear peak in the band, or no static equilibrium: the latter fails in all ways.
                continue
            if peak is not None and self._band[0] < peak.frequency_hz < self._band[1]:
                return method, peak
        return "swept", None

    def _near(self, start: Start) -> Peak | None:
        self._come_to_rest()
        peak = self.tracker.begin_near(start, self._level, self._preload)
        return None if peak.outcome == "not_converged" else peak

    def _come_to_rest(self) -> None:
        path = self._load_path * self._preload
        self._solver.follow_static_path(path, self._job["static"]["steps"], self._band[0])

    def _tracked(self) -> Start | None:
        tracker, peak = begin(self._solver, self._job, self._scene, self._load_path, self._value)
        return None if peak.outcome == "not_converged" else tracker.start(peak.frequency_hz)

    def _swept(self) -> Start | None:
        """The largest of the points of a frequency response."""
        self._come_to_rest()
        highest, start = 0.0, None
        grid = np.linspace(self._band[1], self._band[0], SWEEP_POINTS)
        for point in self._solver.solve_at(grid.tolist(), self._level, 0):
            height = self._height(point)
            if height > highest:
                highest, start = height, self.tracker.start(point.frequency_hz)
        return start

    def _height(self, point: Point) -> float:
        if point.outcome == "not_converged":
            return 0.0
        if self._job["peak"]["amplitude"] == "first_harmonic":
            return float(np.hypot(*point.harmonics[self.monitor, 1:3]))
        return float(point.amplitude[self.monitor])


def _row(method: str, peak: Peak | None) -> dict[str, Any]:
    return {
        "frequency_hz": None if peak is None else peak.frequency_hz,
        "amplitude": None if peak is None else peak.amplitude,
        "level": None if peak is None else peak.level,
        "states": [0, 0, 0, 0] if peak is None else list(peak.point.states),
        "method": method,
        "outcome": "not_converged" if peak is None else peak.outcome,
    }
