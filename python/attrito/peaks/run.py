"""`attrito peak`: a resonance peak followed in the level or the preload, without sweeps, into an HDF5 file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.coriolis import asking_key
from attrito.job.job import Job, peak_path
from attrito.library.peak_tracker import Peak, PeakTracker
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.peaks.curve import Ending, Found, elasticity, ending_of
from attrito.peaks.file import higher_in_words, jumps_in_words, write
from attrito.peaks.first import band_of, drifting, find, looking_for_higher, monitor_of
from attrito.peaks.fixed_series import fixed_series, is_enough
from attrito.peaks.higher import Followed, HigherPeaks
from attrito.runs.followed import follow_job
from attrito.runs.progress import Progress
from attrito.runs.sensitivity import Differentiator
from attrito.scene import cautions
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options
from attrito.support.errors import InputError, NumericsError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Of the parameter's logarithm: the peak is stationary at its optimum, so its own error is of second order.
OPTIMUM_TOLERANCE = 1e-6


def peak_job(comm: Comm, path: str | Job, picture: str | None = None) -> str:
    """Follow the peak that a job asks for: file, table on standard output, picture. Returns the file's path.

    What was found of a curve that is lost is written and shown before `UnsolvedError` is raised.
    """

    def follow(job: Job, scene: Scene | None, file: str, picture: str, progress: Progress) -> str:
        return _follow_and_show(comm, job, scene, file, picture, progress)

    return follow_job(comm, path, _check, peak_path, picture, follow)


def _follow_and_show(comm: Comm, job: Job, scene: Scene | None, file: str, picture: str, progress: Progress) -> str:
    """Follow the peak, write and show what was found; what is missing, in words."""
    progress.warn(on_root(comm, lambda: cautions.of_scene(job, scene)))
    rom, report = make_rom(comm, job, scene, progress.say, progress.step)
    progress.reduction(report)
    reduced, load_path, series = on_root(
        comm, lambda: (reduced_scene(job, scene, rom), scene.load_path, fixed_series(solver_options(job, rom)))
    )
    progress.warn(on_root(comm, lambda: cautions.of_damping(reduced)))
    found: list[Found] = []
    broken = ""
    for options in series:
        if found:
            progress.say(f"above the tolerance: again with {options.harmonics} harmonics, {options.samples} samples")
        found = []
        with (
            Solver(comm, reduced, options) as solver,
            _warning_of_statics(progress, solver),
            looking_for_higher(comm, job, options, reduced, load_path) as looking,
        ):
            differentiator = Differentiator(comm, solver, job, scene, reduced)
            try:
                for one in follow(solver, job, reduced, load_path, looking):
                    found.append(replace(one, derivatives=_derivatives(differentiator, job, reduced, one)))
                    progress.say(line(one, job["peak"]["parameter"]))
            except NumericsError as error:
                # What was found until then is written.
                if not found:
                    raise
                broken = str(error)
        if broken or is_enough(one.peak.outcome for one in found):
            break
    parameter = job["peak"]["parameter"]
    progress.warn([*jumps_in_words(found, parameter), *higher_in_words(found, parameter)])

    def show() -> str:
        from attrito.peaks.plot import peak_curve
        from attrito.plots.style import save

        write(file, job, reduced, found, progress.warnings)
        save(peak_curve(file), picture)
        return picture

    if (ending := _ending(job, found)).is_physical:
        progress.say(ending.words)
    progress.say(f"Result: {file}; picture: {on_root(comm, show)}. Table: attrito table {file}")
    return broken or _missed(job, found)


def _derivatives(differentiator: Differentiator, job: Job, scene: ReducedScene, found: Found) -> np.ndarray:
    """Of a peak's height and of its frequency, Hz, by the parameters of `[sensitivity]`, `[2, parameters]`."""
    preload = found.peak.parameter if job["peak"]["parameter"] == "preload" else 1.0
    if not len(differentiator.values):
        return np.empty((2, 0))
    return differentiator.of_peak(found.peak.point, monitor_of(job, scene), found.peak.at_corner, preload)


