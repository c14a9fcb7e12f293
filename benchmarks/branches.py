"""Branches that coexist: a block shaken upright that stays down, or bounces at the same force and frequency.

    .venv/bin/python benchmarks/branches.py --picture docs/pictures/branches.png > branches.json

Sweeps up and down at one force, and integration in time along both: each frequency from the steady motion at the one
before. A sweep follows its first branch past its fold to where it is lost, and goes on beyond all that it has come to.
Prints JSON: where contacts of the stuck response would slip and open, where its branch folds, the first point that the
sweep finds beyond the fold, with the parts of the period for which contacts are open, where the branch on which they
lift off ends, and the orbits that integration holds on to.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import evidence
import numpy as np
import scenes
from scipy.optimize import brentq

from attrito.library.integrator import Integrator
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options

STATIC_PATH = np.array([[0.0], [1.0]])


@dataclass(frozen=True)
class Place:
    """A point of a sweep, and the part of the period for which each contact is open there."""

    point: Point
    open: np.ndarray


def sweep(solver: common.TimedSolver, start: float, stop: float, arguments: argparse.Namespace) -> list[Place]:
    """From one end to the other, over all branches on the way."""
    solver.follow_static_path(STATIC_PATH, 10, start)
    started = time.process_time()
    places = []
    for point in solver.sweep(start, stop, arguments.force, 0, arguments.max_points):
        places.append(Place(point, open_parts(solver)))
        if time.process_time() - started > arguments.max_seconds:
            break
    return places


def open_parts(solver: common.TimedSolver) -> np.ndarray:
    """At the last point, of each contact."""
    found = {}
    solver.report_point(lambda path, _, entry: found.update({path: entry}))
    return found["/contacts/open"]


def solved(places: list[Place], beyond: bool) -> list[Place]:
    """Those with a solution on the first branch, or beyond where it was lost."""
    return [place for place in places if place.point.outcome == "converged" and (place.point.branch > 0) == beyond]


def beyond_fold(places: list[Place]) -> dict | None:
    """The first point of another branch at a frequency that the first branch has not reached."""
    way = np.sign(places[-1].point.frequency_hz - places[0].point.frequency_hz)
    reached = max((way * place.point.frequency_hz for place in solved(places, beyond=False)), default=-np.inf)
    found = [place for place in solved(places, beyond=True) if way * place.point.frequency_hz > reached]
    if not found:
        return None
    return {
        "frequency_hz": found[0].point.frequency_hz,
        "amplitude": float(found[0].point.amplitude[0]),
        "open_median": float(np.median(found[0].open)),
        "open_most": float(found[0].open.max()),
        **common.states(found[0].point),
    }


def follow(scene: ReducedScene, frequencies: np.ndarray, arguments: argparse.Namespace) -> list[dict]:
    """Orbits by integration in time, one frequency after another."""
    rows = []
    with Integrator(scene) as integrator:
        integrator.start_static(STATIC_PATH, 10)
        for frequency in frequencies:
            found, _ = evidence.march_on(
                integrator, scene, float(frequency), arguments.force, arguments.cycles, arguments.seconds
            )
            rows.append({"frequency_hz": float(frequency), **found})
            common.progress(f"{frequency:.1f} Hz: {found['integration']}, open {found['open_most']:.2f}")
    return rows


def crossing(threshold: object, force: float, low: float, high: float) -> float | None:
    """Frequency at which the least threshold comes down to the force."""
    if (threshold(low).min() - force) * (threshold(high).min() - force) > 0.0:
        return None
    return float(brentq(lambda f: threshold(f).min() - force, low, high))


def fold(places: list[Place]) -> float:
    """Frequency of the first point of a branch at which it turns, or of the last."""
    frequencies = np.array([place.point.frequency_hz for place in places])
    turned = np.flatnonzero(np.diff(frequencies) * np.sign(frequencies[1] - frequencies[0]) < 0.0)
    return float(frequencies[turned[0] if len(turned) else -1])


def table(places: list[Place]) -> list[dict]:
    """Points as JSON."""
    return [
        {
            "frequency_hz": place.point.frequency_hz,
            "branch": place.point.branch,
            "outcome": place.point.outcome,
            "amplitude": float(place.point.amplitude[0]),
            "estimate": place.point.estimate,
            "open_median": float(np.median(place.open)),
            "open_most": float(place.open.max()),
            **common.states(place.point),
        }
        for place in places
    ]


def draw(up: list[Place], down: list[Place], orbits: dict[str, list[dict]], found: dict, path: str) -> None:
    """Amplitude against frequency: both branches with the state of their contacts, and orbits of integration."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for places, style, label in ((up, "-", "branch from below"), (down, "--", "branch from above")):
        points = [place.point for place in solved(places, beyond=False)]
        frequencies, amplitudes = np.array([(p.frequency_hz, 1e6 * p.amplitude[0]) for p in points]).T
        axes.plot(frequencies, amplitudes, style, color="0.6", zorder=1, label=label)
        stuck = np.array([p.states[0] + p.states[1] == sum(p.states) for p in points])
        every = np.array([p.states[0] + p.states[1] == 0 for p in points])
        for chosen, color, name in (
            (stuck, "C0", "all contacts stick"),
            (~stuck & ~every, "C1", "some slip or open"),
            (every, "C3", "all slip or open"),
        ):
            axes.plot(
                frequencies[chosen], amplitudes[chosen], ".", color=color, ms=5, label=name if places is up else None
            )
    if found["beyond_fold"]:
        axes.plot(
            found["beyond_fold"]["frequency_hz"],
            1e6 * found["beyond_fold"]["amplitude"],
            "*",
            color="C2",
            ms=13,
            label="first point that the sweep up finds beyond the fold",
        )
    for way, marker in (("up", "^"), ("down", "v")):
        for walking, color in ((False, "k"), (True, "C4")):
            rows = [row for row in orbits[way] if row["integration"] == ("walks" if walking else "period_one")]
            if rows:
                axes.plot(
                    [row["frequency_hz"] for row in rows],
                    [1e6 * row["integrated_amplitude"] for row in rows],
                    marker,
                    mfc="none",
                    color=color,
                    ms=7,
                    label=f"integration in time, {way}" + walking * ": walks",
                )
    for name in ("opens_hz", "folds_hz"):
        if found[name]:
            axes.axvline(found[name], color="0.8", lw=0.8, zorder=0)
            axes.text(
                found[name], axes.get_ylim()[0], f" {name[:-3]}", rotation=90, va="bottom", ha="right", color="0.4"
            )
    axes.set(xlabel="frequency, Hz", ylabel="amplitude of the upper corner, um")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Both branches, by sweeps and by integration."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, default=10)
    parser.add_argument("--force", type=float, default=2.0e4)
    parser.add_argument("--damping", type=float, default=0.02, help="ratio")
    parser.add_argument("--harmonics", type=int, default=10)
    parser.add_argument("--range", type=float, nargs=2, default=[1200.0, 1900.0], help="Hz")
    parser.add_argument("--step", type=float, default=10.0, help="between frequencies of integration, Hz; 0: none")
    parser.add_argument("--cycles", type=int, default=400, help="of an integration, at most")
    parser.add_argument("--seconds", type=float, default=4.0, help="of the processor, for an integration")
    parser.add_argument("--max-points", type=int, default=400)
    parser.add_argument("--max-seconds", type=float, default=60.0, help="of the processor, for a sweep")
    parser.add_argument("--picture", help="file to draw to")
    arguments = parser.parse_args()
    low, high = arguments.range
    scene = scenes.bouncing_block(arguments.contacts, damping=arguments.damping)
    with common.TimedSolver(scene, Options(harmonics=arguments.harmonics)) as solver:
        up = sweep(solver, low, high, arguments)
        down = sweep(solver, high, low, arguments)
    stuck = scenes.stuck_system(scene)
    resonance = next(
        f
        for f, mode in zip(stuck.frequencies_hz, stuck.modes.T, strict=True)
        if abs(mode @ scene.harmonic[1]) > 0.1 * np.linalg.norm(stuck.modes.T @ scene.harmonic[1])
    )
    found = {
        "slips_hz": crossing(lambda f: scenes.slip_thresholds(scene, stuck, f), arguments.force, low, resonance),
        "opens_hz": crossing(lambda f: scenes.opening_thresholds(scene, stuck, f), arguments.force, low, resonance),
        "folds_hz": fold(solved(up, beyond=False)),
        "from_below_lost_hz": solved(up, beyond=False)[-1].point.frequency_hz,
        "from_above_lost_hz": solved(down, beyond=False)[-1].point.frequency_hz,
        "beyond_fold": beyond_fold(up),
        "below_lift_off": beyond_fold(down),
        "reached_stop": [up[-1].point.reached_stop, down[-1].point.reached_stop],
    }
    common.progress(str(found))
    orbits = {"up": [], "down": []}
    if arguments.step > 0.0:
        frequencies = np.arange(low, high, arguments.step)
        orbits = {"up": follow(scene, frequencies, arguments), "down": follow(scene, frequencies[::-1], arguments)}
    if arguments.picture:
        draw(up, down, orbits, found, arguments.picture)
    common.report({"arguments": vars(arguments), **found, "up": table(up), "down": table(down), "orbits": orbits})


if __name__ == "__main__":
    main()
