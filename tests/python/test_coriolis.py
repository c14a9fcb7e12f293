"""Coriolis forces on one sector of a wheel, given by a matrix: against the wheel assembled whole, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cyclic_scenes import random_sector
from mpi4py import MPI
from multipliers import HILL, MONODROMY, examined, farthest
from scipy.linalg import eig, eigh

from attrito.library.integrator import Integrator, Run
from attrito.library.points import StoredPoint
from attrito.library.session import Options, Solver
from attrito.modes.families import families_of
from attrito.scene.wheel import wave_in_wheel, whole_wheel

EVERY = 10_000


def turning_sector(seed, sectors, engine_order, tangents=1, strength=0.5, **more):
    """A random sector with a random skew matrix; natural frequencies are 0.1 to 1 Hz, and its forces some tenths."""
    scene = random_sector(seed, sectors, engine_order, tangents=tangents, **more)
    mixed = np.random.default_rng(1000 + seed).uniform(-1.0, 1.0, scene.mass.shape)
    return replace(scene, gyroscopic=np.ascontiguousarray(strength * (mixed - mixed.T)))


def solver_of(scene, harmonics=5):
    options = Options(harmonics=harmonics, tolerance=1e-13)
    solver = Solver(MPI.COMM_SELF, scene, options)
    solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.15)
    return solver


def stuck_stiffness(scene):
    """K with every contact stuck."""
    laws, springs = scene.laws, []
    for i, tangents in enumerate(laws["tangents"]):
        springs += [laws["tangential_stiffness"][i]] * tangents + [laws["normal_stiffness"][i]]
    return scene.stiffness + scene.directions.T @ (np.array(springs)[:, None] * scene.directions)


def dense_response(wheel, hz):
    """Coefficients of the monitors of a wheel whose contacts stick, by a dense solve at each harmonic, without mean."""
    stiffness = stuck_stiffness(wheel)
    found = np.zeros((len(wheel.monitors), len(wheel.harmonic)))
    for h in range(1, (len(wheel.harmonic) + 1) // 2):
        omega = 2.0 * np.pi * h * hz
        damping = wheel.damping_value * wheel.mass + wheel.gyroscopic
        force = wheel.harmonic[2 * h - 1] - 1j * wheel.harmonic[2 * h]
        motion = wheel.monitors @ np.linalg.solve(stiffness - omega**2 * wheel.mass + 1j * omega * damping, force)
        found[:, 2 * h - 1], found[:, 2 * h] = motion.real, -motion.imag
    return found


@pytest.mark.parametrize(("order", "axis_nodes"), [(2, 0), (-2, 0), (1, 1), (0, 0)])
def test_contacts_that_stick_leave_the_linear_response_of_the_wheel(order, axis_nodes):
    scene = turning_sector(3, 5, order, axis_nodes=axis_nodes)
    scene = replace(scene, laws=scene.laws | {"friction_coefficient": np.full(2, 1e3), "preload": np.full(2, 1e3)})
    with solver_of(scene, harmonics=2) as solver:
        (point,) = solver.solve_at([0.15], 1.0, 0)
    assert point.is_solved and point.states[0] == 2
    expected = dense_response(whole_wheel(scene), 0.15)
    # Rounding times the condition of Z, some 1e3.
    assert point.harmonics[:, 1:5] == pytest.approx(expected[:, 1:], rel=1e-11, abs=1e-12)


@pytest.mark.parametrize(("order", "tangents"), [(2, 1), (-2, 1), (1, 2), (3, 1)])
def test_a_sector_slips_as_the_whole_wheel_does(order, tangents):
    scene = turning_sector(7, 5, order, tangents)
    frequencies = [0.12, 0.15, 0.2]
    with solver_of(scene, tangents) as solver:
        points, motions = [], []
        for point in solver.solve_at(frequencies, 1.0, 0):
            points.append(point)
            motions.append(solver.coordinates())
    assert all(point.is_solved and point.states[2] + point.states[3] > 0 for point in points), "nothing slips"
    with solver_of(whole_wheel(scene), tangents) as solver:
        solver.set_excitation(0.1, 0.25, 1.0)
        for point, motion in zip(points, motions, strict=True):
            wave = wave_in_wheel(motion, scene.sector)
            assert solver.start_from(StoredPoint(point.frequency_hz, wave, np.zeros((10, 2))), 1.0)
            found = solver.coordinates()
            # Residuals of 1e-13 times the condition of the balance.
            assert np.abs(found - wave).max() < 1e-9 * np.abs(wave).max()


def test_forward_and_backward_waves_differ():
    found = []
    for order in (2, -2):
        with solver_of(turning_sector(7, 5, order)) as solver:
            found += [point.amplitude for point in solver.solve_at([0.15], 1.0, 0)]
    assert np.abs(found[0] / found[1] - 1.0).max() > 0.05


def gyroscopic_hz(stiffness, mass, gyroscopic):
    """Natural frequencies above zero, ascending, by the eigenvalues of a matrix that knows nothing of symmetry."""
    n = len(mass)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -gyroscopic]])
    values = eig(companion, np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), mass]]), right=False)
    return np.sort(values.imag[values.imag > 0.0]) / (2.0 * np.pi)


@pytest.mark.parametrize(("sectors", "axis_nodes"), [(1, 0), (2, 0), (3, 1), (5, 1), (6, 0)])
def test_modes_of_waves_both_ways_are_those_of_the_wheel(sectors, axis_nodes):
    scene = turning_sector(1, sectors, 1, axis_nodes=axis_nodes)
    with solver_of(scene) as solver:
        families = families_of(solver, "stuck", EVERY)
    ways = {n % sectors for n in range(sectors)}
    assert {family.diameter % sectors for family in families} == ways and len(families) == len(ways)
    found = np.sort(np.concatenate([family.modes.natural_hz for family in families]))
    wheel = whole_wheel(scene)
    expected = gyroscopic_hz(stuck_stiffness(wheel), wheel.mass, wheel.gyroscopic)
    # Rounding of 1e-16 times the condition of the matrices, some 1e4.
    assert found == pytest.approx(expected, rel=1e-10)
    if sectors > 2:
        split = families[1].modes.natural_hz - families[2].modes.natural_hz
        assert np.abs(split / families[1].modes.natural_hz).max() > 0.01


def test_where_all_contacts_stick_both_engines_have_the_multipliers_of_the_linear_wheel():
    scene = turning_sector(3, 4, 1, strength=0.2)
    scene = replace(scene, laws=scene.laws | {"friction_coefficient": np.full(2, 1e3), "preload": np.full(2, 1e3)})
    with solver_of(scene) as solver:
        (point,) = solver.solve_at([0.15], 1.0, 0)
        assert point.is_solved and point.states[0] == 2
        verdict, reason, _, found = examined(solver, MONODROMY | HILL)
    # Stable but for contacts that stick: a neutral multiplier each.
    assert "differ" not in reason, (verdict, reason)
    hill = found[HILL][0]
    flow = found[MONODROMY][0][np.abs(found[MONODROMY][0]) > 0.011]
    assert farthest(hill[np.abs(hill) > 0.011], flow) < 1e-8
    for value, wave in zip(*found[HILL][:2], strict=True):
        same = np.abs(found[MONODROMY][0] - value) < 1e-8
        assert wave in found[MONODROMY][1][same]


@pytest.mark.parametrize("kind", ["mass", "ratio", "viscous"])
def test_damping_ratios_are_those_of_the_wheel_to_first_order_in_the_damping(kind):
    """Against the real parts of the wheel's exponents; what is left is of the third order in the damping, 1e-4 here."""
    scene = turning_sector(1, 4, 1)
    viscous = np.ascontiguousarray(1e-4 * scene.mass + 2e-5 * scene.stiffness)
    scene = replace(scene, damping_kind=kind, damping_value=1e-4, damping=viscous if kind == "viscous" else None)
    with solver_of(scene) as solver:
        families = families_of(solver, "stuck", EVERY)
    wheel = whole_wheel(scene)
    n, stiffness = len(wheel.mass), stuck_stiffness(wheel)
    damping = {"mass": 1e-4 * wheel.mass, "viscous": wheel.damping}.get(kind)
    if damping is None:
        squares, shapes = eigh(stiffness, wheel.mass)
        damping = wheel.mass @ shapes @ np.diag(2e-4 * np.sqrt(squares)) @ shapes.T @ wheel.mass
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -wheel.gyroscopic - damping]])
    values = eig(companion, np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), wheel.mass]]), right=False)
    values = values[values.imag > 0.0]
    hz = np.concatenate([family.modes.natural_hz for family in families])
    ratios = np.concatenate([family.modes.damping_ratio for family in families])
    nearest = np.abs(2.0 * np.pi * hz[:, None] - values.imag).argmin(axis=1)
    assert len(set(nearest)) == len(values)
    assert ratios == pytest.approx(-values.real[nearest] / np.abs(values[nearest]), rel=1e-5)


