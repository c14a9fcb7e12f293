"""Peaks of random scenes, followed in level and in preload, up and down: do they arrive, are they the peaks of sweeps?

    .venv/bin/python benchmarks/peaks.py --scenes 100 --seed 1 --output peaks.jsonl
    .venv/bin/python benchmarks/peaks.py --seed 1 --first 17 --scenes 1 --runs level_up --verbose

Scenes are those of `peaks_scenes.py`. Each is followed four times by what `attrito peak` runs, with as many
harmonics as that begins with, sweeps for a higher peak included. A run arrives if its last peak is at `stop`, or if
it says by which `ending` there is no peak farther on. Values asked for are held against two references with the same
harmonics and samples:

- *dense*: frequencies listed from the followed peak outwards, SPAN to either side or to where the response falls
  below half power, each starting from the one before; the largest amplitude among them, refined by golden sections
  between its neighbours, from the sliders of the followed peak;
- *swept*: a new session at that level and preload, swept up and down; the higher of both peaks, refined likewise.

The first must be the value to 1e-4. The second may differ: where the peak is not unique (sliders keep the way there),
where solutions coexist, and where the response has another, higher peak; these are counted apart. Whether the
coarse sweep of `attrito peak` from the followed peak notices it is counted, too, with what that costs. Cost is work
(`src/balance/work.f90`) of a run without its static paths, by value and by peak, in sweeps at the run's values, and of
the coarse sweeps.

JSON on standard output; `--output` keeps a line of JSON a run, as it ends. Runs that the file holds already are not
followed again, so that a campaign that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import peaks_scenes
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from attrito.library.points import Point
from attrito.library.session import Options, Solver
from attrito.peaks.curve import REASONS, Found
from attrito.peaks.higher import HALF_POWER, HIGHER, HigherPeaks
from attrito.peaks.run import follow
from attrito.support.errors import NumericsError

PATH = np.array([[0.0], [1.0]])
STATIC_STEPS = 20
RUNS = ("level_up", "level_down", "preload_up", "preload_down")
# Values asked for besides both ends, as parts of the range of the logarithm
VALUES = (0.5,)
# Relative, of an amplitude
EQUAL = 1e-4
# Frequencies to either side of the followed peak, and how far they reach, part of it
DENSE, SPAN = 20, 0.03
# Largest difference of frequencies of what counts as the same peak, relative
SAME_PEAK = 0.02
MOST_POINTS = 1000
# A run is ended where it takes so many times its limit, checks included
WHOLE = 4.0


@dataclass
class Value:
    """A value asked for, and what it is held against; errors are relative differences of the amplitude.

    `noticed`: by how much the highest peak that the coarse sweep found is higher, NaN if none is. `moved`: the
    curve came to a lower maximum of the same resonance.
    """

    parameter: float
    frequency_hz: float
    unique: bool
    dense_error: float
    swept_error: float
    swept_hz: float
    sweep_work: float
    sweep_points: int
    noticed: float
    moved: bool

    @property
    def kind(self) -> str:
        """What the new sweep found instead."""
        if abs(self.swept_error) <= EQUAL:
            return "equal"
        if abs(self.swept_hz / self.frequency_hz - 1.0) > SAME_PEAK:
            return "higher elsewhere" if self.swept_error > 0.0 else "lower elsewhere"
        if not self.unique:
            return "not unique"
        return "coexisting, higher" if self.swept_error > 0.0 else "coexisting, lower"


@dataclass
class Run:
    """One way along a range."""

    scene: int
    kind: str
    way: str
    start: float
    stop: float
    arrived: bool = False
    came_to: float = np.nan
    ending: str = ""
    out_of_time: bool = False
    peaks: int = 0
    evaluations: int = 0
    work: float = 0.0
    look_work: float = 0.0
    seconds: float = 0.0
    values: list[Value] = field(default_factory=list)

    def in_sweeps(self, work: float) -> float:
        """Work in sweeps, by value; NaN where no sweep tells, as where all contacts stick and a sweep takes no work."""
        swept = sum(value.sweep_work for value in self.values)
        return work / swept if swept > 0.0 else np.nan

    @property
    def sweeps(self) -> float:
        """Work of the curve and of the coarse sweeps."""
        return self.in_sweeps(self.work + self.look_work)


def keys_of(scene: peaks_scenes.Scene, way: str) -> dict:
    """What `follow` asks of a job."""
    parameter, direction = way.split("_")
    low, high = scene.levels if parameter == "level" else scene.preloads
    values = [low * (high / low) ** part for part in VALUES]
    ends = (low, high) if direction == "up" else (high, low)
    peak = {"parameter": parameter, "start": ends[0], "stop": ends[1], "values": values, "level": scene.level}
    peak |= {"monitor": None, "amplitude": "half_range", "near_hz": None, "optimum": False, "max_points": MOST_POINTS}
    sweep = {"frequencies_hz": None, "start_hz": scene.band_hz[0], "stop_hz": scene.band_hz[1]}
    return {"peak": peak, "sweep": sweep, "static": {"steps": STATIC_STEPS}}


@dataclass(frozen=True)
class Task:
    """A scene to be followed one way, by these options; `limit`: seconds of the processor, where it is given up."""

    seed: int
    number: int
    way: str
    check: bool
    limit: float
    options: Options
    tangents: int | None = None

    def scene(self) -> peaks_scenes.Scene:
        """The scene."""
        return peaks_scenes.make(self.seed, self.number, self.tangents)


class Counted(Solver):
    """Counts how often it follows a static path, always the same here."""

    static_paths = 0

    def follow_static_path(self, path: np.ndarray, steps: int, frequency_hz: float) -> np.ndarray:
        """See `Solver.follow_static_path`."""
        self.static_paths += 1
        return super().follow_static_path(path, steps, frequency_hz)


def new_run(task: Task) -> Run:
    """A run that has found nothing yet."""
    keys = keys_of(task.scene(), task.way)["peak"]
    return Run(task.number, task.scene().kind, task.way, keys["start"], keys["stop"])


def run(task: Task) -> Run:
    """Follow a scene's peak one way, and check its values."""
    scene, done = task.scene(), new_run(task)
    job = keys_of(scene, task.way)
    keys = job["peak"]
    started = time.process_time()
    found: list[Found] = []
    states: list[np.ndarray] = []
    looks_at = (PATH, STATIC_STEPS, 0, "half_range", scene.band_hz)
    preload = keys["start"] if keys["parameter"] == "preload" else 1.0
    with (
        Counted(MPI.COMM_SELF, scene.reduced, task.options) as solver,
        HigherPeaks(MPI.COMM_SELF, scene.reduced, task.options, *looks_at) as looking,
    ):
        try:
            solver.follow_static_path(PATH * preload, STATIC_STEPS, scene.band_hz[0])
            static_work = solver.static_work
            for one in follow(solver, job, scene.reduced, PATH, looking):
                found.append(one)
                states.append(solver.save_state())
                if time.process_time() - started > task.limit:
                    done.out_of_time = True
                    break
        except NumericsError as error:
            done.ending = str(error)
        done.look_work = looking.work
        done.work = found[-1].peak.point.work - solver.static_paths * static_work if found else 0.0
    done.seconds = time.process_time() - started
    solved = [one for one in found if one.converged]
    done.peaks = len(solved)
    if found:
        done.evaluations = found[-1].peak.evaluations
    if found and not found[-1].converged and found[-1].peak.ending in REASONS:
        done.ending = found[-1].peak.ending
    if solved:
        done.came_to = solved[-1].peak.parameter
        done.arrived = found[-1].converged and abs(done.came_to / keys["stop"] - 1.0) <= 1e-12
    if task.check:
        for one, state in zip(found, states, strict=True):
            # What has taken long already is checked at its end alone.
            late = time.process_time() - started > task.limit and one is not found[-1]
            if one.converged and one.kind == "value" and not late:
                done.values.append(check_value(scene, task.options, one, state, keys["parameter"]))
    return done


