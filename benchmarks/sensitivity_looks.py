"""What is looked at in a random scene, a point or mode: its derivatives, and its quantities in a scene beside.

Each begins from the motion and the sliders of the scene itself; modes go on from the state of the mode. Points are
looked at by the frequency, too: peaks (`sensitivity_peaks.py`) count on that derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import common  # noqa: F401  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI
from sensitivity_scenes import BY_FREQUENCY, Case, Parameter, column_of, contact_motion

from attrito.library.derivatives import LAW_NUMBERS, Inquiry, Rates
from attrito.library.family import Family, Member
from attrito.library.names import LAWS
from attrito.library.points import LinearModes, StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.library.structures import omega
from attrito.modes import tracker as mode_tracker
from attrito.modes.frequency_slopes import REPEATED, frequency_slopes, spring_rates
from attrito.modes.mode_point import ModePoint
from attrito.modes.mode_slopes import shape_slopes

NUMBERS = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# What points are solved to, and what is taken for known of them
SOLVED_TO, RESIDUAL = 1e-14, 1e-13
# Part of the springs' work, and of the largest force, below which there is no dissipation and no force of a contact
NOTHING = 1e-4
# How often sliders of Iwan's elements are moved away from their ends, and by how much more at most each time
MOST_MOVES, FARTHEST = 60, 1e8
# Modes begin at this part of the amplitude of the point that they are looked for at
FIRST = 0.3
# In a scene beside, at a frequency higher by so many Hz
Beside = Callable[[ReducedScene, float], "np.ndarray | None"]


class NothingFoundError(Exception):
    """There is no such thing in this scene; says why."""


@dataclass(frozen=True)
class Look:
    """What was found in a scene.

    Parameters
    ----------
    found : derivatives `[quantities, parameters]`
    kinds : places of the quantities of one kind, errors being relative to the largest of it
    floor : least size of quantities of a kind, `[quantities]`
    least : what solutions are found to, of quantities that are not known to a part of themselves, `[quantities]`
    frequency_hz : of a point
    side : -1 or 1 where derivatives are those towards smaller or larger parameters, else 0
    corner : whether it is a corner, whose derivatives are those of two branches
    scene : where that is another one than the case's
    at : the quantities in a scene beside, None where there is none
    free : which contacts hold their sliders `[nc]`
    beside : of an onset of lift-off, by parts of the level, how far gradients beside are from those found
    """

    found: np.ndarray
    kinds: dict[str, slice]
    floor: np.ndarray
    at: Beside
    free: np.ndarray
    least: np.ndarray | float = 0.0
    frequency_hz: float = 0.0
    side: int = 0
    corner: bool = False
    scene: ReducedScene | None = None
    beside: dict[str, float] | None = None


def options_of(case: Case) -> Options:
    """Of the balance."""
    return Options(case.harmonics, tolerance=SOLVED_TO, integrate_in_time=False)


def follow_loads(solver: Solver, scene: ReducedScene, frequency_hz: float) -> None:
    """Apply the static loads."""
    solver.follow_static_path(np.array([np.zeros(len(scene.static)), np.ones(len(scene.static))]), 10, frequency_hz)


def family_of(solver: Solver, scene: ReducedScene) -> Family:
    """The family of a solver's point."""
    return Family(MPI.COMM_WORLD, solver, len(scene.laws["tangents"]), len(scene.monitors))


def member_of(solver: Solver, scene: ReducedScene) -> Member:
    """What the solver's point is."""
    member = family_of(solver, scene).visit(lambda family: family.describe())
    if member is None:
        raise NothingFoundError("no derivatives")
    return member


