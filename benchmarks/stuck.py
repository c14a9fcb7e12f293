"""A sweep in which nothing slips beside a linear frequency response that recovers the same contact rows.

    .venv/bin/python benchmarks/stuck.py > stuck.json
    .venv/bin/python benchmarks/stuck.py --plane 100 --hexahedral 100 1000 --modes 200

Prints JSON: for each scene milliseconds of the processor a point of the sweep (every contact checked, its forces ready
to be told, monitors reported) and of a linear response at the same frequencies (solved, rows of all contacts recovered,
monitors reported), both called from Python point by point, by turns, the least of each, and their ratio. `kernel_ms` is
the linear response without Python and without monitors.
"""

from __future__ import annotations

import argparse
import json
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options


def measure(name: str, scene: ReducedScene, turns: int) -> dict:
    """Both through the first resonance, at a level at which every contact sticks where the static solution left it."""
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    start, stop = 0.5 * first, 1.5 * first
    least = min(scenes.slip_thresholds(scene, stuck, frequency).min() for frequency in (start, first, stop))
    with common.TimedSolver(scene, Options(harmonics=5)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, start)
        solver.linear_points(np.array([start]))
        sweeps, linear = [], []
        while len(sweeps) < turns:
            started = time.process_time()
            swept = list(solver.sweep(start, stop, 0.1 * least, 0, 10000))
            sweeps.append((time.process_time() - started) / len(swept))
            frequencies = [point.frequency_hz for point in swept]
            started = time.process_time()
            response = solver.linear_points(frequencies)
            linear.append((time.process_time() - started) / len(response))
            worst = max(abs(a.amplitude[0] / b[2][0] - 1) for a, b in zip(swept, response, strict=True))
            start, stop = stop, start
        kernel = solver.seconds_of_linear_response(start)
    return {
        "scene": name,
        "contacts": len(scene.laws["tangents"]),
        "rows": len(scene.directions),
        "modes": len(scene.mass),
        "points": len(swept),
        "iterations": sum(point.iterations for point in swept),
        "moving": sum(sum(point.states[1:]) for point in swept),
        "sweep_ms": 1e3 * min(sweeps),
        "linear_ms": 1e3 * min(linear),
        "kernel_ms": 1e3 * kernel,
        "ratio": min(sweeps) / min(linear),
        "amplitudes_differ": worst,
    }


def main() -> None:
    """Measure the sizes asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--plane", type=int, nargs="*", default=[100])
    parser.add_argument("--hexahedral", type=int, nargs="*", default=[100, 1000])
    parser.add_argument("--modes", type=int, default=200)
    parser.add_argument("--turns", type=int, default=10)
    arguments = parser.parse_args()
    rows = [measure("plane", scenes.plane_block(contacts), arguments.turns) for contacts in arguments.plane]
    rows += [
        measure("hexahedral", scenes.hexahedral_block(contacts, arguments.modes), arguments.turns)
        for contacts in arguments.hexahedral
    ]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
