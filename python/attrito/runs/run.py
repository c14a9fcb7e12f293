"""`attrito run`: a job from its file to result.h5."""

from __future__ import annotations

import contextlib
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job, rom_path
from attrito.job.reading import read_job
from attrito.library.points import Point, StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.results.journal import Record, find_earlier, remove_journals
from attrito.results.result import RESULT, Result
from attrito.results.result_file import fill_result
from attrito.results.stored_point import read_point
from attrito.runs.answer import answer
from attrito.runs.bifurcations import Finder
from attrito.runs.bounds import write_bounds
from attrito.runs.bounds_of_levels import Sampler
from attrito.runs.branch_ends import BranchEnds
from attrito.runs.branch_search import Search
from attrito.runs.header import first_record
from attrito.runs.linear_references import band_without_mode, linear_references
from attrito.runs.longer_periods import LongerPeriods
from attrito.runs.position import RunPosition
from attrito.runs.progress import Progress
from attrito.runs.recorder import Recorder
from attrito.runs.sensitivity import Differentiator
from attrito.runs.slider_rates import LoadPath
from attrito.runs.stability import Examiner
from attrito.runs.sweeps import Course, beginning
from attrito.scene import cautions
from attrito.scene.build import build_scene
from attrito.scene.friction_margin import friction_margin, warning
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options
from attrito.scene.stiff_contacts import highest_hz, of_hidden_inertia, of_stiff_contacts
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import InputError, NumericsError, UnsolvedError
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root, on_root_only
from attrito.support.stop_signals import Stop
from attrito.support.timing import Stages
from attrito.support.verbosity import is_quiet

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


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
    progress.end(result, stages, run.place, run.words_on_bounds(), on_root_only(comm, lambda: _answer(result)) or [])
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
        warnings += on_root(comm, lambda: cautions.of_damping(reduced) + of_hidden_inertia(reduced, highest_hz(job)))
        if (wedges := warning(margin)) is not None:
            warnings.append(wedges)
        progress.warn(warnings)
        start = on_root(comm, lambda: _start(job, reduced))
        with stop.solving():
            means = solver.follow_static_path(load_path, job["static"]["steps"], beginning(job, start))
        stages.end("static solution")
        linear = linear_references(solver, job)
        progress.begin(len(reduced.mass), len(reduced.laws["tangents"]), linear)
        unswept = on_root(comm, lambda: band_without_mode(job, linear))
        progress.warn(unswept)
        warnings += unswept
        progress.expect(job["sweep"], job["continuation"]["branches"])
        first = on_root_only(comm, lambda: first_record(job, scene, rom, reduced, comm.size, linear, margin))
        stages.end("linear responses")
        path = LoadPath(options, load_path, beginning(job, start)) if job["static"]["slider"] == "reset" else None
        differentiator = Differentiator(comm, solver, job, scene, reduced, path)
        run = _Run(comm, job, solver, scene, reduced, options, progress, stages, load_path, stop, differentiator)
        run.start, run.static_means = start, means
        try:
            with stop.solving():
                run.solve(first, load_path, resume, stop)
        finally:
            run.recorder.close()
    run.finish(warnings)
    return run


