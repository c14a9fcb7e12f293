"""The linear programs that bounds come from: the dual simplex against SciPy's, and sliders that limit each other."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import chain, everything
from scipy.optimize import linprog

from attrito.support.linear_programs import DualSimplex


def test_rows_may_be_added_to_a_linear_program_that_was_solved():
    generator = np.random.default_rng(11)
    a, b, c = generator.normal(size=(30, 4)), generator.uniform(0.1, 1.0, 30), generator.normal(size=4)
    box = np.vstack([np.eye(4), -np.eye(4)])
    program, added = DualSimplex(box, c), 0
    for rows in (5, 17, 30):
        program.add(a[added:rows])
        added = rows
        full, limits = np.vstack([box, a[:rows]]), np.concatenate([np.full(8, 10.0), b[:rows]])
        x, held = program.maximizer(limits)
        oracle = linprog(-c, full, limits, bounds=(None, None))
        assert c @ x == pytest.approx(-oracle.fun, rel=1e-9)
        assert np.abs(full[held] @ x - limits[held]).max() < 1e-9


@pytest.mark.parametrize("size", [1, 2, 7, 30])
def test_the_dual_simplex_finds_the_maxima_of_the_oracle_for_one_right_side_after_another(size):
    generator = np.random.default_rng(size)
    compliance = generator.normal(size=(2 * size, 2 * size))
    compliance = np.linalg.inv(np.linalg.inv(compliance @ compliance.T / size) + np.eye(2 * size))
    tangential, normal = np.eye(size) - compliance[:size, :size], -compliance[size:, :size]
    a = np.vstack([tangential - 0.5 * normal, -tangential - 0.5 * normal])
    for c in (tangential[0], -normal[-1], generator.normal(size=size)):
        program = DualSimplex(a, c)
        for _ in range(8):
            b = generator.uniform(0.0, 1.0, 2 * size)
            oracle = linprog(-c, a, b, bounds=(None, None), method="highs")
            found = program.maximum(b)
            assert found == (np.inf if oracle.status in (3, 4) else pytest.approx(-oracle.fun, rel=1e-7, abs=1e-9))


def test_the_dual_simplex_says_what_has_no_maximum():
    half_plane = DualSimplex(np.array([[1.0, 0.0]]), np.array([0.0, 1.0]))
    assert half_plane.maximum(np.array([1.0])) == np.inf
    nowhere = DualSimplex(np.array([[1.0], [-1.0]]), np.array([1.0]))
    assert np.isnan(nowhere.maximum(np.array([-1.0, -1.0])))
    assert nowhere.maximum(np.array([2.0, -1.0])) == 2.0


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_bounds_of_a_row_of_masses_that_only_friction_holds_are_what_the_others_can_carry(tmp_path, seed):
    # Nothing else acts along it, so mean friction adds up to zero: |T_i| <= r_i, and at most what all others carry,
    # r_i = mu N_i - |swing of T_i|. All sliders may move together: limits on seven combinations of eight sliders.
    generator, masses = np.random.default_rng(seed), 8
    job = chain(masses)
    springs = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    springs[0, 0] = springs[-1, -1] = 1.0
    nothing = np.zeros((masses, masses))
    job["model"]["stiffness"] = np.block([[2e5 * springs, nothing], [nothing, 1e5 * np.eye(masses)]]).tolist()
    for i, contact in enumerate(job["contact"]):
        contact["normal"], contact["tangents"] = [[masses + i, 1.0]], [[[i, 1.0]]]
        contact["tangential_stiffness"] = float(10 ** generator.uniform(4.0, 6.5))
        contact["friction_coefficient"] = float(generator.uniform(0.2, 0.8))
    job["load"][1] = {"kind": "harmonic", "cosine": [[0, 2.0], [3, -1.5]]}
    job["sweep"] = {"frequencies_hz": [40.0]}
    data = everything(tmp_path, job)
    assert set(data["contacts/state"][0]) == {0}
    force = data["contacts/force"][0]
    friction = np.array([contact["friction_coefficient"] for contact in job["contact"]])
    room = friction * force[:, 2, 0] - np.hypot(force[:, 0, 1], force[:, 0, 2])
    most = np.minimum(room, room.sum() - room)
    assert data["contacts/t1_high"][0] == pytest.approx(most, rel=1e-9)
    assert data["contacts/t1_low"][0] == pytest.approx(-most, rel=1e-9)
    assert data["monitors/end/mean_high"][0] == np.inf
