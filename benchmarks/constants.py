"""What do the guesses in the sources change? Each is halved and doubled, and random scenes are solved again.

    .venv/bin/python benchmarks/constants.py --scenes 200 --seed 1 --output benchmarks/constants.csv
    .venv/bin/python benchmarks/constants.py --scenes 200 --seed 1 --output benchmarks/constants.csv --only accuracy

Constants are those that a declaration in `src/` calls a guess (docs/constants_reference.py). For each a copy of the
library is built with half and with twice the number, and scenes of `campaign_scenes.py` are solved with the part of the
program that its folder serves:

- `sweep` (continuation): from the first frequency to the last by arc length;
- `peak` (peak): the largest peak at half the level and at the level, followed from one to the other;
- `verdict` (stability, and integrate, which it rests on): stability of every listed point;
- `list` (all others): listed frequencies with a tolerance.

A row says how many points were lost or gained, how many moved on by more than their estimates, how many verdicts or
outcomes changed, and the ratio of counted work. docs/constants.md shows the rows. Rows that are there are kept, so that
the benchmark goes on where it was ended. Constants of `reduce/` and of fixed arrays are not varied here.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import campaign  # isort: skip (sets the threads of BLAS before numpy is loaded)
import campaign_scenes
import numpy as np
from campaign_truth import PATH
from mpi4py import MPI

from attrito.library.names import ENGINES, ORBITS
from attrito.library.peak_tracker import PeakTracker
from attrito.library.session import Point, Solver
from attrito.runs.stability import examine_point
from attrito.support.errors import NumericsError

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
from constants_reference import Constant, collect  # noqa: E402 (a folder of scripts, not a package)

FACTORS = ("0.5", "2")
PART = {"continuation": "sweep", "peak": "peak", "stability": "verdict", "integrate": "verdict"}
SKIPPED = ("reduce", "api")
MOST_POINTS = 80
# Amplitudes that differ by less have not moved, whatever their estimates say
ROUNDING = 1e-6
# Seconds by the clock after which a scene is ended
SECONDS = 60.0


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
        report, _ = examine_point(solver, ENGINES["monodromy"], ORBITS["auto"])
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


def solve_all(library: Path, part: str, seed: int, numbers: list[int]) -> dict[int, list[Solution]]:
    """Scenes by a library, in a process of its own; a scene that takes too long is left out, and so is what crashes."""
    found: dict[int, list[Solution]] = {}
    left = list(numbers)
    while left:
        which = ["--seed", str(seed), "--numbers", ",".join(map(str, left))]
        command = [sys.executable, __file__, "--worker", part, *which]
        environment = os.environ | {"ATTRITO_LIBRARY": str(library)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as worker:
            found |= dict(_replies(worker))
        # The one after the last that came is what took too long, or crashed.
        done = next((index for index, number in enumerate(left) if number not in found), len(left))
        left = left[done + 1 :]
    return found


def _replies(worker: subprocess.Popen[str]) -> Iterator[tuple[int, list[Solution]]]:
    """What a worker writes, until it ends by itself (an alarm ends it after `SECONDS` in one scene)."""
    assert worker.stdout
    for line in worker.stdout:
        reply = json.loads(line)
        yield reply["scene"], [Solution(**one) for one in reply["points"]]


def work(part: str, seed: int, numbers: list[int]) -> None:
    """The worker: a line of JSON a scene."""
    import signal

    for number in numbers:
        signal.alarm(int(SECONDS))
        points = [asdict(one) for one in solve(part, seed, number)]
        print(json.dumps({"scene": number, "points": points}), flush=True)


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


def varied(constant: Constant, factor: str) -> str | None:
    """The number as the sources write it, halved or doubled; None where it is not a plain number."""
    if constant.value.isdigit():
        number = int(constant.value)
        return str(2 * number if factor == "2" else max(1, number // 2))
    plain = re.fullmatch(r"[-0-9.e+]+_wp(/[-0-9.e+]+_wp)?", constant.value)
    return f"{float(factor)!r}_wp*{constant.value}" if plain and not constant.value.startswith("-") else None


class Workshop:
    """A copy of the sources in which the library is built with other numbers."""

    def __init__(self, place: Path):
        self._tree = place / "tree"
        if not self._tree.exists():
            keep = shutil.ignore_patterns("build", ".git", ".venv")
            shutil.copytree(ROOT, self._tree, ignore=keep)
            self._run("cmake", "--preset", "release", "--fresh")
        self._place = place

    def build(self, name: str) -> Path:
        """The library as the tree is now, kept under a name."""
        self._run("cmake", "--build", "--preset", "release", "--target", "attrito")
        kept = self._place / f"lib{name}.so"
        shutil.copy(self._tree / "build" / "release" / "libattrito.so", kept)
        return kept

    def build_with(self, constant: Constant, number: str) -> Path:
        """The library with another number."""
        path = self._tree / "src" / constant.file
        text = path.read_text()
        lines = text.split("\n")
        declared = f"{constant.name} = {constant.value}"
        lines[constant.line] = lines[constant.line].replace(declared, f"{constant.name} = {number}", 1)
        try:
            path.write_text("\n".join(lines))
            return self.build("variant")
        finally:
            path.write_text(text)

    def _run(self, *command: str) -> None:
        done = subprocess.run(command, cwd=self._tree, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stdout[-2000:]}{done.stderr[-2000:]}")


def main(options: argparse.Namespace) -> None:
    """Row by row into the file."""
    known = set()
    if options.output.exists():
        with options.output.open() as file:
            known = {(row["file"], row["name"], row["factor"]) for row in csv.DictReader(file)}
    else:
        options.output.write_text(",".join(field.name for field in fields(Row)) + "\n")
    workshop = Workshop(options.place)
    plain = workshop.build("plain")
    numbers = list(range(options.scenes))
    before: dict[str, dict[int, list[Solution]]] = {}
    for constant in collect():
        folder = constant.file.partition("/")[0]
        if constant.kind != "guess" or folder in SKIPPED or (options.only and folder not in options.only):
            continue
        for factor in FACTORS:
            number = varied(constant, factor)
            if number is None or (constant.file, constant.name, factor) in known:
                continue
            part = PART.get(folder, "list")
            if part not in before:
                before[part] = solve_all(plain, part, options.seed, numbers)
            # What the unchanged library does not solve in time is left to nobody.
            library = workshop.build_with(constant, number)
            after = solve_all(library, part, options.seed, list(before[part]))
            row = compare(constant, factor, part, before[part], after)
            with options.output.open("a", newline="") as file:
                csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n").writerow(asdict(row))
            print(row, flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "constants.csv")
    parser.add_argument("--only", nargs="+", help="folders below src/")
    parser.add_argument("--place", type=Path, default=Path("build") / "constants", help="where copies are built")
    parser.add_argument("--worker", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--numbers", default="", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.worker:
        work(chosen.worker, chosen.seed, [int(number) for number in chosen.numbers.split(",")])
    else:
        chosen.place = chosen.place.resolve()
        chosen.place.mkdir(parents=True, exist_ok=True)
        main(chosen)
