"""`attrito study`: a job solved for many values of its keys, over groups of ranks, into one HDF5 file.

Samples are put into batches of neighbours. A batch is solved by one group and written when it is complete. Every sample
begins at its own static path and linear peak, so what it gives depends neither on the number of groups nor on where
a study was interrupted; one that is started again goes on from the batches that are there.
"""

from __future__ import annotations

import copy
import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize_scalar

from attrito.faults import NumericsError
from attrito.job import Job, read_job, rom_path
from attrito.parallel import on_root
from attrito.peak import begin
from attrito.progress import Progress
from attrito.rom import make_rom, reduced_scene
from attrito.running import solver_options
from attrito.scene import Scene, build_scene
from attrito.solver import Point, Solver
from attrito.study_design import Study, batches, read_study, set_value
from attrito.study_file import write_study

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Of a frequency response where tracking is lost, and how finely its largest point is located, relative.
SWEEP_POINTS = 60
FREQUENCY_TOLERANCE = 1e-7


def run_study(comm: Comm, path: str) -> str:
    """Solve a study's samples; returns the file's path. Raises at the end if some have no peak."""
    progress = Progress(comm)
    study = on_root(comm, lambda: read_study(path))
    job = on_root(comm, lambda: read_job(study.job_path))
    on_root(comm, lambda: study.check(job))
    values = study.sample()
    order = batches(study, values)
    folder = Path(f"{study.file}.parts") / _fingerprint(study, job)
    _reduce(comm, job, progress)
    on_root(comm, lambda: folder.mkdir(parents=True, exist_ok=True))
    missing = on_root(comm, lambda: [i for i in range(len(order)) if not _part(folder, i).exists()])
    progress.say(f"{study.samples} samples in {len(order)} batches, {len(order) - len(missing)} of them there already")
    groups = max(1, comm.size // study.ranks_per_group)
    color = min(comm.rank // study.ranks_per_group, groups - 1)
    group = comm.Split(color, comm.rank)
    try:
        for i in missing[color::groups]:
            rows = _solve_batch(group, job, study, values[order[i]])
            on_root(group, lambda i=i, rows=rows: _keep(_part(folder, i), order[i], rows))
            progress.say(f"batch {i}: {len(rows)} samples")
    finally:
        group.Free()
    comm.Barrier()

    def finish() -> int:
        found = [json.loads(_part(folder, i).read_text()) for i in range(len(order))]
        failed = write_study(study, job, values, found)
        shutil.rmtree(folder.parent)
        return failed

    failed = on_root(comm, finish)
    progress.say(study.file)
    if failed:
        raise NumericsError(f"{study.file}: {failed} of {study.samples} samples have no peak; they are in the file")
    return study.file


def _reduce(comm: Comm, job: Job, progress: Progress) -> None:
    """Make the reduced model that all samples share."""
    if rom_path(job) is None:
        return
    kept: list[Scene] = []
    on_root(comm, lambda: kept.append(build_scene(job)))
    progress.reduction(make_rom(comm, job, kept[0] if kept else None, progress.say, progress.step))


def _solve_batch(comm: Comm, job: Job, study: Study, values: np.ndarray) -> list[list[dict[str, Any]]]:
    """Peaks of the samples of one batch, `[samples][stops]`."""
    rows: list[list[dict[str, Any]]] = []
    for sample in values:
        changed = Job(job.path, copy.deepcopy(job.tables), job.given)
        for vary, value in zip(study.vary, sample, strict=True):
            for key in vary.keys:
                set_value(changed.tables, key, float(value), vary.factor)
        rows.append(_solve_sample(comm, changed, study))
    return rows


def _solve_sample(comm: Comm, job: Job, study: Study) -> list[dict[str, Any]]:
    def scene_of() -> tuple:
        scene = build_scene(job)
        return reduced_scene(job, scene), scene.load_path

    reduced, load_path = on_root(comm, scene_of)
    stops = study.stops(job)
    found: list[dict[str, Any]] = []
    with Solver(comm, reduced, solver_options(job)) as solver:
        tracker, peak = begin(solver, job, reduced, load_path, stops[0])
        if peak.outcome != "not_converged" and job["peak"]["parameter"] == "preload":
            peak = tracker.follow_in("preload")
        for stop in stops:
            if stop != stops[0] and peak.outcome != "not_converged":
                peak = tracker.at(stop)
            if peak.outcome != "not_converged":
                found.append(_row(peak.point, peak.amplitude, "tracked"))
                continue
            point, amplitude = _sweep(solver, job, reduced.monitor_names, load_path, stop)
            found.append(_row(point, amplitude, "swept"))
    return found


def _sweep(
    solver: Solver, job: Job, monitors: list[str], load_path: np.ndarray, value: float
) -> tuple[Point | None, float]:
    """Where tracking was lost: the largest amplitude of a frequency response over the band, located."""
    keys = job["peak"]
    by_level = keys["parameter"] == "level"
    level = value if by_level else keys["level"]
    monitor = monitors.index(keys["monitor"]) if keys["monitor"] is not None else 0
    low, high = sorted(job["sweep"][name] for name in ("start_hz", "stop_hz"))

    def height(point: Point) -> float:
        if point.outcome == "not_converged":
            return 0.0
        if keys["amplitude"] == "first_harmonic":
            return float(np.hypot(*point.harmonics[monitor, 1:3]))
        return float(point.amplitude[monitor])

    solver.walk_static_path(load_path * (1.0 if by_level else value), job["static"]["steps"], high)
    grid = np.linspace(high, low, SWEEP_POINTS)
    heights = np.array([height(point) for point in solver.solve_at(grid.tolist(), level, 0)])
    largest = int(np.argmax(heights))
    if largest in (0, len(grid) - 1):
        return None, np.nan

    def at(frequency: float) -> Point:
        return next(solver.solve_at([float(frequency)], level, 0))

    best = minimize_scalar(
        lambda frequency: -height(at(frequency)),
        bounds=(grid[largest + 1], grid[largest - 1]),
        method="bounded",
        options={"xatol": FREQUENCY_TOLERANCE * grid[largest]},
    )
    point = at(best.x)
    return (point, height(point)) if height(point) > 0.0 else (None, np.nan)


def _row(point: Point | None, amplitude: float, method: str) -> dict[str, Any]:
    return {
        "frequency_hz": None if point is None else point.frequency_hz,
        "amplitude": None if point is None else amplitude,
        "level": None if point is None else point.level,
        "states": [0, 0, 0, 0] if point is None else list(point.states),
        "method": method,
        "outcome": "not_converged" if point is None else point.outcome,
    }


def _part(folder: Path, batch: int) -> Path:
    return folder / f"batch_{batch:06d}.json"


def _keep(path: Path, samples: np.ndarray, rows: list) -> None:
    """Write a batch; the file appears when it is complete, whatever ends the program."""
    partial = path.with_suffix(".partial")
    with open(partial, "w") as stream:
        json.dump({"samples": samples.tolist(), "rows": rows}, stream)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, path)


def _fingerprint(study: Study, job: Job) -> str:
    """Of all that the samples depend on."""
    text = json.dumps([study.as_table(), job.tables], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
