"""The scene of the demo on its coarse mesh: from CalculiX's files to tables, pictures and shapes."""

from __future__ import annotations

import csv
import io
import subprocess
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from jobs import attrito
from scipy.linalg import eigh
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh

from attrito.job.reading import read_job
from attrito.scene.build import build_scene

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    """Folder of a run of the demo's job, on two ranks, on the coarse mesh and a narrower sweep."""
    folder = tmp_path_factory.mktemp("blade")
    script = REPOSITORY / "meshes" / "blade.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", folder], check=True)
    done = attrito(folder, "import", "model.h5", "--calculix", "blade", "--mesh", "blade.inp")
    assert done.returncode == 0, done.stderr
    text = (REPOSITORY / "input" / "blade.toml").read_text().replace("../out/blade/", "")
    # The coarse mesh is softer: its first stuck mode lies at 400 Hz.
    text = text.replace("start_hz = 390.0", "start_hz = 396.0").replace("stop_hz = 440.0", "stop_hz = 403.0")
    (folder / "blade.toml").write_text(text)
    done = attrito(folder, "run", "blade.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    return folder


def table(folder, *options):
    done = attrito(folder, "table", *options, "result.h5")
    assert done.returncode == 0, done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


def test_every_point_of_both_levels_converges_and_friction_lowers_the_peak(blade):
    rows = table(blade)
    assert {row["outcome"] for row in rows} == {"converged"}
    peaks = {}
    for row in rows:
        level = float(row["level"])
        peaks[level] = max(peaks.get(level, 0.0), float(row["tip_amplitude"]) / level)
    low, high = sorted(peaks)
    assert peaks[high] < 0.9 * peaks[low]


def test_the_frequencies_of_the_stuck_reduced_model_are_those_of_the_full_one(blade):
    scene = build_scene(read_job(blade / "blade.toml"))
    laws = scene.contacts.laws
    springs = np.ravel(np.column_stack([laws["tangential_stiffness"]] * 2 + [laws["normal_stiffness"]]))

    def stuck(stiffness, rows):
        return stiffness + rows.T @ diags(springs) @ rows

    full = stuck(scene.model.stiffness, scene.contacts.rows)
    expected = np.sort(eigsh(full.tocsc(), 5, scene.model.mass.tocsc(), sigma=0.0, return_eigenvectors=False))
    with h5py.File(blade / "rom.h5") as file:
        mass, stiffness, boundary = file["mass"][:], file["stiffness"][:], file["boundary/dof"][:]
    rows = np.zeros((scene.contacts.rows.shape[0], len(mass)))
    rows[:, : len(boundary)] = scene.contacts.rows[:, boundary].toarray()
    values = eigh(stuck(stiffness, rows), mass, eigvals_only=True)[:5]
    # The bar; what fixed-interface modes leave out of the lowest five is some 1e-6.
    assert np.sqrt(values) == pytest.approx(np.sqrt(expected), rel=1.0e-4)


def test_the_centrifugal_load_is_carried_by_the_flanks(blade):
    """Mean contact forces along z balance Omega^2 M r of the blade, whatever friction does."""
    scene = build_scene(read_job(blade / "blade.toml"))
    flank_nodes = np.concatenate([scene.model.node_sets[name] for name in ("root_left", "root_right")])
    with h5py.File(blade / "result.h5") as file:
        force = file["contacts/force"][0, :, :, 0]
        frame = file["contacts/parameters/frame"][:]
        assert np.isin(file["contacts/parameters/node_a"][:], flank_nodes).all()
    # Rows of the frame are t1, t2, n; the force on the blade is -B^T (T, N).
    on_blade = -np.einsum("ci,cij->j", force, frame)
    # The blade is the connected piece that holds the tip.
    from scipy.sparse.csgraph import connected_components

    label = connected_components(scene.model.stiffness)[1]
    tip = np.isin(scene.model.dof_node, scene.model.node_sets["tip"])
    blade_dofs = label == label[tip][0]
    for direction in (1, 2, 3):
        own = blade_dofs & (scene.model.dof_direction == direction)
        pull = scene.static["spin"][own].sum()
        scale = np.abs(scene.static["spin"][blade_dofs]).sum()
        assert on_blade[direction - 1] + pull == pytest.approx(0.0, abs=1.0e-7 * scale)


def test_contacts_never_pull_nor_exceed_the_friction_limit_on_average(blade):
    rows = table(blade, "--contacts")
    points = len(table(blade))
    assert points > 10 and len(rows) >= points and len(rows) % points == 0
    for row in rows:
        tangential = np.hypot(float(row["t1_mean"]), float(row["t2_mean"]))
        assert float(row["n_min"]) >= 0.0
        # |mean T| <= mean |T| <= mu mean N; forces are kept to rounding of their springs' share.
        assert tangential <= 0.3 * float(row["n_mean"]) * (1.0 + 1.0e-9)
        assert float(row["stick"]) + float(row["slip"]) + float(row["open"]) == pytest.approx(1.0, abs=1.0e-12)


def test_a_shape_and_pictures_come_out(blade):
    for arguments in (("plot",), ("plot", "--loops"), ("plot", "--map"), ("export",)):
        done = attrito(blade, arguments[0], "result.h5", *arguments[1:])
        assert done.returncode == 0, done.stderr
    mesh = meshio.read(blade / "shape.vtu")
    amplitude = np.linalg.norm(mesh.point_data["amplitude"].reshape(len(mesh.points), -1), axis=1)
    # First bending: the tip moves most.
    assert mesh.points[np.argmax(amplitude), 2] > 360.0
    with h5py.File(blade / "result.h5") as file:
        contacts = {node for side in ("node_a", "node_b") for node in file[f"contacts/parameters/{side}"][:]}
    assert (mesh.point_data["contact_state"] >= 0).sum() == len(contacts)
