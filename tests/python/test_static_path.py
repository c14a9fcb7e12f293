"""The static load path: against increments of another program's making, closed forms, and what starts from it."""

from __future__ import annotations

from dataclasses import replace

import incremental
import numpy as np
import pytest
from jobs import by_pressure, run, table, wedge
from mpi4py import MPI

from attrito.library.integrator import Integrator
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver

RAMP = np.array([[0.0], [1.0]])
# Of the path's estimate: what an increment may be off, and more increments than any path here takes
PER_INCREMENT, INCREMENTS = 1e-6, 50


def random_scene(rng: np.random.Generator, m: int, tangents: list[int], loads: int = 1) -> ReducedScene:
    """A structure of m coordinates around 3e5 N/m, contacts to the ground along random directions at right angles."""
    rows = []
    for i, count in enumerate(tangents):
        place = slice(3 * i, 3 * i + 3)
        turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        for row in turned[: count + 1]:
            rows.append(np.zeros(m))
            rows[-1][place] = row
    spread = np.linalg.qr(rng.normal(size=(m, m)))[0]
    stiffness = spread @ np.diag(3e5 * 10.0 ** rng.uniform(-0.5, 0.5, m)) @ spread.T
    number = len(tangents)
    laws = {
        "tangents": np.array(tangents),
        "tangential_stiffness": 10.0 ** rng.uniform(4.5, 10.5, number),
        "normal_stiffness": 10.0 ** rng.uniform(4.5, 10.5, number),
        "friction_coefficient": rng.uniform(0.2, 1.6, number),
        "gap": np.zeros(number),
        "preload": np.zeros(number),
    }
    return ReducedScene(
        np.eye(m),
        0.5 * (stiffness + stiffness.T),
        "viscous",
        0.0,
        50.0 * np.eye(m),
        laws,
        np.array(rows),
        50.0 * rng.normal(size=(loads, m)),
        np.vstack([np.zeros(m), np.eye(m)[0], np.zeros(m)]),
        np.eye(m)[:1],
        ["q"],
    )


def end_of(scene: ReducedScene, path: np.ndarray, steps: int = 4) -> np.ndarray:
    """Displacements at the end of the path."""
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=1, samples=16)) as solver:
        solver.follow_static_path(path, steps, 1.0)
        return solver.coordinates()[:, 0]


def when_all_stick(scene: ReducedScene) -> tuple[np.ndarray, bool]:
    """Displacements under full load with all contacts stuck, and whether no law is broken by them."""
    laws, first, matrix, springs = scene.laws, 0, scene.stiffness.copy(), []
    for i, count in enumerate(laws["tangents"]):
        springs += [laws["tangential_stiffness"][i]] * count + [laws["normal_stiffness"][i]]
    matrix = matrix + scene.directions.T @ np.diag(springs) @ scene.directions
    q = np.linalg.solve(matrix, scene.static.sum(axis=0))
    force, admitted = np.array(springs) * (scene.directions @ q), True
    for mu, count in zip(laws["friction_coefficient"], laws["tangents"], strict=True):
        pull, normal = np.linalg.norm(force[first : first + count]), force[first + count]
        admitted, first = admitted and normal > 0.0 and pull < 0.999 * mu * normal, first + count + 1
    return q, admitted


@pytest.mark.parametrize(
    ("tangents", "path"),
    [
        ([2], RAMP),
        ([1], RAMP),
        ([2, 2], RAMP),
        ([2, 1, 2], RAMP),
        ([2], np.array([[1.0]])),
        ([2], np.array([[0.5], [1.0]])),
    ],
    ids=["two tangents", "one", "two contacts", "three, mixed", "no corner at rest", "a corner on the way"],
)
def test_where_all_contacts_stick_under_the_load_the_path_ends_there(tangents, path):
    rng = np.random.default_rng(24)
    tried = 0
    while tried < 15:
        scene = random_scene(rng, 3 * len(tangents), tangents)
        q, admitted = when_all_stick(scene)
        if not admitted:
            continue
        tried += 1
        # The stuck system is of condition 1e6 at most, and rounding of it is what an exact solution is off by.
        assert end_of(scene, path) == pytest.approx(q, rel=1e-8, abs=1e-8 * np.abs(q).max())


