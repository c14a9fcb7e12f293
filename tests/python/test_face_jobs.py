"""Jobs with contact on faces, from the mesher to the result; gaps from geometry and files."""

from __future__ import annotations

import copy
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import attrito
from scipy.sparse import identity
from unlike_meshes import unlike_joint

from attrito.job.reading import read_job
from attrito.model.face_sets import pair_faces
from attrito.model.model_file import write_model
from attrito.scene.build import build_scene, with_numbers_of
from attrito.support.errors import InputError

REPOSITORY = Path(__file__).resolve().parents[2]


def described(folder: Path, text: str, **keys: object) -> dict:
    """A job on a model of two boxes with masses and springs of one, gaps as asked for."""
    pair = {"a": "top", "b": "bottom", "tolerance": 0.2, "pairing": "face"}
    law = {"normal_stiffness": 2.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3}
    if text:
        (folder / "gaps.txt").write_text(text)
    return {
        "model": {"file": "model.h5"},
        "contact_set": [pair | law | keys],
        "load": [{"kind": "harmonic", "cosine": [[["node", 101, "z"], 1.0]]}],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [1.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "tip", "dofs": [[["node", 101, "z"], 1.0]]}]},
    }


@pytest.fixture
def boxes(tmp_path):
    """A model of two boxes 0.05 apart, faces of 2 x 2 and 3 x 3 quadrilaterals, in `model.h5`."""
    model = unlike_joint(("C3D8", "C3D8"), (2, 3), gap=0.05)
    model.stiffness = model.mass = identity(model.size, format="csr")
    write_model(tmp_path / "model.h5", model, [])
    return model


def gaps_of(folder: Path, text: str = "", **keys: object) -> np.ndarray:
    return build_scene(read_job(described(folder, text, **keys), folder)).contacts.laws["gap"]


@pytest.mark.parametrize("points", ("node", "gauss", "cut"))
def test_a_gap_from_the_geometry_is_the_distance_of_the_faces(tmp_path, boxes, points):
    assert gaps_of(tmp_path, points=points) == pytest.approx(0.0, abs=0)
    found = gaps_of(tmp_path, points=points, gap="geometry")
    assert found == pytest.approx(np.full(len(found), 0.05), rel=1e-12)


def test_node_pairs_have_a_gap_from_the_geometry_too(tmp_path, boxes):
    found = gaps_of(tmp_path, pairing="node", tolerance=0.06, gap="geometry")
    assert len(found) == 4
    assert found == pytest.approx(np.full(4, 0.05), rel=1e-12)


@pytest.mark.parametrize("points", ("node", "gauss", "cut"))
def test_a_gap_file_s_linear_gap_is_met_at_every_contact(tmp_path, boxes, points):
    place = dict(zip(boxes.node_ids, boxes.coordinates, strict=True))
    top = boxes.node_sets["top"]
    lines = [f"{node}, {1e-3 + 0.01 * place[node][0] - 0.02 * place[node][1]!r}  # {node}" for node in top]
    text = "# node, gap\n\n" + "\n".join(reversed(lines))
    found = gaps_of(tmp_path, text, gap_file="gaps.txt", points=points, gap=0.5)
    at = pair_faces(boxes, "top", "bottom", 0.2, 2, points, "", "").position
    assert found == pytest.approx(0.5 + 1e-3 + 0.01 * at[:, 0] - 0.02 * at[:, 1], rel=1e-12)


def test_a_scene_with_another_job_s_numbers_keeps_its_gaps(tmp_path, boxes):
    text = "\n".join(f"{node} 0.25" for node in boxes.node_sets["top"])
    job = read_job(described(tmp_path, text, gap_file="gaps.txt", gap=1.0), tmp_path)
    other = copy.deepcopy(job)
    other.tables["contact_set"][0]["gap"] = 2.0
    scene = build_scene(job)
    assert scene.contacts.laws["gap"] == pytest.approx(1.25)
    assert with_numbers_of(other, scene).contacts.laws["gap"] == pytest.approx(2.25)


