"""A sweep in which nothing slips beside a linear frequency response that recovers the same contact rows.

    .venv/bin/python benchmarks/stuck.py > stuck.json
    .venv/bin/python benchmarks/stuck.py --plane 100 --hexahedral 100 1000 --modes 200

Prints JSON: for each scene milliseconds of the processor a point of the sweep (every contact checked, monitors
reported, called from Python) and of the linear response (set up, solved, rows recovered), and their ratio, in one run.
"""

from __future__ import annotations

import argparse
import json
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes

from attrito.solver import Options, ReducedScene


def measure(name: str, scene: ReducedScene, options: dict, points: int) -> dict:
    """Both, at a level at which every contact sticks with its slider where the static solution left it."""
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    start, stop = 0.5 * first, 0.8 * first
    least = min(scenes.slip_thresholds(scene, stuck, frequency).min() for frequency in (start, stop))
    with common.TimedSolver(scene, Options(harmonics=5, **options)) as solver:
        solver.walk_static_path(np.array([[0.0], [1.0]]), 10, start)
        started, swept = time.process_time(), []
        while len(swept) < points:
            swept += list(solver.sweep(start, stop, 0.1 * least, 0, points))
            start, stop = stop, start
        seconds = (time.process_time() - started) / len(swept)
        linear = solver.linear_response(start)
    return {
        "scene": name,
        "contacts": len(scene.laws["tangents"]),
        "rows": len(scene.directions),
        "modes": len(scene.mass),
        **options,
        "points": len(swept),
        "iterations": sum(point.iterations for point in swept),
        "moving": sum(sum(point.states[1:]) for point in swept),
        "sweep_ms": 1e3 * seconds,
        "linear_ms": 1e3 * linear,
        "ratio": seconds / linear,
    }


def main() -> None:
    """Measure the sizes asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--plane", type=int, nargs="*", default=[100])
    parser.add_argument("--hexahedral", type=int, nargs="*", default=[100, 1000])
    parser.add_argument("--modes", type=int, default=200)
    parser.add_argument("--points", type=int, default=300)
    arguments = parser.parse_args()
    rows = [
        measure("plane", scenes.plane_block(contacts), {"by_events": True}, arguments.points)
        for contacts in arguments.plane
    ]
    rows += [
        measure("hexahedral", scenes.hexahedral_block(contacts, arguments.modes), {"samples": 128}, arguments.points)
        for contacts in arguments.hexahedral
    ]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
