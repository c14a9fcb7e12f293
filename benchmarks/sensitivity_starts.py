"""Points of a random scene where contacts begin to slip or to open, and points that begin at the load path's sliders.

At an onset of slip there are two derivatives, towards smaller and larger parameters; at one of lift-off both are the
same. With `[static] slider = "reset"` points begin at the sliders that the load path leaves, which change with the
parameters.
"""

from __future__ import annotations

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

# The least level at which contacts are taken to stick, and what an onset is found to, a part of the level
LEAST, EXACT = 1e-3, 1e-12
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
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        follow_loads(solver, scene, frequency)
        if not next(solver.solve_at([frequency], 1.0, 0)).is_solved:
            raise NothingFoundError("not solved at an onset")
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
    return looks_of_onset(case, scene, start, free, member.amplitude, sides(*both))


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
    both = {f"{name} lift-off": found for name in SIDES}
    return looks_of_onset(case, scene, start, member.free, member.amplitude, both)


def looks_of_onset(
    case: Case,
    scene: ReducedScene,
    start: StoredPoint,
    free: np.ndarray,
    amplitude: np.ndarray,
    both: dict[str, np.ndarray],
) -> list[Look]:
    """Amplitudes on both sides, derivatives by what the side is called."""
    frequency, quantities = start.frequency_hz, len(amplitude)

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        del higher
        with Solver(MPI.COMM_WORLD, beside, options_of(case)) as solver:
            follow_loads(solver, beside, frequency)
            solver.set_excitation(frequency, frequency, 1.0)
            return member_of(solver, beside).amplitude if solver.start_from(start, 1.0) else None

    # The point is as far from the corner as that was found to.
    least = EXACT * amplitude.max()
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
