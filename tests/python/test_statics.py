"""Wedging: friction so large that the static problem has several solutions, or none, against closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import campaign
import campaign_scenes
import h5py
import numpy as np
import pytest
from jobs import attrito, run, table, wedge
from mpi4py import MPI

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.scene.friction_margin import friction_margin
from attrito_verification.scene_grid.scenes import STIFFNESS, Family

SIDES = {"slip+": 1.0, "slip-": -1.0}


def critical_friction(degrees: float, contact_stiffness: float) -> float:
    """The friction coefficient at which a mass on springs kx, ky wedges: (1/kn + c_nn)/|c_nt|."""
    angle, (kx, ky) = np.radians(degrees), STIFFNESS
    normal = np.sin(angle) ** 2 / kx + np.cos(angle) ** 2 / ky
    across = np.sin(angle) * np.cos(angle) * abs(1.0 / ky - 1.0 / kx)
    return (1.0 / contact_stiffness + normal) / across


@pytest.mark.parametrize("degrees", [20.0, 45.0, 80.0])
@pytest.mark.parametrize("ratio", [1.0, 1.0e2, 1.0e4])
def test_the_margin_of_the_wedge_is_its_closed_form(degrees, ratio):
    margin = friction_margin(Family(1, ratio, 0.5, "small", degrees).scene())
    assert margin.complete
    # Of a 2 x 2 eigenproblem whose condition is the ratio of stiffnesses.
    assert margin.factor * 0.5 == pytest.approx(critical_friction(degrees, ratio * STIFFNESS[0]), rel=1e-10)


def test_on_a_level_wall_and_without_friction_nothing_wedges():
    assert friction_margin(Family(1, 1.0e2, 3.0, "small", 0.0).scene()).factor > 1e9
    assert friction_margin(Family(2, 1.0e2, 0.0, "small", 45.0).scene()).unique


def stiffness_in(scene: ReducedScene, states: tuple[str, ...]) -> np.ndarray:
    """Of the structure with its contacts in these states."""
    kt, kn, mu = law(scene)
    matrix = scene.stiffness.copy()
    for i, state in enumerate(states):
        t, n = scene.directions[2 * i], scene.directions[2 * i + 1]
        if state != "open":
            springs = kt * np.outer(t, t) if state == "stuck" else SIDES[state] * mu * kn * np.outer(t, n)
            matrix += kn * np.outer(n, n) + springs
    return matrix


def solutions(scene: ReducedScene, load: np.ndarray) -> int:
    """How many combinations of states balance a load, sliders at zero: by trying them all."""
    kt, kn, mu = law(scene)
    found = 0
    for states in product(("stuck", "slip+", "slip-", "open"), repeat=len(scene.laws["tangents"])):
        q = np.linalg.solve(stiffness_in(scene, states), load)
        fits = []
        for state, u, v in zip(states, scene.directions[::2] @ q, scene.directions[1::2] @ q, strict=True):
            if state == "open":
                fits.append(v < 0)
            elif state == "stuck":
                fits.append(v > 0 and kt * abs(u) <= mu * kn * v)
            else:
                fits.append(v > 0 and SIDES[state] * kt * u >= mu * kn * v)
        found += all(fits)
    return found


def load_held_in(scene: ReducedScene, states: tuple[str, ...]) -> np.ndarray:
    """A load that these states balance, well within them."""
    kt, kn, mu = law(scene)
    motion = []
    for state in states:
        motion += [1.5 * SIDES.get(state, 0.0) * mu * kn / kt, -1.0 if state == "open" else 1.0]
    return stiffness_in(scene, states) @ np.linalg.solve(scene.directions, motion)


def law(scene: ReducedScene) -> list[float]:
    """Tangential stiffness, normal stiffness and friction of all contacts."""
    return [scene.laws[name][0] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient")]


@pytest.mark.parametrize("masses", [1, 2])
@pytest.mark.parametrize("friction", [0.3, 1.2])
def test_within_the_margin_every_load_has_one_solution(masses, friction):
    scene = Family(masses, 1.0e4, friction, "small", 45.0).scene()
    assert friction_margin(scene).unique
    loads = np.random.default_rng(1).standard_normal((400, 2 * masses))
    assert {solutions(scene, load) for load in loads} == {1}


@pytest.mark.parametrize("masses", [1, 2])
@pytest.mark.parametrize("friction", [1.6, 3.0])
def test_where_the_margin_is_used_up_the_states_it_names_balance_a_load_that_others_balance_too(masses, friction):
    # tan 45 degrees, and a little more for the spring along y, lies between 1.2 and 1.6.
    scene = Family(masses, 1.0e4, friction, "small", 45.0).scene()
    margin = friction_margin(scene)
    assert margin.unique is False
    assert solutions(scene, load_held_in(scene, margin.states)) >= 2


def test_a_run_says_that_friction_wedges_and_the_result_keeps_it(tmp_path):
    job = wedge(stiffness=3.0e9)
    job["contact"][0]["friction_coefficient"] = 2.0
    done = run(tmp_path, job)
    assert "static solutions are not unique: friction wedges the structure at 0.69" in done.stdout
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["static/unique"][()] == 0
        assert file["static/friction_margin"][()] == pytest.approx(0.5 * critical_friction(45.0, 3.0e9), rel=1e-8)
        assert file["static"].attrs["states"] in ("slip+", "slip-")


def test_a_run_with_little_friction_has_one_static_solution(tmp_path):
    done = run(tmp_path, wedge())
    assert "wedges" not in done.stdout
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["static/unique"][()] == 1
        assert file["static/friction_margin"][()] > 1.0
    assert attrito(tmp_path, "table", "result.h5").returncode == 0


def test_points_that_begin_at_the_static_sliders_know_the_load_path(tmp_path):
    """A push leaves the contact at its other limit: the first point is the same whether sliders are reset or kept."""
    job = wedge(force=1.0)
    job["load"].append({"name": "push", "kind": "static", "dofs": [[0, -60.0], [1, 60.0]]})
    job["sweep"] = {"frequencies_hz": [120.0]}
    means = []
    for slider in ("keep", "reset"):
        path = [{"preload": 1.0}, {"preload": 1.0, "push": 1.0}, {"preload": 1.0}]
        run(tmp_path, job | {"static": {"load_path": path, "slider": slider}})
        (contact,) = table(tmp_path, "--contacts")
        means.append(float(contact["t1_mean"]))
    assert means[0] < -5.0
    # Both are solved to 1e-10 of the motion.
    assert means[1] == pytest.approx(means[0], rel=1e-7)


@pytest.mark.parametrize("number", [0, 1, 4, 5])
def test_sliders_that_are_reset_give_a_listed_frequency_what_it_gives_alone(number):
    scene = campaign_scenes.make(21, number)
    options = replace(campaign.options_of(scene), reset_slider=True)

    def points_at(frequencies_hz):
        with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
            solver.follow_static_path(campaign.PATH, 10, frequencies_hz[0])
            return list(solver.solve_at(frequencies_hz, 1.0, 0))

    for point in points_at(scene.frequencies_hz):
        (alone,) = points_at([point.frequency_hz])
        assert (point.outcome, point.states) == (alone.outcome, alone.states)
        # Residuals are scaled by the first frequency: both are solved to 1e-10 of the stuck motion, and stiff contacts
        # multiply that.
        np.testing.assert_allclose(point.harmonics, alone.harmonics, atol=1e-6 * np.abs(alone.harmonics).max())
