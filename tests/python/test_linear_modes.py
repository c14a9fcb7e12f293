"""The linear references of a scene: stuck, frictionless and tangent, in runs and by `attrito linear-modes`."""

from __future__ import annotations

import h5py
import meshio
import numpy as np
import pytest
from elastic import elastic_block
from jobs import Job, attrito, blocks, run, table, write_blocks, write_job
from scipy.linalg import eigh

from attrito.job.reading import read_job
from attrito.model.model_file import write_model
from attrito.scene.build import build_scene

LAW = {"tangential_stiffness": 3.0e4, "normal_stiffness": 5.0e4, "friction_coefficient": 0.4}
STATES = ("stuck", "frictionless", "tangent")


def two_masses() -> Job:
    """Two masses of 2 on springs of 1e5; one contact on mass 0 is closed at rest, one on mass 1 is open."""
    return {
        "model": {"mass": (2.0 * np.eye(4)).tolist(), "stiffness": (1.0e5 * np.eye(4)).tolist()},
        "damping": {"ratio": 0.01},
        "contact": [
            {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]], **LAW},
            {"normal": [[3, 1.0]], "tangents": [[[2, 1.0]]], "gap": 1.0e-3, **LAW},
        ],
        "load": [{"name": "press", "kind": "static", "dofs": [[1, 50.0]]}],
        "balance": {"harmonics": 1},
        "output": {"file": "result.h5"},
    }


def excited(job: Job) -> Job:
    """The job with what a run needs besides."""
    job["load"].append({"name": "shake", "kind": "harmonic", "cosine": [[2, 1.0e-3], [0, 1.0e-3]]})
    job["sweep"] = {"frequencies_hz": [30.0, 45.0]}
    job["output"]["monitors"] = [{"name": "a", "dofs": [[0, 1.0]]}, {"name": "b", "dofs": [[2, 1.0]]}]
    return job


def natural(*stiffnesses: float) -> np.ndarray:
    """Ascending, Hz, of masses of 2."""
    return np.sqrt(np.sort(stiffnesses) / 2.0) / (2 * np.pi)


EXPECTED = {
    "stuck": natural(1.3e5, 1.5e5, 1.3e5, 1.5e5),
    "frictionless": natural(1.0e5, 1.5e5, 1.0e5, 1.5e5),
    "tangent": natural(1.3e5, 1.5e5, 1.0e5, 1.0e5),
}

FILES = {state: "result.modes.h5" if state == "tangent" else f"result.{state}.modes.h5" for state in EXPECTED}


@pytest.mark.parametrize("state", STATES)
def test_modes_of_two_masses_have_the_springs_of_their_reference_alone(tmp_path, state):
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, two_masses()), "--state", state)
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result=FILES[state])
    assert [float(row["frequency_hz"]) for row in rows] == pytest.approx(EXPECTED[state], rel=1e-11)
    assert [row["mode"] for row in rows] == ["1", "2", "3", "4"]
    assert {row["kind"] for row in rows} == {"elastic"}
    with h5py.File(tmp_path / FILES[state]) as file:
        assert file["closed"][:].tolist() == [1, 0]
        shapes = file["points/coordinates"][:, :, 1]
        assert 2.0 * shapes @ shapes.T == pytest.approx(np.eye(4), abs=1e-12)


def test_modes_of_one_state_do_not_replace_those_of_another(tmp_path):
    job = write_job(tmp_path, two_masses())
    for state in STATES:
        assert attrito(tmp_path, "linear-modes", job, "--state", state).returncode == 0
    for state in STATES:
        rows = table(tmp_path, result=FILES[state])
        assert [float(row["frequency_hz"]) for row in rows] == pytest.approx(EXPECTED[state], rel=1e-11)


def test_a_ratio_damps_tangent_modes_by_the_matrix_that_the_stuck_modes_make_of_it(tmp_path):
    attrito(tmp_path, "linear-modes", write_job(tmp_path, two_masses()), "--state", "tangent")
    rows = table(tmp_path, result="result.modes.h5")
    # Each dof is a mode of its own: c = 2 zeta omega_stuck m, so the ratio is zeta omega_stuck / omega.
    stuck = [1.3e5, 1.5e5, 1.3e5, 1.5e5]
    tangent = [1.3e5, 1.5e5, 1.0e5, 1.0e5]
    expected = sorted(0.01 * np.sqrt(a / b) for a, b in zip(stuck, tangent, strict=True))
    assert sorted(float(row["damping_ratio"]) for row in rows) == pytest.approx(expected, rel=1e-10)