def inquiry_of(scene: ReducedScene, parameters: list[Parameter], contact: int | None) -> Inquiry:
    """Amplitudes, then means; then dissipation of all contacts, mean forces t1, t2, n of one, if it is given."""
    monitors, contacts = np.eye(len(scene.monitors)), len(scene.laws["tangents"])
    quantities = [(kind, unit) for kind in ("amplitude", "mean") for unit in monitors]
    if contact is not None:
        quantities.append(("dissipated_energy", np.ones(contacts)))
        quantities += [(kind, np.eye(contacts)[contact]) for kind in ("t1_mean", "t2_mean", "n_mean")]
    return Inquiry(
        quantities,
        scene,
        numbers=any(name.startswith("law_numbers") for name, _ in parameters),
        damping=any(name == "damping" for name, _ in parameters),
    )


def rates_of(scene: ReducedScene, parameters: list[Parameter], rates: Rates) -> Rates:
    """What parameters change, in rates of nothing."""
    for i, (name, place) in enumerate(parameters):
        if (name, place) == BY_FREQUENCY:
            continue
        if name == "level":
            rates.level[i] = 1.0
        elif name == "gap field":
            rates.laws[i, :, NUMBERS.index("gap")] = scene.laws["gap"]
        elif name.startswith("law_numbers"):
            rates.laws[i, place, LAW_NUMBERS + column_of(name)] = 1.0
        elif name in NUMBERS:
            rates.laws[i, place, NUMBERS.index(name)] = 1.0
        else:
            array = {"load": rates.static_factors, "harmonic": rates.harmonic_factors, "damping": rates.damping}[name]
            array[i, place - (name == "harmonic")] = 1.0
    return rates


def gradient(
    solver: Solver,
    scene: ReducedScene,
    parameters: list[Parameter],
    contact: int | None = None,
    amplitudes_alone: bool = False,
) -> np.ndarray | None:
    """Derivatives `[quantities, parameters]` of the quantities of `inquiry_of`: by the adjoint, of sectors directly.

    By the frequency as along the response.
    """
    family, inquiry = family_of(solver, scene), inquiry_of(scene, parameters, contact)
    if amplitudes_alone:
        inquiry = replace(inquiry, quantities=inquiry.quantities[: len(scene.monitors)])
    family.ask(inquiry)
    rates = rates_of(scene, parameters, inquiry.zeros(solver, len(parameters)))

    def work(family: Family) -> np.ndarray | None:
        if family.describe() is None:
            return None
        found = family.differentiate_along(rates, scene.sector is None)
        if found is not None and BY_FREQUENCY in parameters:
            found[:, parameters.index(BY_FREQUENCY)] = family.differentiate_by_frequency()
        return found

    return family.visit(work)


def quantities_of(solver: Solver, scene: ReducedScene, contact: int) -> np.ndarray:
    """The same quantities at the solver's last point."""
    member = member_of(solver, scene)
    motion, work, row = contact_motion(scene, solver.coordinates()), 0.0, 0
    for tangents, force in zip(scene.laws["tangents"], member.force, strict=True):
        for t in range(tangents):
            cosine, sine = (motion[row + t, first::2] for first in (1, 2))
            harmonics = np.arange(1, len(cosine) + 1)
            work += np.pi * float(harmonics @ (force[t, 1::2] * sine - force[t, 2::2] * cosine))
        row += tangents + 1
    return np.concatenate([member.amplitude, member.monitors[:, 0], [work], member.force[contact, :, 0]])


def kinds_of(scene: ReducedScene, before: int = 0) -> dict[str, slice]:
    """Places of these quantities, so many others coming before."""
    monitors = before + 2 * len(scene.monitors)
    return {
        "monitors": slice(before, monitors),
        "dissipation": slice(monitors, monitors + 1),
        "forces": slice(monitors + 1, monitors + 4),
    }


def floor_of(scene: ReducedScene, member: Member, coordinates: np.ndarray) -> np.ndarray:
    """Where nothing slips dissipation is the rounding of work that springs give back; `[quantities]`."""
    force = float(np.abs(member.force).max())
    springs = force * float(np.abs(contact_motion(scene, coordinates)).max())
    return NOTHING * np.array([0.0] * (2 * len(scene.monitors)) + [springs] + [force] * 3)


def most_loaded(member: Member) -> int:
    """Forces of a contact that is open are zero: the one that carries most."""
    return int(np.argmax(np.abs(member.force[:, :, 0]).max(axis=1)))


