"""Derivatives by parameters against differences on random scenes, and what they cost.

    .venv/bin/python benchmarks/sensitivities.py --scenes 300 > sensitivities.json
    .venv/bin/python benchmarks/sensitivities.py --contacts 200 > cost.json

Scenes are those of `campaign_scenes.py`, one frequency each, solved to a residual of 1e-13. Of each the derivatives of
all monitors' amplitudes and means, of the contacts' dissipation and of the mean forces of one contact by up to so many
of its parameters, drawn (numbers of contacts' laws, factors on static and harmonic loads, damping, the level), are
compared with extrapolated central differences of solved points that start from the same motion and sliders. An error is
relative to the scene's largest |p dQ/dp| of quantities of a kind: monitors, dissipation, forces. Differences have an
error of their own, that of the extrapolation: what it changes of the difference is printed beside, and scenes whose
differences are not sure to a third of the tolerance are counted apart.

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
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.support.errors import NumericsError

NUMBERS = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# Part of a parameter's scale by which differences move it, and what derivatives are to keep: by events, by samples
STEPS, TOLERANCES = ((1e-3, 1e-4, 1e-5, 1e-6), (1e-6, 1e-7)), (1e-6, 1e-4)
HARMONICS, SAMPLES, RESIDUAL = 5, 128, 1e-13
# Part of the springs' work, and of the largest force, below which there is no dissipation and no force of a contact
NOTHING = 1e-4

# Numbers of damping by its kind, in the order of the library: alpha, beta, ratio, loss factor
DAMPED = {"none": (), "viscous": (0, 1), "ratio": (2,), "mass": (0,), "loss_factor": (3,)}
# Places of quantities of one kind: the dissipation, and mean forces of one contact, are the last
KINDS = {"monitors": slice(0, -4), "dissipation": slice(-4, -3), "forces": slice(-3, None)}

# A contact and one of its law's numbers; a load's number; or the level
Parameter = tuple[str, int]


def parameters_of(scene: ReducedScene) -> list[Parameter]:
    """All that a scene has."""
    numbers = NUMBERS[2:] if scene.damping_kind == "ratio" else NUMBERS
    contacts = [(name, i) for i in range(len(scene.laws["tangents"])) for name in numbers]
    loaded = [h for h in range(1, len(scene.harmonic) // 2 + 1) if np.any(scene.harmonic[2 * h - 1 : 2 * h + 1])]
    return [
        *contacts,
        *(("load", i) for i in range(len(scene.static))),
        *(("harmonic", h) for h in loaded),
        *(("damping", i) for i in DAMPED[scene.damping_kind]),
        ("level", 0),
    ]


def scale_of(scene: ReducedScene, parameter: Parameter) -> float:
    """What a parameter is measured by: itself; gaps and preloads by the largest static force."""
    name, place = parameter
    if name in NUMBERS[:3]:
        return float(scene.laws[name][place])
    if name in ("load", "level", "harmonic"):
        return 1.0
    if name == "damping":
        # Of a matrix the alpha or beta that would be as large.
        if scene.damping is None:
            return scene.damping_value
        return float(np.trace(scene.damping) / np.trace((scene.mass, scene.stiffness)[place]))
    force = max(float(np.abs(scene.static).max()), float(np.abs(scene.laws["preload"]).max()))
    return force if name == "preload" else force / float(scene.laws["normal_stiffness"][place])


def moved(scene: ReducedScene, parameter: Parameter, change: float) -> ReducedScene:
    """The scene with a parameter changed."""
    name, place = parameter
    if name == "level":
        return replace(scene, harmonic=(1.0 + change) * scene.harmonic)
    if name == "harmonic":
        harmonic = scene.harmonic.copy()
        harmonic[2 * place - 1 : 2 * place + 1] *= 1.0 + change
        return replace(scene, harmonic=harmonic)
    if name == "damping":
        if scene.damping is None:
            return replace(scene, damping_value=scene.damping_value + change)
        return replace(scene, damping=scene.damping + change * (scene.mass, scene.stiffness)[place])
    if name == "load":
        static = scene.static.copy()
        static[place] *= 1.0 + change
        return replace(scene, static=static)
    values = scene.laws[name].copy()
    values[place] += change
    return replace(scene, laws=scene.laws | {name: values})


def gradient(
    solver: Solver, scene: ReducedScene, parameters: list[Parameter], contact: int | None = None
) -> np.ndarray | None:
    """Derivatives `[quantities, parameters]` of amplitudes, then of means; of a contact's forces, if one is given.

    Then dissipation of all contacts, mean forces t1, t2, n of this one come last.
    """
    monitors, contacts = np.eye(len(scene.monitors)), len(scene.laws["tangents"])
    family = Family(MPI.COMM_WORLD, solver, contacts, len(monitors))
    quantities = [(kind, unit) for kind in ("amplitude", "mean") for unit in monitors]
    if contact is not None:
        quantities.append(("dissipated_energy", np.ones(contacts)))
        quantities += [(kind, np.eye(contacts)[contact]) for kind in ("t1_mean", "t2_mean", "n_mean")]
    family.ask(Inquiry(quantities, scene, damping=any(name == "damping" for name, _ in parameters)))
    found = family.visit(lambda family: None if family.describe() is None else family.differentiate_by_adjoint())
    if found is None:
        return None

    def column(name: str, place: int) -> np.ndarray:
        others = {"load": found.static_factors, "damping": found.damping}
        if name == "level":
            return found.level
        if name == "harmonic":
            return found.harmonic_factors[:, place - 1]
        return others[name][:, place] if name in others else found.laws[:, place, NUMBERS.index(name)]

    return np.stack([column(*parameter) for parameter in parameters], axis=-1)


def quantities_of(solver: Solver, scene: ReducedScene, contact: int) -> np.ndarray | None:
    """The same quantities at the solver's last point."""
    family = Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), len(scene.monitors))
    member = family.visit(lambda family: family.describe())
    if member is None:
        return None
    motion, work, row = scene.directions @ solver.coordinates(), 0.0, 0
    for tangents, force in zip(scene.laws["tangents"], member.force, strict=True):
        for t in range(tangents):
            cosine, sine = (motion[row + t, first::2] for first in (1, 2))
            harmonics = np.arange(1, len(cosine) + 1)
            work += np.pi * float(harmonics @ (force[t, 1::2] * sine - force[t, 2::2] * cosine))
        row += tangents + 1
    return np.concatenate([member.amplitude, member.monitors[:, 0], [work], member.force[contact, :, 0]])


