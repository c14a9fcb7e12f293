"""`attrito run`: a job from its file to result.h5."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito import cautions
from attrito.bifurcations import Finder, write_bifurcations
from attrito.course import Course
from attrito.faults import InputError, NumericsError, UnsolvedError
from attrito.job import SAMPLES, Job, read_job, rom_path
from attrito.journal import Record, remove_journal, set_aside
from attrito.locks import writing_alone
from attrito.longer_periods import LongerPeriods, write_periods
from attrito.parallel import on_root, on_root_only
from attrito.progress import Progress
from attrito.recorder import Place, Recorder
from attrito.restart import StoredPoint, read_point
from attrito.result_file import fill_result
from attrito.rom import Rom, make_rom, reduced_scene
from attrito.run_header import first_record, linear_responses
from attrito.scene import Scene, build_scene
from attrito.search import Search
from attrito.solver import Options, ReducedScene, Solver
from attrito.stability import Examiner, write_multipliers
from attrito.stages import Stages
from attrito.statics import Margin, friction_margin, warning, write_margin
from attrito.stop import Stop
from attrito.uniqueness import Sampler, write_bounds
from attrito.whole_file import whole_hdf5

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Where they are chosen point by point, to begin with
FIRST_HARMONICS, FIRST_SAMPLES = 3, 64
# No fewer are chosen
FEWEST_SAMPLES = 32


def reduce_job(comm: Comm, path: str | Job) -> str:
    """`attrito reduce`: make the job's rom.h5; returns its path."""
    progress = Progress(comm)
    job = on_root(comm, lambda: read_job(path))
    scene = on_root_only(comm, lambda: build_scene(job))
    _say_notes(progress, scene)
    if rom_path(job) is None:
        raise InputError(job.fault("[reduction]", "missing", "this table, to say what to reduce to"))
    progress.warn(on_root(comm, lambda: cautions.of_scene(job, scene)))
    rom, report = make_rom(comm, job, scene, progress.say, progress.step)
    progress.reduction(report)
    progress.warn(on_root(comm, lambda: cautions.of_damping(reduced_scene(job, scene, rom))))
    return comm.bcast(None if rom is None else rom.path)


def run_job(comm: Comm, path: str | Job, resume: bool = False, max_seconds: float | None = None) -> str:
    """Run a job; returns the result's path.

    Parameters
    ----------
    path : the job file, or the job
    resume : go on after the last point that an earlier run of the same job left; where there is none, begin
    max_seconds : wall time to keep within: the run ends in good order before it

    Raises
    ------
    InputError : the input is at fault
    UnsolvedError : points are without a solution; they are in the result
    NumericsError : the solver gave up, or the run was stopped; what was solved is kept
    """
    progress, stages = Progress(comm), Stages(comm)
    job = on_root(comm, lambda: read_job(path))
    result = job.file(job["output"]["file"])
    with Stop(comm, max_seconds) as stop:
        scene = on_root_only(comm, lambda: build_scene(job))
        _say_notes(progress, scene)
        warnings = on_root(comm, lambda: cautions.of_scene(job, scene))
        stages.end("input")
        with writing_alone(comm, result):
            run = _solve(comm, job, scene, warnings, progress, stages, stop, resume)
    progress.end(result, stages, run.place)
    complaints = run.complaints()
    if complaints:
        raise UnsolvedError(result, "; ".join(complaints))
    return result