def check_value(scene: peaks_scenes.Scene, options: Options, found: Found, state: np.ndarray, parameter: str) -> Value:
    """Hold a peak against listed frequencies and against sweeps."""
    peak = found.peak
    preload = peak.parameter if parameter == "preload" else 1.0
    reference = dense(scene, options, found, state, preload)
    sweeps = [swept(scene, options, peak.level, preload, way) for way in (1, -1)]
    amplitude, at, work, points = max(sweeps)
    return Value(
        peak.parameter,
        peak.frequency_hz,
        peak.point.unique,
        reference / peak.amplitude - 1.0,
        amplitude / peak.amplitude - 1.0,
        at,
        # Of either way: which is the cheaper is not known beforehand.
        0.5 * sum(sweep[2] for sweep in sweeps),
        points,
        found.higher.amplitude / peak.amplitude - 1.0 if found.higher else np.nan,
        found.moved,
    )


def dense(scene: peaks_scenes.Scene, options: Options, found: Found, state: np.ndarray, preload: float) -> float:
    """Largest amplitude about a followed peak, whose sliders and motion are the start to either side."""
    peak = found.peak
    offsets = SPAN * np.linspace(0.0, 1.0, DENSE + 1) ** 2
    best, nearest, bracket = -np.inf, (np.empty(0), peak.frequency_hz), np.ones(2)
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        solver.follow_static_path(PATH * preload, STATIC_STEPS, scene.band_hz[0])
        for way in (1.0, -1.0):
            solver.load_state(state)
            least = np.inf
            listed = (peak.frequency_hz * (1.0 + way * offsets)).tolist()
            for i, point in enumerate(solver.solve_at(listed, peak.level, 0)):
                if not point.is_solved:
                    continue
                least = min(least, point.amplitude[0])
                if least < HALF_POWER * peak.amplitude:
                    break
                if best < point.amplitude[0]:
                    best, nearest = point.amplitude[0], (solver.save_state(), point.frequency_hz)
                    around = (
                        (offsets[max(i - 1, 0)], offsets[min(i + 1, DENSE)]) if i > 0 else (-offsets[1], offsets[1])
                    )
                    bracket = 1.0 + way * np.array(around)
        ends = (peak.frequency_hz * bracket.min(), peak.frequency_hz * bracket.max())
        return max(best, refined(solver, nearest, peak.level, ends)[0])