def follow_loads(solver: Solver, scene: ReducedScene, frequency_hz: float) -> None:
    """Apply the static loads."""
    solver.follow_static_path(np.array([np.zeros(len(scene.static)), np.ones(len(scene.static))]), 10, frequency_hz)


def holding(scene: ReducedScene, held: np.ndarray) -> ReducedScene:
    """The scene with friction that nothing overcomes at contacts `[nc]` that hold their sliders.

    That is what derivatives take; one that is just at its limit would follow a change to one side and not to the other.
    """
    coefficient = np.where(held > 0.0, 1e4, 1.0) * scene.laws["friction_coefficient"]
    return replace(scene, laws=scene.laws | {"friction_coefficient": coefficient})


def solved_beside(scene: ReducedScene, options: Options, start: StoredPoint, contact: int) -> np.ndarray | None:
    """Quantities `[quantities]` at a frequency from a motion and its sliders."""
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        follow_loads(solver, scene, start.frequency_hz)
        solver.set_excitation(start.frequency_hz, start.frequency_hz, 1.0)
        if not solver.start_from(start, 1.0):
            return None
        return quantities_of(solver, scene, contact)


def difference(
    scene: ReducedScene,
    options: Options,
    start: StoredPoint,
    contact: int,
    parameter: Parameter,
    steps: tuple[float, ...],
) -> tuple[np.ndarray, np.ndarray] | None:
    """Extrapolated central differences `[quantities]`, and what that changes of them: of some steps the surest."""
    surest: tuple[np.ndarray, np.ndarray] | None = None
    for step in steps:
        slopes = []
        for reach in (step, 2.0 * step):
            change = reach * scale_of(scene, parameter)
            sides = [solved_beside(moved(scene, parameter, s * change), options, start, contact) for s in (-1.0, 1.0)]
            if sides[0] is None or sides[1] is None:
                break
            slopes.append((sides[1] - sides[0]) / (2.0 * change))
        if len(slopes) < 2:
            continue
        unsure = np.abs(slopes[0] - slopes[1]) / 3.0
        for places in KINDS.values():
            # Points are solved to a tolerance, which the shorter step shows more of.
            solved_to = RESIDUAL * float(np.abs(sides[0][places]).max()) / (step * scale_of(scene, parameter))
            unsure[places] = unsure[places].max() + solved_to
        better = (4.0 * slopes[0] - slopes[1]) / 3.0, unsure
        if surest is None:
            surest = better
        surest = tuple(np.where(unsure < surest[1], new, old) for new, old in zip(better, surest, strict=True))
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
        member = Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), len(scene.monitors)).visit(
            lambda family: family.describe()
        )
        # The one that carries most: forces of one that is open are zero.
        contact = 0 if member is None else int(np.argmax(np.abs(member.force[:, :, 0]).max(axis=1)))
        found = gradient(solver, scene, every, contact)
        coordinates = solver.coordinates()
    if found is None or member is None:
        return row | {"outcome": "no derivatives"}
    start = StoredPoint(frequency, coordinates, member.slider)
    beside = holding(scene, member.free)
    scales = np.array([scale_of(scene, parameter) for parameter in every])
    largest = np.zeros(len(found))
    for places in KINDS.values():
        largest[places] = np.abs(found[places] * scales).max()
    # Where nothing slips dissipation is the rounding of work that springs give back.
    springs = float(np.abs(member.force).max() * np.abs(scene.directions @ coordinates).max())
    for kind, scale in (("dissipation", springs), ("forces", float(np.abs(member.force).max()))):
        largest[KINDS[kind]] = np.maximum(largest[KINDS[kind]], NOTHING * scale)
    errors, unsure = np.zeros((len(chosen), len(found))), np.zeros((len(chosen), len(found)))
    for row_of_errors, place in enumerate(chosen):
        parameter = every[place]
        if parameter[0] == "friction_coefficient" and member.free[parameter[1]] > 0.0:
            result = np.zeros(len(found)), np.zeros(len(found))
        else:
            result = difference(beside, options, start, contact, parameter, STEPS[not by_events])
        if result is None:
            return row | {"outcome": "no difference"}
        errors[row_of_errors] = np.abs(found[:, place] - result[0]) * scales[place]
        unsure[row_of_errors] = result[1] * scales[place]
    with np.errstate(invalid="ignore"):
        errors, unsure = np.nan_to_num(errors / largest), np.nan_to_num(unsure / largest)
    worst = int(np.argmax(errors.max(axis=1)))
    return row | {
        "by": "events" if by_events else "samples",
        "parameters": len(chosen),
        "error": float(errors.max()),
        "unsure": float(unsure.flat[np.argmax(errors)]),
        "errors": {kind: float(errors[:, places].max()) for kind, places in KINDS.items()},
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
