"""Sweeps of plane blocks that only friction holds, up and down, from hardly loaded to sliding: what is followed?

    .venv/bin/python benchmarks/sliding.py --picture out/sliding.png > sliding.json
    .venv/bin/python benchmarks/sliding.py --contacts 10 --parts 0.5 2 --sampled

Levels are parts of the one at which half the contacts would slip at 0.9 of the first stuck frequency; sweeps go from
0.75 to 1.25 of that frequency and back, and are given up after a number of points or of seconds. Prints JSON: for each
sweep points, branches (each a loss of the one before), points without an orbit and points that failed with their
frequency, the largest states, and whether the end was reached; in it, too, the band in which the ways up and down
differ. Points without an orbit, where they begin and end and some between, and all that failed are integrated in time
from the static solution: an orbit that integration comes to would belie the sweep, and a walk must have the amplitude
that the balance has found with its mean held.
"""

from __future__ import annotations

import argparse
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import evidence
import numpy as np
import scenes

from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options

DIFFERENT = 0.05


def sweep(
    solver: common.TimedSolver, start: float, stop: float, level: float, limits: tuple[int, float]
) -> tuple[dict, list[Point]]:
    """One way, from the static solution, for so many points and seconds."""
    solver.follow_static_path(np.array([[0.0], [1.0]]), 10, start)
    started = time.process_time()
    points = []
    for point in solver.sweep(start, stop, level, 0, limits[0]):
        points.append(point)
        if time.process_time() - started > limits[1]:
            break
    seconds = time.process_time() - started
    without = [point for point in points if point.outcome == "no_period_one_orbit"]
    failed = [point for point in points if point.outcome not in ("converged", "no_period_one_orbit")]
    solved = [point for point in points if point.outcome == "converged"]
    frequencies = np.array([point.frequency_hz for point in solved])
    return {
        "from_hz": start,
        "to_hz": stop,
        "points": len(points),
        "last_hz": points[-1].frequency_hz,
        "reached_stop": points[-1].reached_stop,
        "branches": len({point.branch for point in points}),
        "folds": int(np.sum(np.diff(np.sign(np.diff(frequencies))) != 0)) if len(frequencies) > 2 else 0,
        "solved": len(solved),
        "without": len(without),
        "failed": len(failed),
        "without_at": [place(point) for point in without],
        "failed_at": [place(point) for point in failed],
        "most_slipping": max((point.states[2] for point in solved), default=0),
        "most_open": max((point.states[3] for point in solved), default=0),
        "largest_amplitude": max((float(point.amplitude[0]) for point in solved), default=None),
        "iterations": sum(point.iterations for point in points),
        "seconds": seconds,
    }, points


def place(point: Point) -> dict:
    """Of a point that is not solved."""
    return {
        "frequency_hz": point.frequency_hz,
        "branch": point.branch,
        "outcome": point.outcome,
        "amplitude": float(point.amplitude[0]),
        **common.states(point),
    }


def band(up: list[Point], down: list[Point]) -> list[float] | None:
    """Range of frequencies over which both ways are solved and differ by more than a twentieth."""
    curves = []
    for points in (up, down):
        solved = sorted((p.frequency_hz, p.amplitude[0]) for p in points if p.outcome == "converged")
        if len(solved) < 2:
            return None
        curves.append(np.array(solved).T)
    low, high = max(c[0][0] for c in curves), min(c[0][-1] for c in curves)
    if high <= low:
        return None
    grid = np.linspace(low, high, 400)
    a, b = (np.interp(grid, *curve) for curve in curves)
    apart = grid[np.abs(a - b) > DIFFERENT * np.maximum(a, b)]
    return [float(apart[0]), float(apart[-1])] if len(apart) else None


def where_lost(way: dict, points: list[Point], most: int) -> list[dict]:
    """Points that failed and those without an orbit, at most `most` of each, and beyond where a sweep was given up."""
    lost = spread(way["failed_at"], most) + spread(way["without_at"], most)
    if not way["reached_stop"] and points[-1].outcome == "converged":
        width = way["to_hz"] - way["from_hz"]
        lost += [{"frequency_hz": points[-1].frequency_hz + part * width} for part in (0.0, 0.01, 0.03)]
    return lost