@contextlib.contextmanager
def _warning_of_statics(progress: Progress, solver: Solver) -> Iterator[None]:
    """Warn of the static solution that the block comes to, however it ends."""
    try:
        yield
    finally:
        progress.warn(cautions.of_static_solution(solver.static_states))


def follow(
    solver: Solver, job: Job, scene: ReducedScene, load_path: np.ndarray, looking: HigherPeaks | None = None
) -> Iterator[Found]:
    """Peaks of a job along its parameter; the last one has not converged if the curve was lost.

    `looking` finds what is higher at values asked for; a higher maximum of the same resonance is followed from there.
    """
    keys = job["peak"]
    first = find(solver, job, scene, load_path, keys["start"], looking)
    tracker, peak = first.tracker, first.peak
    if keys["parameter"] == "preload" and first.found:
        peak = tracker.follow_in("preload")
    stops = _stops(keys)
    yield Found(peak, "value", higher=first.higher, moved=first.moved)
    if peak.outcome == "not_converged":
        return
    count = 1
    for stop in stops:
        for after in tracker.follow(stop):
            before, peak = peak, after
            reached = abs(peak.parameter - stop) <= 1e-12 * stop
            converged = "not_converged" not in (before.outcome, peak.outcome)
            if converged and keys["optimum"] and _is_between(before, peak, keys["parameter"]):
                optimum = locate_optimum(tracker, before, peak)
                if optimum is not None:
                    yield Found(optimum, "optimum")
                peak = tracker.at(peak.parameter)
                if peak.outcome != "not_converged":
                    # Rounding decides the search's last values: steps farther on begin again, by no tangent of theirs.
                    tracker.follow_in(tracker.parameter)
            count += 1
            if reached and peak.outcome != "not_converged":
                value = _look_about(solver, tracker, looking, peak)
                peak = value.peak
                yield value
            else:
                yield Found(peak, "value" if reached else "step")
            if peak.outcome == "not_converged" or count >= keys["max_points"]:
                return


def _look_about(solver: Solver, tracker: PeakTracker, looking: HigherPeaks | None, peak: Peak) -> Found:
    """A value asked for: the highest maximum of the peak's resonance, where the tracker and the solver then are.

    None, an ending by drift, where the resonance is highest beside frequencies without periodic motion.
    """
    if looking is None:
        return Found(peak, "value")
    state = solver.save_state()
    preload = peak.parameter if tracker.parameter == "preload" else 1.0
    higher, better, start = looking.beside(Followed(peak, state), preload)
    if higher.drifts:
        return Found(drifting(peak), "value", higher=higher)
    if better is None or start is None:
        return Found(peak, "value", higher=higher)
    solver.load_state(better.state)
    parameter = tracker.parameter
    moved = tracker.begin_near(start, peak.level, preload)
    if moved.outcome != "not_converged" and parameter == "preload":
        moved = tracker.follow_in(parameter)
    return Found(moved, "value", higher=higher, moved=True)


def locate_optimum(tracker: PeakTracker, before: Peak, after: Peak) -> Peak | None:
    """The extremum of the peak over the parameter between two peaks; None where it jumps or is lost on the way."""
    from scipy.optimize import brentq

    slopes: dict[float, float] = {}

    def slope(logarithm: float) -> float:
        # Once for each value: another way there may lead to another peak.
        if logarithm not in slopes:
            peak = tracker.at(float(np.exp(logarithm)))
            if peak.outcome == "not_converged" or peak.at_corner:
                raise _LostError
            slopes[logarithm] = elasticity(peak, tracker.parameter)
        return slopes[logarithm]

    ends = np.log([before.parameter, after.parameter]).tolist()
    try:
        # On the way back from the second the peak may stay on a curve that the first is not on.
        if slope(ends[1]) * slope(ends[0]) > 0.0:
            return None
        best = brentq(slope, *ends, xtol=OPTIMUM_TOLERANCE, rtol=1e-12)
    except _LostError:
        return None
    optimum = tracker.at(float(np.exp(best)))
    return None if optimum.outcome == "not_converged" else optimum


