"""`attrito run`: a job from its file to result.h5."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito import __version__
from attrito.bifurcations import Finder, write_bifurcations
from attrito.faults import InputError, NumericsError, UnsolvedError
from attrito.job import TOLERANCE, Job, read_job
from attrito.parallel import on_root
from attrito.progress import Progress
from attrito.restart import StoredPoint, read_point
from attrito.rom import make_rom, mode_error, model_path, reduced_scene, rom_fingerprint, rom_path
from attrito.scene import Scene, build_scene
from attrito.search import Search
from attrito.solver import Options, Point, ReducedScene, Solver
from attrito.stability import Examiner, write_multipliers
from attrito.statics import friction_margin, warning, write_margin
from attrito.uniqueness import Sampler, write_bounds

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

REFERENCES = (
    "Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032; Craig & Bampton 1968, doi:10.2514/3.4741; "
    "Cameron & Griffin 1989, doi:10.1115/1.3176036; PETSc, SLEPc, MUMPS, FFTW, HDF5"
)
LINEAR_POINTS = 400
# Where they are chosen point by point, to begin with
FIRST_HARMONICS, FIRST_SAMPLES = 3, 64
NATURAL_FREQUENCIES = 20


def reduce_job(comm: Comm, path: str | Job) -> str:
    """`attrito reduce`: make the job's rom.h5; returns its path."""
    progress = Progress(comm)
    job = on_root(comm, lambda: read_job(path))
    scene = _on_root_only(comm, lambda: build_scene(job))
    _say_notes(progress, scene)
    if rom_path(job) is None:
        raise InputError(job.fault("[reduction]", "missing", "this table, to say what to reduce to"))
    progress.reduction(make_rom(comm, job, scene, progress.say, progress.step))
    return rom_path(job)


def run_job(comm: Comm, path: str | Job) -> str:
    """Run a job; returns the result's path. A point that did not converge is in the result, and raises at the end."""
    progress = Progress(comm)
    started = time.perf_counter()
    job = on_root(comm, lambda: read_job(path))
    scene = _on_root_only(comm, lambda: build_scene(job))
    _say_notes(progress, scene)
    if rom_path(job) is not None:
        progress.reduction(make_rom(comm, job, scene, progress.say, progress.step))
    reduced = on_root(comm, lambda: reduced_scene(job, scene))
    load_path = on_root(comm, lambda: scene.load_path)
    result = job.file(job["output"]["file"])
    partial = f"{result}.partial"
    options = on_root(comm, lambda: solver_options(job))
    margin = on_root(comm, lambda: friction_margin(reduced))
    if (wedges := warning(margin)) is not None:
        progress.say(wedges)
    outcomes: Counter[str] = Counter()
    incomplete: list[str] = []
    try:
        with Solver(comm, reduced, options) as solver:
            on_root(comm, lambda: _write_root(partial, job, scene))
            linear = _linear_responses(solver, job)
            sampler = Sampler(comm, solver, reduced, options, job["static"]["bounds"])
            examiner = Examiner(comm, solver, job)
            finder = Finder(solver, job, progress)
            search = Search(solver, job, load_path, finder, progress)
            restart = on_root(comm, lambda: _restart(job, reduced))
            on_root(comm, lambda: _write_linear(partial, linear, reduced.monitor_names))
            solver.open_result(partial)
            progress.begin(len(reduced.mass), len(reduced.laws["tangents"]), linear)
            for point, first in _points(solver, job, load_path, progress, incomplete, search, restart):
                point = examiner.examine(point)
                solver.write_point()
                sampler.visit(point)
                progress.point(point, reduced.monitor_names[0])
                outcomes[point.outcome] += 1
                finder.visit(point)
                search.keep(point, first)
    except (InputError, NumericsError) as error:
        if progress.count == 0:
            on_root(comm, lambda: Path(partial).unlink(missing_ok=True))
        elif isinstance(error, NumericsError):
            raise NumericsError(f"{error}; the {progress.count} points solved before are in {partial}") from None
        raise
    except KeyboardInterrupt:
        progress.say(f"interrupted: the {progress.count} points solved so far are in {partial}")
        raise
    on_root(comm, lambda: _write_incomplete(partial, incomplete))
    on_root(comm, lambda: write_bounds(partial, reduced, sampler))
    on_root(comm, lambda: write_multipliers(partial, examiner))
    on_root(comm, lambda: write_margin(partial, margin))
    on_root(comm, lambda: write_bifurcations(partial, finder.found, reduced.monitor_names))
    on_root(comm, lambda: os.replace(partial, result))
    progress.end(result, time.perf_counter() - started, outcomes)
    complaints = list(incomplete)
    if outcomes["not_converged"]:
        complaints.append(
            f"{outcomes['not_converged']} point(s) did not converge; they are in the file with outcome not_converged"
        )
    if outcomes["no_period_one_orbit"]:
        complaints.append(
            f"{outcomes['no_period_one_orbit']} point(s) without an orbit of the excitation's period, by motion in time"
            " too (it walks, bounces or takes several periods); they are in the file with outcome no_period_one_orbit"
        )
    if complaints:
        raise UnsolvedError(result, "; ".join(complaints))
    return result


