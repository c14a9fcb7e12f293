"""Fallback strategies left out one by one: points solved, Newton iterations and time without each.

    .venv/bin/python benchmarks/ablation.py > ablation.json
    .venv/bin/python benchmarks/ablation.py --groups corner --families 4 --frequencies 40

Four groups of scenes, each solved by listed frequencies, one from the next unless `--alone`: `corner`, the hard corner
of the scene grid (contacts of at least 1000 times the structure at an inclined wall, without a large preload); `plane`,
plane blocks by events; `block`, hexahedral blocks by samples; `joint`, the lap joint of `--job`, whose model must be
there. Levels of the blocks are parts of that at which half the contacts would slip, those of the joint parts of the
job's first level.

Where the first strategy alone solves every point of a scene, no other is tried, and what is found without one of the
others is what is found with all of them; such scenes are not solved again. Prints JSON: by group and by what is left
out points, points solved, iterations, the processor's seconds, and the points whose outcome differs from that of all
strategies, or whose amplitude does by 1 % (by less differ members of a family, which the sliders of the start choose).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import bench_library
import numpy as np
import scenes
from mpi4py import MPI

from attrito.job.reading import read_job
from attrito.library.names import STRATEGIES
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options
from attrito_verification.scene_grid.scenes import BAND, families

GROUPS = ("corner", "plane", "block", "joint")
SAME = 1.0e-2
STATIC_STEPS = 20


@dataclass(frozen=True)
class Case:
    """A scene at one level: `path` of the static loads `[corners, loads]`, frequencies in their order, Hz.

    `alone`: every point from the static solution.
    """

    name: str
    scene: ReducedScene
    options: Options
    path: np.ndarray
    level: float
    frequencies_hz: np.ndarray
    alone: bool = False


def corner(arguments: argparse.Namespace) -> Iterator[Case]:
    """Every so many families of the hard corner of the scene grid."""
    hard = [one for one in families() if one.ratio >= 1.0e3 and one.degrees > 0.0 and one.preload != "large"]
    options = Options(harmonics=10, samples=128)
    chosen = hard[:: max(len(hard) // arguments.families, 1)][: arguments.families]
    for family in chosen:
        frequencies = np.linspace(*BAND, arguments.frequencies)
        yield Case(family.name, family.scene(), options, np.array([[0.0], [1.0]]), 1.0, frequencies)


def plane(arguments: argparse.Namespace) -> Iterator[Case]:
    """Plane blocks, one tangent."""
    options = Options(harmonics=5, samples=128)
    for stiffness in (2.0e9, 2.0e11):
        scene = scenes.plane_block(10, stiffness=stiffness)
        yield from _block(f"plane block, {stiffness:g} N/m", scene, options, arguments.block_frequencies)


def block(arguments: argparse.Namespace) -> Iterator[Case]:
    """Hexahedral blocks, two tangents."""
    options = Options(harmonics=3, samples=64)
    for stiffness in (2.0e9, 2.0e11):
        scene = scenes.hexahedral_block(arguments.contacts, 60, stiffness)
        yield from _block(f"hexahedral block, {stiffness:g} N/m", scene, options, arguments.block_frequencies)


def _block(name: str, scene: ReducedScene, options: Options, count: int) -> Iterator[Case]:
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    half = float(np.median(scenes.slip_thresholds(scene, stuck, 0.9 * first)))
    for part in (0.7, 1.5, 5.0):
        frequencies = np.linspace(0.8, 1.1, count) * first
        yield Case(f"{name}, level {part:g}", scene, options, np.array([[0.0], [1.0]]), part * half, frequencies)


def joint(arguments: argparse.Namespace) -> Iterator[Case]:
    """The lap joint below its first stuck natural frequency."""
    job = read_job(arguments.job)
    scene = build_scene(job)
    rom, _ = make_rom(MPI.COMM_SELF, job, scene, common.progress)
    reduced = reduced_scene(job, scene, rom)
    first = scenes.stuck_system(reduced).frequencies_hz[0]
    options = solver_options(job, rom)
    for part in (0.5, 1.0, 2.0):
        frequencies = np.linspace(0.88, 1.0, arguments.joint_frequencies) * first
        level = part * job["sweep"]["levels"][0]
        yield Case(f"lap joint, {level:g} N", reduced, options, scene.load_path, level, frequencies)


def solve(case: Case, left_out: list[str]) -> tuple[list[Point], float]:
    """The points of a case without some strategies, and the processor's seconds from the first point on."""
    frequencies = list(case.frequencies_hz)
    with common.TimedSolver(case.scene, case.options) as solver:
        bench_library.leave_out(solver, left_out)
        points, seconds = [], 0.0
        # All from one static solution, or each from its own.
        for part in [[one] for one in frequencies] if case.alone else [frequencies]:
            solver.follow_static_path(case.path, STATIC_STEPS, part[0])
            started = time.process_time()
            points += list(solver.solve_at(part, case.level, 0))
            seconds += time.process_time() - started
        return points, seconds


