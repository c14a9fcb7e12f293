"""Derivatives by parameters against differences on random scenes, and what they cost.

    .venv/bin/python benchmarks/sensitivities.py --scenes 300 > sensitivities.json
    .venv/bin/python benchmarks/sensitivities.py --contacts 200 > cost.json

Scenes are those of `sensitivity_scenes.py`, solved to a residual of 1e-14, a part of the contacts' vibration, or,
where that is more, to what rounding of their mean motion leaves: 1e-13 of the mean. In each a point, a peak or a
nonlinear mode is looked at (`sensitivity_looks.py`, `sensitivity_peaks.py`), and the natural frequencies of whole
models besides; of points also where a contact begins to slip, and with the load path's sliders
(`sensitivity_starts.py`). Derivatives by all of its parameters, or by so many of them, drawn (numbers of contacts'
laws, factors on static and harmonic loads, damping, a field of gaps, the level; of points the frequency), are
compared with extrapolated central differences of solutions that start from the same motion and sliders. An error is
relative to the scene's largest |p dQ/dp| of quantities of a kind: monitors, dissipation, forces; height, frequency;
damping. Differences have an error of their own, that of the extrapolation and of rounding, which the fourth
difference measures: quantities whose differences are not sure to a third of the tolerance are counted apart, with the
reason.

Cost: the hexahedral block with so many contacts where half of them slip; processor seconds of a point from its
neighbour, and of all derivatives of one monitor's amplitude, and of its amplitude and mean, by all its parameters.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import points
import scenes
from sensitivity_looks import (
    RESIDUAL,
    Look,
    NothingFoundError,
    gradient,
    look_at_mode,
    look_at_natural_frequencies,
    look_at_point,
)
from sensitivity_peaks import look_at_peak
from sensitivity_scenes import BY_FREQUENCY, LOOKS, Case, Parameter, make, moved, parameters_of, scale_of
from sensitivity_starts import look_at_lift_off, look_at_onset, look_at_reset

from attrito.library.names import LAWS, REFERENCES
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options
from attrito.support.errors import NumericsError

# Part of a parameter's scale by which differences move it, and what derivatives are to keep: smooth, bent
STEPS, TOLERANCES = ((1e-3, 1e-2, 1e-4, 1e-5, 1e-6), (1e-6, 1e-7, 1e-5, 1e-3)), (1e-6, 1e-4)
# The same at corners, beside which responses may bend within very little
CORNER_STEPS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
# Of derivatives at corners
CORNER_TOLERANCE = 1e-4
# Differences that are so much surer than need be are not sought with further steps
SURE = 1e-2
# Of this many parameters all are taken
FEW = 16
# Part of a quantity itself that is no derivative
NOTHING = 1e-9
# Quantities where a parameter differs by a part of its scale
At = Callable[[float], "np.ndarray | None"]


def holding(scene: ReducedScene, held: np.ndarray) -> ReducedScene:
    """The scene with friction that nothing overcomes at contacts `[nc]` that hold their sliders.

    That is what derivatives take; one that is just at its limit would follow a change to one side and not to the other.
    Of Iwan's elements some hold their sliders where others slip: these are moved away from their limits instead.
    """
    kinds = scene.laws.get("law", np.zeros(len(held), dtype=int))
    holds = (held > 0.0) & (kinds != LAWS.index("iwan"))
    laws = scene.laws | {"friction_coefficient": np.where(holds, 1e4, 1.0) * scene.laws["friction_coefficient"]}
    if "law_numbers" in laws:
        numbers = laws["law_numbers"].copy()
        by_pressure = holds & (kinds == LAWS.index("pressure"))
        numbers[by_pressure, 2::2] *= 1e4
        laws["law_numbers"] = numbers
    return replace(scene, laws=laws)


def difference(
    look: Look,
    scene: ReducedScene,
    here: np.ndarray,
    parameter: Parameter,
    scale: float,
    steps: tuple[float, ...],
    enough: np.ndarray,
) -> tuple[np.ndarray, ...] | None:
    """Extrapolated differences `[quantities]`, what that changes of them, and the part of that by rounding.

    Of some steps the surest, until that is less than `enough`; at corners the shortest that rounding allows, as longer
    ones agree among themselves where the response bends within less. `here`: the quantities in the scene itself.
    """

    def at(part: float) -> np.ndarray | None:
        change = part * scale
        return look.at(scene, change) if parameter == BY_FREQUENCY else look.at(moved(scene, parameter, change), 0.0)

    surest: tuple[np.ndarray, ...] | None = None
    for step in steps:
        better = one_sided(at, here, look, step) if look.side else central(at, here, look, step)
        if better is None:
            continue
        better = tuple(part / scale for part in better)
        if look.side and surest is not None and np.any(better[2] > enough / (3.0 * SURE)):
            break
        if surest is None or look.side:
            surest = better
            continue
        keep = better[1] < surest[1]
        surest = tuple(np.where(keep, new, old) for new, old in zip(better, surest, strict=True))
        if np.all(surest[1] <= enough):
            break
    return surest


def central(at: At, here: np.ndarray, look: Look, step: float) -> tuple[np.ndarray, ...] | None:
    """By a part of the parameter, from four values beside the one here."""
    values = [at(part * step) for part in (-2.0, -1.0, 1.0, 2.0)]
    if any(value is None for value in values):
        return None
    far_below, below, above, far_above = values
    slopes = (above - below) / (2.0 * step), (far_above - far_below) / (4.0 * step)
    # Where values differ by rounding alone their fourth difference is some sqrt(70) times that.
    noise = np.abs(far_below - 4.0 * below + 6.0 * here - 4.0 * above + far_above) / 8.0
    return (4.0 * slopes[0] - slopes[1]) / 3.0, *doubts(look, here, np.abs(slopes[0] - slopes[1]) / 3.0, noise, step)


def one_sided(at: At, here: np.ndarray, look: Look, step: float) -> tuple[np.ndarray, ...] | None:
    """The same of f(0) + a h + b h^(3/2) + c h^2 + ..., h on one side: 2 q(h / 4) - q(h) of quotients has no b."""
    parts = look.side * step / 4.0 ** np.arange(4)
    values = [at(float(part)) for part in parts]
    if any(value is None for value in values):
        return None
    first = np.array([(value - here) / part for value, part in zip(values, parts, strict=True)])
    second = 2.0 * first[1:] - first[:-1]
    third = (4.0 * second[1:] - second[:-1]) / 3.0
    # Where steps are too long for that form neither order agrees with the other, though neighbours may by chance.
    unsure = np.maximum(np.abs(third[1] - third[0]), np.abs(third[1] - second[2]))
    return third[1], *doubts(look, here, unsure, np.zeros_like(here), abs(float(parts[-1])))


def doubts(
    look: Look, here: np.ndarray, unsure: np.ndarray, noise: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """How unsure quantities are of a kind, all like the worst of it, and the part of that by rounding."""
    unsure, rounding = unsure.copy(), np.zeros_like(unsure)
    for places in look.kinds.values():
        # Solutions are found to a tolerance, which a shorter step shows more of.
        size = np.maximum(RESIDUAL * np.abs(here[places]).max(), np.broadcast_to(look.least, unsure.shape)[places])
        rounding[places] = np.maximum(size, noise[places].max()) / step
        unsure[places] = unsure[places].max() + rounding[places]
    return unsure, rounding


def compare(
    look: Look, case: Case, every: list[Parameter], chosen: list[int], steps: tuple[float, ...], tolerance: float
) -> dict[str, dict]:
    """By kinds of quantities: the largest error, relative to the largest |p dQ/dp|, and how unsure differences are.

    By the frequency derivatives are relative to their own largest, too: near a resonance that is far larger.
    """
    own_scene = case.scene if look.scene is None else look.scene
    scene = holding(own_scene, look.free)
    kinds = own_scene.laws.get("law", np.zeros(len(look.free), dtype=int))
    scales = np.array([look.frequency_hz if one == BY_FREQUENCY else scale_of(own_scene, one) for one in every])
    own = np.nan_to_num(np.abs(look.found * scales))
    there = look.at(scene, 0.0)
    if there is None:
        raise NothingFoundError("not found again from itself")
    largest = np.zeros(len(look.found))
    for places in look.kinds.values():
        largest[places] = own[places][:, [one != BY_FREQUENCY for one in every]].max()
        # What is less than a billionth of the quantities themselves is nothing.
        largest[places] = np.maximum(largest[places], NOTHING * np.abs(there[places]).max())
    largest = np.maximum(largest, look.floor)
    rows: dict[str, list] = {kind: [] for kind in look.kinds}
    for place in chosen:
        parameter, scale = every[place], scales[place]
        size = largest
        if parameter == BY_FREQUENCY:
            size = np.maximum(largest, own[:, place])
        is_friction = parameter[0] == "friction_coefficient" or parameter[0].startswith("law_numbers")
        if is_friction and look.free[parameter[1]] > 0.0 and kinds[parameter[1]] != LAWS.index("iwan"):
            # Differences have another friction coefficient there: nothing changes.
            result = (np.zeros(len(look.found)),) * 3
        else:
            result = difference(look, scene, there, parameter, scale, steps, SURE * tolerance * size / scale)
        for kind, places in look.kinds.items():
            if result is None:
                rows[kind].append((parameter, np.nan, np.inf, np.inf))
                continue
            with np.errstate(invalid="ignore", divide="ignore"):
                error = np.abs(look.found[places, place] - result[0][places]) * scale / size[places]
                unsure, rounding = (part[places] * scale / size[places] for part in result[1:])
            error = np.where(np.isnan(look.found[places, place]), np.nan, np.nan_to_num(error))
            worst = int(np.argmax(np.nan_to_num(error)))
            rows[kind].append((parameter, error[worst], np.nan_to_num(unsure)[worst], np.nan_to_num(rounding)[worst]))
    return {kind: worst_of(found, tolerance) for kind, found in rows.items()}


def worst_of(rows: list, tolerance: float) -> dict:
    """Of one kind of quantity by all parameters that were compared."""
    known = [row for row in rows if np.isfinite(row[1])]
    sure = [row for row in known if row[2] <= tolerance / 3.0]
    worst = max(sure, key=lambda row: row[1], default=None)
    unsure = [row for row in known if row[2] > tolerance / 3.0]
    reasons = ["rounding" if row[3] > 0.5 * row[2] else "corners or curvature" for row in unsure]
    return {
        "parameters": len(rows),
        "without": len(rows) - len(known),
        "sure": len(sure),
        "error": None if worst is None else float(worst[1]),
        "worst": None if worst is None else worst[0],
        "unsure": sorted(
            ((row[0], float(row[1]), float(row[2]), why) for row, why in zip(unsure, reasons, strict=True)),
            key=lambda row: -row[1],
        )[:4],
        "unsure within": sum(bool(row[1] <= tolerance) for row in unsure),
        "unsure count": len(unsure),
        "reasons": {why: reasons.count(why) for why in set(reasons)},
    }


def compared(seed: int, number: int, most: int, looks_at: tuple[str, ...] = tuple(LOOKS)) -> Iterator[dict]:
    """One scene: what was looked at, then natural frequencies; a scene without them says why."""
    case = make(seed, number)
    if case.look not in looks_at:
        return
    random = np.random.default_rng([seed, number, 2])
    looks = {"point": look_at_point, "peak": look_at_peak, "mode": look_at_mode}
    by = 0 if case.is_smooth else 1
    labels = {"scene": number, "kinds": case.kinds, "by": ("smooth", "bent")[by]}

    def row(look: Callable[[list[Parameter]], Look | list[Look]], every: list[Parameter], how: int) -> dict:
        few = len(every) if len(every) <= max(FEW, most) and most >= FEW - 4 else most
        chosen = sorted(random.choice(len(every), min(few, len(every)), replace=False).tolist())
        if BY_FREQUENCY in every:
            chosen = sorted({*chosen, every.index(BY_FREQUENCY)})
        began, found = time.process_time(), {}
        try:
            there = look(every)
            for one in there if isinstance(there, list) else [there]:
                tolerance = CORNER_TOLERANCE if one.corner else TOLERANCES[how]
                steps = CORNER_STEPS if one.side else STEPS[how]
                rows = compare(one, case, every, chosen, steps, tolerance)
                found |= {kind: row | ({"beside": one.beside} if one.beside else {}) for kind, row in rows.items()}
        except (NumericsError, NothingFoundError) as error:
            return {"outcome": str(error)}
        return {"found": found, "seconds": time.process_time() - began}

    every = parameters_of(case.scene)
    if case.look == "point":
        every.append(BY_FREQUENCY)
    if case.look == "mode":
        every = [parameter for parameter in every if parameter[0] not in ("level", "harmonic")]
    yield labels | {"look": case.look} | row(lambda every: looks[case.look](case, random, every), every, by)
    if case.look == "point":
        every.remove(BY_FREQUENCY)
        others = {"onset of slip": look_at_onset, "onset of lift-off": look_at_lift_off, "reset": look_at_reset}
        for name, other in others.items():
            random = np.random.default_rng([seed, number, 3])
            yield labels | {"look": name} | row(lambda every: other(case, random, every), every, by)  # noqa: B023
    random = np.random.default_rng([seed, number, 4])
    springs = [parameter for parameter in every if parameter[0].endswith("_stiffness")]
    if case.scene.sector is None and springs:
        state = str(random.choice(REFERENCES))
        found = row(lambda every: look_at_natural_frequencies(case.scene, every, state), springs, 0)
        yield labels | {"look": "natural frequencies", "by": "smooth"} | found


def summary(rows: list[dict]) -> dict:
    """Of what was looked at, smooth or bent, and by kinds of quantities: how many keep the tolerance."""
    found: dict = {"scenes": len({row["scene"] for row in rows}), "without": {}}
    for row in rows:
        if "found" not in row:
            key = f"{row['look']}: {row['outcome'].splitlines()[0][:60]}"
            found["without"][key] = found["without"].get(key, 0) + 1
    for by, tolerance in zip(("smooth", "bent"), TOLERANCES, strict=True):
        own = [row for row in rows if row["by"] == by and "found" in row]
        found[by] = {}
        for look in sorted({row["look"] for row in own}):
            of_look = [row["found"] for row in own if row["look"] == look]
            found[by][look] = {"scenes": len(of_look)}
            for kind in dict.fromkeys(kind for row in of_look for kind in row):
                limit = CORNER_TOLERANCE if "corner" in kind else tolerance
                found[by][look][kind] = tally([row[kind] for row in of_look if kind in row], limit)
    return found


def tally(rows: list[dict], tolerance: float) -> dict:
    """Of one kind of quantity in all scenes."""
    errors = [row["error"] for row in rows if row["error"] is not None]
    return {
        "derivatives": sum(row["parameters"] - row["without"] for row in rows),
        "sure": sum(row["sure"] for row in rows),
        "scenes that keep it": sum(error <= tolerance for error in errors),
        "of scenes with sure ones": len(errors),
        "median of scenes' largest": float(np.median(errors)) if errors else None,
        "largest": max(errors, default=None),
        "unsure": sum(row["unsure count"] for row in rows),
        "of these within": sum(row["unsure within"] for row in rows),
        "reasons": {why: sum(row["reasons"].get(why, 0) for row in rows) for row in rows for why in row["reasons"]},
    }


def cost(contacts: int, harmonics: int) -> dict:
    """Processor seconds of a point from its neighbour, and of all derivatives of a monitor there."""
    scene = points.made_once(contacts, 40)
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    level = float(np.median(scenes.slip_thresholds(scene, stuck, frequency)))
    with common.TimedSolver(scene, Options(harmonics=harmonics)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency)
        rows = []
        for i in range(12):
            began = time.process_time()
            point = next(solver.solve_at([frequency * (1.0 - 0.002 * i)], level, 0))
            middle = time.process_time()
            gradient(solver, scene, parameters_of(scene), amplitudes_alone=True)
            later = time.process_time()
            found = gradient(solver, scene, parameters_of(scene))
            ended = time.process_time()
            rows.append(
                {
                    "outcome": point.outcome,
                    "states": point.states,
                    "iterations": point.iterations,
                    "point": middle - began,
                    "of the amplitude": later - middle,
                    "of amplitude and mean": ended - later,
                    "finite": found is not None and bool(np.all(np.isfinite(found))),
                }
            )
    kinds = "of the amplitude", "of amplitude and mean"
    return {
        "contacts": contacts,
        "harmonics": harmonics,
        "parameters": len(parameters_of(scene)),
        "monitors": len(scene.monitors),
        "derivatives over point, median": {
            kind: float(np.median([row[kind] / row["point"] for row in rows[1:]])) for kind in kinds
        },
        "points": rows,
    }


def main() -> None:
    """Scenes, costs, or both, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--parameters", type=int, default=12, help="of a scene with many")
    parser.add_argument("--looks", nargs="*", choices=list(LOOKS), default=list(LOOKS), help="scenes of these alone")
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--contacts", type=int, nargs="*", default=[])
    parser.add_argument("--harmonics", type=int, default=7)
    options = parser.parse_args()
    found: dict = {}
    if options.scenes:
        numbers = range(options.first, options.first + options.scenes)
        rows = []
        for number in numbers:
            for row in compared(options.seed, number, options.parameters, tuple(options.looks)):
                rows.append(row)
                print(json.dumps(row, default=str), file=sys.stderr, flush=True)
        found = {"summary": summary(rows), "rows": rows}
    if options.contacts:
        found["cost"] = [cost(contacts, options.harmonics) for contacts in options.contacts]
    print(json.dumps(found, indent=1, default=str))


if __name__ == "__main__":
    main()