class _LostError(Exception):
    """A peak that was not found again."""


def line(found: Found, parameter: str) -> str:
    """One line a peak."""
    peak = found.peak
    stuck, shaken_down, slipping, opened = peak.point.states
    corner = "  at a corner" if peak.at_corner else ""
    return (
        f"{parameter} {peak.parameter:<10.6g} {peak.frequency_hz:11.6g} Hz  amplitude {peak.amplitude:11.5e}"
        f"  per level {peak.response:11.5e}  stuck {stuck + shaken_down:3d} slipping {slipping:3d} open {opened:3d}"
        f"  {peak.point.iterations:3d} iterations  {found.kind}  {peak.outcome}{corner}"
    )


def _stops(keys: dict[str, Any]) -> list[float]:
    """Values to stop at, in the order of the curve."""
    low, high = sorted((keys["start"], keys["stop"]))
    inside = sorted({value for value in keys["values"] if low < value < high})
    return [*(inside if keys["stop"] > keys["start"] else inside[::-1]), keys["stop"]]


def _is_between(before: Peak, after: Peak, parameter: str) -> bool:
    """Whether the response has an extremum over the parameter between two peaks; stuck, it does not change."""
    if sum(before.point.states[2:]) == 0 or sum(after.point.states[2:]) == 0:
        return False
    return elasticity(before, parameter) * elasticity(after, parameter) < 0.0


def _ending(job: Job, found: list[Found]) -> Ending:
    keys = job["peak"]
    return ending_of(found, keys["parameter"], keys["stop"])


def _missed(job: Job, found: list[Found]) -> str:
    ending = _ending(job, found)
    if ending.kind != "stop" and not ending.is_physical:
        return ending.words
    if above := sum(one.peak.outcome == "above_tolerance" for one in found):
        return f"the estimated error of {above} peak(s) is above [balance] tolerance = {job['balance']['tolerance']:g}"
    return ""


def _check(job: Job) -> None:
    keys = job["peak"]
    faults = [
        job.fault(f"[peak] {name}", "missing", "a value of the parameter to follow the peak from and to")
        for name in ("start", "stop")
        if keys[name] is None
    ]
    if not faults and keys["start"] == keys["stop"]:
        faults.append(job.fault("[peak] stop", keys["stop"], "a value other than start"))
    names = [monitor["name"] for monitor in job["output"]["monitors"]]
    if keys["monitor"] not in (None, *names):
        faults.append(job.fault("[peak] monitor", keys["monitor"], "one of " + ", ".join(names)))
    low, high = band_of(job)
    if low == high:
        shown = job["sweep"]["frequencies_hz"] or [low, high]
        faults.append(job.fault("[sweep] frequencies_hz", shown, "a band, in which the peak is looked for"))
    if keys["parameter"] == "preload":
        if job["balance"]["approach"] == "uncoupled":
            expected = '"level": uncoupled, the mean is frozen and does not follow the preload'
            faults.append(job.fault("[peak] parameter", "preload", expected))
        if not any(load["kind"] in ("static", "centrifugal") for load in job["load"]):
            faults.append(job.fault("[peak] parameter", "preload", '"level", since the job has no static load'))
        if any(load["spin_softening"] for load in job["load"]) or asking_key(job) is not None:
            expected = '"level": spin softening and Coriolis forces belong to one speed, and so to one preload'
            faults.append(job.fault("[peak] parameter", "preload", expected))
    elif keys["level"] != 1.0:
        faults.append(job.fault("[peak] level", keys["level"], 'no such key but with parameter = "preload"'))
    if job["sensitivity"]["to"] and keys["amplitude"] != "half_range":
        expected = '"half_range" with [sensitivity]: derivatives are of that'
        faults.append(job.fault("[peak] amplitude", keys["amplitude"], expected))
    if faults:
        raise InputError(*faults)
