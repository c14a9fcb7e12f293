"""A plane-stress block on friction contacts: cost of a sweep against the number of contacts.

The block of `scenes.plane_block` is swept through its first stuck resonance at a force that makes part of its contacts
slip.

    .venv/bin/python benchmarks/block.py --contacts 10 30 100 --harmonics 5 > block.json

Prints JSON: for each size the milliseconds a point and a Newton iteration, and the states of the contacts at the peak.
"""

from __future__ import annotations

import argparse
import json
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from mpi4py import MPI
from scenes import plane_block, slip_thresholds, stuck_system

from attrito.library.names import STATES
from attrito.library.session import Options, Solver


def measure(contacts: int, harmonics: int, modes: int, load: float) -> dict:
    """Sweep through the first stuck resonance; times of this rank's wall clock."""
    scene = plane_block(contacts, modes)
    stuck = stuck_system(scene)
    first = stuck.frequencies_hz[0]
    level = load * np.median(slip_thresholds(scene, stuck, first))
    with Solver(MPI.COMM_WORLD, scene, Options(harmonics=harmonics)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, first)
        started = time.perf_counter()
        points = list(solver.sweep(0.8 * first, 1.2 * first, level, 0, 400))
        seconds = time.perf_counter() - started
    iterations = sum(point.iterations for point in points)
    highest = max(points, key=lambda point: point.amplitude[0])
    return {
        "contacts": contacts,
        "coordinates": len(scene.mass),
        "unknowns": 2 * contacts * (2 * harmonics + 1),
        "harmonics": harmonics,
        "load": load,
        "ranks": MPI.COMM_WORLD.size,
        "points": len(points),
        "not_converged": sum(point.outcome == "not_converged" for point in points),
        "iterations": iterations,
        "ms_per_point": 1e3 * seconds / len(points),
        "ms_per_iteration": 1e3 * seconds / iterations if iterations else None,
        "states_at_peak": dict(zip(STATES, highest.states, strict=True)),
    }


def main() -> None:
    """Measure the sizes asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 30, 100])
    parser.add_argument("--harmonics", type=int, default=5)
    parser.add_argument("--modes", type=int, default=10)
    parser.add_argument("--load", type=float, default=1.5, help="force, relative to where half the contacts slip")
    arguments = parser.parse_args()
    rows = [measure(contacts, arguments.harmonics, arguments.modes, arguments.load) for contacts in arguments.contacts]
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
