"""The peak of a scene at a value of the job's parameter, of loads which come on at once at the end of the static path.

It is the highest maximum that the response leads to in the band of `[sweep]`, of its resonance if `near_hz` chooses
one, from the sliders that the static path leaves: it does not depend on what was solved before. The curve of
`attrito peak` begins at it; it is the peak of a study's sample and of an optimum's.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.peak_tracker import Peak, PeakTracker, Start
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks.higher import Followed, Higher, HigherPeaks

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# By which part the peak may be lower from the static path's sliders than from those of the way to it
LOWER = 0.05


@dataclass(frozen=True)
class First:
    """A peak, the solver being there.

    Parameters
    ----------
    method : how it was found: `near` a motion that was given, by a sweep of the band (`swept`), or `tracked` up from
        where all contacts stick
    tracker, peak : with what, and what
    higher : what the band has beside it; None if that was not looked for
    moved : whether the one that was come to first was lower
    """

    method: str
    tracker: PeakTracker
    peak: Peak
    higher: Higher | None = None
    moved: bool = False

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return self.peak.outcome != "not_converged"


def find(
    solver: Solver,
    job: Job,
    scene: ReducedScene,
    load_path: np.ndarray,
    value: float,
    looking: HigherPeaks | None = None,
    near: Start | None = None,
) -> First:
    """Follow the static path and find the peak at a value of the job's parameter.

    Parameters
    ----------
    looking : finds the highest maximum; None: the one that is come to first is taken
    near : a motion that may be near the peak, as of a scene that differs in a number, which spares the way up
    """
    keys, band = job["peak"], band_of(job)
    level, preload = factors(job, value)
    tracker = PeakTracker(solver, monitor_of(job, scene), keys["amplitude"], band, load_path[-1])

    def from_rest(start: Start) -> Peak:
        come_to_rest()
        return tracker.begin_near(start, level, preload)

    def come_to_rest() -> None:
        solver.follow_static_path(load_path * preload, job["static"]["steps"], band[0])

    if near is not None:
        here = First("near", tracker, from_rest(near))
        if not here.found and looking is not None and keys["near_hz"] is None:
            best = looking.across(level, preload)
            here = here if best is None else First("swept", tracker, from_rest(best))
    if near is None or not here.found:
        come_to_rest()
        near_hz = tracker.linear_peak_hz() if keys["near_hz"] is None else keys["near_hz"]
        here = First("tracked", tracker, tracker.begin(level, near_hz))
    if here.method == "swept" or not here.found or looking is None:
        return here
    state = solver.save_state()
    higher, better, start = looking.beside(Followed(here.peak, state), preload, anywhere=keys["near_hz"] is None)
    if higher.drifts:
        return replace(here, peak=drifting(here.peak), higher=higher)
    if better is None and here.method == "near":
        return replace(here, higher=higher)
    start = tracker.start(here.peak.frequency_hz) if start is None else start
    best, state = (here.peak, state) if better is None else (better.peak, better.state)
    peak = from_rest(start)
    if peak.outcome == "not_converged" or peak.amplitude < (1.0 - LOWER) * best.amplitude:
        solver.load_state(state)
        peak = tracker.begin_near(start, level, preload)
    return replace(here, peak=peak, higher=higher, moved=better is not None)


def drifting(peak: Peak) -> Peak:
    """No peak, since the resonance is highest beside frequencies without periodic motion."""
    return replace(peak, point=peak.point._replace(outcome="not_converged"), ending="no_periodic_motion")


@contextlib.contextmanager
def looking_for_higher(
    comm: Comm, job: Job, options: Options, scene: ReducedScene, load_path: np.ndarray
) -> Iterator[HigherPeaks | None]:
    """What looks for higher peaks; None if the job does not want it."""
    keys, band = job["peak"], band_of(job)
    if not keys["look_for_higher"]:
        yield None
        return
    monitor, steps = monitor_of(job, scene), job["static"]["steps"]
    chosen = keys["near_hz"] is not None
    with HigherPeaks(comm, scene, options, load_path, steps, monitor, keys["amplitude"], band, chosen) as looking:
        yield looking


def factors(job: Job, value: float) -> tuple[float, float]:
    """Level of the harmonic loads and factor on the static ones at a value of the job's parameter."""
    keys = job["peak"]
    return (value, 1.0) if keys["parameter"] == "level" else (keys["level"], value)


def monitor_of(job: Job, scene: ReducedScene) -> int:
    """Index of the monitor whose peak it is."""
    name = job["peak"]["monitor"]
    return scene.monitor_names.index(name) if name is not None else 0


def band_of(job: Job) -> tuple[float, float]:
    """Least and largest frequency of the sweep, Hz, which the peak lies between."""
    sweep = job["sweep"]
    frequencies = sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]]
    return min(frequencies), max(frequencies)
