"""The first peak of a job: where its load path has been followed, at a value of the parameter.

A module of its own: a study of peaks takes no more than that of what follows them.
"""

from __future__ import annotations

import numpy as np

from attrito.job.job import Job
from attrito.library.peak_tracker import Peak, PeakTracker
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver


def begin(
    solver: Solver, job: Job, scene: ReducedScene, load_path: np.ndarray, value: float
) -> tuple[PeakTracker, Peak]:
    """Follow the static path and find the first peak, at a value of the job's parameter."""
    keys = job["peak"]
    by_level = keys["parameter"] == "level"
    band = band_of(job)
    solver.follow_static_path(load_path * (1.0 if by_level else value), job["static"]["steps"], band[0])
    tracker = PeakTracker(solver, monitor_of(job, scene), keys["amplitude"], band, load_path[-1])
    near = keys["near_hz"] if keys["near_hz"] is not None else tracker.linear_peak_hz()
    return tracker, tracker.begin(value if by_level else keys["level"], near)


def monitor_of(job: Job, scene: ReducedScene) -> int:
    """Index of the monitor whose peak it is."""
    name = job["peak"]["monitor"]
    return scene.monitor_names.index(name) if name is not None else 0


def band_of(job: Job) -> tuple[float, float]:
    """Least and largest frequency of the sweep, Hz, which the peak lies between."""
    sweep = job["sweep"]
    frequencies = sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]]
    return min(frequencies), max(frequencies)
