"""What do the guesses in the sources change? Each is halved and doubled, and random scenes are solved again.

    .venv/bin/python benchmarks/constants.py --scenes 200 --seed 1 --output benchmarks/constants.csv
    .venv/bin/python benchmarks/constants.py --scenes 200 --seed 1 --output benchmarks/constants.csv --only accuracy

Constants are those that a declaration in `src/` calls a guess (docs/constants_reference.py). They are variables of the
library that constants_library.py builds. Scenes of `campaign_scenes.py` are solved with half and with twice the number,
by the part of the program that its folder serves:

- `sweep` (continuation): from the first frequency to the last by arc length;
- `peak` (peak): the largest peak at half the level and at the level, followed from one to the other;
- `verdict` (stability, and integrate, which it rests on): stability of every listed point;
- `list` (all others): listed frequencies with a tolerance.

A row says how many points were lost or gained, how many moved on by more than their estimates, how many verdicts or
outcomes changed, and the ratio of counted work. docs/constants.md shows the rows. Rows that are there are kept, so that
the benchmark goes on where it was ended. Constants of `reduce/` are not varied here.

    .venv/bin/python benchmarks/constants.py --scenes 2000 --seed 2 --together

Constants that changed nothing in the file's rows are varied all at once; where that changes a scene, the half of them
that does it is looked for, and so on. What some scenes have shown is kept, so that this too goes on where it was ended.
A number out of reach tells those that scenes do not meet from those that they do
not need. Both are written into the rows' notes.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import itertools
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import campaign  # isort: skip (sets the threads of BLAS before numpy is loaded)
import campaign_scenes
import constants_library
import numpy as np
from campaign_truth import PATH
from constants_library import Constant
from mpi4py import MPI

from attrito.library.names import ENGINES, ORBITS
from attrito.library.peak_tracker import PeakTracker
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.runs.stability import examine_point
from attrito.support.errors import NumericsError

ROOT = Path(__file__).resolve().parents[1]
FACTORS = ("0.5", "2")
PART = {"continuation": "sweep", "peak": "peak", "stability": "verdict", "integrate": "verdict"}
MOST_POINTS = 60
# Amplitudes that differ by less have not moved, whatever their estimates say
ROUNDING = 1e-6
# A factor that shows whether a constant is looked at in a scene
OUT_OF_REACH = 1e30
# Scenes that are solved before what is known is written down
AT_A_TIME = 60
# Seconds of a processor that the unchanged library may take for a scene that is used, and any other for it
USUAL_SECONDS, MOST_SECONDS = 2.0, 10.0


@dataclass(frozen=True)
class Row:
    """What a factor on a constant changes; `work` is a ratio, `same` whether all amplitudes are equal bit for bit."""

    file: str
    name: str
    value: str
    factor: str
    part: str
    scenes: int
    points: int
    lost: int
    gained: int
    moved: int
    work: float
    same: int
    note: str = ""


@dataclass(frozen=True)
class Solution:
    """A point as it is compared: what it is called, amplitude, estimate, work up to it."""

    outcome: str
    amplitude: float
    estimate: float
    work: float


def solution_of(point: Point, outcome: str = "") -> Solution:
    """Of a point, under its own outcome unless another is given."""
    return Solution(outcome or point.outcome, float(point.amplitude[0]), point.estimate, point.work)


def listed(solver: Solver, scene: campaign_scenes.Scene) -> Iterator[Solution]:
    """Listed frequencies."""
    for point in solver.solve_at(scene.frequencies_hz, 1.0, 0):
        yield solution_of(point)


def swept(solver: Solver, scene: campaign_scenes.Scene) -> Iterator[Solution]:
    """Where a sweep ends, with the largest amplitude met."""
    points = list(solver.sweep(scene.frequencies_hz[0], scene.frequencies_hz[-1], 1.0, 0, MOST_POINTS))
    last, top = points[-1], max(points, key=lambda point: point.amplitude[0] if point.is_solved else 0.0)
    reached = last.reached_stop or len(points) == MOST_POINTS
    yield replace(solution_of(top, "converged" if reached else last.outcome), work=last.work, estimate=0.01)


def judged(solver: Solver, scene: campaign_scenes.Scene) -> Iterator[Solution]:
    """Listed frequencies with their verdicts; an indeterminate one counts as no solution."""
    for point in solver.solve_at(scene.frequencies_hz, 1.0, 0):
        if point.outcome != "converged":
            continue
        report, _ = examine_point(solver, sum(ENGINES.values()), ORBITS["auto"])
        yield solution_of(point, {0: "unstable", 1: "converged"}.get(report.verdict, "indeterminate"))


def peaked(solver: Solver, scene: campaign_scenes.Scene) -> Iterator[Solution]:
    """The peak at half the level and at the level."""
    band = min(scene.frequencies_hz), max(scene.frequencies_hz)
    tracker = PeakTracker(solver, 0, "half_range", band, np.ones(PATH.shape[1]))
    peak = tracker.begin(0.5, tracker.linear_peak_hz())
    yield solution_of(peak.point)
    if peak.point.is_solved:
        tracker.follow_in("level")
        peak = tracker.at(1.0)
        arrived = peak.point.is_solved and peak.parameter == 1.0
        yield solution_of(peak.point, "converged" if arrived else "not_converged")


PARTS: dict[str, Callable[[Solver, campaign_scenes.Scene], Iterator[Solution]]] = {
    "list": listed,
    "sweep": swept,
    "verdict": judged,
    "peak": peaked,
}


def solve(part: str, seed: int, number: int) -> list[Solution]:
    """A scene; nothing where it has no static solution, or no peak."""
    scene = campaign_scenes.make(seed, number)
    with Solver(MPI.COMM_SELF, scene.reduced, campaign.options_of(scene)) as solver:
        try:
            solver.follow_static_path(PATH, 10, scene.frequencies_hz[0])
            return list(PARTS[part](solver, scene))
        except NumericsError:
            return []


def solve_all(library: Path, part: str, seed: int, numbers: list[int], varied: dict[str, float] | None = None,
              seconds: float = MOST_SECONDS) -> dict[int, list[Solution]]:  # fmt: skip
    """Scenes by a library with some numbers multiplied, in a process of its own.

    What takes more than so many seconds of a processor is left out, and so is what crashes.
    """
    task = {"part": part, "seed": seed, "numbers": numbers, "varied": varied or {}, "seconds": seconds}
    environment = os.environ | {"ATTRITO_LIBRARY": str(library)}
    command = [sys.executable, __file__, "--worker", json.dumps(task)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as worker:
        assert worker.stdout
        replies = [json.loads(line) for line in worker.stdout]
    if worker.returncode:
        raise RuntimeError(f"{part}: worker ended with {worker.returncode}")
    return {reply["scene"]: [Solution(**one) for one in reply["points"]] for reply in replies}


def work(task: dict[str, Any]) -> None:
    """The worker: a line of JSON a scene, each in a fork that may neither crash the others nor go on for ever."""
    library = ctypes.CDLL(os.environ["ATTRITO_LIBRARY"])
    by_symbol = {constants_library.symbol(one): one for one in constants_library.guesses()}
    for name, factor in task["varied"].items():
        constants_library.vary(library, by_symbol[name], factor)
    for number in task["numbers"]:
        child = os.fork()
        if child == 0:
            whole = int(np.ceil(task["seconds"]))
            resource.setrlimit(resource.RLIMIT_CPU, (whole, whole))
            points = [asdict(one) for one in solve(task["part"], task["seed"], number)]
            print(json.dumps({"scene": number, "points": points}), flush=True)
            os._exit(0)
        end = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if end not in (0, -signal.SIGXCPU, -signal.SIGKILL):
            print(f"scene {number}: ended with {end}, varied: {task['varied']}", file=sys.stderr)


def compare(constant: Constant, factor: str, part: str, before: dict[int, list[Solution]],
            after: dict[int, list[Solution]]) -> Row:  # fmt: skip
    """The row of a variant; scenes that only one of both has come to count as lost or gained, a point each."""
    lost = gained = moved = points = 0
    same, works = True, [0.0, 0.0]
    for number in sorted(before.keys() | after.keys()):
        one, other = before.get(number, []), after.get(number, [])
        lost += max(0, len(one) - len(other))
        gained += max(0, len(other) - len(one))
        same = same and len(one) == len(other)
        if one and other:
            works[0] += one[-1].work
            works[1] += other[-1].work
        for old, new in zip(one, other, strict=False):
            points += 1
            lost += old.outcome == "converged" != new.outcome
            gained += new.outcome == "converged" != old.outcome
            same = same and old.amplitude == new.amplitude and old.outcome == new.outcome
            if old.outcome == new.outcome == "converged":
                bound = max(np.nan_to_num(old.estimate) + np.nan_to_num(new.estimate), ROUNDING)
                moved += abs(new.amplitude - old.amplitude) > bound * abs(old.amplitude)
    ratio = works[1] / works[0] if works[0] > 0.0 else 1.0
    about = constant.file, constant.name, constant.plain_value, factor, part
    return Row(*about, len(before), points, lost, gained, moved, round(ratio, 4), int(same))


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows that are there."""
    if not path.exists():
        return []
    with path.open() as file:
        return list(csv.DictReader(file))