def test_tangent_modes_do_not_depend_on_the_number_of_ranks(tmp_path):
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, two_masses()), ranks=2)
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.modes.h5")
    assert [float(row["frequency_hz"]) for row in rows] == pytest.approx(EXPECTED["tangent"], rel=1e-11)


def test_a_run_has_the_three_references_and_the_weakly_driven_response_is_the_tangent_one(tmp_path):
    done = run(tmp_path, excited(two_masses()))
    words = [f"{state} {EXPECTED[state][0]:.4g}" for state in STATES]
    assert all(word in done.stdout for word in words), done.stdout
    with h5py.File(tmp_path / "result.h5") as file:
        for state in STATES:
            assert file[f"linear/{state}/natural_hz"][:] == pytest.approx(EXPECTED[state], rel=1e-12)
            assert file[f"linear/{state}"].attrs["rigid_body_modes"] == 0
        for name in ("a", "b"):
            line = [file[f"linear/tangent/{key}"][:] for key in ("frequency_hz", name)]
            found = np.interp(file["points/frequency_hz"][:], *line)
            # Interpolated linearly between 400 points over 15 Hz, 5 Hz and more from any resonance.
            assert found == pytest.approx(file[f"monitors/{name}/amplitude"][:], rel=1e-3)
            stuck = np.interp(file["points/frequency_hz"][:], *(file[f"linear/stuck/{key}"][:] for key in
                                                               ("frequency_hz", name)))  # fmt: skip
            assert (name == "b") == bool(np.all(np.abs(stuck / found - 1) > 0.05))
    page = attrito(tmp_path, "report", "result.h5")
    assert page.returncode == 0, page.stderr
    text = (tmp_path / "report.html").read_text()
    assert all(f"natural frequencies in Hz, {state}" in text for state in STATES)


def test_rigid_body_modes_of_a_body_that_nothing_but_friction_holds_are_named_as_such(tmp_path):
    job = excited(two_masses())
    # Mass 0 slides freely but for its contact; 7 natural frequencies would be zero but for rounding.
    job["model"]["stiffness"][0][0] = 0.0
    done = run(tmp_path, job)
    assert f"frictionless {natural(1.0e5)[0]:.4g}" in done.stdout and "(and 1 rigid-body mode)" in done.stdout
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["linear/frictionless"].attrs["rigid_body_modes"] == 1
        assert file["linear/frictionless/natural_hz"][:] == pytest.approx(natural(1.5e5, 1.0e5, 1.5e5), rel=1e-12)
        assert file["linear/tangent"].attrs["rigid_body_modes"] == 0
    attrito(tmp_path, "linear-modes", "job.toml", "--state", "frictionless")
    rows = table(tmp_path, result=FILES["frictionless"])
    assert [row["kind"] for row in rows] == ["rigid", "elastic", "elastic", "elastic"]
    assert float(rows[0]["frequency_hz"]) < 1e-4 and float(rows[0]["damping_ratio"]) == 0.0


def pressed_block(folder, reduction: Job | None) -> tuple[Job, np.ndarray, np.ndarray]:
    """A cantilever of bricks on a floor: contacts of its outer half are preloaded, the others far from it; K and M."""
    model, points = elastic_block((4, 1, 1), (0.12, 0.02, 0.01), fixed=lambda points: points[:, 0] < 1e-9)
    model.damping = None
    write_model(folder / "model.h5", model, [])
    law = {"tangential_stiffness": 2.0e7, "normal_stiffness": 3.0e7, "friction_coefficient": 0.4}
    job: Job = {
        "model": {"file": "model.h5"},
        "contact": [
            {"normal": [[int(3 * i + 2), -1.0]], "tangents": [[[int(3 * i), 1.0]]], **law}
            | ({"preload": 50.0} if points[i, 0] > 0.06 + 1e-9 else {"gap": 1.0})
            for i in np.flatnonzero(points[:, 2] < 1e-9)
        ],
        "balance": {"harmonics": 1},
        "output": {"file": "result.h5"},
    }
    if reduction is not None:
        job["reduction"] = reduction
    return job, model.stiffness.toarray(), model.mass.toarray()


