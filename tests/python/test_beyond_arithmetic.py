"""What numbers of 64 bits cannot resolve is said to have failed: it is no finding about the motion."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from jobs import attrito_here, run, wedge, write_job

from attrito.library.names import OUTCOMES
from attrito.scene.stiff_contacts import of_stiff_contacts


def against_a_wall(tangential_stiffness: float, gap: float = 0.0) -> dict:
    """The wedge sliding along a wall that is normal to y."""
    job = wedge(force=400.0)
    stiffness = {"normal_stiffness": 3.0e5, "tangential_stiffness": tangential_stiffness, "friction_coefficient": 0.5}
    job["contact"] = [{"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]], "gap": gap, **stiffness}]
    job["load"][0]["dofs"] = [[1, 420.0]]
    job["load"][1] = {"kind": "harmonic", "cosine": [[0, -400.0]]}
    job["balance"] = {"harmonics": 7}
    job["sweep"] = {"frequencies_hz": [100.0, 110.0, 120.0, 130.0]}
    return job


@pytest.mark.parametrize("tangential_stiffness", [3e13, 1e14, 1e15, 1e16, 1e19])
def test_friction_whose_slip_radius_rounding_hides_is_not_said_to_have_no_orbit(tmp_path: Path, tangential_stiffness):
    """There is one: that of rigid friction, to which softer springs lead."""
    said = run(tmp_path, against_a_wall(tangential_stiffness), code=1).stderr
    # Beside k of the structure, which the inertia of 130 Hz adds to
    ratio = tangential_stiffness / ((2.0 * np.pi * 100.0) ** 2 + (2.0 * np.pi * 130.0) ** 2)
    assert f"did not converge (contacts are up to {ratio:.1e} times as stiff as the structure at them" in said
    with h5py.File(tmp_path / "result.h5") as file:
        outcome = file["points/outcome"][:]
    assert not np.any(outcome == OUTCOMES.index("no_period_one_orbit"))


@pytest.mark.parametrize("tangential_stiffness", [1e11, 1e12])
def test_friction_that_is_nearly_rigid_is_that_of_a_softer_spring(tmp_path: Path, tangential_stiffness):
    """Motion in time gives the starts: a stiff contact that slips had hardly moved in it (500 iterations a point)."""
    run(tmp_path, against_a_wall(tangential_stiffness))
    with h5py.File(tmp_path / "result.h5") as file:
        amplitude, iterations = file["monitors/x/amplitude"][:], file["points/iterations"][:]
    assert amplitude == pytest.approx([9.39778e-3, 4.1209e-3, 2.1733e-3, 1.41956e-3], rel=2e-4)
    assert iterations.max() < 100


@pytest.mark.parametrize("settings", [{}, {"stability": {"method": "monodromy"}}])
@pytest.mark.parametrize(("normal_stiffness", "tangential_stiffness"), [(1e14, 1e14), (3e5, 1e16)])
def test_contacts_of_any_stiffness_are_not_said_to_have_no_orbit(
    tmp_path: Path, normal_stiffness, tangential_stiffness, settings
):
    """Motion that rounding hides was followed in time: without end at 1e16, and to no orbit at 1e14."""
    job = against_a_wall(tangential_stiffness) | settings
    job["contact"][0]["normal_stiffness"] = normal_stiffness
    assert "did not converge (contacts are up to" in run(tmp_path, job, code=1).stderr
    with h5py.File(tmp_path / "result.h5") as file:
        assert set(file["points/outcome"][:]) == {OUTCOMES.index("not_converged")}


@pytest.mark.parametrize(("normal_stiffness", "friction"), [(1e14, 0.5), (3e5, 0.0), (1e14, 0.0), (1e16, 0.05)])
def test_whatever_is_said_of_motion_that_rounding_hides_names_the_stiffness(tmp_path: Path, normal_stiffness, friction):
    job = against_a_wall(1e14)
    job["contact"][0] |= {"normal_stiffness": normal_stiffness, "friction_coefficient": friction}
    assert "(contacts are up to" in run(tmp_path, job, code=1).stderr


@pytest.mark.parametrize("along", ["tangential_stiffness", "normal_stiffness"])
def test_contacts_that_leave_two_digits_of_the_structure_are_refused(tmp_path, capfd, along):
    """With two tangents the motion was 1e-19, and converged."""
    job = against_a_wall(3e5)
    job["contact"][0][along] = 1e21
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
    assert (
        done.returncode == 2 and "times as stiff as the structure at them': expected less than 4.5e+13" in done.stderr
    )


def test_a_contact_of_infinite_stiffness_is_refused(tmp_path, capfd):
    """At 1e300 the motion was 0, and converged."""
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, against_a_wall(1e300)))
    assert done.returncode == 2 and "at most 1e+100" in done.stderr


def test_a_structure_that_holds_itself_is_not_asked_what_holds_it(tmp_path, capfd):
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, against_a_wall(3e5, gap=-1e10)))
    assert done.returncode == 1
    assert "no equilibrium found, though the structure holds itself: the iteration failed (give contacts" in done.stderr
    assert "do the loads open" not in done.stderr


@pytest.mark.parametrize("factor", [1e-158, 1e-300, 1e160])
@pytest.mark.parametrize("load", [0, 1])
def test_loads_whose_squares_are_no_numbers_are_refused(tmp_path, capfd, factor, load):
    """Amplitudes were 0, and converged."""
    job = wedge()
    key = ["dofs", "cosine"][load]
    job["load"][load][key] = [[dof, factor * value] for dof, value in job["load"][load][key]]
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
    assert done.returncode == 2
    assert "expected from 1e-140 to 1e+140, or 0: squares must be numbers, so take other units" in done.stderr


@pytest.mark.parametrize(("stiffness", "said"), [(0.0, ""), (1e4, "up to 1.0e+08 times as stiff")])
def test_a_contact_at_dofs_without_stiffness_and_mass_hides_no_friction(stiffness, said):
    laws = {"tangents": [1], "tangential_stiffness": [1e5], "normal_stiffness": [1e12]}
    parts = {"directions": np.eye(2), "stiffness": np.diag([1e4, stiffness]), "mass": np.zeros((2, 2))}
    words = of_stiff_contacts(SimpleNamespace(laws=laws, **parts), 100.0, 1e-10)
    assert said in words and bool(words) == bool(said)


def on_a_table(tangential_stiffness: float, hertz: float, tangents: list) -> dict:
    """One kilogram that lies on a table, of stiffness along its normal alone: its contact holds it, or nothing."""
    job = against_a_wall(tangential_stiffness)
    job["contact"][0]["tangents"] = tangents
    job["model"] = {"mass": np.eye(3).tolist(), "stiffness": np.diag([0.0, 2.5e6, 0.0]).tolist()}
    job["damping"] = {"ratio": 0.01}
    job["load"][1] = {"kind": "harmonic", "cosine": [[0, 3.5]]}
    return job | {"sweep": {"frequencies_hz": [hertz]}}


@pytest.mark.parametrize("tangents", [[[[0, 1.0]]], [[[0, 1.0]], [[2, 1.0]]]])
@pytest.mark.parametrize("hertz", [1e-5, 1e-2])
def test_a_body_that_only_its_contact_holds_is_solved_at_any_frequency(tmp_path: Path, hertz, tangents):
    """Next to 0 Hz any contact is stiffer than inertia by more than numbers have digits, and nothing is lost."""
    job = on_a_table(3e5, hertz, tangents)
    if len(tangents) == 1:
        job["model"] = {name: np.array(job["model"][name])[:2, :2].tolist() for name in ("mass", "stiffness")}
    run(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        assert ("as stiff as the inertia of what only they hold" in file.attrs["warnings"]) == (hertz == 1e-5)
        assert file["monitors/x/amplitude"][:] == pytest.approx(3.5 / 3e5, rel=1e-9)


def test_a_structure_whose_springs_a_contact_hides_is_refused_next_to_zero_frequency(tmp_path, capfd):
    """Springs of 2e-9 along x are more than what rounds in this body, and nothing beside the contact."""
    job = on_a_table(3e5, 1e-5, [[[0, 1.0]], [[2, 1.0]]])
    job["model"]["stiffness"][0][0] = job["model"]["stiffness"][2][2] = 2e-9
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
    assert done.returncode == 2 and "times as stiff as the structure at them" in done.stderr