def solved_point(solver: Solver, case: Case, frequency_hz: float) -> StoredPoint:
    """A point, sliders of Iwan's elements that hold them being away from where they would begin to slip."""
    scene = case.scene
    follow_loads(solver, scene, frequency_hz)
    point = next(solver.solve_at([frequency_hz], 1.0, 0))
    if not point.is_solved:
        raise NothingFoundError(point.outcome)
    return inside_point(solver, scene, frequency_hz)


def inside_point(solver: Solver, scene: ReducedScene, frequency_hz: float) -> StoredPoint:
    """The solver's point, or one beside it with sliders that are away from their ends."""
    slider = member_of(solver, scene).slider
    if "law" in scene.laws and np.any(scene.laws["law"] == LAWS.index("iwan")):
        # Stiff contacts carry their sliders' move along: what that leaves of it says by how much more they are moved.
        factor, before = 1.0, 0.0
        for _ in range(MOST_MOVES):
            missing = away_from_ends(scene, solver.coordinates(), slider) - slider
            left = float(np.abs(missing).max())
            if left == 0.0:
                break
            if 0.0 < left < before:
                factor = float(np.clip(factor * before / (before - left), 1.0, FARTHEST))
            elif before > 0.0:
                factor = max(1.0, 0.5 * factor)
            before = left
            moved = StoredPoint(frequency_hz, solver.coordinates(), slider + factor * missing)
            if not solver.start_from(moved, 1.0):
                raise NothingFoundError("no member with sliders away from their ends")
            slider = member_of(solver, scene).slider
        else:
            raise NothingFoundError("sliders of Iwan's elements stay at their ends")
    return StoredPoint(frequency_hz, solver.coordinates(), slider)


