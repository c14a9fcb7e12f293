"""Cost of an ordinary point of the hexahedral block against contacts, slipping contacts, harmonics and modes.

    .venv/bin/python benchmarks/scaling.py --picture docs/pictures/scaling.png > scaling.json
    .venv/bin/python benchmarks/scaling.py --contacts 30 50 --slipping 3 6 --harmonics 1 3 --modes 40 60 --base 30

A point is ordinary when it is reached from the one before, a fifth of a per cent away in frequency, to and fro at 0.9
of the first stuck frequency. The load grows in steps of a tenth until as many contacts slip as are wanted. Each
quantity is varied with the others held: `--base` contacts, `--wanted` of them slipping, 5 harmonics, 200 modes. Prints
JSON: the processor's seconds a point and a Newton iteration, medians over the points, and exponents of a power of the
quantity, fitted by least squares to the logarithms.
"""

from __future__ import annotations

import argparse
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes

from attrito.library.session import Options

POINTS = 24
SHIFT = 0.002
TO_AND_FRO = (1, 2, 3, 2, 1, 0)
TITLES = {
    "contacts": "contacts",
    "slipping": "slipping contacts",
    "harmonics": "harmonics",
    "modes": "modes of the stuck system",
}


def measure(contacts: int, wanted: int, harmonics: int, modes: int, samples: int) -> dict:
    """Seconds of ordinary points where some `wanted` contacts slip."""
    scene = scenes.hexahedral_block(contacts, modes)
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    median = float(np.median(scenes.slip_thresholds(scene, stuck, frequency)))
    with common.TimedSolver(scene, Options(harmonics=harmonics, samples=samples)) as solver:
        level = climb(solver, frequency, median, wanted)
        asked = solver.solve_at(list(frequency * (1 + SHIFT * np.resize(TO_AND_FRO, POINTS))), level, 0)
        points, seconds = [], np.zeros(POINTS)
        for i in range(POINTS):
            started = time.process_time()
            points.append(next(asked))
            seconds[i] = time.process_time() - started
    iterations = np.array([max(point.iterations, 1) for point in points])
    return {
        "contacts": contacts,
        "slipping": float(np.mean([moving(point) for point in points])),
        "harmonics": harmonics,
        "modes": len(scene.mass),
        "samples": samples,
        "level": level / median,
        "converged": sum(point.outcome == "converged" for point in points),
        "points": POINTS,
        "iterations_a_point": float(np.median(iterations)),
        "seconds_a_point": float(np.median(seconds)),
        "seconds_an_iteration": float(np.median(seconds / iterations)),
    }


def climb(solver: common.TimedSolver, frequency: float, median: float, wanted: int) -> float:
    """Raise the level, from nothing slipping, until enough contacts slip."""
    level = scenes.LEVELS["stuck"] * median
    point = solver.solve_from_static(frequency, level)
    while moving(point) < wanted and level < 20.0 * median:
        level *= 1.1
        point = next(solver.solve_at([frequency], level, 0))
    return level


def moving(point: common.Point) -> int:
    """Contacts that slip or open."""
    return point.states[2] + point.states[3]


def exponent(rows: list[dict], quantity: str, cost: str) -> float:
    """Of the power law through the rows."""
    x, y = (np.log([max(row[name], 1e-12) for row in rows]) for name in (quantity, cost))
    return float(np.polyfit(x, y, 1)[0]) if np.ptp(x) > 0.0 else float("nan")


def draw(series: dict[str, dict], path: str) -> None:
    """Four panels, logarithmic, with the fitted powers."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 2, figsize=(9, 6.5), layout="constrained", sharey=True)
    for axes, (quantity, found) in zip(panels.flat, series.items(), strict=True):
        x = [row[quantity] for row in found["rows"]]
        for cost, label in (("seconds_a_point", "point"), ("seconds_an_iteration", "Newton iteration")):
            y = [row[cost] for row in found["rows"]]
            axes.loglog(x, y, "o-", label=f"{label}: power {found['exponents'][cost]:.1f}")
        axes.set_xticks(x, [f"{value:.0f}" for value in x])
        axes.set_xticks([], minor=True)
        axes.set_xlabel(TITLES[quantity])
        axes.legend(loc="upper left")
        axes.grid(alpha=0.3, which="both")
    for axes in panels[:, 0]:
        axes.set_ylabel("processor time, s")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Vary each quantity."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[50, 100, 200, 400, 800])
    parser.add_argument("--slipping", type=int, nargs="+", default=[5, 10, 20, 40, 80])
    parser.add_argument("--harmonics", type=int, nargs="+", default=[1, 3, 5, 9, 15])
    parser.add_argument("--modes", type=int, nargs="+", default=[100, 200, 400, 800])
    parser.add_argument("--base", type=int, default=100, help="contacts where another quantity is varied")
    parser.add_argument("--wanted", type=int, default=20, help="slipping contacts where another quantity is varied")
    parser.add_argument("--usual-modes", type=int, default=200, help="modes where another quantity is varied")
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--picture", help="file to draw to")
    arguments = parser.parse_args()
    usual = {"contacts": arguments.base, "slipping": arguments.wanted, "harmonics": 5, "modes": arguments.usual_modes}
    series = {}
    for quantity in TITLES:
        rows = []
        for value in getattr(arguments, quantity):
            asked = usual | {quantity: value}
            rows.append(measure(*asked.values(), arguments.samples))
            common.progress(f"{quantity} {value}: {rows[-1]['seconds_a_point']:.3g} s a point")
        fitted = {cost: exponent(rows, quantity, cost) for cost in ("seconds_a_point", "seconds_an_iteration")}
        series[quantity] = {"rows": rows, "exponents": fitted}
    if arguments.picture:
        draw(series, arguments.picture)
    common.report(series)


if __name__ == "__main__":
    main()