def turning_scene(seed: int) -> tuple[ReducedScene, np.ndarray]:
    """Two contacts as stiff as the structure, one with a gap, under two loads that do not come on together."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 6, [2, 2], 2)
    pressing = scene.directions[2] + scene.directions[5]
    static = scene.static + 80.0 * pressing
    laws = scene.laws | {
        "tangential_stiffness": rng.uniform(5e4, 2e5, 2),
        "normal_stiffness": rng.uniform(2e5, 5e5, 2),
        "friction_coefficient": rng.uniform(0.1, 0.5, 2),
        "gap": np.array([0.0, 3e-5]),
    }
    return replace(scene, laws=laws, static=static), np.array([[0.0, 0.0], [1.5, 0.7], [1.0, -0.3], [1.0, 1.0]])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("steps", [1, 4])
def test_the_estimate_makes_any_least_number_of_steps_end_where_many_small_ones_do(seed, steps):
    scene, path = turning_scene(seed)
    coarse, fine = (incremental.follow(scene, path, many) for many in (40, 80))
    forces = [
        np.linalg.solve(scene.directions.T, path[-1] @ scene.static - scene.stiffness @ q) for q in (coarse, fine)
    ]
    found = np.linalg.solve(scene.directions.T, path[-1] @ scene.static - scene.stiffness @ end_of(scene, path, steps))
    largest = np.abs(forces[1]).max()
    # Of at least first order, the finer reference is off by no more than it differs from the coarser one.
    allowed = PER_INCREMENT * INCREMENTS * largest + np.abs(forces[1] - forces[0]).max()
    assert np.abs(found - forces[1]).max() <= allowed
    # So a figure of 1e-4 is looked at, and the reference tells it.
    assert allowed <= 1.5e-4 * largest


@pytest.mark.parametrize("seed", range(3))
def test_time_integration_starts_where_a_run_does(seed):
    scene, path = turning_scene(seed)
    with Integrator(scene) as integrator:
        integrator.start_static(path, 4)
        displacement, velocity, _ = integrator.state()
    # The same solve; the modes it is handed over in are exact but for rounding.
    assert displacement == pytest.approx(end_of(scene, path), rel=1e-10, abs=1e-16)
    assert np.all(velocity == 0.0)


def stiff_wedge(stiffness: float):
    job = wedge(force=5.0)
    job["contact"][0] |= {"tangential_stiffness": stiffness, "normal_stiffness": stiffness}
    job["sweep"] = {"frequencies_hz": [100.0]}
    return job


@pytest.mark.parametrize("law", [dict, by_pressure], ids=["coulomb", "pressure"])
@pytest.mark.parametrize("stiffness", [5e12, 1e13, 1e14, 1e15])
def test_contacts_up_to_ten_thousand_million_times_as_stiff_as_the_body_are_solved(tmp_path, stiffness, law):
    run(tmp_path, law(stiff_wedge(stiffness)))
    (row,) = table(tmp_path)
    # All stuck: contacts alike in both directions add to the stiffness's diagonal, and the force along x is -5/sqrt 2.
    assert row["outcome"] == "converged"
    # Displacements of 1e-4 with 16 digits make forces that rounding hides 64 epsilon of (k/kx).
    assert float(row["x_amplitude"]) == pytest.approx(
        5.0 * 0.5**0.5 / stiffness, rel=64.0 * 2.3e-16 * stiffness / 3.9e5
    )


@pytest.mark.parametrize("law", [dict, by_pressure], ids=["coulomb", "pressure"])
@pytest.mark.parametrize(
    ("stiffness", "code", "said"),
    [
        (1e17, 1, "so much stiffer than the structure that rounding may hide"),
        (1e18, 1, "so much stiffer than the structure that rounding may hide"),
        # Less than two digits of the structure are left.
        (1e20, 2, "times as stiff as the structure at them"),
        (1e22, 2, "times as stiff as the structure at them"),
    ],
)
def test_contacts_too_stiff_for_the_digits_of_a_number_are_refused_by_name(tmp_path, stiffness, code, said, law):
    done = run(tmp_path, law(stiff_wedge(stiffness)), code=code)
    assert said in done.stderr
    assert "drifts" not in done.stderr


@pytest.mark.parametrize("springs", [1.0, 0.01])
def test_a_body_on_weak_springs_that_contacts_hold_is_solved_whatever_their_stiffness(tmp_path, springs):
    # Both coordinates stick: the force moves the contact's spring, beside which all others, and inertia, are nothing.
    job = stiff_wedge(1e13)
    job["model"] |= {"stiffness": [[springs, 0.0], [0.0, springs]]}
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]]}
    run(tmp_path, job)
    (row,) = table(tmp_path)
    assert row["outcome"] == "converged"
    assert float(row["x_amplitude"]) == pytest.approx(5.0 * 0.5**0.5 / 1e13, rel=1e-6)