def test_what_contacts_leave_free_moves_round_circles_at_twice_the_speed():
    """Masses in axes that turn at Omega, held by contacts that slide freely: of two motions across one is at rest.

    Contacts press along the second coordinate with the spring k: m x'' = 2 Omega m y', m y'' + k y = -2 Omega m x'.
    """
    mass, omega, spring = 2.0, 3.0, 5.0
    turn = 2.0 * omega * mass * np.array([[0.0, -1.0], [1.0, 0.0]])
    scene = random_sector(0, 4, 1, boundary=False, inside=2)
    rows = np.array([[1.0, 0.0], [0.0, 1.0]])
    laws = {name: values[:1] for name, values in scene.laws.items()} | {"normal_stiffness": np.array([spring])}
    scene = replace(
        scene,
        mass=mass * np.eye(2),
        stiffness=np.zeros((2, 2)),
        gyroscopic=np.ascontiguousarray(turn),
        laws=laws,
        directions=rows,
        static=np.zeros((1, 2)),
        sector=replace(scene.sector, next_directions=np.zeros((2, 2))),
    )
    with solver_of(scene) as solver:
        families = families_of(solver, "frictionless", EVERY)
    for family in families:
        assert family.modes.rigid == 1 and family.modes.natural_hz[0] == 0.0
        expected = np.sqrt(spring / mass + (2.0 * omega) ** 2) / (2.0 * np.pi)
        assert family.modes.natural_hz[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("sectors", "order", "engines"), [(3, 1, MONODROMY | HILL), (5, -2, MONODROMY)])