def tangent_frequencies(job: Job, folder, stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """By scipy on the full matrices, with the springs of the contacts that the solution has left closed."""
    with h5py.File(folder / "result.modes.h5") as file:
        closed = file["closed"][:] == 1
    assert 0 < closed.sum() < len(closed), "the test is void unless some contacts are open and some closed"
    law = job["contact"][0]
    springs = np.tile([law["tangential_stiffness"], law["normal_stiffness"]], len(closed)) * np.repeat(closed, 2)
    rows = build_scene(read_job(folder / "job.toml", excited=False)).contacts.rows.toarray()
    return np.sqrt(eigh(stiffness + rows.T * springs @ rows, mass, eigvals_only=True)) / (2 * np.pi)


# Interior modes that are left out make frequencies of a Craig-Bampton model too high.
@pytest.mark.parametrize(("reduction", "tolerance"), [(None, 1e-9), ({"modes": 25}, 1e-3)])
def test_tangent_modes_of_a_finite_element_model_are_those_of_its_full_matrices(tmp_path, reduction, tolerance):
    job, stiffness, mass = pressed_block(tmp_path, reduction)
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, job), "--count", "6")
    assert done.returncode == 0, done.stderr
    found = [float(row["frequency_hz"]) for row in table(tmp_path, result="result.modes.h5")]
    assert found == pytest.approx(tangent_frequencies(job, tmp_path, stiffness, mass)[:6], rel=tolerance)


def test_the_shape_of_a_mode_is_exported_on_the_nodes_with_unit_modal_mass(tmp_path):
    model = write_blocks(tmp_path / "model.h5")
    job = blocks()
    job["load"].pop()
    del job["sweep"]
    del job["output"]["monitors"]
    assert attrito(tmp_path, "linear-modes", write_job(tmp_path, job), "--state", "stuck").returncode == 0
    done = attrito(tmp_path, "export", FILES["stuck"], "--mode", "2", "-o", "mode.vtu")
    assert done.returncode == 0, done.stderr
    shape = meshio.read(tmp_path / "mode.vtu").point_data["shape"]
    row = np.searchsorted(np.sort(model.node_ids), model.dof_node)
    vector = shape[np.argsort(model.node_ids)[row], model.dof_direction - 1]
    assert vector @ model.mass @ vector == pytest.approx(1.0, rel=1e-9)
    contacts = build_scene(read_job(tmp_path / "job.toml", excited=False)).contacts
    omega = 2 * np.pi * float(table(tmp_path, result=FILES["stuck"])[1]["frequency_hz"])
    # Rayleigh's quotient of the recovered shape, in full coordinates; stiffness 1e6 per area, per pair's area.
    areas = contacts.places["area"]
    energy = vector @ model.stiffness @ vector + 1.0e6 * np.repeat(areas, 3) @ (contacts.rows @ vector) ** 2
    assert energy == pytest.approx(omega**2, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--mode", "9"), "--mode = 9: expected --mode and a number from 1 to 4"),
        ((), "--mode = 'not given': expected --mode"),
    ],
)
def test_a_mode_that_is_not_there_is_a_fault_of_the_option(tmp_path, options, said):
    attrito(tmp_path, "linear-modes", write_job(tmp_path, two_masses()))
    done = attrito(tmp_path, "export", "result.modes.h5", *options)
    assert done.returncode == 2 and said in done.stderr


@pytest.mark.parametrize("command", ["plot", "report"])
def test_what_draws_responses_refuses_linear_modes_and_says_what_shows_them(tmp_path, command):
    attrito(tmp_path, "linear-modes", write_job(tmp_path, two_masses()))
    done = attrito(tmp_path, command, "result.modes.h5")
    assert done.returncode == 2 and "attrito table and export --mode show linear modes" in done.stderr


def test_modes_of_a_reduction_by_error_need_a_band(tmp_path):
    job = two_masses() | {"reduction": {"modes": "auto"}}
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, job))
    assert done.returncode == 2
    assert "[reduction] modes = 'auto': expected a number, or max_frequency_hz" in done.stderr


def test_a_run_still_asks_for_a_sweep_a_harmonic_load_and_monitors(tmp_path):
    done = attrito(tmp_path, "run", write_job(tmp_path, two_masses()))
    assert done.returncode == 2
    for key in ("[sweep] is missing", "load is missing", "[output] monitors is missing"):
        assert key in done.stderr, done.stderr
