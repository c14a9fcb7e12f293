"""`attrito chart --contacts`: error against cost of the ways to let two faces meet, for a job's own structure.

The job is swept with contacts at the nodes, at the Gauss points and at those of cut faces of its contact sets with
`pairing = "face"`, and so is every other job that is given: the same structure on other meshes, matching ones for
instance. All have the harmonics and samples that their jobs ask for. The error is that of the peaks,

    e = max over monitors |A - A_ref| / A_ref,   A = max over the sweep's points of the monitor's amplitude,

A_ref being that of the last of the other jobs, or without any of cut faces, which hold a constant stress exactly. Cost
is processor time of the sweep without the static load path, and its counted work.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.file import LEAST_SHARE, SOLVED, Chart, Way
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.model.face_sets import POINTS
from attrito.model.pairs import GROUND
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options
from attrito.support.errors import InputError, NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

REFERENCE = "the reference"


@dataclass(frozen=True)
class _Swept:
    """A way, the largest amplitude of each monitor `[monitors]`, NaN where none was solved, and the monitors' names."""

    way: Way
    peaks: np.ndarray
    monitors: list[str]


def chart_contacts(
    path: str | Job, others: Sequence[str | Job] = (), say: Callable[[str], None] = lambda _: None
) -> Chart:
    """Chart the contacts of a job, on one process.

    Parameters
    ----------
    path : the job file, or the job
    others : jobs, or files of them, of the same structure on other meshes; the last one's peak is the reference
    say : receives what is done, a line each

    Raises
    ------
    InputError : the job has no contact on faces and no other job is given; another job has other monitors or levels
    NumericsError : the reference, or every other way, has no solution
    """
    from mpi4py import MPI

    job = path if isinstance(path, Job) else read_job(path)
    jobs = [read_job(other) for other in others]
    variants = [*_variants(job), *((Path(other.path).stem, "meshes", other) for other in jobs)]
    if len(variants) < 2:
        raise InputError(job.fault("contact_set", "no pairing", 'a contact set with pairing = "face", or another job'))
    _check_alike(job, jobs)
    swept = []
    for label, series, variant in variants:
        swept.append(_sweep(MPI.COMM_SELF, variant, Way(series, label, own=variant is job), say))
        _say_peak(swept[-1], say)
    reference = swept[-1]
    if not np.isfinite(reference.peaks).all():
        raise NumericsError(f"the reference, {reference.way.label}, has no solution: {reference.way.note}")
    ways = [replace(one.way, error=_error(one.peaks, reference.peaks)) for one in swept[:-1]]
    if not any(np.isfinite(way.error) for way in ways):
        raise NumericsError(f"no way but the reference has a solution: {ways[0].note}")
    ways.append(replace(reference.way, note=REFERENCE))
    level = job["sweep"]["levels"][-1]
    places = {"frequency_hz": reference.way.frequency_hz, "level": level}
    title = f"level {level:g}; reference: {reference.way.label}, peak at {reference.way.frequency_hz:.6g} Hz"
    return Chart(ways, places, title, "Relative error of the peak", replace(reference.way, estimate=np.nan))


def _variants(job: Job) -> list[tuple[str, str, Job]]:
    """Label, series and job of each kind of points on the job's faces; the job itself where it has none."""
    faces = [keys for keys in job["contact_set"] if keys["pairing"] == "face"]
    if not faces:
        return [("pairs of nodes", "points", job)]
    found = []
    for kind, label in POINTS.items():
        if kind == "cut" and all(keys["b"] == GROUND for keys in faces):
            continue
        own = all((keys["points"] or "node") == kind for keys in faces)
        found.append((label, "points", job if own else _with_points(job, kind)))
    return found


def _with_points(job: Job, kind: str) -> Job:
    """The job with other points on its faces, not cut on the ground, which has no edges; and its own reduced model."""
    tables = copy.deepcopy(job.tables)
    for keys in tables["contact_set"]:
        if keys["pairing"] == "face":
            keys["points"] = "gauss" if kind == "cut" and keys["b"] == GROUND else kind
    tables["reduction"]["file"] = None
    return replace(job, tables=tables)


def _check_alike(job: Job, others: list[Job]) -> None:
    """Refuse jobs whose peaks cannot be compared."""
    faults = []
    for key, value_of in (
        ("[output] monitors", lambda one: [monitor["name"] for monitor in one["output"]["monitors"]]),
        ("[sweep] levels", lambda one: one["sweep"]["levels"][-1:]),
    ):
        own = value_of(job)
        faults += [
            other.fault(key, value_of(other), f"{own}, as in {job.path}") for other in others if value_of(other) != own
        ]
    if faults:
        raise InputError(*faults)


def _sweep(comm: Comm, job: Job, way: Way, say: Callable[[str], None]) -> _Swept:
    """Sweep a job's last level, from the static solution on."""
    scene = build_scene(job)
    rom, _ = make_rom(comm, job, scene, say)
    reduced = reduced_scene(job, scene, rom)
    sweep = job["sweep"]
    listed = sweep["frequencies_hz"]
    start, stop = (listed[0], listed[-1]) if listed else (sweep["start_hz"], sweep["stop_hz"])
    with Solver(comm, reduced, solver_options(job, rom)) as solver:
        solver.follow_static_path(scene.load_path, job["static"]["steps"], start)
        started = time.process_time()
        if listed:
            points = list(solver.solve_at(listed, sweep["levels"][-1], 0))
        else:
            points = list(solver.sweep(start, stop, sweep["levels"][-1], 0, job["continuation"]["max_points"]))
        seconds = time.process_time() - started
        work = points[-1].work - solver.static_work if points else np.nan
    way = replace(way, seconds=seconds, work=work, contacts=len(scene.contacts.tables))
    return _at_peak(way, points, reduced.monitor_names)


def _at_peak(way: Way, points: list[Point], monitors: list[str]) -> _Swept:
    """What the solved points of a sweep say of its peak."""
    solved = [point for point in points if point.outcome in SOLVED]
    if not solved:
        note = f"no point of the sweep converged: {points[-1].outcome}" if points else "the sweep has no points"
        return _Swept(replace(way, note=note), np.full(len(monitors), np.nan), monitors)
    top = max(solved, key=lambda point: point.amplitude[0])
    way = replace(
        way,
        frequency_hz=top.frequency_hz,
        harmonics=(top.harmonics.shape[1] - 1) // 2,
        samples=top.samples,
        estimate=top.estimate,
    )
    return _Swept(way, np.max([point.amplitude for point in solved], axis=0), monitors)


def _say_peak(swept: _Swept, say: Callable[[str], None]) -> None:
    way = swept.way
    if way.note:
        say(f"{way.label}: {way.note}")
        return
    peak = f"{swept.monitors[0]} {swept.peaks[0]:.6g} at {way.frequency_hz:.6g} Hz"
    say(f"{way.label}: {way.contacts} contacts, peak of {peak}, {way.seconds:.3g} s")


def _error(peaks: np.ndarray, reference: np.ndarray) -> float:
    """Of the monitors; one that hardly moves is measured against the others, as in the estimate."""
    return float(np.max(np.abs(peaks - reference) / np.maximum(reference, LEAST_SHARE * reference.max())))
