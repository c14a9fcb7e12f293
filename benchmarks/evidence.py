"""Has a point that the balance does not solve a solution? What integration in time from the static solution comes to.

A block that only friction holds need not have an orbit of the excitation's period: it may walk, bounce or take several
periods. Such points are told from those that the solver should have solved.
"""

from __future__ import annotations

import time
from collections import Counter

import numpy as np

from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.reduced_scene import ReducedScene

# What of a march's ends counts as an orbit found, in the solver's disfavour: still approaching one, or repeating but
# for a change a period of less than NEARLY, which neither fades nor goes one way.
FOUND = ("period_one", "settling", "nearly")
NEARLY = 1e-3
SETTLING = 0.05
TOLERANCE = 1e-7
# Periods between two looks, and how much alike steps of a period that far apart are of a motion that walks.
LOOK = 25
ALIKE = 0.01
# Of the period whose amplitude is told: half a step off its peak costs 1e-4 of it.
SAMPLES = 256


def march(scene: ReducedScene, frequency_hz: float, level: float, cycles: int = 400, seconds: float = 20.0) -> dict:
    """Evidence at one point.

    `seconds`: of the processor; a march is looked at every LOOK cycles, later less often, and given up beyond.
    """
    with Integrator(scene) as integrator:
        integrator.start_static(np.array([[0.0], [1.0]]), 10)
        return march_on(integrator, scene, frequency_hz, level, cycles, seconds)[0]


def march_on(
    integrator: Integrator, scene: ReducedScene, frequency_hz: float, level: float, cycles: int, seconds: float
) -> tuple[dict, Orbit]:
    """The same from where the integrator stands, and the last orbit."""
    started, marched, stretch = time.process_time(), 0, LOOK
    steps = [np.zeros(integrator.size)]
    while True:
        stretch = min(stretch, cycles - marched)
        orbit = integrator.run(Run(frequency_hz, level, cycles=stretch, periodicity_tolerance=TOLERANCE, samples=64))
        marched += orbit.cycles
        spent = time.process_time() - started
        steady = orbit.outcome == "converged" or orbit.period > 1
        if not steady:
            one_period = Run(frequency_hz, level, cycles=1, samples=SAMPLES)
            step, amplitude = one_more(integrator, scene, one_period)
            steps.append(step)
        walking = not steady and walks(steps)
        if steady or walking or marched >= cycles or spent > seconds:
            break
        stretch = max(LOOK, min(2 * stretch, int(stretch * (seconds - spent) / max(spent, 1e-3))))
    found = "walks" if walking else verdict(orbit)
    if found == "none" and orbit.defect < NEARLY:
        found = "nearly"
    return {
        "integration": found,
        "period": orbit.period,
        "cycles": marched,
        "defect": orbit.defect,
        "integrated_amplitude": amplitude if walking else float(orbit.amplitude[0]),
        "open_most": float(orbit.open.max()),
        "open_mean": float(orbit.open.mean()),
        "slip_mean": float(orbit.slip.mean()),
        "integration_seconds": spent,
    }, orbit


def one_more(integrator: Integrator, scene: ReducedScene, one_period: Run) -> tuple[np.ndarray, float]:
    """What one more period changes of the displacements, and the first monitor's amplitude but for that."""
    before = integrator.state()[0]
    orbit = integrator.run(one_period)
    step = integrator.state()[0] - before
    swing = orbit.monitors[:, 0] - scene.monitors[0] @ step * (orbit.time - orbit.time[0]) * one_period.frequency_hz
    return step, 0.5 * float(np.ptp(swing))


def walks(steps: list[np.ndarray]) -> bool:
    """Is a period's step what it was LOOK periods or more before, to a hundredth?

    A motion that comes to rest in the end then takes thousands of periods to do so.
    """
    return bool(np.linalg.norm(steps[-1] - steps[-2]) < ALIKE * np.linalg.norm(steps[-1]))


def verdict(orbit: Orbit) -> str:
    """In a word."""
    if orbit.outcome == "converged":
        return "period_one"
    if orbit.period > 1:
        return f"period_{orbit.period}"
    return "settling" if orbit.outcome == "not_converged" and orbit.defect < SETTLING else "none"


def count(solved: int, unsolved: list[dict]) -> dict:
    """How many of the points that were not solved have an orbit of period one, and the share solved of all that do.

    `unsolved`: rows with the evidence of `march`, or without, where it was not asked for.
    """
    marched = [row for row in unsolved if "integration" in row]
    if len(marched) < len(unsolved):
        return {"unsolved": len(unsolved)}
    found = sum(row["integration"] in FOUND for row in marched)
    return {
        "unsolved": len(unsolved),
        "unsolved_with_an_orbit": found,
        "unsolved_without": len(unsolved) - found,
        "share_solved_of_those_with_an_orbit": solved / (solved + found) if solved + found else None,
        "integration": dict(Counter(row["integration"] for row in marched)),
    }
