"""`attrito mode`: a nonlinear mode followed in its amplitude, into an HDF5 file that is read as a result is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.cyclic import is_cyclic
from attrito.job.job import Job, mode_path
from attrito.job.sensitivity import refuse_for_sectors
from attrito.library.names import OUTCOMES
from attrito.library.points import LinearModes
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Options, Solver
from attrito.modes.limit_cycles import NAMES as CYCLE_NAMES
from attrito.modes.limit_cycles import LimitCycles
from attrito.modes.mode_point import ModePoint
from attrito.modes.mode_slopes import ModeDifferentiator
from attrito.modes.quasi_static import QuasiStaticTracker
from attrito.modes.scene_at_rest import Prepared, prepare, solver_at_rest
from attrito.modes.tracker import ModeTracker
from attrito.peaks.fixed_series import fixed_series
from attrito.results.journal import Record, find_earlier, read_journal, remove_journals
from attrito.results.result import MODE, Result
from attrito.results.result_file import fill_result
from attrito.runs.followed import follow_job
from attrito.runs.header import first_record
from attrito.runs.position import RunPosition
from attrito.runs.progress import Progress
from attrito.runs.recorder import Recorder
from attrito.runs.tangent_modes import equal_modes, said_of_equal, tangent_modes
from attrito.scene.scene import Scene
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import InputError
from attrito.support.parallel import on_root, on_root_only

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

REFERENCES = (
    "Krack 2015, doi:10.1016/j.compstruc.2015.02.037; Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032; "
    "Craig & Bampton 1968, doi:10.2514/3.4741"
)
# What finds points, by the method
Tracker = ModeTracker | QuasiStaticTracker
# Of a point at an amplitude that was asked for
NO_CYCLE = CYCLE_NAMES[0]
# Of modes that are looked through for the one meant
LISTED = 40
# Of a file of a mode, beside the series of a result
SERIES = {
    "amplitude": ("amplitude Q: zero to peak of phi^T M q_1, phi the tangent mode", "user length (user mass)^0.5"),
    "damping_ratio": ("of the contacts: their work a period / (2 pi omega^2 sum h^2 q_h^H M q_h)", "1"),
    "damping_ratio_structure": ("of the structure's own damping, likewise", "1"),
    "dissipated_energy": ("work of all contacts a period", "user energy"),
    # What keeps the motion up, by the method
    "excitation": ("negative damping that keeps the motion up, a part of the mass", "rad/s"),
    "drift": ("by how much a period moves a slider, the most: no motion repeats where they drift", "user length"),
    "load": ("amplitude A of the load A M phi", "user length (user mass)^0.5 / (user time)^2"),
    "masing_hz": ("by Masing's rule from the first loading: its secant's frequency", "Hz"),
    "masing_damping_ratio": ("by Masing's rule from the first loading: of the contacts", "1"),
    "loop_area": ("area of the loop of load and Q, by trapezoids: what the contacts' work adds up to", "user energy"),
}

# What the estimate is of, by the method; NaN: not estimated
ERRORS = {
    "epmc": "relative error of frequency, negative damping or monitors by the series, the largest; NaN: not estimated",
    "quasi_static": "relative error of the contacts' work; NaN: not estimated",
}


def mode_job(comm: Comm, path: str | Job, picture: str | None = None, resume: bool = False) -> str:
    """Follow the mode that a job asks for: file, table on standard output, picture. Returns the file's path.

    What was found of a mode that is lost is written and shown before `UnsolvedError` is raised.

    Parameters
    ----------
    path : the job file, or the job
    picture : the file to draw it in; None: that of the mode, ending .png
    resume : go on after the last point that an earlier run of the same job left; where there is none, begin
    """

    def follow(job: Job, scene: Scene | None, file: str, picture: str, progress: Progress) -> str:
        return _follow_and_show(comm, job, scene, file, picture, resume, progress)

    return follow_job(comm, path, check_mode, mode_path, picture, follow, excited=False)


def _follow_and_show(
    comm: Comm, job: Job, scene: Scene | None, file: str, picture: str, resume: bool, progress: Progress
) -> str:
    """Follow the mode, write and show what was found; what is missing, in words."""
    prepared = prepare(comm, job, scene, progress)
    prepared = replace(prepared, options=series_of_mode(prepared.options))
    first = on_root_only(comm, lambda: _first_record(comm, job, scene, prepared))
    journal = f"{file}.partial"
    with solver_at_rest(comm, job, prepared, progress) as solver:
        number, modes = chosen_mode(comm, job, solver)
        progress.say(f"tangent mode {number}: {modes.natural_hz[number - 1]:.6g} Hz")
        alike = "" if job["mode"]["method"] != "epmc" else said_of_equal(equal_modes(modes.natural_hz, number))
        progress.warn([alike] if alike else [])
        differentiator = ModeDifferentiator(comm, solver, job, scene, prepared.reduced, number - 1)
        tracker = new_tracker(job, solver, prepared.reduced, modes, number - 1)
        cycles = LimitCycles()
        recorder = Recorder(comm, solver, journal, (tracker, cycles))
        try:
            place = _begin(comm, job, recorder, tracker, cycles, journal, first, resume, progress)
            missed = _follow(comm, job, solver, tracker, differentiator, recorder, cycles, place, progress)
            missed += f": {alike}" if missed and alike else ""
        finally:
            recorder.close()

    def show() -> str:
        from attrito.plots.modes import mode_curve
        from attrito.plots.style import save

        with whole_hdf5(file) as whole:
            fill_result(whole, journal)
            whole.attrs["warnings"] = "\n".join(progress.warnings)
            whole.attrs["mode"], whole.attrs["method"] = number, job["mode"]["method"]
            whole.attrs["tangent_hz"] = modes.natural_hz[number - 1]
            whole.attrs["tangent_damping_ratio"] = modes.damping_ratio[number - 1]
        remove_journals(journal, MODE)
        with Result(file) as result:
            save(mode_curve(result), picture)
        return picture

    progress.say(f"Result: {file}; picture: {on_root(comm, show)}. Table: attrito table {file}")
    return missed


def _begin(
    comm: Comm,
    job: Job,
    recorder: Recorder,
    tracker: Tracker,
    cycles: LimitCycles,
    journal: str,
    first: Record | None,
    resume: bool,
    progress: Progress,
) -> RunPosition:
    """Begin the journal, or go on after its last point. Collective."""
    there = on_root(comm, lambda: find_earlier(journal, MODE, resume))
    if there and resume:
        # Of a journal without a point only the beginning is gone on from.
        if on_root(comm, lambda: sum(1 for _ in read_journal(journal)) > 1):
            tracker.prepare()
        place = recorder.resume(job.path, first)
        tracker.known = comm.bcast(tracker.known)
        cycles.load_state(comm.bcast(cycles.save_state()))
        progress.say(f"going on after {place.points} points of {journal}")
        return place
    if resume:
        progress.say(f"nothing to go on from ({journal} is absent): beginning")
    recorder.begin(first)
    return RunPosition()


def series_of_mode(options: Options) -> Options:
    """One series for the whole mode: where the job leaves it open the second, which other errors are seldom above."""
    series = fixed_series(options)
    return series[min(1, len(series) - 1)]


def chosen_mode(comm: Comm, job: Job, solver: Solver) -> tuple[int, LinearModes]:
    """The number, from 1, of the tangent mode that a job means, and the tangent modes. Collective.

    Of a sector they are those of the nodal diameter of its engine order.
    """
    keys, number = job["mode"], job["mode"]["number"] or 0
    modes = tangent_modes(job, solver, max(LISTED, number))
    count = len(modes.natural_hz)

    def choose() -> int:
        if keys["near_hz"] is not None:
            elastic = modes.natural_hz[modes.rigid :]
            return int(modes.rigid + np.argmin(abs(elastic - keys["near_hz"]))) + 1
        number: int = keys["number"] or modes.rigid + 1
        if not modes.rigid < number <= count:
            expected = f"the number of an elastic mode, {modes.rigid + 1} to {count}"
            raise InputError(job.fault("[mode] number", number, expected))
        return number

    return on_root(comm, choose), modes


def amplitudes(job: Job) -> np.ndarray:
    """The amplitudes at which the mode is located, equal in ratio."""
    keys = job["mode"]
    values = np.geomspace(keys["start"], keys["stop"], keys["points"])
    values[0], values[-1] = keys["start"], keys["stop"]
    return values


def _follow(
    comm: Comm,
    job: Job,
    solver: Solver,
    tracker: Tracker,
    differentiator: ModeDifferentiator,
    recorder: Recorder,
    cycles: LimitCycles,
    place: RunPosition,
    progress: Progress,
) -> str:
    """Point after point into the journal, those of `place` being there; what is missing, in words."""
    values = amplitudes(job)

    def write(one: ModePoint, kind: str) -> None:
        recorder.hear()
        ratio = _record(comm, recorder, one, kind)
        if corner := differentiator.visit(one, recorder):
            progress.say(f"Q {one.amplitude:.6g}: {corner}")
        if kind == NO_CYCLE:
            cycles.pass_by(one.amplitude, ratio + one.structural_ratio)
        place.add(one.point)
        recorder.write(one.point, place)
        progress.say(
            f"Q {one.amplitude:10.4e}  {one.point.frequency_hz:11.6g} Hz  damping ratio {ratio:10.4e} +"
            f" {one.structural_ratio:.4e}  stuck {sum(one.point.states[:2]):3d} slipping {one.point.states[2]:3d}"
            f" open {one.point.states[3]:3d}  {one.iterations:3d} iterations  {one.point.outcome}"
            + ("" if kind == NO_CYCLE else f"  limit cycle that {kind}")
        )
        if one.folded and one.converged:
            progress.warn([f"the mode's curve folds in its amplitude before {one.amplitude:.6g}: it goes on elsewhere"])

    while (done := place.points - cycles.found) < len(values) and "not_converged" not in place.outcomes:
        one = tracker.at(float(values[done]))
        if one.converged and cycles.lie_before(damping_of_both(comm, solver, one)):
            found, kind = _limit_cycle(comm, solver, tracker, cycles, one)
            if found is not None:
                write(found, kind)
            else:
                progress.warn([f"the limit cycle before Q = {one.amplitude:.6g} was not found: no solution near it"])
            continue
        write(one, NO_CYCLE)
    if "not_converged" not in place.outcomes:
        return ""
    lost = values[place.points - cycles.found - 1]
    return f"the mode was lost at amplitude {lost:.6g}, before [mode] stop = {job['mode']['stop']:g}"


def _limit_cycle(
    comm: Comm, solver: Solver, tracker: Tracker, cycles: LimitCycles, after: ModePoint
) -> tuple[ModePoint | None, str]:
    """The limit cycle before a point, whose damping has the other sign, and its kind. Collective.

    The solver stands there afterwards.
    """
    iterations = 0

    def at(amplitude: float) -> float:
        nonlocal iterations
        one = tracker.at(amplitude)
        iterations += one.iterations
        return damping_of_both(comm, solver, one) if one.converged else np.nan

    amplitude, kind = cycles.search(after.amplitude, damping_of_both(comm, solver, after), at)
    if np.isnan(amplitude):
        return None, kind
    one = tracker.at(amplitude)
    return replace(one, iterations=iterations + one.iterations) if one.converged else None, kind


def new_tracker(job: Job, solver: Solver, scene: ReducedScene, modes: LinearModes, index: int) -> Tracker:
    """By the job's method, of the tangent mode of an index; the solver solves the scene."""
    shape, frequency_hz = modes.shapes[index], modes.natural_hz[index]
    equal = equal_modes(modes.natural_hz, index + 1)
    if job["mode"]["method"] == "epmc":
        return ModeTracker(solver, scene, modes.shapes[[number - 1 for number in equal]], frequency_hz)
    return QuasiStaticTracker(solver, len(scene.laws["tangents"]), shape, frequency_hz, job["mode"]["steps"])


