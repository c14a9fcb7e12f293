"""Modes by periodic motion, in memory: linear modes, the Jenkins element in closed form, the forced balance."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from rubbing_mass import DAMPING, KT, element, jenkins

from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.modes.mode_point import ModePoint
from attrito.modes.tracker import ModeTracker
from attrito_verification.paper.wedge import PARAMETER_SETS, Wedge


@contextmanager
def tracking(scene: ReducedScene, options: Options) -> Iterator[tuple[Solver, ModeTracker]]:
    """A tracker of a scene's first tangent mode, its static loads on it."""
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.array([[1.0]]), 4, 0.2)
        modes = solver.linear_modes("tangent", 1)
        yield solver, ModeTracker(solver, scene, modes.shapes[:1], modes.natural_hz[0])


@pytest.mark.parametrize("kind", ["viscous", "mass", "ratio", "loss_factor", "none"])
def test_a_mode_that_sticks_is_the_linear_one(kind):
    scene = jenkins()
    omega, value = np.sqrt(1.0 + KT), 0.03
    # A loss factor acts on the structure's spring, 1, not on the contact's.
    excitation = {
        "viscous": DAMPING,
        "mass": value,
        "ratio": 2.0 * value * omega,
        "loss_factor": value / omega,
        "none": 0.0,
    }
    scene = replace(scene, damping_kind=kind, damping_value=value, damping=scene.damping if kind == "viscous" else None)
    # Of the stuck modes the normal one, at sqrt(2), is the second: sqrt(1.5) is the mass's own.
    with tracking(scene, Options(harmonics=3, tolerance=1e-12)) as (_, tracker):
        point = tracker.at(0.1)
        assert point.converged and sum(point.point.states[2:]) == 0
        assert 2.0 * np.pi * point.point.frequency_hz == pytest.approx(omega, rel=1e-11)
        assert point.drive["excitation"] == pytest.approx(excitation[kind], rel=1e-10, abs=1e-11)


def test_a_mass_that_rubs_has_the_mode_of_the_describing_function():
    with tracking(jenkins(), Options(harmonics=1, tolerance=1e-12)) as (_, tracker):
        for amplitude in (1.5, 3.0, 6.0, 40.0, 4.0):
            point = tracker.at(amplitude)
            stiffness, loss = element(amplitude)
            omega = np.sqrt(1.0 + stiffness)
            assert point.converged
            # The amplitude is found to 1e-9, and the loss changes at most as it does.
            assert 2.0 * np.pi * point.point.frequency_hz == pytest.approx(omega, rel=1e-8)
            assert point.drive["excitation"] == pytest.approx(DAMPING + loss / omega, rel=1e-8)


def forced_by_its_own_damping(scene: ReducedScene, point: ModePoint, coordinates: np.ndarray) -> ReducedScene:
    """The scene under xi M q' as an excitation, for the motion `[m, 2 H + 1]` of a mode."""
    harmonic = np.zeros(coordinates.T.shape)
    for h in range(1, len(harmonic) // 2 + 1):
        factor = point.drive["excitation"] * 2.0 * np.pi * point.point.frequency_hz * h
        harmonic[2 * h - 1] = factor * scene.mass @ coordinates[:, 2 * h]
        harmonic[2 * h] = -factor * scene.mass @ coordinates[:, 2 * h - 1]
    return replace(scene, harmonic=harmonic)


def in_the_plane() -> ReducedScene:
    """A mass on springs along two tangents, 10 % apart, that rubs along both."""
    laws = jenkins().laws | {"tangents": np.full(1, 2, dtype=np.int32), "tangential_stiffness": np.full(1, 0.3)}
    mixed = np.array([[0.1, 0.02, 0.0], [0.02, 0.08, 0.01], [0.0, 0.01, 0.1]])
    return ReducedScene(
        np.eye(3),
        np.array([[1.0, 0.05, 0.0], [0.05, 1.1, 0.1], [0.0, 0.1, 2.0]]),
        "viscous",
        0.0,
        mixed,
        laws,
        np.eye(3),
        np.array([[0.0, 0.0, 3.0]]),
        np.array([[0.0, 0.0, 0.0], [1.0, 0.3, 0.0], [0.0, 0.4, 0.0]]),
        np.array([[1.0, 0.0, 0.0]]),
        ["x"],
    )


@pytest.mark.parametrize("scene", ["inclined wall", "two tangents", "mode damping"])
def test_a_mode_solves_the_forced_balance_that_its_negative_damping_makes(scene):
    reduced, options, amplitude = {
        "inclined wall": (
            Wedge(PARAMETER_SETS["unrounded"], 45.0, "C", 5).scene,
            Options(harmonics=5, tolerance=1e-12),
            0.4,
        ),
        "two tangents": (in_the_plane(), Options(harmonics=4, samples=128, tolerance=1e-12), 8.0),
        "mode damping": (
            replace(in_the_plane(), damping_kind="ratio", damping_value=0.03, damping=None),
            Options(harmonics=4, samples=128, tolerance=1e-12),
            8.0,
        ),
    }[scene]  # fmt: skip
    with tracking(reduced, options) as (solver, tracker):
        point = tracker.at(amplitude)
        coordinates = solver.coordinates()
    assert point.converged and sum(point.point.states[2:]) == 1
    forced = forced_by_its_own_damping(reduced, point, coordinates)
    with Solver(MPI.COMM_SELF, forced, options) as solver:
        solver.follow_static_path(np.array([[1.0]]), 4, point.point.frequency_hz)
        start = StoredPoint(point.point.frequency_hz, coordinates, np.zeros((1, 2)))
        assert solver.start_from(start, 1.0)
        # Had it to move, it would go to another solution: this one is unique. Balances end at 1e-12 of their scales.
        assert np.abs(solver.coordinates() - coordinates).max() <= 1e-9 * np.abs(coordinates).max()