def one_by_one(options: argparse.Namespace, library: Path, chosen: list[Constant]) -> None:
    """Row by row into the file."""
    known = {(row["file"], row["name"], row["factor"]) for row in rows_of(options.output)}
    names = [field.name for field in fields(Row)]
    if not known:
        options.output.write_text(",".join(names) + "\n")
    before: dict[str, dict[int, list[Solution]]] = {}
    for constant in chosen:
        folder = constant.file.partition("/")[0]
        if options.only and folder not in options.only:
            continue
        part = PART.get(folder, "list")
        if part not in before:
            before[part] = solve_all(library, part, options.seed, list(range(options.scenes)), seconds=options.seconds)
        for factor in FACTORS:
            if (constant.file, constant.name, factor) in known:
                continue
            varied = {constants_library.symbol(constant): float(factor)}
            after = solve_all(library, part, options.seed, list(before[part]), varied)
            row = compare(constant, factor, part, before[part], after)
            with options.output.open("a", newline="") as file:
                csv.DictWriter(file, names, lineterminator="\n").writerow(asdict(row))
            print(row, flush=True)


def together(options: argparse.Namespace, library: Path, chosen: list[Constant]) -> None:
    """What constants that changed nothing change in other scenes, some scenes after the others, into the rows' notes.

    A constant that has been met, or felt, is not varied in scenes that follow. What is known is kept in a file beside
    the library, from which the same command goes on where it was ended.
    """
    kept = options.place / "together.json"
    known = json.loads(kept.read_text()) if kept.exists() else {}
    for part in options.parts:
        about = {"met": [], "felt": {factor: [] for factor in FACTORS}, "drawn": 0, "scenes": 0}
        record = known.setdefault(f"{part} {options.seed} {options.seconds}", about)
        idle = [row for row in rows_of(options.output) if is_idle(row)]
        group = [one for one in chosen if any(is_of(row, one) and row["part"] == part for row in idle)]
        while record["drawn"] < options.scenes:
            numbers = list(range(record["drawn"], min(record["drawn"] + AT_A_TIME, options.scenes)))
            before = solve_all(library, part, options.seed, numbers, seconds=options.seconds)
            search_on(record["met"], library, part, options.seed, before, group, OUT_OF_REACH)
            for factor in FACTORS:
                some = [one for one in group if constants_library.symbol(one) in record["met"]]
                some = [one for one in some if any(is_of(row, one) and row["factor"] == factor for row in idle)]
                search_on(record["felt"][factor], library, part, options.seed, before, some, float(factor))
            record["drawn"] = numbers[-1] + 1
            record["scenes"] += len(before)
            kept.write_text(json.dumps(known, indent=1))
            write_notes(options.output, part, group, record)
            quick = f"{record['scenes']} of {record['drawn']} scenes take at most {options.seconds} s of a processor"
            print(f"{part}: {quick}; they meet {len(record['met'])} of {len(group)}", flush=True)


