"""`attrito chart --mode`: error against cost of both methods of nonlinear modes, for a job's own mode.

The mode is followed through all amplitudes of the job: by the extended periodic motion concept with H harmonics, and by
cycles of quasi-static loading with S steps. The error is the larger of

    max over Q |f - f_ref| / f_ref,   max over Q |z - z_ref| / max z_ref,

f being the frequency, z the damping ratio of the contacts, and the reference periodic motion with `FINEST` harmonics,
whose own error is taken to be its distance from the next shorter series. What quasi-static loading leaves at many steps
is what it leaves out: inertia of other modes, and motion that is not about the preload.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.file import Chart, Way
from attrito.job.cyclic import take_no_sector
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.library.session import Options, Solver
from attrito.modes.nonlinear import amplitudes, check_mode, chosen_mode, contact_work, new_tracker, series_of_mode
from attrito.modes.scene_at_rest import come_to_rest
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

HARMONICS = (1, 2, 3, 5, 7, 10, 14, 20)
FINEST = 30
STEPS = (16, 32, 64, 128, 256, 512)


class ModeBench:
    """A job's mode, followed again and again; `seconds`: what one run of a series may take."""

    def __init__(self, comm: Comm, job: Job, seconds: float, say: Callable[[str], None]):
        self._comm, self._job, self._seconds, self._say = comm, job, seconds, say
        scene = build_scene(job)
        self._path = scene.load_path
        rom, _ = make_rom(comm, job, scene, say)
        self._scene = reduced_scene(job, scene, rom)
        self._options = series_of_mode(solver_options(job, rom))
        self._amplitudes = amplitudes(job)
        # Frequency and damping ratio of the reference `[2, amplitudes]`
        self._reference = np.empty((2, 0))

    def chart(self, keep: Callable[[Chart], None] = lambda _: None) -> Chart:
        """Follow the reference, then go all ways; `keep` receives the chart after each."""
        _, _, self._reference = self._follow("epmc", self._series(FINEST))
        reference = self._way("epmc", self._series(HARMONICS[-1]))
        if not np.isfinite(self._reference).all() or reference.note:
            raise NumericsError(f"the reference, {FINEST} harmonics, loses the mode before [mode] stop")
        self._say(f"reference: {FINEST} harmonics, {reference.error:.1e} from {HARMONICS[-1]}")
        reference = replace(reference, harmonics=FINEST, estimate=reference.error)
        places = {"frequency_hz": float(self._reference[0, -1]), "amplitude": float(self._amplitudes[-1])}
        title = f"up to amplitude {places['amplitude']:g}, {places['frequency_hz']:.5g} Hz"
        found = Chart([], places, title, "Relative error of frequency and damping", reference)
        for way in self._ways():
            found.ways.append(way)
            outcome = f"error {way.error:.1e}, {way.seconds:.3g} s" if np.isfinite(way.error) else way.note
            self._say(f"{way.series}, {way.label}: {outcome}")
            keep(found)
        return found

    def _series(self, harmonics: int) -> Options:
        return replace(self._options, harmonics=harmonics, uncoupled=False)

    def _ways(self) -> Iterator[Way]:
        keys = self._job["mode"]
        epmc = keys["method"] == "epmc"
        own = self._options.harmonics if epmc else keys["steps"]
        loaded = max((len(self._scene.harmonic) - 1) // 2, 1)
        for harmonics in sorted({*HARMONICS, *([own] if epmc else [])}):
            if harmonics < loaded:
                continue
            options = self._options if epmc and harmonics == own else self._series(harmonics)
            way = self._way("epmc", options)
            yield replace(way, own=epmc and harmonics == own)
            if way.seconds > self._seconds and harmonics >= own * epmc:
                break
        for steps in sorted({*STEPS, *([] if epmc else [own])}):
            way = self._way("quasi_static", self._options, steps)
            yield replace(way, own=not epmc and steps == own)
            if way.seconds > self._seconds and steps >= own * (not epmc):
                break

    def _way(self, method: str, options: Options, steps: int = 0) -> Way:
        seconds, work, found = self._follow(method, options, steps)
        settings = {"steps": steps} if steps else {"harmonics": options.harmonics}
        label = f"{steps} steps" if steps else f"H = {options.harmonics}"
        if not np.isfinite(found).all():
            lost = self._amplitudes[np.isnan(found[0])][0]
            return Way(method, label, **settings, seconds=seconds, note=f"lost at amplitude {lost:.4g}")
        frequency, damping = abs(found - self._reference)
        largest = max(self._reference[1].max(), np.finfo(float).tiny)
        error = max((frequency / self._reference[0]).max(), damping.max() / largest)
        return Way(method, label, **settings, error=float(error), seconds=seconds, work=work)

    def _follow(self, method: str, options: Options, steps: int = 0) -> tuple[float, float, np.ndarray]:
        """Seconds, counted work, and frequency and damping ratio `[2, amplitudes]`, NaN where the mode is lost."""
        found = np.full((2, len(self._amplitudes)), np.nan)
        work = 0.0
        mode = self._job["mode"] | {"method": method} | ({"steps": steps} if steps else {})
        job = replace(self._job, tables=self._job.tables | {"mode": mode})
        with Solver(self._comm, self._scene, options) as solver:
            come_to_rest(solver, job, self._path)
            number, modes = chosen_mode(self._comm, job, solver)
            tracker = new_tracker(job, solver, self._scene, modes, number - 1)
            started = time.process_time()
            for i, amplitude in enumerate(self._amplitudes):
                one = tracker.at(float(amplitude))
                if not one.converged:
                    break
                found[:, i] = one.point.frequency_hz, one.damping_ratio(contact_work(self._comm, solver, one))
                work = one.point.work - solver.static_work
            return time.process_time() - started, work, found


def chart_mode(
    path: str | Job,
    seconds: float = 20.0,
    say: Callable[[str], None] = lambda _: None,
    keep: Callable[[Chart], None] = lambda _: None,
) -> Chart:
    """Chart a job's mode, on one process.

    Parameters
    ----------
    path : the job file, or the job
    seconds : of the processor; a series ends where a run of it takes longer
    say : receives what is done, a line each
    keep : receives the chart as it is after each way
    """
    from mpi4py import MPI

    job = path if isinstance(path, Job) else read_job(path, excited=False)
    check_mode(job)
    take_no_sector(job, "chart --mode")
    return ModeBench(MPI.COMM_SELF, job, seconds, say).chart(keep)