def contact_work(comm: Comm, solver: Solver, one: ModePoint) -> float:
    """Of all contacts a period at the last point, user energy; zero but at the root. Collective."""
    heard: dict[str, np.ndarray] = {}
    solver.report_point((lambda path, _, values: heard.update({path: values})) if comm.rank == 0 else None)
    work = heard.get("/contacts/dissipated_energy", 0.0) if one.contact_work is None else one.contact_work
    return float(np.nansum(work))


def damping_of_both(comm: Comm, solver: Solver, one: ModePoint) -> float:
    """Damping ratio of contacts and structure together at the last point. Collective."""
    work = comm.bcast(contact_work(comm, solver, one))
    return one.damping_ratio(work) + one.structural_ratio


def _record(comm: Comm, recorder: Recorder, one: ModePoint, kind: str) -> float:
    """Note what is known of a mode's point beside a result's series; the contacts' damping ratio. Collective."""

    def note() -> float:
        if one.contact_work is not None and one.converged:
            friction = Series("real64", "work done against friction per period", "user energy")
            recorder.add("/contacts/dissipated_energy", friction, one.contact_work)
        # The estimate is of the mode: its frequency and damping, or the work of all contacts.
        recorder.leave_out("/contacts/dissipated_energy_error")
        work = float(np.nansum(recorder.heard("/contacts/dissipated_energy")))
        values = {
            "damping_ratio": one.damping_ratio(work) if one.converged else np.nan,
            "damping_ratio_structure": one.structural_ratio,
            "dissipated_energy": work,
        } | one.drive
        values = {name: value if one.converged else np.nan for name, value in values.items()}
        for name, value in ({"amplitude": one.amplitude} | values).items():
            description, unit = SERIES[name]
            recorder.add(f"/points/{name}", Series("real64", description, unit), np.array(value))
        iterations = Series("int32", "iterations of Newton's method, all tries together", "1")
        recorder.add("/points/iterations", iterations, np.array(one.iterations))
        ended = Series("int32", "how the point ended: index into the attribute names", "1", tuple(OUTCOMES))
        recorder.add("/points/outcome", ended, np.array(OUTCOMES.index(one.point.outcome)))
        cycle = Series("int32", "limit cycle of a mode that is fed: index into the attribute names", "1", CYCLE_NAMES)
        recorder.add("/points/limit_cycle", cycle, np.array(CYCLE_NAMES.index(kind)))
        for name in ("estimate", "error_harmonics", "error_samples", "error_modes"):
            known = getattr(one, name, np.nan) if one.converged else np.nan
            error = Series("real64", ERRORS["quasi_static" if one.contact_work is not None else "epmc"], "1")
            recorder.add(f"/points/{name}", error, np.array(known))
        return values["damping_ratio"]

    return on_root(comm, note)


