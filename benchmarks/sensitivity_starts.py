"""Points of a random scene where contacts begin to slip or to open, and points that begin at the load path's sliders.

At an onset of slip there are two derivatives, towards smaller and larger parameters; at one of lift-off both are the
same. With `[static] slider = "reset"` points begin at the sliders that the load path leaves, which change with the
parameters.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import common  # noqa: F401  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI
from sensitivity_looks import (
    RESIDUAL,
    Look,
    NothingFoundError,
    family_of,
    follow_loads,
    gradient,
    inquiry_of,
    inside_point,
    member_of,
    options_of,
    rates_of,
)
from sensitivity_scenes import Case, Parameter, contact_motion, moved, scale_of

from attrito.library.family import Family
from attrito.library.names import LAWS
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.runs.onsets import SIDES, branches, find_onset, margin_of, sides

# Processor seconds that an onset is looked for
LONGEST = 60.0
# The least level at which contacts are taken to stick, and what an onset is found to, a part of the level
LEAST, EXACT = 1e-3, 1e-12
# With two tangents: secants towards an onset, how much they stay short of it, and what parts of friction are found to
MOST_SECANTS, SHORT_OF, PART_EXACT = 12, 1e-3, 1e-4
# Parts of the level beside an onset of lift-off at which gradients are compared with those there
BESIDE = (1e-4, 1e-6, 1e-8, 1e-10)
# Part of the amplitude by which it jumps, if it changes by so much within the last of these
JUMP = 1e-4
# Of the period at which normal forces are looked at
INSTANTS = 4096
# Part of a parameter for the change of sliders by the load path, as of a job
STEP = 1e-4


def look_at_onset(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> list[Look]:
    """The point of a level at which one contact more begins to slip."""
    frequency = float(random.choice(case.frequencies_hz))
    if "law" in case.scene.laws and np.any(case.scene.laws["law"] != LAWS.index("coulomb")):
        raise NothingFoundError("onsets of slip of other laws than Coulomb's are not examined")
    scene = at_onset(case, frequency, lambda solver: member_of(solver, case.scene).free > 0.0)
    options, quantities = options_of(case), len(scene.monitors)
    sliders_move = bool(np.any(scene.laws["tangents"] == 2))
    first = None
    if sliders_move:
        scene, first = nearer_onset(case, scene, frequency)
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        solve_or_start(solver, scene, frequency, 1.0, first)
        member, family = member_of(solver, scene), family_of(solver, scene)
        start = StoredPoint(frequency, solver.coordinates(), member.slider)
        onset = family.visit(lambda family: find_onset(family, margin_of(sliders_move)))
        if onset is None:
            raise NothingFoundError("a contact that opens begins to slip")
        inquiry = inquiry_of(scene, parameters, None)
        inquiry = replace(inquiry, quantities=[*inquiry.quantities[:quantities], onset.dissipation])
        family.ask(inquiry)
        rates = rates_of(scene, parameters, inquiry.zeros(solver, len(parameters)))

        def find(family: Family) -> np.ndarray | None:
            return None if family.describe() is None else family.differentiate_directly(rates)

        both = family.visit(lambda family: branches(family, onset, find, sliders_move))
    if both is None:
        raise NothingFoundError("singular")

    free = np.where(onset.contacts > 0.0, 0.0, member.free)
    exact = 10.0 * EXACT if sliders_move else EXACT
    return looks_of_onset(case, scene, start, free, member.amplitude, sides(*both), exact)


def nearer_onset(case: Case, scene: ReducedScene, frequency_hz: float) -> tuple[ReducedScene, StoredPoint]:
    """The scene with loads nearer the onset of slip of contacts with two tangents, and the point there.

    Where places to rest are nearly gone solutions that slip by what they are solved to pass, too, so that the pattern
    of contacts ends early. The part of friction by which they stick is linear in the level near its zero, for points
    that each start from the first.
    """
    start: StoredPoint | None = None
    levels, parts = [1.0], []
    for _ in range(MOST_SECANTS):
        with Solver(MPI.COMM_WORLD, scene, options_of(case)) as solver:
            solve_or_start(solver, scene, frequency_hz, levels[-1], start)
            if start is None:
                start = StoredPoint(frequency_hz, solver.coordinates(), member_of(solver, scene).slider)
            parts.append(part_missing(family_of(solver, scene)))
            start_there = StoredPoint(frequency_hz, solver.coordinates(), member_of(solver, scene).slider)
        if parts[-1] <= 10.0 * EXACT:
            return replace(scene, harmonic=levels[-1] * scene.harmonic), start_there
        if len(levels) == 1:
            levels.append(1.0 + parts[0])
            continue
        slope = (parts[-2] - parts[-1]) / (levels[-1] - levels[-2])
        if slope <= 0.0:
            break
        # A little less, so that contacts go on to stick
        levels.append(levels[-1] + (1.0 - SHORT_OF) * parts[-1] / slope)
    raise NothingFoundError("sliders with two tangents: the onset is not found to rounding")


def solve_or_start(
    solver: Solver, scene: ReducedScene, frequency_hz: float, level: float, start: StoredPoint | None
) -> None:
    """A point under static loads, from another one if that is given."""
    follow_loads(solver, scene, frequency_hz)
    if start is None:
        found = next(solver.solve_at([frequency_hz], level, 0)).is_solved
    else:
        solver.set_excitation(frequency_hz, frequency_hz, level)
        found = solver.start_from(start, level)
    if not found:
        raise NothingFoundError("not solved at an onset")


def part_missing(family: Family) -> float:
    """The least part of friction within which a contact begins to slip."""

    def work(family: Family) -> float:
        low, high = 0.1 * EXACT, 1.0
        while high > (1.0 + PART_EXACT) * low:
            middle = float(np.sqrt(low * high))
            begins = family.find_onsets(middle)
            low, high = (low, middle) if begins is not None and np.any(begins) else (middle, high)
        return high

    return float(family.visit(work))  # type: ignore[arg-type]


def look_at_lift_off(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> list[Look]:
    """The point of a level at which one contact more begins to open."""
    frequency = float(random.choice(case.frequencies_hz))
    scene = at_onset(case, frequency, lambda solver: least_normal_forces(solver, case.scene) > 0.0)
    with Solver(MPI.COMM_WORLD, scene, options_of(case)) as solver:
        follow_loads(solver, scene, frequency)
        if not next(solver.solve_at([frequency], 1.0, 0)).is_solved:
            raise NothingFoundError("not solved at an onset")
        start, member = inside_point(solver, scene, frequency), member_of(solver, scene)
        found = gradient(solver, scene, parameters, amplitudes_alone=True)
        if found is None:
            raise NothingFoundError("singular")
        beside = gradients_beside(solver, scene, parameters, start, found)
    both = {f"{name} lift-off": found for name in SIDES}
    # The slope itself does not jump: where the onset is matters little.
    looks = looks_of_onset(case, scene, start, member.free, member.amplitude, both, RESIDUAL)
    return [replace(look, beside=beside) for look in looks]


def gradients_beside(
    solver: Solver, scene: ReducedScene, parameters: list[Parameter], start: StoredPoint, found: np.ndarray
) -> dict[str, float]:
    """How far gradients at higher and lower levels are from those found, largest relative to the largest |p dA/dp|.

    They tend to them as the root of the change, though differences of solutions are lost in rounding before that.
    """
    amplitude = member_of(solver, scene).amplitude
    scales = np.array([scale_of(scene, parameter) for parameter in parameters])
    largest, rows = np.abs(found * scales).max(), {}
    for part in BESIDE:
        rows[f"{part:.0e}"] = np.nan
        for level in (1.0 - part, 1.0 + part):
            solver.set_excitation(start.frequency_hz, start.frequency_hz, level)
            if not solver.start_from(start, level):
                continue
            moved = np.abs(member_of(solver, scene).amplitude - amplitude).max()
            if part == BESIDE[-1] and moved > JUMP * amplitude.max():
                raise NothingFoundError("the response jumps where a contact begins to open")
            there = gradient(solver, scene, parameters, amplitudes_alone=True)
            if there is not None:
                # By loads' factors, the level and so on at another level: as small as the change itself.
                error = float(np.abs((there - found) * scales).max() / largest)
                rows[f"{part:.0e}"] = float(np.fmax(rows[f"{part:.0e}"], error))
    return rows


def looks_of_onset(
    case: Case,
    scene: ReducedScene,
    start: StoredPoint,
    free: np.ndarray,
    amplitude: np.ndarray,
    both: dict[str, np.ndarray],
    exact: float,
) -> list[Look]:
    """Amplitudes on both sides, derivatives by what the side is called; the corner is found to a part of the level."""
    frequency, quantities = start.frequency_hz, len(amplitude)

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        del higher
        with Solver(MPI.COMM_WORLD, beside, options_of(case)) as solver:
            follow_loads(solver, beside, frequency)
            solver.set_excitation(frequency, frequency, 1.0)
            return member_of(solver, beside).amplitude if solver.start_from(start, 1.0) else None

    least = exact * amplitude.max()
    return [
        Look(
            found,
            {f"amplitudes {name}": slice(0, quantities)},
            np.zeros(quantities),
            at,
            free,
            least,
            side=side,
            corner=True,
            scene=scene,
        )
        for side, (name, found) in zip((-1, 1), both.items(), strict=True)
    ]


def least_normal_forces(solver: Solver, scene: ReducedScene) -> np.ndarray:
    """The least of N_p + k_n (v - gap) over the period, `[nc]`, below zero where a contact opens."""
    motion, laws = contact_motion(scene, solver.coordinates()), scene.laws
    rows = motion[np.cumsum(laws["tangents"] + 1) - 1]
    angles = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    harmonics = np.arange(1, motion.shape[1] // 2 + 1)
    swings = rows[:, 1::2] @ np.cos(np.outer(harmonics, angles)) + rows[:, 2::2] @ np.sin(np.outer(harmonics, angles))
    lowest = np.argmin(swings, axis=1)
    before, least, after = (swings[np.arange(len(rows)), (lowest + shift) % INSTANTS] for shift in (-1, 0, 1))
    # The parabola through three instants
    bend = np.maximum(before - 2.0 * least + after, np.finfo(float).tiny)
    least = least - (after - before) ** 2 / (8.0 * bend)
    return np.asarray(laws["preload"] + laws["normal_stiffness"] * (rows[:, 0] + least - laws["gap"]))


def at_onset(case: Case, frequency_hz: float, pattern: Callable[[Solver], np.ndarray]) -> ReducedScene:
    """The scene with harmonic loads up to which a pattern of contacts is what it is at small ones."""
    scene = case.scene

    def found(level: float) -> np.ndarray | None:
        with Solver(MPI.COMM_WORLD, scene, options_of(case)) as solver:
            follow_loads(solver, scene, frequency_hz)
            solved = next(solver.solve_at([frequency_hz], level, 0)).is_solved
            return pattern(solver) if solved else None

    began = time.process_time()
    low, high = LEAST, 1.0
    first = found(low)
    if first is None or not np.any(first):
        raise NothingFoundError("no contact does so at small loads")
    last = found(high)
    if last is not None and np.array_equal(first, last):
        raise NothingFoundError("no onset")
    while high - low > EXACT * high:
        middle = 0.5 * (low + high)
        there = found(middle)
        if time.process_time() - began > LONGEST:
            raise NothingFoundError("no onset within a minute")
        low, high = (middle, high) if there is not None and np.array_equal(first, there) else (low, middle)
    if found(high) is None:
        raise NothingFoundError("not solved beyond")
    return replace(scene, harmonic=low * scene.harmonic)


def look_at_reset(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> Look:
    """A point that begins at the sliders of the load path."""
    scene, options = case.scene, replace(options_of(case), reset_slider=True)
    frequency, quantities = float(random.choice(case.frequencies_hz)), 2 * len(scene.monitors)
    rates_of_sliders = np.array([slider_rates(case, parameter, frequency) for parameter in parameters])
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        follow_loads(solver, scene, frequency)
        point = next(solver.solve_at([frequency], 1.0, 0))
        if not point.is_solved:
            raise NothingFoundError(point.outcome)
        family, inquiry = family_of(solver, scene), replace(inquiry_of(scene, parameters, None), sliders=True)
        family.ask(inquiry)
        rates = rates_of(scene, parameters, inquiry.zeros(solver, len(parameters)))
        rates.laws[:, :, -solver.slider_width :] = rates_of_sliders

        def work(family: Family) -> np.ndarray | None:
            return None if family.describe() is None else family.differentiate_directly(rates)

        found, coordinates = family.visit(work), solver.coordinates()
    if found is None:
        raise NothingFoundError("singular")

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        del higher
        with Solver(MPI.COMM_WORLD, beside, options) as solver:
            follow_loads(solver, beside, frequency)
            slider = member_of(solver, beside).slider
            solver.set_excitation(frequency, frequency, 1.0)
            if not solver.start_from(StoredPoint(frequency, coordinates, slider), 1.0):
                return None
            member = member_of(solver, beside)
            return np.concatenate([member.amplitude, member.monitors[:, 0]])

    kinds = {"monitors": slice(0, quantities)}
    return Look(found, kinds, np.zeros(quantities), at, np.zeros(len(scene.laws["tangents"])))


def slider_rates(case: Case, parameter: Parameter, frequency_hz: float) -> np.ndarray:
    """Change of the sliders that the load path leaves, `[nc, width]`, by extrapolated central differences."""
    scale, slopes = scale_of(case.scene, parameter), []
    for step in (STEP, 2.0 * STEP):
        ends = []
        for side in (-1.0, 1.0):
            scene = moved(case.scene, parameter, side * step * scale)
            with Solver(MPI.COMM_WORLD, scene, replace(options_of(case), tolerance=RESIDUAL)) as solver:
                follow_loads(solver, scene, frequency_hz)
                ends.append(member_of(solver, scene).slider)
        slopes.append((ends[1] - ends[0]) / (2.0 * step * scale))
    return np.asarray((4.0 * slopes[0] - slopes[1]) / 3.0)