def swept(
    scene: peaks_scenes.Scene, options: Options, level: float, preload: float, way: int
) -> tuple[float, float, float, int]:
    """Highest peak of a sweep, its frequency, the sweep's work and points; the work of refining it is not counted."""
    points: list[Point] = []
    states: list[np.ndarray] = []
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        ends = scene.band_hz[::way]
        solver.follow_static_path(PATH * preload, STATIC_STEPS, ends[0])
        for point in solver.sweep(*ends, level, 0, MOST_POINTS):
            points.append(point)
            states.append(solver.save_state())
        work = points[-1].work - solver.static_work
        amplitudes = [point.amplitude[0] if point.is_solved else -np.inf for point in points]
        best = int(np.argmax(amplitudes))
        if best in (0, len(points) - 1):
            return float(amplitudes[best]), points[best].frequency_hz, work, len(points)
        neighbours = sorted(points[i].frequency_hz for i in (best - 1, best + 1))
        at = points[best].frequency_hz
        bracket = (min(neighbours[0], at), max(neighbours[1], at))
        found = refined(solver, (states[best], at), level, bracket)
    return *max(found, (float(amplitudes[best]), at)), work, len(points)


def refined(
    solver: Solver, start: tuple[np.ndarray, float], level: float, bracket: tuple[float, float]
) -> tuple[float, float]:
    """Largest amplitude within a bracket and its frequency, every point from the same start."""

    def minus(frequency: float) -> float:
        solver.load_state(start[0])
        (point,) = solver.solve_at([frequency], level, 0)
        return -float(point.amplitude[0]) if point.is_solved else 0.0

    found = minimize_scalar(minus, bounds=bracket, method="bounded", options={"xatol": 1e-7 * bracket[1]})
    return -float(found.fun), float(found.x)