def _solve(
    comm: Comm,
    job: Job,
    scene: Scene | None,
    warnings: list[str],
    progress: Progress,
    stages: Stages,
    stop: Stop,
    resume: bool,
) -> _Run:
    """Reduce, solve, write the result with `warnings` and those found here; nobody else writes it meanwhile."""
    rom, report = make_rom(comm, job, scene, progress.say, progress.step)
    progress.reduction(report)
    if rom_path(job) is not None:
        stages.end("reduction")
    reduced = on_root(comm, lambda: reduced_scene(job, scene, rom))
    load_path = on_root(comm, lambda: scene.load_path)
    options = on_root(comm, lambda: solver_options(job, rom))
    with Solver(comm, reduced, options) as solver:
        # Of a structure that is held, as the solver has found by now.
        margin = on_root(comm, lambda: friction_margin(reduced))
        warnings += on_root(comm, lambda: cautions.of_damping(reduced))
        if (wedges := warning(margin)) is not None:
            warnings.append(wedges)
        progress.warn(warnings)
        linear = linear_responses(solver, job)
        progress.begin(len(reduced.mass), len(reduced.laws["tangents"]), linear)
        first = on_root_only(comm, lambda: first_record(job, scene, rom, reduced, comm.size, linear))
        stages.end("linear responses")
        run = _Run(comm, job, solver, reduced, options, progress, stages, load_path, stop)
        try:
            with stop.solving():
                run.solve(first, load_path, resume, stop)
        finally:
            run.recorder.close()
    run.finish(margin, warnings)
    return run


class _Run:
    """The solving part of a run, from its first point to the result file."""

    def __init__(
        self,
        comm: Comm,
        job: Job,
        solver: Solver,
        reduced: ReducedScene,
        options: Options,
        progress: Progress,
        stages: Stages,
        load_path: np.ndarray,
        stop: Stop,
    ):
        self._comm, self._job, self._solver, self._reduced = comm, job, solver, reduced
        self._progress, self._stages = progress, stages
        self._sampler = Sampler(comm, solver, reduced, options, job["static"]["bounds"], stop.interrupted)
        self._examiner = Examiner(comm, solver, job)
        self._longer = LongerPeriods(comm, job, reduced, load_path)
        self._finder = Finder(solver, job, progress)
        self.result = job.file(job["output"]["file"])
        self.journal = f"{self.result}.partial"
        self.recorder = Recorder(
            comm, solver, self.journal, (self._examiner, self._longer, self._sampler, self._finder)
        )
        self.place = Place()

    def solve(self, first: Record | None, load_path: np.ndarray, resume: bool, stop: Stop) -> None:
        """Solve all points, each on disk before the next begins."""
        progress, stages = self._progress, self._stages
        search = Search(self._solver, self._job, load_path, self._finder, progress)
        start = on_root(self._comm, lambda: _start(self._job, self._reduced))
        self._begin(first, resume, search)
        try:
            course = Course(self._solver, self._job, load_path, search, start, progress)
            for point in course.points(self.place):
                stages.end("points")
                point = self._longer.visit(self._examiner.examine(point))
                stages.end("stability")
                self.recorder.hear()
                self._sampler.visit(point)
                stages.end("bounds")
                self._finder.visit(point)
                stages.end("bifurcations")
                search.keep(point, self.place.taken == 1)
                self.place.add(point)
                self.recorder.write(point, self.place)
                stages.end("writing")
                progress.point(point, self._reduced.monitor_names[0], self.place.points)
                reason = stop.asked()
                if reason and not course.is_done(self.place):
                    raise NumericsError(f"stopped by {reason}")
        except NumericsError as error:
            if self.recorder.written:
                raise NumericsError(f"{error}; {self._left()}") from None
            on_root(self._comm, lambda: Path(self.journal).unlink(missing_ok=True))
            raise
        except (InputError, KeyboardInterrupt):
            progress.say(self._left())
            raise

    def _begin(self, first: Record | None, resume: bool, search: Search) -> None:
        there = on_root(self._comm, lambda: _journal_before(self.journal, resume))
        if there and resume:
            self.place = self.recorder.resume(self._job.path, first, search)
            self._progress.say(f"going on after {self.place.points} points of {self.journal}")
            self._progress.count = self.place.points
            return
        if resume:
            self._progress.say(f"nothing to go on from ({self.journal} is absent): beginning")
        self.recorder.begin(first)

    def _left(self) -> str:
        return (
            f"the {self.recorder.written} points solved so far are in {self.journal} (attrito table reads it);"
            f" go on with attrito run --resume {self._job.path}"
        )

    def finish(self, margin: Margin | None, warnings: list[str]) -> None:
        """Make the result file; an older one stays until it is complete."""
        on_root(self._comm, lambda: self._make_result(margin, [*warnings, *self.place.warnings]))
        self._stages.end("writing")

    def _make_result(self, margin: Margin | None, warnings: list[str]) -> None:
        with whole_hdf5(self.result) as file:
            fill_result(file, self.journal)
            file.attrs["warnings"] = "\n".join(warnings)
            if self.place.incomplete:
                file["points"].attrs["incomplete"] = "; ".join(self.place.incomplete)
            write_bounds(file, self._reduced, self._sampler)
            write_multipliers(file, self._examiner)
            write_periods(file, self._longer)
            write_margin(file, margin)
            write_bifurcations(file, self._finder.found, self._reduced.monitor_names)
        Path(self.journal).unlink()
        remove_journal(f"{self.journal}.old")

    def complaints(self) -> list[str]:
        """What the numerics did not deliver."""
        found = list(self.place.incomplete)
        if failed := self.place.outcomes.get("not_converged", 0):
            found.append(f"{failed} point(s) did not converge; they are in the file with outcome not_converged")
        if missing := self.place.outcomes.get("no_period_one_orbit", 0):
            found.append(
                f"{missing} point(s) without an orbit of the excitation's period: friction alone does not hold the body"
                " there, or motion in time walks, bounces or takes several periods; they are in the file with outcome"
                " no_period_one_orbit"
            )
        if above := self.place.outcomes.get("above_tolerance", 0):
            found.append(
                f"the estimated error of {above} point(s) is above [balance] tolerance ="
                f" {self._job['balance']['tolerance']:g}; they are in the file with outcome above_tolerance, and"
                f" /points/error_harmonics, error_samples and error_modes say what causes it"
            )
        return found


