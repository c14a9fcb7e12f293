"""Points over force levels, frequencies and contact stiffnesses of a hexahedral block: which are solved, at what cost.

    .venv/bin/python benchmarks/robustness.py > robustness.json
    .venv/bin/python benchmarks/robustness.py --contacts 10 --levels 5 --frequencies 4 --stiffnesses 2e10
    .venv/bin/python benchmarks/robustness.py --contacts 100 --modes 200 --harmonics 7 --parts 0.56 1 1.78 3.16 5.62 \\
        --stiffnesses 6e10 --no-integration

Every level, from a hundredth to a hundred times the one at which half the contacts would slip or the stated parts of it
(`--parts`), and every stiffness starts from the static solution; its frequencies, from 0.8 of the first stuck one to
1.05 of the third, are solved from one to the next, or each from the static solution (`--alone`). What is not solved is
integrated in time: without an orbit of the excitation's period there was nothing to solve. Prints JSON: the share
solved of the points that have one, iterations, the processor's seconds of the hardest point, also relative to the
median of those in which contacts slip, every point, those not solved with what integration found, and the command's own
arguments. Sums are told of all points, of each stiffness and of each level.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import evidence
import numpy as np
import scenes

from attrito.library.session import Options


def measure(contacts: int, stiffness: float, arguments: argparse.Namespace) -> list[dict]:
    """All points of one stiffness."""
    scene = scenes.hexahedral_block(contacts, arguments.modes, stiffness)
    stuck = scenes.stuck_system(scene)
    first, third = stuck.frequencies_hz[[0, 2]]
    median = float(np.median(scenes.slip_thresholds(scene, stuck, 0.9 * first)))
    frequencies = np.linspace(0.8 * first, 1.05 * third, arguments.frequencies)
    rows = []
    with common.TimedSolver(scene, Options(harmonics=arguments.harmonics, samples=arguments.samples)) as solver:
        for part in arguments.parts or np.geomspace(0.01, 100.0, arguments.levels):
            rows += [
                {"stiffness": stiffness, **row} for row in level(solver, frequencies, part, median, arguments.alone)
            ]
            unsolved = [row for row in rows if row["outcome"] != "converged"]
            common.progress(
                f"stiffness {stiffness:g}, level {part:.3g}: {len(unsolved)} of {len(rows)} unsolved so far"
            )
    if arguments.integration:
        for row in unsolved:
            row |= evidence.march(scene, row["frequency_hz"], row["force"], seconds=arguments.seconds)
        common.progress(f"stiffness {stiffness:g}: {Counter(row['integration'] for row in unsolved)}")
    return rows


def level(solver: common.TimedSolver, frequencies: np.ndarray, part: float, median: float, alone: bool) -> list[dict]:
    """The frequencies at one level."""
    solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequencies[0])
    rows = []
    points = solver.solve_at(list(frequencies), part * median, 0)
    for frequency in frequencies:
        if alone:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency)
            points = solver.solve_at([frequency], part * median, 0)
        started = time.process_time()
        point = next(points)
        rows.append(
            {
                "level": float(part),
                "force": float(part * median),
                "frequency_hz": float(frequency),
                "outcome": point.outcome,
                "iterations": point.iterations,
                "seconds": time.process_time() - started,
                "residual": point.residual,
                **common.states(point),
            }
        )
    return rows


def summary(rows: list[dict]) -> dict:
    """Share solved and cost."""
    seconds = np.array([row["seconds"] for row in rows])
    iterations = np.array([row["iterations"] for row in rows])
    solved = np.array([row["outcome"] == "converged" for row in rows])
    moving = np.array([row["slipping"] + row["open"] > 0 for row in rows]) & solved
    median = float(np.median(seconds[moving])) if moving.any() else None
    return {
        "points": len(rows),
        "solved": int(solved.sum()),
        "share_solved": float(solved.mean()),
        **evidence.count(int(solved.sum()), [row for row in rows if row["outcome"] != "converged"]),
        "slipping": int(moving.sum()),
        "iterations_median": float(np.median(iterations)),
        "iterations_99_percent": float(np.quantile(iterations, 0.99)),
        "iterations_most": int(iterations.max()),
        "iterations_median_slipping": float(np.median(iterations[moving])) if moving.any() else None,
        "iterations_99_percent_solved": float(np.quantile(iterations[solved], 0.99)) if solved.any() else None,
        "seconds_median": float(np.median(seconds)),
        "seconds_median_slipping": median,
        "seconds_most": float(seconds.max()),
        "seconds_total": float(seconds.sum()),
        "hardest_to_median_slipping": float(seconds.max() / median) if median else None,
        "above_ten_medians": int((seconds > 10.0 * median).sum()) if median else None,
        "hardest_solved_to_median_slipping": float(seconds[solved].max() / median) if median else None,
    }


def main() -> None:
    """Solve them all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, default=30)
    parser.add_argument("--modes", type=int, default=100)
    parser.add_argument("--harmonics", type=int, default=5)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--levels", type=int, default=20)
    parser.add_argument("--parts", type=float, nargs="+", help="levels as parts of the median threshold")
    parser.add_argument("--frequencies", type=int, default=10)
    parser.add_argument("--stiffnesses", type=float, nargs="+", default=[2e9, 6e9, 2e10, 6e10, 2e11])
    parser.add_argument("--alone", action="store_true", help="every point from the static solution")
    parser.add_argument("--no-integration", dest="integration", action="store_false", help="no integration in time")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the processor, for the integration of a point")
    arguments = parser.parse_args()
    rows = [row for stiffness in arguments.stiffnesses for row in measure(arguments.contacts, stiffness, arguments)]
    common.report(
        {
            "arguments": vars(arguments),
            "summary": summary(rows),
            "by_stiffness": {
                f"{stiffness:.3g}": summary([row for row in rows if row["stiffness"] == stiffness])
                for stiffness in arguments.stiffnesses
            },
            "by_level": {
                f"{part:.3g}": summary([row for row in rows if row["level"] == part])
                for part in sorted({row["level"] for row in rows})
            },
            "points": rows,
            "not_solved": [row for row in rows if row["outcome"] != "converged"],
        }
    )


if __name__ == "__main__":
    main()
