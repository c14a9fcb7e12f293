"""Ordinary points of the hexahedral block: processor time, iterations and memory where many contacts slip.

    .venv/bin/python benchmarks/points.py > points.json
    .venv/bin/python benchmarks/points.py --cases 1000:5:sliding
    mpirun -n 2 .venv/bin/python benchmarks/points.py --cases 1000:5:sliding

A case is contacts:harmonics:level, the level one of `scenes.LEVELS` or a part of the median slip threshold. Static
loads are walked first; a first point at 0.9 of the first stuck frequency follows, then ordinary ones from each
other, a fifth of a per cent apart, away from resonance and back. Prints JSON: for each case and point seconds of the
processor (this rank's), Newton's and GMRES's iterations, states of the contacts and the amplitude of the monitor; the
least and the median of the ordinary points' seconds, wall seconds of all of them, and the most memory held so far, of
the scene's making included.
"""

from __future__ import annotations

import argparse
import resource
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes
from mpi4py import MPI

from attrito.library.points import Point
from attrito.library.session import Options

CASES = ("100:7:sliding", "1000:7:partial", "1000:5:sliding")
SHIFT = 0.002


def measure(contacts: int, harmonics: int, level: str, modes: int, points: int) -> dict:
    """One case."""
    scene = made_once(contacts, modes)
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    median = float(np.median(scenes.slip_thresholds(scene, stuck, frequency)))
    part = scenes.LEVELS.get(level) or float(level)
    away = [frequency * (1.0 - SHIFT * i) for i in range(1, points // 2 + 1)]
    rows = []
    with common.TimedSolver(scene, Options(harmonics=harmonics)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency)
        wall = 0.0
        for target in [frequency, *away, *away[-2::-1], frequency][: points + 1]:
            MPI.COMM_WORLD.Barrier()
            began, started = time.perf_counter(), time.process_time()
            point = next(solver.solve_at([target], part * median, 0))
            rows.append(row_of(point, time.process_time() - started))
            wall += time.perf_counter() - began if len(rows) > 1 else 0.0
    seconds = [row["seconds"] for row in rows[1:]]
    return {
        "contacts": contacts,
        "harmonics": harmonics,
        "modes": modes,
        "ranks": MPI.COMM_WORLD.size,
        "level": part,
        "least_seconds": min(seconds),
        "median_seconds": float(np.median(seconds)),
        "wall_seconds": wall,
        "peak_gigabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "first": rows[0],
        "points": rows[1:],
    }


def made_once(contacts: int, modes: int) -> scenes.ReducedScene:
    """The scene, made by one rank: eigenvectors of a second one would differ by rounding."""
    scene = scenes.hexahedral_block(contacts, modes) if MPI.COMM_WORLD.rank == 0 else None
    return MPI.COMM_WORLD.bcast(scene)


def row_of(point: Point, seconds: float) -> dict:
    """What is told of a point."""
    return {
        "frequency_hz": point.frequency_hz,
        "seconds": seconds,
        "outcome": point.outcome,
        "iterations": point.iterations,
        "linear_iterations": point.linear_iterations,
        "states": common.states(point),
        "amplitude": float(point.amplitude[0]),
    }


def main() -> None:
    """Measure the cases asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", nargs="+", default=CASES, help="contacts:harmonics:level")
    parser.add_argument("--modes", type=int, default=200)
    parser.add_argument("--points", type=int, default=6, help="ordinary ones of each case")
    arguments = parser.parse_args()
    rows = []
    for case in arguments.cases:
        contacts, harmonics, level = case.split(":")
        rows.append(measure(int(contacts), int(harmonics), level, arguments.modes, arguments.points))
        common.progress(f"{case}: {rows[-1]['least_seconds']:.3f} s of the processor a point at the least")
    common.report(rows)


if __name__ == "__main__":
    main()