def solver_options(job: Job) -> Options:
    """The job's choices of the balance."""
    balance = job["balance"]
    automatic = balance["harmonics"] == "auto"
    loaded = max((load["harmonic"] for load in job["load"] if load["kind"] == "harmonic"), default=1)
    harmonics = max(FIRST_HARMONICS, loaded) if automatic else balance["harmonics"]
    samples = FIRST_SAMPLES if balance["quadrature"] == "auto" else balance["samples"]
    return Options(
        harmonics=harmonics,
        samples=max(samples, 6 * harmonics + 2) if automatic else samples,
        max_iterations=balance["max_iterations"],
        tolerance=balance["residual_tolerance"],
        reset_slider=job["static"]["slider"] == "reset",
        uncoupled=balance["approach"] == "uncoupled",
        by_events=balance["quadrature"] != "sampled",
        choose_harmonics=automatic,
        choose_samples=balance["quadrature"] == "auto",
        accepted_error=balance["tolerance"] or TOLERANCE,
        mode_error=mode_error(rom_path(job)),
    )


def _on_root_only(comm: Comm, work) -> Scene | None:
    """What stays on rank 0; its faults are raised everywhere."""
    kept: list[Scene] = []
    on_root(comm, lambda: kept.append(work()))
    return kept[0] if kept else None


def _points(
    solver: Solver,
    job: Job,
    load_path: np.ndarray,
    progress: Progress,
    incomplete: list[str],
    search: Search,
    restart: StoredPoint | None,
) -> Iterator[tuple[Point, bool]]:
    """Every point of the job, and whether it is the first of a sweep.

    For each level the static path, then the sweep, and back if the job says so; then other branches if asked for.
    """
    sweep = job["sweep"]
    listed = sweep["frequencies_hz"]
    ends = [(listed[0], listed[-1])] if listed else [(sweep["start_hz"], sweep["stop_hz"])]
    if job["continuation"]["both_directions"] and not listed:
        ends.append(ends[0][::-1])
    most = job["continuation"]["max_points"]
    branch = 0
    for level in sweep["levels"]:
        search.begin_level(level)
        for start, stop in ends:
            begin = start if restart is None else restart.frequency_hz
            means = solver.walk_static_path(load_path, job["static"]["steps"], begin)
            progress.static(means)
            if listed:
                points = solver.solve_at(listed, level, branch)
            elif restart is not None:
                if not solver.stand_at(restart, level):
                    raise NumericsError(f"the point to start at, {begin:.6g} Hz, is not solved at level {level:g}")
                points = solver.follow(start, stop, branch, most, 1 if stop > start else -1)
            else:
                points = solver.sweep(start, stop, level, branch, most)
            point = None
            for count, point in enumerate(points):
                branch = max(branch, point.branch)
                yield point, count == 0
            if point is not None and not listed and not point.reached_stop:
                incomplete.append(
                    f"the sweep of level {level:g} from {begin:g} Hz ended at {point.frequency_hz:.6g} Hz,"
                    f" before its stop at {stop:g} Hz: the branch turned back over its start, closed upon itself or was"
                    " lost, or [continuation] max_points was reached"
                )
                progress.say(incomplete[-1])
            branch += 1
        if search.searches:
            for point, first in search.branches(*sorted(ends[0]), branch):
                branch = max(branch, point.branch + 1)
                yield point, first