@pytest.mark.parametrize(("pairing", "contacts"), [("node", 4), ("face", 9)])
def test_the_log_says_how_long_pairing_took_and_what_memory_its_rows_take(tmp_path, boxes, pairing, contacts):
    read = read_job(described(tmp_path, "", pairing=pairing, tolerance=0.06), tmp_path)
    pairs = build_scene(read).contacts
    said = re.fullmatch(
        r"contact_set\[0\]: (\d+) contacts paired in (\S+) s; their rows take (\S+) MB, memory so far at most (\d+) MB",
        pairs.notes[-1],
    )
    assert int(said[1]) == contacts == len(pairs.tables)
    # Values of 8 bytes, columns and offsets of 4.
    held = 12 * pairs.rows.nnz + 4 * (3 * contacts + 1)
    assert float(said[3]) == pytest.approx(held / 1e6, abs=0.005)
    assert float(said[2]) >= 0.0 and float(said[4]) > 10.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3\n", "line 1 = '1 2 3': expected a node and its gap"),
        ("# all\n102 wide\n", "line 2 = '102 wide': expected a node and its gap"),
        ("102 inf\n", "line 1 = '102 inf': expected a finite gap"),
        ("99999999999999999999 0\n", "line 1 = '99999999999999999999 0': expected a node and its gap"),
        ("102 0\n103 0\n102 0\n", "nodes = 'nodes 102': expected each node once"),
        ("7 0.0\n", "nodes = 'nodes 7': expected nodes of the model"),
        ("102 0.0\n", "nodes = 'without nodes "),
        ("", "file = 'No such file or directory': expected a text file that can be read"),
    ],
)
def test_a_faulty_gap_file_is_refused_by_its_line_or_nodes(tmp_path, boxes, text, said):
    with pytest.raises(InputError) as caught:
        gaps_of(tmp_path, text, gap_file="gaps.txt")
    assert f"{tmp_path / 'gaps.txt'}: {said}" in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"pairing": "node", "points": "gauss"}, "points = 'gauss': expected no such key but with pairing = \"face\""),
        ({"b": "ground", "points": "cut"}, 'points = \'cut\': expected "node" or "gauss": the ground has no edges'),
        (
            {"b": "ground", "gap": "geometry"},
            "gap = 'geometry': expected a number: the ground has no place in the mesh",
        ),
        ({"gap_file": "g", "gap": "geometry"}, "gap = 'geometry': expected a number, to which gap_file adds"),
        ({"pairing": "faces"}, 'pairing = \'faces\': expected one of "node", "face"'),
        ({"gap": "mesh"}, "gap = 'mesh': expected a number, or \"geometry\""),
    ],
)
def test_keys_of_a_contact_set_that_do_not_go_together_are_refused(tmp_path, keys, said):
    with pytest.raises(InputError) as caught:
        read_job(described(tmp_path, "", **keys), tmp_path)
    assert f"contact_set[0] {said}" in str(caught.value)


def test_all_nodes_of_a_contact_s_faces_are_boundary_nodes(tmp_path, boxes):
    # One tangent leaves the second one's direction out of the rows.
    scene = build_scene(read_job(described(tmp_path, "", points="gauss", tangents=1), tmp_path))
    nodes = np.concatenate([boxes.node_sets["top"], boxes.node_sets["bottom"]])
    assert (scene.boundary == np.flatnonzero(np.isin(boxes.dof_node, nodes))).all()


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """Folder of the lap joint whose plates are meshed 1 : 1.7, imported."""
    folder = tmp_path_factory.mktemp("plates")
    script = REPOSITORY / "meshes" / "lap_joint.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--ratio", "1.7", "--out", folder], check=True)
    done = attrito(folder, "import", "model.h5", "--calculix", "lap_joint", "--mesh", "lap_joint.inp")
    assert done.returncode == 0, done.stderr
    return folder


def test_plates_with_unlike_meshes_are_reduced_and_run(plates):
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / "lap_joint.toml").read_text())
    text, count = re.subn(r"start_hz = .*\nstop_hz = .*\n", "frequencies_hz = [50.0]\n", text)
    text, changed = re.subn(r"tolerance = .*\n", 'pairing = "face"\ntolerance = 1e-3\n', text)
    assert count == changed == 1
    (plates / "job.toml").write_text(text.replace("[static]", '[static]\nbounds = "none"'))
    for command in ("reduce", "run"):
        done = attrito(plates, command, "job.toml")
        assert done.returncode == 0, done.stderr
    assert re.search(r"contact_set\[0\]: 130 nodes of lower_face on 23 of 23 faces of upper_face: area", done.stdout)
    with h5py.File(plates / "result.h5") as file:
        mean = file["contacts/n_mean"][0]
        position = file["contacts/parameters/position"][:]
        clearance = file["contacts/parameters/clearance"][:]
    radius = np.hypot(*position[:, :2].T)
    assert np.abs(clearance).max() < 1e-9
    # The contacts carry the bolt's 4 kN, about its hole.
    assert mean.sum() == pytest.approx(4000.0, abs=1e-2)
    assert mean[radius > 15.0].sum() < 1e-2 * mean.sum()


def test_the_job_with_contact_on_faces_runs_on_the_meshes_that_it_names(plates):
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / "lap_joint_faces.toml").read_text())
    text, count = re.subn(r"start_hz = .*\nstop_hz = .*\n", "frequencies_hz = [50.0]\n", text)
    assert count == 1
    text = text.replace("result.h5", "faces.h5").replace("modes = 20", 'modes = 20\nfile = "rom_faces.h5"')
    (plates / "faces.toml").write_text(text.replace("[static]", '[static]\nbounds = "none"'))
    done = attrito(plates, "run", "faces.toml")
    assert done.returncode == 0, done.stderr
    assert re.search(r"contact_set\[0\]: 168 Gauss points .* of upper_face: area", done.stdout)
    with h5py.File(plates / "faces.h5") as file:
        assert file["contacts/n_mean"][0].sum() == pytest.approx(4000.0, abs=1e-2)