def _start(job: Job, scene: ReducedScene) -> StoredPoint | None:
    """The point of an older result that the job starts at."""
    continuation = job["continuation"]
    if continuation["start"] is None:
        return None
    path = job.file(continuation["start_file"] or job["output"]["file"])
    return read_point(job, "[continuation] start", continuation["start"], path, scene)


def _journal_before(path: str, resume: bool) -> bool:
    """Whether an earlier run left a journal; one that is not gone on from is kept once, under another name."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    if not Path(path).is_file():
        return False
    if not resume:
        set_aside(path, f"{path}.old")
    return True


def solver_options(job: Job, rom: Rom | None = None) -> Options:
    """The job's choices of the balance, and what its reduced model, if there is one, leaves out."""
    balance = job["balance"]
    automatic = balance["harmonics"] == "auto"
    loaded = max((load["harmonic"] for load in job["load"] if load["kind"] == "harmonic"), default=1)
    harmonics = max(FIRST_HARMONICS, loaded) if automatic else balance["harmonics"]
    chosen = balance["quadrature"] == "auto"
    samples = balance["samples"] or max(FIRST_SAMPLES if chosen else SAMPLES, 6 * harmonics + 2)
    return Options(
        harmonics=harmonics,
        samples=max(samples, (6 if automatic else 4) * harmonics + 2),
        max_iterations=balance["max_iterations"],
        tolerance=balance["residual_tolerance"],
        reset_slider=job["static"]["slider"] == "reset",
        uncoupled=balance["approach"] == "uncoupled",
        by_events=balance["quadrature"] != "sampled",
        choose_harmonics=automatic,
        choose_samples=chosen,
        fewest_samples=(balance["samples"] if chosen and balance["samples"] else FEWEST_SAMPLES),
        accepted_error=balance["tolerance"] or 0.0,
        mode_error=0.0 if rom is None else rom.mode_error,
    )


def _say_notes(progress: Progress, scene: Scene | None) -> None:
    for note in scene.contacts.notes if scene is not None else []:
        progress.say(note)