def differences(case: Case, points: list[Point], others: list[Point]) -> list[dict]:
    """Points that end otherwise than with all strategies."""
    found = []
    for point, other in zip(points, others, strict=True):
        scale = np.abs(point.amplitude).max()
        same = point.outcome == other.outcome
        if same and point.is_solved:
            same = bool(np.abs(point.amplitude - other.amplitude).max() <= SAME * scale)
        if not same:
            ratio = float(np.abs(other.amplitude).max() / scale) if scale > 0.0 else None
            outcomes = {"all": point.outcome, "without": other.outcome}
            found.append({"case": case.name, "frequency_hz": point.frequency_hz, **outcomes, "amplitude_ratio": ratio})
    return found


def measure(cases: Iterable[Case], kinds: list[str]) -> dict[str, dict]:
    """Sums over cases by what is left out, several strategies joined by `+`; `none`: nothing."""
    sums: dict[str, dict] = {
        kind: {"points": 0, "solved": 0, "iterations": 0, "seconds": 0.0, "changed": []} for kind in kinds
    }
    for case in cases:
        points, seconds = solve(case, [])
        alone, _ = solve(case, list(STRATEGIES[1:]))
        easy = all(point.is_solved for point in alone)
        for kind in kinds:
            others, spent = points, seconds
            left_out = [] if kind == "none" else kind.split("+")
            if STRATEGIES[0] in left_out or (left_out and not easy):
                others, spent = solve(case, left_out)
            row = sums[kind]
            row["points"] += len(others)
            row["solved"] += sum(point.is_solved for point in others)
            row["iterations"] += sum(point.iterations for point in others)
            row["seconds"] += spent
            row["changed"] += differences(case, points, others)
        solved = sum(point.is_solved for point in points)
        common.progress(f"{case.name}: {solved} of {len(points)}, {seconds:.2f} s{', first alone' if easy else ''}")
    return sums


def main() -> None:
    """Solve them all, with each left out in turn."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS))
    parser.add_argument("--families", type=int, default=60, help="of the scene grid's hard corner")
    parser.add_argument("--frequencies", type=int, default=40, help="of each family")
    parser.add_argument("--contacts", type=int, default=20, help="of the hexahedral blocks")
    parser.add_argument("--block-frequencies", type=int, default=16, help="of each level of a block")
    parser.add_argument("--joint-frequencies", type=int, default=12, help="of each level of the lap joint")
    parser.add_argument("--job", type=Path, default=Path("input/lap_joint.toml"), help="of the lap joint")
    parser.add_argument("--alone", action="store_true", help="every point from the static solution")
    parser.add_argument("--uncoupled", action="store_true", help="the mean frozen at the static solution")
    parser.add_argument("--without", nargs="+", default=list(STRATEGIES), help="what is left out in turn; a+b: both")
    arguments = parser.parse_args()
    kinds = ["none", *arguments.without]
    make = {"corner": corner, "plane": plane, "block": block, "joint": joint}
    result = {}
    for name in arguments.groups:
        cases = (
            replace(case, alone=arguments.alone, options=replace(case.options, uncoupled=arguments.uncoupled))
            for case in make[name](arguments)
        )
        result[name] = measure(cases, kinds)
    common.report({"arguments": {**vars(arguments), "job": str(arguments.job)}, "groups": result})


if __name__ == "__main__":
    main()
