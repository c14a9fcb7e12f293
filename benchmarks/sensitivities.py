"""Derivatives by parameters against differences on random scenes, and what they cost.

    .venv/bin/python benchmarks/sensitivities.py --scenes 300 > sensitivities.json
    .venv/bin/python benchmarks/sensitivities.py --contacts 200 > cost.json

Scenes are those of `campaign_scenes.py`, one frequency each, solved to a residual of 1e-13. Of each the derivatives of
all monitors' amplitudes and means by up to so many of its parameters, drawn (numbers of contacts' laws, factors on
static loads, the level), are compared with extrapolated central differences of solved points that start from the same
motion and sliders. An error is relative to the scene's largest |p dA/dp|. Differences have an error of their own, that
of the extrapolation: what it changes of the difference is printed beside, and scenes whose differences are not sure
to a third of the tolerance are counted apart.

Cost: the hexahedral block with so many contacts where half of them slip; seconds of a point from its neighbour, and of
all derivatives of one monitor's amplitude and mean by all its parameters.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import campaign_scenes
import numpy as np
import points
import scenes
from mpi4py import MPI

from attrito.library.derivatives import Inquiry
from attrito.library.family import Family
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver, StoredPoint
from attrito.support.errors import NumericsError

NUMBERS = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# Part of a parameter's scale by which differences move it, and what derivatives are to keep: by events, by samples
STEPS, TOLERANCES = ((1e-3, 1e-4, 1e-5, 1e-6), (1e-6, 1e-7)), (1e-6, 1e-4)
HARMONICS, SAMPLES, RESIDUAL = 5, 128, 1e-13

# A contact and one of its law's numbers; a load's number; or the level
Parameter = tuple[str, int]


def parameters_of(scene: ReducedScene) -> list[Parameter]:
    """All that a scene has."""
    numbers = NUMBERS[2:] if scene.damping_kind == "ratio" else NUMBERS
    contacts = [(name, i) for i in range(len(scene.laws["tangents"])) for name in numbers]
    return [*contacts, *(("load", i) for i in range(len(scene.static))), ("level", 0)]


def scale_of(scene: ReducedScene, parameter: Parameter) -> float:
    """What a parameter is measured by: itself; gaps and preloads by the largest static force."""
    name, place = parameter
    if name in NUMBERS[:3]:
        return float(scene.laws[name][place])
    if name in ("load", "level"):
        return 1.0
    force = max(float(np.abs(scene.static).max()), float(np.abs(scene.laws["preload"]).max()))
    return force if name == "preload" else force / float(scene.laws["normal_stiffness"][place])


def moved(scene: ReducedScene, parameter: Parameter, change: float) -> ReducedScene:
    """The scene with a parameter changed."""
    name, place = parameter
    if name == "level":
        return replace(scene, harmonic=(1.0 + change) * scene.harmonic)
    if name == "load":
        static = scene.static.copy()
        static[place] *= 1.0 + change
        return replace(scene, static=static)
    values = scene.laws[name].copy()
    values[place] += change
    return replace(scene, laws=scene.laws | {name: values})


def gradient(solver: Solver, scene: ReducedScene, parameters: list[Parameter]) -> np.ndarray | None:
    """Derivatives of amplitudes, then of means, `[2, monitors, parameters]`."""
    monitors = len(scene.monitors)
    family = Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), monitors)
    quantities = [(kind, unit) for kind in ("amplitude", "mean") for unit in np.eye(monitors)]
    family.ask(Inquiry(quantities, scene))
    found = family.visit(lambda family: None if family.describe() is None else family.differentiate_by_adjoint())
    if found is None:
        return None
    columns = [
        found.level if name == "level" else found.static_factors[:, place] if name == "load"
        else found.laws[:, place, NUMBERS.index(name)]
        for name, place in parameters
    ]  # fmt: skip
    return np.stack(columns, axis=-1).reshape(2, monitors, -1)


def follow_loads(solver: Solver, scene: ReducedScene, frequency_hz: float) -> None:
    """Apply the static loads."""
    solver.follow_static_path(np.array([np.zeros(len(scene.static)), np.ones(len(scene.static))]), 10, frequency_hz)


def holding(scene: ReducedScene, held: np.ndarray) -> ReducedScene:
    """The scene with friction that nothing overcomes at contacts `[nc]` that hold their sliders.

    That is what derivatives take; one that is just at its limit would follow a change to one side and not to the other.
    """
    coefficient = np.where(held > 0.0, 1e4, 1.0) * scene.laws["friction_coefficient"]
    return replace(scene, laws=scene.laws | {"friction_coefficient": coefficient})


def solved_beside(scene: ReducedScene, options: Options, start: StoredPoint) -> np.ndarray | None:
    """Amplitudes and means `[2, monitors]` at a frequency from a motion and its sliders."""
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        follow_loads(solver, scene, start.frequency_hz)
        solver.set_excitation(start.frequency_hz, start.frequency_hz, 1.0)
        if not solver.start_from(start, 1.0):
            return None
        family = Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), len(scene.monitors))
        member = family.visit(lambda family: family.describe())
    return None if member is None else np.array([member.amplitude, member.monitors[:, 0]])


def difference(
    scene: ReducedScene, options: Options, start: StoredPoint, parameter: Parameter, steps: tuple[float, ...]
) -> tuple[np.ndarray, float] | None:
    """An extrapolated central difference `[2, monitors]`, and what that changes of it: of some steps the surest."""
    surest: tuple[np.ndarray, float] | None = None
    for step in steps:
        slopes = []
        for reach in (step, 2.0 * step):
            change = reach * scale_of(scene, parameter)
            sides = [solved_beside(moved(scene, parameter, side * change), options, start) for side in (-1.0, 1.0)]
            if sides[0] is None or sides[1] is None:
                break
            slopes.append((sides[1] - sides[0]) / (2.0 * change))
        if len(slopes) < 2:
            continue
        # Points are solved to a tolerance, which the shorter step shows more of.
        solved_to = RESIDUAL * float(np.abs(sides[0]).max()) / (step * scale_of(scene, parameter))
        unsure = float(np.abs(slopes[0] - slopes[1]).max() / 3.0) + solved_to
        if surest is None or unsure < surest[1]:
            surest = (4.0 * slopes[0] - slopes[1]) / 3.0, unsure
    return surest


def compare(seed: int, number: int, most: int) -> dict:
    """One scene: the largest error of its derivatives, relative to the largest |p dA/dp|."""
    drawn = campaign_scenes.make(seed, number)
    scene = drawn.reduced
    by_events = drawn.tangents == 1
    random = np.random.default_rng([seed, number, 1])
    frequency = float(random.choice(drawn.frequencies_hz))
    options = Options(
        max(HARMONICS, drawn.loaded_harmonics),
        SAMPLES,
        by_events=by_events,
        tolerance=RESIDUAL,
        integrate_in_time=False,
    )
    row = {"scene": number, "structure": drawn.structure, "frequency_hz": frequency}
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        follow_loads(solver, scene, frequency)
        point = next(solver.solve_at([frequency], 1.0, 0))
        row |= {"outcome": point.outcome, "unique": point.unique, "states": point.states}
        if not point.is_solved:
            return row
        every = parameters_of(scene)
        chosen = sorted(random.choice(len(every), min(most, len(every)), replace=False))
        found = gradient(solver, scene, every)
        member = Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), len(scene.monitors)).visit(
            lambda family: family.describe()
        )
        coordinates = solver.coordinates()
    if found is None or member is None:
        return row | {"outcome": "no derivatives"}
    start = StoredPoint(frequency, coordinates, member.slider)
    beside = holding(scene, member.free)
    errors, unsure = [], []
    largest = float(np.abs(found * [scale_of(scene, parameter) for parameter in every]).max())
    for place in chosen:
        parameter = every[place]
        if parameter[0] == "friction_coefficient" and member.free[parameter[1]] > 0.0:
            result = np.zeros((2, len(scene.monitors))), 0.0
        else:
            result = difference(beside, options, start, parameter, STEPS[not by_events])
        if result is None:
            return row | {"outcome": "no difference"}
        scale = scale_of(scene, parameter)
        errors.append(float(np.abs(found[:, :, place] - result[0]).max() * scale))
        unsure.append(result[1] * scale)
    worst = int(np.argmax(errors))
    return row | {
        "by": "events" if by_events else "samples",
        "parameters": len(chosen),
        "error": errors[worst] / largest,
        "unsure": unsure[worst] / largest,
        "worst": every[chosen[worst]],
    }


def compared(seed: int, number: int, most: int) -> dict:
    """The same; a scene without a static equilibrium says so."""
    try:
        return compare(seed, number, most)
    except NumericsError as error:
        return {"scene": number, "outcome": str(error)}


def summary(rows: list[dict]) -> dict:
    """Of scenes by events and by samples: how many keep the tolerance, where differences are sure and where not."""
    found: dict = {"scenes": len(rows), "without": sum("error" not in row for row in rows)}
    for by, tolerance in zip(("events", "samples"), TOLERANCES, strict=True):
        own = [row for row in rows if row.get("by") == by]
        sure = [row for row in own if row["unsure"] <= tolerance / 3.0]
        found[by] = {
            "compared": len(own),
            "kept": sum(row["error"] <= tolerance for row in own),
            "differences that are sure": len(sure),
            "kept of these": sum(row["error"] <= tolerance for row in sure),
            "median error": float(np.median([row["error"] for row in own])) if own else None,
        }
    return found


def cost(contacts: int, harmonics: int) -> dict:
    """Seconds of a point from its neighbour, and of all derivatives of a monitor there."""
    scene = points.made_once(contacts, 40)
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    level = float(np.median(scenes.slip_thresholds(scene, stuck, frequency)))
    with common.TimedSolver(scene, Options(harmonics=harmonics)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency)
        rows = []
        for i in range(6):
            began = time.perf_counter()
            point = next(solver.solve_at([frequency * (1.0 - 0.002 * i)], level, 0))
            middle = time.perf_counter()
            found = gradient(solver, scene, parameters_of(scene))
            ended = time.perf_counter()
            rows.append(
                {
                    "outcome": point.outcome,
                    "states": point.states,
                    "iterations": point.iterations,
                    "point": middle - began,
                    "derivatives": ended - middle,
                    "finite": found is not None and bool(np.all(np.isfinite(found))),
                }
            )
    ratios = [row["derivatives"] / row["point"] for row in rows[1:]]
    return {
        "contacts": contacts,
        "harmonics": harmonics,
        "parameters": len(parameters_of(scene)),
        "monitors": len(scene.monitors),
        "derivatives over point, median": float(np.median(ratios)),
        "points": rows,
    }


def main() -> None:
    """Scenes, costs, or both, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--parameters", type=int, default=12, help="of a scene, at most")
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--contacts", type=int, nargs="*", default=[])
    parser.add_argument("--harmonics", type=int, default=7)
    options = parser.parse_args()
    found: dict = {}
    if options.scenes:
        numbers = range(options.first, options.first + options.scenes)
        rows = [compared(options.seed, number, options.parameters) for number in numbers]
        found = {"summary": summary(rows), "rows": rows}
    if options.contacts:
        found["cost"] = [cost(contacts, options.harmonics) for contacts in options.contacts]
    print(json.dumps(found, indent=1, default=str))


if __name__ == "__main__":
    main()