def search_on(found: list[str], library: Path, part: str, seed: int, before: dict[int, list[Solution]],
              group: list[Constant], factor: float) -> None:  # fmt: skip
    """Search for those of a group that have not been found yet."""
    left = [one for one in group if constants_library.symbol(one) not in found]
    found += [constants_library.symbol(one) for one in search(library, part, seed, before, left, factor)]


def write_notes(path: Path, part: str, group: list[Constant], record: dict[str, Any]) -> None:
    """What is known of the constants of a group, into the rows of a file."""
    rows = rows_of(path)
    for row, one in itertools.product(rows, group):
        if is_of(row, one) and row["part"] == part and is_idle(row):
            symbol = constants_library.symbol(one)
            met_words = "some" if symbol in record["felt"][row["factor"]] else "nothing"
            row["note"] = f"{met_words if symbol in record['met'] else 'not met'} in {record['scenes']} others"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def is_idle(row: dict[str, str]) -> bool:
    """Has a variant changed nothing, in the file's rows?"""
    return row["same"] == "1" and row["work"] == "1.0"


def is_of(row: dict[str, str], constant: Constant) -> bool:
    """Is a row of the file about a constant?"""
    return (row["file"], row["name"]) == (constant.file, constant.name)


def search(library: Path, part: str, seed: int, before: dict[int, list[Solution]], group: list[Constant],
           factor: float) -> list[Constant]:  # fmt: skip
    """The constants of a group that change a scene.

    All are varied in all scenes. The first one that changes names some; the others are varied again where any changed.
    """
    found: list[Constant] = []
    changed = before
    while changed and (left := [one for one in group if one not in found]):
        changed = changed_by(library, part, seed, changed, left, factor)
        first = dict(itertools.islice(changed.items(), 1))
        found += named_by(library, part, seed, first, left, factor)
        changed = {number: points for number, points in changed.items() if number not in first}
    return found