def main() -> None:
    """Follow all scenes; JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--tangents", type=int, choices=(1, 2), help="of contacts; both unless given")
    parser.add_argument("--runs", nargs="*", default=RUNS, choices=RUNS)
    parser.add_argument("--unchecked", action="store_true", help="do not sweep: arrival alone")
    parser.add_argument("--harmonics", type=int, default=5)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of the processor a run")
    parser.add_argument("--output", help="lines of JSON, one a run; runs in it are not followed again")
    parser.add_argument("--verbose", action="store_true", help="print every value")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.scenes)
    options = Options(arguments.harmonics, arguments.samples)
    tasks = [
        Task(arguments.seed, number, way, not arguments.unchecked, arguments.limit, options, arguments.tangents)
        for number in numbers
        for way in arguments.runs
    ]
    runs = stored_runs(arguments.output, tasks)
    done = {(one.scene, one.way) for one in runs}
    left = [task for task in tasks if (task.number, task.way) not in done]
    for one in results(left, WHOLE * arguments.limit):
        runs.append(one)
        if arguments.output:
            with open(arguments.output, "a") as file:
                file.write(json.dumps(asdict(one)) + "\n")
        common.progress(
            f"{one.scene} {one.kind} {one.way}: {'arrived' if one.arrived else one.ending or 'lost'} "
            f"{one.came_to:.4g} of {one.start:.4g}...{one.stop:.4g}, {one.peaks} peaks, "
            f"{one.evaluations} evaluations, {one.sweeps:.2f} sweeps a value, {one.seconds:.1f} s"
        )
        for value in one.values if arguments.verbose else ():
            common.progress(f"    {value} {value.kind}")
    common.report({"arguments": vars(arguments), **summary(runs)})


def results(tasks: list[Task], seconds: float) -> Iterable[Run]:
    """Runs in turn, in a process that is ended with a run that takes so many seconds of the processor."""
    context = multiprocessing.get_context("spawn")
    pool = context.Pool(1)
    used = pool.apply(time.process_time)
    for task in tasks:
        (worker,) = multiprocessing.active_children()
        waiting = pool.apply_async(run, (task,))
        while not waiting.ready() and processor_seconds(worker.pid) - used < seconds:
            waiting.wait(1.0)
        if waiting.ready():
            yield waiting.get()
        else:
            pool.terminate()
            pool.join()
            pool = context.Pool(1)
            yield replace(new_run(task), out_of_time=True)
        used = pool.apply(time.process_time)
    pool.terminate()


def processor_seconds(process: int | None) -> float:
    """What a process has used."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stored_runs(path: str | None, tasks: list[Task]) -> list[Run]:
    """Runs of these tasks that a file holds, none where there is no file."""
    if path is None or not Path(path).exists():
        return []
    wanted = {(task.number, task.way) for task in tasks}
    stored = [json.loads(line) for line in Path(path).read_text().splitlines()]
    runs = [Run(**{**keys, "values": [Value(**value) for value in keys["values"]]}) for keys in stored]
    return [one for one in runs if (one.scene, one.way) in wanted]


def median(numbers: list[float]) -> float:
    """Of those that are known."""
    return float(np.median([one for one in numbers if np.isfinite(one)] or [np.nan]))


def is_higher(value: Value) -> bool:
    """Whether a new sweep has a peak that is higher by more than `attrito peak` reports."""
    return bool(value.swept_error > HIGHER)


def summary(runs: list[Run]) -> dict:
    """Counts and costs by kind of scene and of all."""
    found = {}
    for kind in ["all", *sorted({one.kind for one in runs})]:
        own = [one for one in runs if kind in ("all", one.kind)]
        values = [value for one in own for value in one.values]
        missed = {one.scene for one in own if not (one.arrived or one.ending)}
        found[kind] = {
            "scenes": len({one.scene for one in own}),
            "scenes that arrive": len({one.scene for one in own} - missed),
            "runs": len(own),
            "runs that arrive": sum(one.arrived for one in own),
            "runs with another ending": dict(Counter(one.ending for one in own if not one.arrived)),
            "values": len(values),
            "equal to dense listed frequencies": sum(bool(abs(value.dense_error) <= EQUAL) for value in values),
            "against new sweeps": dict(Counter(value.kind for value in values)),
            "higher by new sweeps": sum(is_higher(value) for value in values),
            "of these noticed": sum(is_higher(value) and math.isfinite(value.noticed) for value in values),
            "noticed where new sweeps are not higher": sum(
                not is_higher(value) and math.isfinite(value.noticed) for value in values
            ),
            "came to a lower maximum of the same resonance": sum(value.moved for value in values),
            "peaks a run, median": float(np.median([one.peaks for one in own])),
            "sweeps a value, median": median([one.sweeps for one in own]),
            "of these the curve": median([one.in_sweeps(one.work) for one in own]),
            "of these coarse sweeps": median([one.in_sweeps(one.look_work) for one in own]),
            "seconds": float(sum(one.seconds for one in own)),
        }
    return found


if __name__ == "__main__":
    main()
