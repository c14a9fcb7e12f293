"""What a run warns of before it is run: each by a scene that has the fault and by one that has not."""

from __future__ import annotations

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from bricks import brick
from elastic import elastic_block
from jobs import attrito, attrito_here, blocks, wedge, write_blocks, write_job
from scipy.sparse import csr_matrix, diags

from attrito.job.reading import read_job
from attrito.model.model_file import write_model
from attrito.model.rigidity import resisted_rotation, rotation_resistance
from attrito.report.report import glance
from attrito.report.view import View
from attrito.results.result import Result
from attrito.scene import cautions
from attrito.scene.cautions import of_static_solution


def warnings_of(folder, capfd, job):
    """What a run printed as warnings; the result and the report hold the same."""
    done = attrito_here(folder, capfd, "run", write_job(folder, job))
    assert done.returncode == 0, done.stdout + done.stderr
    said = [line.removeprefix("warning: ") for line in done.stdout.splitlines() if line.startswith("warning: ")]
    with Result(folder / "result.h5") as result:
        assert result.attribute("warnings").splitlines() == said
        first = [words for words, warns in glance(View(result, None)) if warns]
    assert {f"{line[0].upper()}{line[1:]}." for line in said} <= set(first)
    return said


def test_a_sound_scene_brings_no_warning(tmp_path, capfd):
    assert warnings_of(tmp_path, capfd, wedge()) == []


@pytest.mark.parametrize(
    ("key", "value", "instead"),
    [
        ("contacts", "all", "every pair is solved"),
        ("contacts", "auto", "every pair is solved"),
        ("quadrature", "sampled", "contacts go by events"),
        ("samples", 64, "contacts go by events"),
    ],
)
def test_a_key_without_an_effect_is_accepted_and_named_once(tmp_path, capfd, key, value, instead):
    job = wedge()
    job["sweep"] = {"frequencies_hz": [130.0, 132.0], "levels": [1.0, 0.5]}
    assert warnings_of(tmp_path, capfd, job) == []
    (tmp_path / "result.h5").rename(tmp_path / "without.h5")
    job["balance"] = job.get("balance", {}) | {key: value}
    said = warnings_of(tmp_path, capfd, job)
    assert said == [f"job.toml: [balance] {key} has no effect: {instead}; the key can be deleted"]
    with Result(tmp_path / "result.h5") as own, Result(tmp_path / "without.h5") as other:
        assert own.attribute("job") == other.attribute("job")
        assert np.array_equal(own.array("/contacts/force"), other.array("/contacts/force"))
    assert attrito(tmp_path, "run", "job.toml", ranks=2).stdout.count("has no effect") == 1


@pytest.mark.parametrize(
    ("balance", "said"),
    [
        ({"harmonics": 5, "quadrature": "auto"}, True),
        ({"harmonics": 5, "quadrature": "auto", "tolerance": 0.01}, False),
        ({"harmonics": 5, "quadrature": "event"}, False),
        ({"harmonics": "auto", "quadrature": "auto"}, False),
    ],
)
def test_a_tolerance_that_quadrature_stood_for_is_said_to_be_missing(balance, said):
    job = read_job(wedge() | {"balance": balance})
    assert any("[balance] tolerance is not given" in note for note in job.notes) == said
    assert (job["balance"]["tolerance"] is None) == ("tolerance" not in balance and balance["harmonics"] == 5)


def test_a_static_solution_in_which_nothing_touches_is_told_once(tmp_path, capfd):
    job = wedge()
    job["load"][0]["dofs"] = [[1, -420.0]]
    job["sweep"]["levels"] = [1.0, 0.5]
    (warning,) = warnings_of(tmp_path, capfd, job)
    assert warning.startswith("no contact touches at the static solution")


def test_one_contact_that_touches_is_enough():
    assert of_static_solution((0, 1, 0, 5)) == []
    assert len(of_static_solution((0, 0, 0, 6))) == 1
    assert of_static_solution((0, 0, 0, 0)) == []


def test_a_damping_matrix_that_feeds_a_mode_is_told(tmp_path, capfd):
    job = wedge()
    job["model"]["damping"] = [[60.0, 0.0], [0.0, -30.0]]
    # The frictionless and the stuck system: modes near x and near y each.
    said = warnings_of(tmp_path, capfd, job)
    assert len(said) == 2
    assert all(line.startswith("damping is negative: it feeds the") for line in said)
    assert "stuck mode at" in said[0] and "frictionless mode at" in said[1]