def _first_record(comm: Comm, job: Job, scene: Scene, prepared: Prepared) -> Record:
    record = first_record(job, scene, prepared.rom, prepared.reduced, comm.size, {}, None)
    record.note["attributes"] |= {
        "format": MODE,
        "description": "A nonlinear mode followed in its amplitude; see docs/how-to/nonlinear-modes.md of attrito",
        "references": REFERENCES,
    }
    return record


def check_mode(job: Job) -> None:
    """Faults between the keys of `[mode]` and the rest of the job."""
    refuse_for_sectors(job, "modes")
    keys = job["mode"]
    if "mode" not in job.given:
        raise InputError(job.fault("[mode]", "missing", "this table, with start and stop"))
    faults = []
    if keys["number"] is not None and keys["near_hz"] is not None:
        faults.append(job.fault("[mode] near_hz", keys["near_hz"], "no such key beside number"))
    if is_cyclic(job) and keys["method"] == "quasi_static":
        expected = '"epmc" with [cyclic]: loading in cycles is no travelling wave'
        faults.append(job.fault("[mode] method", keys["method"], expected))
    if job["sensitivity"]["to"] and keys["method"] == "quasi_static":
        faults.append(job.fault("[mode] method", keys["method"], '"epmc" with [sensitivity]: derivatives are of that'))
    if keys["start"] == keys["stop"]:
        faults.append(job.fault("[mode] stop", keys["stop"], "an amplitude other than start"))
    if keys["steps"] % 8:
        faults.append(job.fault("[mode] steps", keys["steps"], "a multiple of 8"))
    if job["balance"]["approach"] == "uncoupled":
        faults.append(job.fault("[balance] approach", "uncoupled", '"coupled": a frozen mean is no motion of a mode'))
    if faults:
        raise InputError(*faults)
