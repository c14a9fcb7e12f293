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