def test_multipliers_of_the_wave_are_those_of_the_wheel(sectors, order, engines):
    scene = turning_sector(20 + sectors, sectors, order, strength=0.2)
    with solver_of(scene) as solver:
        (point,) = solver.solve_at([0.15], 1.0, 0)
        assert point.is_solved and point.states[2] > 0, "no contact slips: the test is void"
        motion = solver.coordinates()
        *_, found = examined(solver, engines)
    with solver_of(whole_wheel(scene)) as solver:
        solver.set_excitation(0.1, 0.2, 1.0)
        start = StoredPoint(0.15, wave_in_wheel(motion, scene.sector), np.zeros((2 * sectors, 2)))
        assert solver.start_from(start, 1.0)
        *_, whole = examined(solver, MONODROMY)
    # As without Coriolis forces: the root of rounding at a defective multiplier; what Hill's harmonics leave out.
    assert farthest(found[MONODROMY][0], whole[MONODROMY][0]) < 1e-6
    if HILL in found:
        largest = [np.sort(np.abs(found[engine][0]))[-6:] for engine in (MONODROMY, HILL)]
        assert largest[1] == pytest.approx(largest[0], abs=2e-5)


@pytest.mark.parametrize(("damping", "scheme"), [("mass", "newmark"), ("ratio", "exponential"), ("viscous", "hht")])
def test_the_whole_wheel_integrated_in_time_comes_to_the_wave(damping, scheme):
    """By events and by steps; a damping ratio is one of modes without Coriolis forces, in wheel and sector alike."""
    scene = turning_sector(7, 3, 1)
    viscous = np.ascontiguousarray(0.05 * scene.mass + 0.02 * scene.stiffness)
    scene = replace(scene, damping_kind=damping, damping_value=0.05, damping=viscous if damping == "viscous" else None)
    with solver_of(scene, harmonics=101) as solver:
        (point,) = solver.solve_at([0.15], 1.0, 0)
    assert point.is_solved and point.states[2] > 0, "no contact slips: the test is void"
    wheel, away = whole_wheel(scene), []
    for name, steps in (("event", None), (scheme, 200), (scheme, 400)):
        with Integrator(wheel) as integrator:
            integrator.start_static(np.array([[0.0], [1.0]]))
            choices = Run(0.15, scheme=name, steps_per_period=steps, samples=100, periodicity_tolerance=1e-11)
            orbit = integrator.run(choices)
        assert orbit.outcome == "converged" and orbit.period == 1
        angles = 2.0 * np.pi * 0.15 * orbit.time
        series = [np.ones_like(angles)]
        for h in range(1, 102):
            series += [np.cos(h * angles), np.sin(h * angles)]
        motion = np.array(series).T @ point.harmonics.T
        away.append(np.abs(motion - orbit.monitors).max() / point.amplitude.min())
    # What harmonics leave out of a motion whose force has corners falls like H^-3: 4e-6 / 2.5^3 with 101 of them.
    assert away[0] < 1e-6
    # Schemes are of second order.
    assert away[1] < 0.1 and away[2] < 0.4 * away[1]