def test_a_tangent_along_the_normal_is_told_and_one_beside_it_is_not(tmp_path, capfd):
    job = wedge()
    job["contact"][0]["tangents"] = [[[0, -3.0], [1, -3.0]]]
    job["contact"].append(job["contact"][0] | {"tangents": [[[0, 1.0], [1, 1.001]]]})
    (warning,) = warnings_of(tmp_path, capfd, job)
    assert warning.startswith("contact[0]: tangents[0] is parallel to normal")


@pytest.mark.parametrize("gap", [0.0, 0.05])
def test_pairs_that_lie_apart_are_told_with_the_moment_that_a_rotation_finds(tmp_path, capfd, gap):
    model = write_blocks(tmp_path / "model.h5")
    pairs = len(model.node_sets["top"])
    model.coordinates[np.isin(model.node_ids, model.node_sets["top"])] += [0.0, 0.0, gap]
    write_model(tmp_path / "model.h5", model, [])
    job = blocks()
    job["contact_set"][0] |= {"tolerance": 0.1, "stiffness_per": "node"}
    said = [line for line in warnings_of(tmp_path, capfd, job) if "apart, " in line and "contact_set" in line]
    if gap == 0.0:
        assert said == []
        return
    (warning,) = said
    # Two tangents of 1e6 at every pair; about an axis in the plane, kt gap^2 each, times 1e-3 rad.
    moment = 1e6 * pairs * gap**2 * 1e-3
    assert f"up to {gap:.3g} apart" in warning
    assert f"a moment of {moment:.3g};" in warning


def test_matrices_that_resist_a_rigid_rotation_are_told_from_held_and_sound_ones():
    model, points = elastic_block((4, 2, 2), (2.0, 1.0, 1.0), fixed=lambda points: points[:, 0] < 1e-9)
    model.node_ids = np.arange(1, len(points) + 1)
    model.coordinates = points
    model.elements = {"C3D8": (np.array([1]), np.array([[1] * 8]))}
    model.dof_node, model.dof_direction = np.repeat(model.node_ids, 3), np.tile([1, 2, 3], len(points))
    assert resisted_rotation(model) is None
    # Springs between nodes, the same in every direction: they resist no translation.
    near = np.linalg.norm(points[:, None] - points[None, :], axis=2) < 0.51
    springs = np.diag(near.sum(axis=1)) - near.astype(float)
    for part in (1e-3, 1e-5):
        spoilt = model.stiffness + part * model.stiffness.max() * csr_matrix(np.kron(springs, np.eye(3)))
        told = model.__class__(spoilt, model.mass, None, model.dof_node, model.dof_direction)
        told.node_ids, told.coordinates, told.elements = model.node_ids, points, model.elements
        assert "resists a rigid rotation" in resisted_rotation(told)
        assert 0.01 * part < rotation_resistance(told) < 10.0 * part
        # Stress stiffening does so rightly.
        told.stiffness_holds = ("stress_stiffening",)
        assert resisted_rotation(told) is None