def _restart(job: Job, scene: ReducedScene) -> StoredPoint | None:
    """The point of an older result that the job starts at."""
    continuation = job["continuation"]
    if continuation["start"] is None:
        return None
    path = job.file(continuation["start_file"] or job["output"]["file"])
    contacts = len(scene.laws["tangents"])
    return read_point(job, "[continuation] start", continuation["start"], path, len(scene.mass), contacts)


def _linear_responses(solver: Solver, job: Job) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Frequencies, amplitudes and natural frequencies of the linear systems, stuck and frictionless."""
    sweep = job["sweep"]
    given = sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]]
    low, high = min(given), max(given)
    responses = {}
    for name, stuck in (("stuck", True), ("frictionless", False)):
        grid = np.linspace(low, high, LINEAR_POINTS) if high > low else np.array([low])
        natural = solver.linear_response(stuck, grid[:1], NATURAL_FREQUENCIES)[1]
        # Resonances are drawn by points of their own, close enough for the sharpest.
        inside = natural[(natural > low) & (natural < high)]
        near = [inside * (1.0 + sign * width) for width in np.geomspace(1e-5, 1e-2, 16) for sign in (-1, 1)]
        grid = np.unique(np.concatenate([grid, inside, *near]))
        grid = grid[(grid >= low) & (grid <= high)]
        responses[name] = (grid, solver.linear_response(stuck, grid, 0)[0], natural)
    return responses


def _write_root(path: str, job: Job, scene: Scene) -> None:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "attrito result"
        file.attrs["format_version"] = 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = (
            "Steady response of a structure with friction contacts; see docs/files.md of attrito"
        )
        file.attrs["references"] = REFERENCES
        file.attrs["job"] = json.dumps(job.tables)
        file.attrs["job_file"] = str(Path(job.path).resolve()) if Path(job.path).is_file() else ""
        file.attrs["model_file"] = _absolute(model_path(job))
        file.attrs["rom_file"] = _absolute(rom_path(job))
        file.attrs["rom_fingerprint"] = rom_fingerprint(rom_path(job))
        units = {
            "tangential_stiffness": "user force/length",
            "normal_stiffness": "user force/length",
            "gap": "user length",
            "preload": "user force",
            "area": "user area",
            "position": "user length",
        }
        for name, values in {**scene.contacts.laws, **scene.contacts.places}.items():
            kind = h5py.string_dtype() if values.dtype == object else values.dtype
            stored = file.create_dataset(f"contacts/parameters/{name}", data=values, dtype=kind)
            stored.attrs["description"] = name.replace("_", " ")
            stored.attrs["unit"] = units.get(name, "1")


def _write_incomplete(path: str, incomplete: list[str]) -> None:
    if incomplete:
        with h5py.File(path, "r+") as file:
            file["points"].attrs["incomplete"] = "; ".join(incomplete)


def _write_linear(path: str, responses: dict, monitors: list[str]) -> None:
    with h5py.File(path, "r+") as file:
        for kind, (frequency, amplitude, natural) in responses.items():
            what = "every contact stuck" if kind == "stuck" else "contacts closed, no friction"
            data = {
                "frequency_hz": (frequency, "frequency", "Hz"),
                "natural_hz": (natural, "natural frequencies", "Hz"),
            }
            data |= {
                name: (values, f"amplitude at level 1, {what}", "user length")
                for name, values in zip(monitors, amplitude, strict=True)
            }
            for name, (values, description, unit) in data.items():
                stored = file.create_dataset(f"linear/{kind}/{name}", data=values)
                stored.attrs["description"], stored.attrs["unit"] = description, unit


def _say_notes(progress: Progress, scene: Scene | None) -> None:
    for note in scene.contacts.notes if scene is not None else []:
        progress.say(note)


def _absolute(path: str | None) -> str:
    return "" if path is None else str(Path(path).resolve())
