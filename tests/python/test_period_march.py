"""Periods marched one by one where no periodic motion is near: a mass that is shaken one way and pushed another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from rubbing_mass import jenkins

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver

LIMIT, HERTZ, LEVEL = 1.0, 0.12, 3.0
OPTIONS = Options(harmonics=3, samples=64, tolerance=1e-11, integrate_in_time=False)


def shaken_and_pushed(push: float) -> ReducedScene:
    """A mass on a spring along x alone, shaken along x, pushed along y, where friction alone, of limit 1, holds it."""
    laws = jenkins().laws | {"tangents": np.full(1, 2, dtype=np.int32)}
    harmonic = np.zeros((3, 3))
    harmonic[1, 0] = 1.0
    return replace(
        jenkins(),
        mass=np.eye(3),
        stiffness=np.diag([1.0, 0.0, 1.0]),
        damping=0.02 * np.eye(3),
        laws=laws,
        directions=np.eye(3),
        static=np.array([[0.0, push, 1.0]]),
        harmonic=harmonic,
        monitors=np.array([[1.0, 0.0, 0.0]]),
    )


def marched(push: float, level: float, strategy: str = "period_march"):
    """The point of that strategy alone, from the static solution."""
    with Solver(MPI.COMM_SELF, shaken_and_pushed(push), OPTIONS) as solver:
        solver.follow_static_path(np.array([[1.0]]), 4, HERTZ)
        solver.set_excitation(HERTZ, HERTZ, level)
        return solver.solve_by_strategy(strategy, HERTZ)


def test_a_mass_that_is_shaken_loose_and_pushed_has_no_periodic_motion():
    # It slips both ways for most of the period. Friction along y is that of the velocity there: at none there is none.
    point = marched(0.1 * LIMIT, LEVEL)
    assert point.outcome == "no_period_one_orbit"


def test_a_mass_that_sticks_for_part_of_the_period_or_is_not_pushed_settles():
    for push, level in ((0.0, LEVEL), (0.1 * LIMIT, 1.0)):
        point, expected = marched(push, level), marched(push, level, "newton")
        assert point.outcome == expected.outcome == "converged"
        assert point.amplitude == pytest.approx(expected.amplitude, rel=1e-8)


def held_softly_too(push: float, stiffness: float, limit: float) -> ReducedScene:
    """The same mass with a second contact, far softer than the first, of this limit."""
    scene = shaken_and_pushed(push)
    laws = {name: np.concatenate([value, value]) for name, value in scene.laws.items()}
    laws["tangential_stiffness"] = np.array([scene.laws["tangential_stiffness"][0], stiffness])
    laws["friction_coefficient"] = np.array([scene.laws["friction_coefficient"][0], limit])
    return replace(scene, laws=laws, directions=np.vstack([scene.directions, scene.directions]))


@pytest.mark.parametrize("level", [3.0, 5.0, 10.0])
def test_springs_that_soften_find_the_drift_of_a_mass_that_is_held_until_it_has_gone_far(level):
    # The first contact slips all over the period and carries little. The second holds a push below its limit, and gives
    # way to more at 0.05/1e-6 = 5e4 from where the mass began: with springs of 1e-3 a step goes some 1e2.
    for push, limit, outcome in ((0.02, 0.05, "converged"), (0.3, 0.05, "no_period_one_orbit")):
        with Solver(MPI.COMM_SELF, held_softly_too(push, 1e-6, limit), OPTIONS) as solver:
            solver.follow_static_path(np.array([[1.0]]), 4, HERTZ)
            solver.set_excitation(HERTZ, HERTZ, level)
            assert solver.solve_by_strategy("mean_regularisation", HERTZ).outcome == outcome