def named_by(library: Path, part: str, seed: int, scene: dict[int, list[Solution]], group: list[Constant],
             factor: float) -> list[Constant]:  # fmt: skip
    """The constants of a group that change one scene: each half is varied, and so on where that changes the scene."""
    if not scene or not group or not changed_by(library, part, seed, scene, group, factor):
        return []
    half = len(group) // 2
    if half == 0:
        return group
    return [one for some in (group[:half], group[half:]) for one in named_by(library, part, seed, scene, some, factor)]


def changed_by(library: Path, part: str, seed: int, before: dict[int, list[Solution]], group: list[Constant],
               factor: float) -> dict[int, list[Solution]]:  # fmt: skip
    """The scenes that change, not bit for bit the same, where all constants of a group are varied."""
    varied = {constants_library.symbol(one): factor for one in group}
    after = solve_all(library, part, seed, list(before), varied)
    return {number: points for number, points in before.items() if repr(after.get(number)) != repr(points)}


def main(options: argparse.Namespace) -> None:
    """Build, then vary."""
    options.place.mkdir(parents=True, exist_ok=True)
    library, chosen = constants_library.build(options.place.resolve())
    (together if options.together else one_by_one)(options, library, chosen)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "constants.csv")
    parser.add_argument("--only", nargs="+", help="folders below src/")
    parser.add_argument("--together", action="store_true", help="all that changed nothing at once")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="with --together")
    parser.add_argument(
        "--seconds", type=float, default=USUAL_SECONDS, help="of a processor that a scene may take as it is"
    )
    parser.add_argument("--place", type=Path, default=Path("build") / "constants", help="where the library is built")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        work(json.loads(given.worker))
    else:
        main(given)