def spread(rows: list[dict], most: int) -> list[dict]:
    """At most so many of them, the first and the last among them."""
    return [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))] if rows else []


def gather(scene: ReducedScene, force: float, way: dict, points: list[Point], marching: tuple[int, float]) -> dict:
    """What integration in time finds where a sweep has no orbit."""
    rows = [
        row | evidence.march(scene, row["frequency_hz"], force, seconds=marching[1])
        for row in where_lost(way, points, marching[0])
    ]
    apart = [
        abs(row["integrated_amplitude"] / row["amplitude"] - 1.0)
        for row in rows
        if row["integration"] == "walks" and "amplitude" in row
    ]
    return {
        "evidence": rows,
        "walks_differ_in_amplitude": max(apart, default=None),
        **evidence.count(way["solved"], rows),
    }


def measure(
    contacts: int, parts: list[float], limits: tuple[int, float], marching: tuple[int, float]
) -> tuple[list[dict], list]:
    """Both ways at each level; `marching`: most integrations of a sweep, and seconds for each."""
    scene = scenes.plane_block(contacts)
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    median = float(np.median(scenes.slip_thresholds(scene, stuck, 0.9 * first)))
    rows, curves = [], []
    for part in parts:
        with common.TimedSolver(scene, Options()) as solver:
            up, upward = sweep(solver, 0.75 * first, 1.25 * first, part * median, limits)
            down, downward = sweep(solver, 1.25 * first, 0.75 * first, part * median, limits)
        if marching[0] > 0:
            for way, points in ((up, upward), (down, downward)):
                way |= gather(scene, part * median, way, points, marching)
        ways = {"up": up, "down": down, "apart_hz": band(upward, downward)}
        rows.append({"contacts": contacts, "level": part, "force": part * median, **ways})
        curves.append((contacts, part, upward, downward))
        for name, way in (("up", up), ("down", down)):
            common.progress(
                f"{contacts} contacts, level {part:g}, {name}: {way['solved']} solved, {way['without']} without, "
                f"{way['failed']} failed, stop reached: {way['reached_stop']}, {way['seconds']:.1f} s, "
                f"{way.get('integration')}, amplitudes within {way.get('walks_differ_in_amplitude')}"
            )
    return rows, curves


def draw(curves: list, path: str) -> None:
    """Amplitude over level against frequency, a panel for each number of contacts."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sizes = sorted({curve[0] for curve in curves})
    figure, panels = plt.subplots(1, len(sizes), figsize=(5 * len(sizes), 4.5), layout="constrained", squeeze=False)
    for axes, contacts in zip(panels.flat, sizes, strict=True):
        for i, (_, part, upward, downward) in enumerate(curve for curve in curves if curve[0] == contacts):
            for points, style in ((upward, "-"), (downward, "--")):
                solved = [(p.frequency_hz, p.amplitude[0] / part) for p in points if p.outcome == "converged"]
                if solved:
                    axes.semilogy(*zip(*solved, strict=True), style, color=f"C{i % 10}", label=f"{part:g} {style}")
        axes.set(title=f"{contacts} contacts", xlabel="frequency, Hz", ylabel="amplitude / level")
        axes.legend(fontsize=7, ncol=2)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Sweep the sizes and levels asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 30, 100])
    parser.add_argument("--parts", type=float, nargs="+", default=[0.01, 0.5, 1.0, 1.5, 2.0, 5.0, 20.0, 100.0])
    parser.add_argument("--max-points", type=int, default=300)
    parser.add_argument("--max-seconds", type=float, default=20.0, help="of the processor, for a sweep")
    parser.add_argument("--no-integration", action="store_true", help="no integration in time where branches are lost")
    parser.add_argument("--marches", type=int, default=10, help="points integrated of a sweep, at most")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the processor, for the integration of a point")
    parser.add_argument("--picture", help="file to draw to")
    arguments = parser.parse_args()
    limits = (arguments.max_points, arguments.max_seconds)
    rows, curves = [], []
    for contacts in arguments.contacts:
        marching = (0 if arguments.no_integration else arguments.marches, arguments.seconds)
        found, drawn = measure(contacts, arguments.parts, limits, marching)
        rows += found
        curves += drawn
    if arguments.picture:
        draw(curves, arguments.picture)
    common.report(rows)


if __name__ == "__main__":
    main()