def test_a_body_that_slides_along_a_plane_resists_no_rotation_beyond_it():
    """Beside the plane of a regular mesh forces of a translation cancel, as if no support were there."""
    model = brick(layers=6)
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    held = np.array([x[node] < 1e-9 for node in model.dof_node]) & (np.asarray(model.dof_direction) == 1)
    stays = np.flatnonzero(~held)
    model.stiffness, model.mass = (matrix[stays][:, stays] for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction = (np.asarray(one)[stays] for one in (model.dof_node, model.dof_direction))
    model.size = len(stays)
    assert rotation_resistance(model) is None


def odd_job() -> dict:
    """A job of which every kind of command warns: no contact touches, damping feeds a mode, rows are parallel."""
    job = wedge(force=1.0)
    job["load"][0]["dofs"] = [[1, -420.0]]
    job["model"]["damping"] = [[60.0, 0.0], [0.0, -30.0]]
    job["contact"].append(job["contact"][0] | {"tangents": [[[0, 1.0], [1, 1.0]]]})
    job["sweep"], job["peak"] = {"start_hz": 280.0, "stop_hz": 85.0}, {"start": 1.0, "stop": 1.05}
    job["integrate"] = {"frequency_hz": 90.0, "cycles": 3}
    return job


@pytest.mark.parametrize("command", ["reduce", "peak", "study", "integrate"])
def test_every_command_on_a_job_warns_once_of_what_it_finds(tmp_path, capfd, command):
    job = odd_job()
    if command == "reduce":
        # Which takes a model with a mesh, and solves nothing.
        model = write_blocks(tmp_path / "model.h5")
        model.damping = -1e-6 * model.stiffness
        write_model(tmp_path / "model.h5", model, [])
        job = blocks()
        job.pop("damping", None)
        job["contact"] = [wedge()["contact"][0] | {"tangents": [[[0, 1.0], [1, 1.0]]]}]
    path = write_job(tmp_path, job)
    if command == "study":
        vary = [{"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 1.0, "high": 1.1, "factor": True}]
        path = write_job(tmp_path, {"job": "job.toml", "samples": 2, "vary": vary}, "study.toml")
    done = attrito_here(tmp_path, capfd, command, path)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    said = [line.removeprefix("warning: ") for line in done.stdout.splitlines() if line.startswith("warning: ")]
    expected = ["is parallel to normal", "feeds the stuck mode", "feeds the frictionless mode"]
    if command != "reduce":
        expected.append("no contact touches at the static solution")
    assert len(said) == len(expected), said
    assert all(part in line for part, line in zip(expected, said, strict=True)), said
    if command == "study":
        assert "static solution of 2 of 2 samples" in said[-1]
    if command != "reduce":
        name = {"peak": "result.peaks.h5", "study": "study.h5", "integrate": "result.h5"}[command]
        with h5py.File(tmp_path / name) as file:
            kept = file["integration"] if command == "integrate" else file
            assert kept.attrs["warnings"].splitlines() == said


def test_an_integration_that_starts_on_touching_contacts_does_not_warn(tmp_path, capfd):
    job = wedge()
    job["integrate"] = {"frequency_hz": 132.0, "cycles": 3}
    done = attrito_here(tmp_path, capfd, "integrate", write_job(tmp_path, job))
    assert done.returncode in (0, 1) and "warning" not in done.stdout


@pytest.mark.parametrize(("band", "harmonic", "told"), [((60.0, 80.0), 1, True), ((60.0, 80.0), 2, False)])
def test_a_band_that_no_mode_can_resonate_in_is_told(tmp_path, capfd, band, harmonic, told):
    job = wedge()
    job["sweep"] = {"start_hz": band[0], "stop_hz": band[1]}
    job["load"][1]["harmonic"] = harmonic
    said = warnings_of(tmp_path, capfd, job)
    assert len(said) == told
    assert not told or said[0].startswith(
        "no natural frequency from 60 to 80 Hz, so no resonance is swept; nearest, in"
    )


@pytest.mark.parametrize("load", ["gravity", "centrifugal"])
def test_a_load_by_mass_that_supports_share_names_what_it_lacks(tmp_path, capfd, load):
    model = write_blocks(tmp_path / "model.h5")
    # Neither lumped nor the mesh's
    beside = diags(np.full(model.size - 3, 0.01 * model.mass.diagonal().min()), 3)
    model.mass = csr_matrix(model.mass + beside + beside.T)
    write_model(tmp_path / "model.h5", model, [])
    job = blocks()
    job["sweep"] = {"frequencies_hz": [1.0]}
    plain = warnings_of(tmp_path, capfd, job)
    spin = {"speed_hz": 1e-3, "axis_point": [0.0, 0.0, 0.0], "axis_direction": [0.0, 0.0, 1.0]}
    more = {"kind": "static", "gravity": [0.0, 0.0, -1e-6]} if load == "gravity" else {"kind": load, **spin}
    job["load"].append({"name": "by mass", **more})
    (said,) = set(warnings_of(tmp_path, capfd, job)) - set(plain)
    assert said.startswith(f"load[{len(job['load']) - 1}]: matrices without held dofs lack 8.33% of the mass")


def test_kinds_of_elements_at_supports_without_shape_functions_are_named():
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    job, scene = {"load": [{"kind": "centrifugal"}]}, SimpleNamespace(model=model)
    assert cautions._lost_at_supports(job, scene) == []
    model.elements = {"C3D10M": model.elements["C3D8"]}
    (said,) = cautions._lost_at_supports(job, scene)
    assert said.startswith("load[0]: what nodes of elements C3D10M share with supports is neither in the matrices")
