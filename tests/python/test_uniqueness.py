"""Bounds of points that are one of a family: against an oracle, closed forms and integration in time."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import chain, run, wedge
from scipy.optimize import linprog

from attrito.integrator import Integrator, Run
from attrito.job import read_job
from attrito.linear_programs import DualSimplex
from attrito.rom import reduced_scene
from attrito.scene import build_scene

FREQUENCY = 132.0
# Printed digits of docs and design.
DIGITS = 0.005


def solved(folder, job):
    """Arrays of a job's result by their path, for the quantities of interest."""
    run(folder, job)
    with h5py.File(folder / "result.h5") as file:
        names = [
            f"{group}/{name}" for group in ("contacts", "monitors/x", "monitors/end") for name in file.get(group, ())
        ]
        return {name: file[name][:] for name in names if isinstance(file[name], h5py.Dataset)}


def bounds(data, name):
    return data[f"contacts/{name}_low"], data[f"contacts/{name}_mean"], data[f"contacts/{name}_high"]


def settled_means(folder, path, sliders, frequency):
    """Mean contact forces `[rows]` that integration in time ends in, from the end of a load path and moved sliders."""
    job = read_job(folder / "job.toml")
    scene = reduced_scene(job, build_scene(job))
    with Integrator(scene) as integrator:
        integrator.start_static(np.array(path)[:, None] * np.ones(len(scene.static)))
        displacement, velocity, own = integrator.state()
        moved = own + np.column_stack([sliders, np.zeros(len(sliders))])
        integrator.start(displacement, velocity, moved, np.ones(len(scene.static)))
        orbit = integrator.run(Run(frequency, cycles=4000, periodicity_tolerance=1e-12))
    assert orbit.outcome == "converged"
    return orbit.force_mean


@pytest.fixture(scope="module")
def stuck_wedge(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wedge")
    return folder, solved(folder, wedge(force=1.0))


def test_the_wedge_at_1_newton_has_the_bounds_of_the_design(stuck_wedge):
    _, data = stuck_wedge
    low, _, high = bounds(data, "t1")
    assert (low[0, 0], high[0, 0]) == pytest.approx((-9.98, 9.27), abs=DIGITS)
    low, _, high = bounds(data, "n")
    assert (low[0, 0], high[0, 0]) == pytest.approx((22.85, 27.12), abs=DIGITS)


def test_the_member_shown_is_within_its_bounds_and_the_contact_is_not_unique(stuck_wedge):
    _, data = stuck_wedge
    for name in ("t1", "n"):
        low, shown, high = bounds(data, name)
        assert np.all((low <= shown) & (shown <= high))
    assert data["contacts/unique"].tolist() == [[0]]


def test_amplitudes_are_the_same_in_all_members_and_means_are_not(stuck_wedge):
    _, data = stuck_wedge
    assert data["monitors/x/low"] == data["monitors/x/amplitude"] == data["monitors/x/high"]
    assert data["monitors/x/mean_high"] - data["monitors/x/mean_low"] > 1e-5


def test_both_load_paths_end_in_members_of_one_family(stuck_wedge, tmp_path):
    _, data = stuck_wedge
    other = solved(tmp_path, wedge(force=1.0) | {"static": {"load_path": [0.0, 2.5, 1.0]}})
    for name in ("t1", "n"):
        (low, shown, high), (other_low, other_shown, other_high) = bounds(data, name), bounds(other, name)
        # The points are solved to 1e-10 of motions that make forces of some 10.
        assert (other_low, other_high) == (pytest.approx(low, abs=1e-7), pytest.approx(high, abs=1e-7))
        assert abs(other_shown - shown) > 1.0


def test_integration_in_time_after_many_load_paths_ends_within_the_bounds_and_on_both(stuck_wedge):
    folder, data = stuck_wedge
    means = [settled_means(folder, [0.0, top, 1.0], [0.0], FREQUENCY) for top in np.linspace(1.0, 2.5, 13)]
    for reached, name in zip(np.transpose(means), ("t1", "n"), strict=True):
        low, _, high = (values[0, 0] for values in bounds(data, name))
        assert len(np.unique(reached.round(3))) > 4
        # Steady to 1e-12 a period, of a motion that decays by some 10 % in each.
        assert (reached.min(), reached.max()) == (pytest.approx(low, abs=1e-6), pytest.approx(high, abs=1e-6))


def test_on_a_level_wall_the_normal_force_is_unique_and_the_tangential_one_has_a_closed_form(tmp_path):
    job = wedge(force=1.0)
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]]}
    job["load"][1]["cosine"] = [[0, 1.0]]
    data = solved(tmp_path, job)
    low, shown, high = bounds(data, "n")
    assert low == shown == high
    low, _, high = bounds(data, "t1")
    room = 0.5 * shown - 3.0e5 * data["monitors/x/amplitude"]
    assert (low, high) == (pytest.approx(-room, rel=1e-8), pytest.approx(room, rel=1e-8))


def test_many_contacts_feel_each_other_and_integration_in_time_stays_within_their_bounds(tmp_path):
    job = chain(contacts=3)
    for contact in job["contact"]:
        # Normal and tangent at an angle, so that a slider moves the normal forces too.
        contact["normal"] = [[contact["normal"][0][0], 1.0], [contact["normal"][1][0], 0.5]]
    job["load"][1] |= {"cosine": [[0, 1.0]], "sine": [[0, 0.5]]}
    job["sweep"] = {"frequencies_hz": [40.0]}
    data = solved(tmp_path, job)
    assert np.all(data["contacts/state"] <= 1)
    generator = np.random.default_rng(3)
    starts = generator.uniform(-1e-3, 1e-3, (6, 3))
    means = np.array([settled_means(tmp_path, [0.0, 1.0], sliders, 40.0) for sliders in starts])
    for column, name in enumerate(("t1", "n")):
        low, _, high = (values[0] for values in bounds(data, name))
        reached = means[:, column::2]
        assert np.all((reached >= low - 1e-6) & (reached <= high + 1e-6))
        assert np.all(np.ptp(reached, axis=0) > 0.1 * (high - low))


def test_where_a_contact_slips_or_the_approach_is_uncoupled_bounds_are_left_open(tmp_path):
    stuck = wedge(force=1.0)
    stuck["balance"]["approach"] = "uncoupled"
    assert np.isnan(solved(tmp_path, stuck)["contacts/n_low"]).all()
    mixed = chain(contacts=3)
    mixed["load"][1] |= {"cosine": [[0, 12.0]], "sine": [[0, 6.0]]}
    mixed["sweep"] = {"frequencies_hz": [85.0]}
    data = solved(tmp_path, mixed)
    assert np.any(data["contacts/state"] == 2)
    assert np.any(data["contacts/state"] <= 1)
    assert np.isnan(data["contacts/n_low"]).all()
    assert np.isnan(data["monitors/end/mean_low"]).all()


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