def away_from_ends(scene: ReducedScene, coordinates: np.ndarray, slider: np.ndarray) -> np.ndarray:
    """Sliders of Iwan's elements that never slip between 0.1 and 0.9 of where they may rest, `[nc, width]`.

    In pairs, one an element.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, 2048, endpoint=False)
    harmonics = np.arange(1, coordinates.shape[1] // 2 + 1)
    basis = np.empty((coordinates.shape[1], len(angles)))
    basis[0], basis[1::2], basis[2::2] = 1.0, np.cos(np.outer(harmonics, angles)), np.sin(np.outer(harmonics, angles))
    motion = contact_motion(scene, coordinates) @ basis
    found, laws = slider.copy(), scene.laws
    for i, kind in enumerate(laws["law"]):
        if LAWS[kind] != "iwan":
            continue
        # One tangent: two rows a contact
        u, v = motion[2 * i], motion[2 * i + 1]
        normal = np.maximum(laws["preload"][i] + laws["normal_stiffness"][i] * (v - laws["gap"][i]), 0.0)
        for element, (share, part) in enumerate(iwan_elements(*laws["law_numbers"][i, :3])):
            reach = part * laws["friction_coefficient"][i] * normal / (share * laws["tangential_stiffness"][i])
            low, high = float((u - reach).max()), float((u + reach).min())
            if low < high:
                ends = low + np.array([0.1, 0.9]) * (high - low)
                found[i, 2 * element] = np.clip(slider[i, 2 * element], *ends)
    return found


def iwan_elements(chi: float, beta: float, count: float) -> list[tuple[float, float]]:
    """Parts of K_T and F_S of each element, as `src/contact/law/iwan.f90` says."""
    cells = int(count) - 1
    x = np.concatenate([[0.0], np.exp(-1.5 / np.sqrt(cells) * (cells - np.arange(1, cells + 1)))])
    slip = 1.0 + beta * (chi + 2.0) / (chi + 1.0)
    stiffness, force = np.diff(x ** (chi + 1.0)) / (1.0 + beta), np.diff(x ** (chi + 2.0)) / slip
    return [*zip(stiffness.tolist(), force.tolist(), strict=True), (beta / (1.0 + beta), (slip - 1.0) / slip)]


def look_at_point(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> Look:
    """A point at one of the frequencies."""
    scene, options = case.scene, options_of(case)
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        start = solved_point(solver, case, float(random.choice(case.frequencies_hz)))
        member = member_of(solver, scene)
        contact = most_loaded(member)
        found = gradient(solver, scene, parameters, contact)
    if found is None:
        raise NothingFoundError("singular")

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        there = replace(start, frequency_hz=start.frequency_hz + higher)
        with Solver(MPI.COMM_WORLD, beside, options) as solver:
            follow_loads(solver, beside, there.frequency_hz)
            solver.set_excitation(there.frequency_hz, there.frequency_hz, 1.0)
            return quantities_of(solver, beside, contact) if solver.start_from(there, 1.0) else None

    floor = floor_of(scene, member, start.coordinates)
    return Look(found, kinds_of(scene), floor, at, member.free, RESIDUAL / NOTHING * floor, start.frequency_hz)


def look_at_mode(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> Look:
    """The first tangent mode at an amplitude that it reaches in a point."""
    scene, options = case.scene, options_of(case)
    mode_tracker.AMPLITUDE_TOLERANCE = 1e-13
    frequencies = sorted(case.frequencies_hz, reverse=True)
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        amplitude = random.uniform(0.3, 1.0) * largest_amplitude(solver, scene, frequencies)
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        modes, tracker, closed = tangent_mode(solver, scene)
        for part in (FIRST, 1.0):
            one = tracker.at(part * amplitude)
            if not one.converged:
                raise NothingFoundError("no mode")
        state, known = solver.save_state(), tracker.save_state()
        member, coordinates = member_of(solver, scene), solver.coordinates()
        if "law" in scene.laws and np.any(scene.laws["law"] == LAWS.index("iwan")):
            # Derivatives hold those that rest at an end; differences push them with numbers that change to one side.
            missing = away_from_ends(scene, coordinates, member.slider) - member.slider
            if np.any(np.abs(missing) > 0.0):
                raise NothingFoundError("sliders of Iwan's elements are at their ends")
        contact = most_loaded(member)
        found = mode_gradient(solver, scene, parameters, contact, modes, closed, one)
    if found is None:
        raise NothingFoundError("singular")

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        del higher
        with Solver(MPI.COMM_WORLD, beside, options) as solver:
            _, tracker, _ = tangent_mode(solver, beside)
            tracker.prepare()
            if not solver.load_state(state):
                return None
            tracker.load_state(known)
            # The state is that of the scene itself: from there Newton's method would find its residual small enough.
            for part in (1.0 + 1e-4, 1.0):
                one = tracker.at(part * amplitude)
                if not one.converged:
                    return None
            ratio = one.drive["excitation"] / (2.0 * omega(one.point.frequency_hz))
            own = [one.point.frequency_hz, ratio, one.structural_ratio]
            return np.array([*own, *quantities_of(solver, beside, contact)])

    kinds = {"frequency": slice(0, 1), "damping": slice(1, 3)} | kinds_of(scene, 3)
    floor = np.concatenate([[0.0, 0.0, 0.0], floor_of(scene, member, coordinates)])
    # Residuals are relative to the whole motion of the contacts, of which the vibration may be a small part. A damping
    # ratio is a part of it.
    motion = contact_motion(scene, coordinates)
    part = max(1.0, float(np.abs(motion[:, 0]).max()) / float(np.abs(motion[:, 1:]).max()))
    least = RESIDUAL / NOTHING * floor
    least[:3] = RESIDUAL * part * np.array([one.point.frequency_hz, 1.0, 1.0])
    return Look(found, kinds, floor, at, member.free, least)


def largest_amplitude(solver: Solver, scene: ReducedScene, frequencies: list[float]) -> float:
    """Q of the first tangent mode in the largest of some points."""
    follow_loads(solver, scene, frequencies[0])
    modes = solver.linear_modes("tangent", len(scene.mass))
    weight, found = scene.mass @ modes.shapes[modes.rigid], 0.0
    for point in solver.solve_at(frequencies, 1.0, 0):
        if point.is_solved:
            motion = solver.coordinates()
            found = max(found, float(abs(weight @ (motion[:, 1] - 1j * motion[:, 2]))))
    if not found > 0.0:
        raise NothingFoundError("no point")
    return found


def tangent_mode(solver: Solver, scene: ReducedScene) -> tuple[LinearModes, mode_tracker.ModeTracker, np.ndarray]:
    """All tangent modes, what follows the first elastic one, and which contacts touch at rest."""
    follow_loads(solver, scene, 1.0)
    modes = solver.linear_modes("tangent", len(scene.mass))
    first, closed = modes.rigid, solver.closed_contacts().astype(float)
    own = slice(first, first + 1)
    return modes, mode_tracker.ModeTracker(solver, scene, modes.shapes[own], modes.natural_hz[first]), closed


def mode_gradient(
    solver: Solver,
    scene: ReducedScene,
    parameters: list[Parameter],
    contact: int,
    modes: LinearModes,
    closed: np.ndarray,
    one: ModePoint,
) -> np.ndarray | None:
    """Of frequency, xi/(2 omega), the structure's ratio, then of a point's quantities, `[quantities, parameters]`."""
    family, inquiry = family_of(solver, scene), inquiry_of(scene, parameters, contact)
    family.ask(inquiry)
    rates = rates_of(scene, parameters, inquiry.zeros(solver, len(parameters)))
    springs = spring_rates(scene.laws["tangents"], rates.laws, "tangent", closed)
    weight = scene.mass @ modes.shapes[modes.rigid]
    motion = solver.coordinates()
    first = motion[:, 1] - 1j * motion[:, 2]
    amplitude = weight @ first
    turned = shape_slopes(modes, modes.rigid, scene.directions, springs) @ scene.mass
    own = np.real(amplitude.conj() * (turned @ first)) / abs(amplitude)

    def work(family: Family) -> tuple[np.ndarray, np.ndarray] | None:
        return None if family.describe() is None else family.differentiate_mode(rates, weight + 0j, own)

    found = family.visit(work)
    if found is None:
        return None
    (frequency, excitation, structure), quantities = found
    speed = omega(one.point.frequency_hz)
    ratio = excitation / (2.0 * speed) - one.drive["excitation"] * omega(1.0) * frequency / (2.0 * speed**2)
    return np.vstack([frequency, ratio, structure, quantities])


def look_at_natural_frequencies(scene: ReducedScene, parameters: list[Parameter], state: str) -> Look:
    """Of all modes in a state of the contacts."""

    def solved(beside: ReducedScene) -> tuple[LinearModes, np.ndarray]:
        with Solver(MPI.COMM_WORLD, beside, Options(1, 64)) as solver:
            follow_loads(solver, beside, 1.0)
            return solver.linear_modes(state, len(scene.mass)), solver.closed_contacts().astype(float)

    modes, closed = solved(scene)
    # Frequencies that are repeated part, the other way round on the other side: their mean does not.
    first = np.diff(modes.natural_hz[modes.rigid :], prepend=0.0) > REPEATED * modes.natural_hz[modes.rigid :]
    group = np.cumsum(first) - 1
    mean = (np.arange(group[-1] + 1)[:, np.newaxis] == group) / np.bincount(group)[:, np.newaxis]
    laws = np.zeros((len(parameters), len(scene.laws["tangents"]), LAW_NUMBERS))
    for i, (name, place) in enumerate(parameters):
        laws[i, place, NUMBERS.index(name)] = 1.0
    found = frequency_slopes(modes, scene.directions, spring_rates(scene.laws["tangents"], laws, state, closed))
    elastic = slice(modes.rigid, None)
    return Look(
        mean @ found[elastic],
        {"natural frequencies": slice(0, len(mean))},
        np.zeros(len(mean)),
        lambda beside, higher: mean @ solved(beside)[0].natural_hz[elastic],
        np.zeros(len(scene.laws["tangents"])),
    )