class _Run:
    """The solving part of a run, from its first point to the result file."""

    def __init__(
        self,
        comm: Comm,
        job: Job,
        solver: Solver,
        scene: Scene | None,
        reduced: ReducedScene,
        options: Options,
        progress: Progress,
        stages: Stages,
        load_path: np.ndarray,
        stop: Stop,
        differentiator: Differentiator,
    ):
        self._comm, self._job, self._solver, self._reduced = comm, job, solver, reduced
        self._progress, self._stages = progress, stages
        self._sampler = Sampler(comm, solver, reduced, options, job["static"]["bounds"], stop.interrupted)
        self._examiner = Examiner(comm, solver, job)
        self._longer = LongerPeriods(comm, solver, job, reduced, load_path)
        self._differentiator = differentiator
        self._finder = Finder(solver, job, progress)
        self.result = job.file(job["output"]["file"])
        self.journal = f"{self.result}.partial"
        self._ends = BranchEnds(comm, scene, solver, reduced)
        followers = (self._examiner, self._sampler, self._finder, self._ends)
        self.recorder = Recorder(comm, solver, self.journal, followers)
        self.place = RunPosition()
        # The point of an older result that sweeps begin at, if any; monitors' means at the static solution
        self.start: StoredPoint | None = None
        self.static_means: np.ndarray | None = None

    def solve(self, first: Record | None, load_path: np.ndarray, resume: bool, stop: Stop) -> None:
        """Solve all points, each on disk before the next begins."""
        progress, stages = self._progress, self._stages
        search = Search(self._solver, self._job, load_path, self._finder, progress)
        self._begin(first, resume, search)
        try:
            course = Course(self._solver, self._job, load_path, search, self.start, self.static_means, progress)
            for level in course.levels(self.place):
                for point in level:
                    self._take(point, search)
                    reason = stop.asked()
                    if reason and not course.is_done(self.place):
                        raise NumericsError(f"stopped by {reason}")
                stages.end("points")
                self._sampler.end_level(self.recorder, stop.asked)
                stages.end("bounds")
        except NumericsError as error:
            if self.recorder.written:
                raise NumericsError(f"{error}; {self._left()}") from None
            on_root(self._comm, lambda: Path(self.journal).unlink(missing_ok=True))
            raise
        except (InputError, KeyboardInterrupt):
            progress.say(self._left())
            raise

    def _note_end(self, point: Point) -> None:
        """Say where the branch of the point before ended, if this one is on another of the same sweep."""
        before = self.place.before if self.place.taken > 1 and not self.place.searching else None
        sentence = self._ends.visit(point, self.recorder, before, self._finder.found)
        if sentence is not None:
            self.place.incomplete.append(sentence)
            self._progress.say(sentence)

    def _take(self, point: Point, search: Search) -> None:
        """Examine a point, and put it on disk."""
        progress, stages = self._progress, self._stages
        stages.end("points")
        point = self._longer.visit(self._examiner.examine(point))
        stages.end("stability")
        self.recorder.hear()
        self._note_end(point)
        self._sampler.visit(point, self.place.level)
        if corner := self._differentiator.visit(point, self.recorder):
            progress.say(f"{point.frequency_hz:.6g} Hz: {corner}")
        stages.end("derivatives")
        self._finder.visit(point)
        stages.end("bifurcations")
        search.keep(point, self.place.taken == 1)
        self.place.add(point)
        self.recorder.write(point, self.place)
        stages.end("writing")
        progress.point(point, self._reduced.monitor_names[0], self.place.points)

    def _begin(self, first: Record | None, resume: bool, search: Search) -> None:
        there = on_root(self._comm, lambda: find_earlier(self.journal, RESULT, resume))
        if there and resume:
            self.place = self.recorder.resume(self._job.path, first, search)
            self._progress.say(f"going on after {self.place.points} points of {self.journal}")
            self._progress.count = self.place.points
            return
        if resume:
            self._progress.say(f"nothing to go on from ({self.journal} is absent): beginning")
        self.recorder.begin(first)

    def _left(self) -> str:
        settings = "".join(f" --set {shlex.quote(setting)}" for setting in self._job.settings)
        return (
            f"the {self.recorder.written} points solved so far are in {self.journal} (attrito table reads it);"
            f" go on with attrito run --resume {self._job.path}{settings}"
        )

    def finish(self, warnings: list[str]) -> None:
        """Make the result file; an older one stays until it is complete."""
        on_root(self._comm, lambda: self._make_result([*warnings, *self.place.warnings]))
        self._stages.end("writing")

    def _make_result(self, warnings: list[str]) -> None:
        with whole_hdf5(self.result) as file:
            fill_result(file, self.journal)
            file.attrs["warnings"] = "\n".join(warnings)
            if self.place.incomplete:
                file["points"].attrs["incomplete"] = "; ".join(self.place.incomplete)
            write_bounds(file, self._reduced, self._sampler)
        remove_journals(self.journal, RESULT)

    def words_on_bounds(self) -> str:
        """What bounds were found for, at the root."""
        return self._sampler.in_words(self._stages.seconds.get("bounds", 0.0))

    def complaints(self) -> list[str]:
        """What the numerics did not deliver."""
        found = list(self.place.incomplete)
        failed, missing = (self.place.outcomes.get(name, 0) for name in ("not_converged", "no_period_one_orbit"))
        stiff, tolerance = "", self._job["balance"]["residual_tolerance"]
        if failed or missing:
            stiff = of_stiff_contacts(self._reduced, highest_hz(self._job), tolerance)
        if failed:
            found.append(f"{failed} point(s) did not converge{stiff}; they are in the file with outcome not_converged")
        if missing:
            found.append(
                f"{missing} point(s) without an orbit of the excitation's period: friction alone does not hold the body"
                f" there, or motion in time drifts, bounces or takes several periods{stiff}; they are in the file with"
                " outcome no_period_one_orbit"
            )
        if above := self.place.outcomes.get("above_tolerance", 0):
            found.append(
                f"the estimated error of {above} point(s) is above [balance] tolerance ="
                f" {self._job['balance']['tolerance']:g}; they are in the file with outcome above_tolerance, and"
                " /points/error_harmonics, error_samples and error_modes say what causes it"
            )
        return found


def _answer(result: str) -> list[str]:
    """The peaks of a result, in lines; none if nobody reads them, or if the file that is complete cannot be read."""
    if is_quiet():
        return []
    with contextlib.suppress(InputError, OSError), Result(result) as file:
        return answer(file)
    return []


def _start(job: Job, scene: ReducedScene) -> StoredPoint | None:
    """The point of an older result that the job starts at."""
    continuation = job["continuation"]
    if continuation["start"] is None:
        return None
    path = job.file(continuation["start_file"] or job["output"]["file"])
    return read_point(job, "[continuation] start", continuation["start"], path, scene)


def _say_notes(progress: Progress, scene: Scene | None) -> None:
    for note in scene.contacts.notes if scene is not None else []:
        progress.say(note)
