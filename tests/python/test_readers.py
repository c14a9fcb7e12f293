"""Files written by hand in every format are one model; so are its dofs, on the command line and in a job."""

from __future__ import annotations

import h5py
import matrix_writers as write
import numpy as np
import pytest
import scipy.sparse as sparse
from jobs import attrito_here
from scipy.linalg import eigh
from two_springs import DATA, DIRECTION, MASS, NODE, STIFFNESS

from attrito.importers import import_model, read_mesh
from attrito.model.model import Model
from attrito.model.model_file import read_model

BY_HAND = {
    "abaqus": {"abaqus_job": "two_springs", "mesh": "two_springs.inp"},
    "ansys": {
        "stiffness": "two_springs_stiffness.hb",
        "mass": "two_springs_mass.hb",
        "dofs": "two_springs.mapping",
        "mesh": "two_springs.cdb",
    },
    "nastran punch": {"nastran_file": "two_springs.pch", "mesh": "two_springs_mesh.bdf"},
    "nastran small and free fields": {"nastran_file": "two_springs_small.bdf"},
    "nastran op4": {"nastran_file": "two_springs.op4", "dofs": "two_springs.aset", "mesh": "two_springs_mesh.bdf"},
    "matrices by name": {
        "stiffness": "two_springs.pch:KAAX",
        "mass": "two_springs_small.bdf:maax",
        "mesh": "two_springs_mesh.bdf",
    },
}


@pytest.mark.parametrize("files", BY_HAND.values(), ids=BY_HAND)
def test_samples_written_by_hand_are_the_two_springs(files, tmp_path, monkeypatch):
    monkeypatch.chdir(DATA)
    model, notes = import_model(tmp_path / "model.h5", **files)
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS)
    assert np.array_equal(model.mass.toarray(), MASS)
    assert (model.stiffness.nnz, model.mass.nnz) == (5, 3)
    assert model.dof_node.tolist() == NODE.tolist() and model.dof_direction.tolist() == DIRECTION.tolist()
    assert model.has_mesh == ("mesh" in files)
    told = any("1 dofs held by a diagonal of 1e+30" in note for note in notes)
    assert told == ("abaqus_job" in files)


@pytest.mark.parametrize(
    ("file", "sets"),
    [
        ("two_springs.cdb", {"BASE": [7, 40], "RANGE": [7, 12, 40]}),
        ("two_springs_mesh.bdf", {"set_1": [40, 1000], "set_2": [7, 12, 40]}),
    ],
)
def test_meshes_written_by_hand_have_their_nodes_elements_and_sets(file, sets):
    mesh = read_mesh(DATA / file)
    assert mesh.node_ids.tolist() == [40, 7, 12, 1000]
    assert np.array_equal(mesh.coordinates, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    ids, connectivity = mesh.elements["C3D4"]
    assert ids.tolist() == [5] and connectivity.tolist() == [[40, 7, 12, 1000]]
    # A range runs over the ids that there are.
    assert {name: ids.tolist() for name, ids in mesh.node_sets.items()} == sets


@pytest.mark.parametrize("name", BY_HAND)
def test_the_command_line_of_each_code_makes_a_model(name, tmp_path, capfd):
    options = {"abaqus_job": "abaqus", "nastran_file": "nastran"}
    arguments = [word for key, file in BY_HAND[name].items() for word in (f"--{options.get(key, key)}", file)]
    done = attrito_here(DATA, capfd, "import", str(tmp_path / "model.h5"), *arguments)
    assert done.returncode == 0, done.stderr
    assert "3 dofs, 5 entries of stiffness, 3 of mass" in done.stdout
    assert ("no mesh" in done.stdout) == ("mesh" not in BY_HAND[name])
    model = read_model(tmp_path / "model.h5")
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS) and model.dof_node.tolist() == NODE.tolist()
    assert model.has_mesh == ("mesh" in BY_HAND[name])


def plate(rows: int = 2) -> tuple[sparse.csr_matrix, sparse.csr_matrix, np.ndarray, np.ndarray]:
    """Stiffness and mass of six dofs at each node, in no order of the ids; rotations have inertia."""
    generator = np.random.default_rng(3)
    node = np.repeat([70, 5, 812][:rows], 6)
    direction = np.tile(np.arange(1, 7), rows)
    factor = generator.standard_normal((6 * rows, 6 * rows))
    stiffness, mass = factor @ factor.T + 10.0 * np.eye(6 * rows), np.diag(generator.uniform(1.0, 2.0, 6 * rows))
    return sparse.csr_matrix(stiffness), sparse.csr_matrix(mass), node, direction


def test_rotations_of_shells_are_kept_and_dofs_come_by_node_and_direction(tmp_path, monkeypatch):
    stiffness, mass, node, direction = plate(3)
    monkeypatch.chdir(tmp_path)
    write.write_dmig(tmp_path / "job.pch", {"KAAX": stiffness, "MAAX": mass}, node, direction, "free")
    model, notes = import_model(tmp_path / "model.h5", nastran_file="job.pch")
    order = np.lexsort((direction, node))
    assert np.array_equal(model.stiffness.toarray(), stiffness.toarray()[np.ix_(order, order)])
    assert model.dof_node.tolist() == node[order].tolist()
    assert model.dof_direction.tolist() == direction[order].tolist()
    assert "9 of the dofs are rotations" in notes


def test_large_and_small_node_ids_are_told_apart(tmp_path, monkeypatch):
    """Some ids look up in a table, those above 2^26 by bisection."""
    stiffness, mass, node, direction = plate(3)
    node = np.where(node == 5, 2**40 + 1, np.where(node == 70, 2**40, node))
    write.write_abaqus(tmp_path / "job_STIF1.mtx", stiffness, node, direction, "both")
    write.write_abaqus(tmp_path / "job_MASS1.mtx", mass, node, direction)
    model, _ = import_model(tmp_path / "model.h5", abaqus_job=tmp_path / "job")
    order = np.lexsort((direction, node))
    expected = stiffness.toarray()[np.ix_(order, order)]
    assert np.allclose(model.stiffness.toarray(), expected, rtol=1.0e-14, atol=0.0)
    assert model.dof_node.tolist() == node[order].tolist()


def test_dofs_held_by_a_unit_row_and_empty_rows_are_taken_out(tmp_path):
    """As programs write that keep held dofs, and Nastran's g-set has rotations of solids."""
    stiffness, mass = np.zeros((5, 5)), np.zeros((5, 5))
    free = [0, 2, 3]
    stiffness[np.ix_(free, free)], mass[np.ix_(free, free)] = STIFFNESS, MASS
    stiffness[1, 1] = 1.0
    for name, matrix in (("K", stiffness), ("M", mass)):
        sparse.save_npz(tmp_path / f"{name}.npz", sparse.csr_matrix(matrix))
    (tmp_path / "rows.dof").write_text("12.2\n12.3\n1000.1\n1000.3\n1000.4\n")
    given = {"stiffness": tmp_path / "K.npz", "mass": tmp_path / "M.npz", "dofs": tmp_path / "rows.dof"}
    model, notes = import_model(tmp_path / "model.h5", **given)
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS) and np.array_equal(model.mass.toarray(), MASS)
    assert model.dof_node.tolist() == NODE.tolist() and model.dof_direction.tolist() == DIRECTION.tolist()
    assert "1 dofs held by a row with nothing but a unit diagonal: taken out" in notes
    assert "1 dofs without stiffness and mass: taken out" in notes


def test_a_dof_file_puts_rows_in_any_order(tmp_path):
    """ANSYS's equations are not in the order of nodes."""
    swap = [2, 0, 1]
    for name, matrix in (("K", STIFFNESS), ("M", MASS)):
        write.write_harwell_boeing(tmp_path / f"{name}.hb", sparse.csr_matrix(matrix[np.ix_(swap, swap)]))
    write.write_mapping(tmp_path / "K.mapping", NODE[swap], DIRECTION[swap])
    given = {"stiffness": tmp_path / "K.hb", "mass": tmp_path / "M.hb", "dofs": tmp_path / "K.mapping"}
    model, _ = import_model(tmp_path / "model.h5", **given, mesh=DATA / "two_springs.cdb")
    assert model.dof_node.tolist() == NODE[swap].tolist() and model.dof_direction.tolist() == DIRECTION[swap].tolist()
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS[np.ix_(swap, swap)])


def test_a_vector_on_nodes_leaves_rotations_alone():
    ids, points = np.array([9, 4]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    node, direction = np.array([4, 4, 9, 9]), np.array([1, 5, 3, 6], np.int8)
    model = Model(sparse.eye(4).tocsr(), sparse.eye(4).tocsr(), None, node, direction, ids, points)
    assert model.on_dofs(points).tolist() == [4.0, 0.0, 3.0, 0.0]


JOB = """
[model]
{model}
[damping]
ratio = 0.01
[[contact]]
normal = [[["node", 12, "y"], 1.0]]
tangents = [[[["node", 1000, "x"], 1.0]]]
normal_stiffness = 10.0
tangential_stiffness = 10.0
friction_coefficient = 0.3
preload = 10.0
[[load]]
kind = "harmonic"
cosine = [[["node", 1000, "{direction}"], 0.1]]
[balance]
harmonics = 1
[sweep]
frequencies_hz = [0.2]
[output]
file = "result.h5"
monitors = [{{ name = "x", dofs = [[["node", 1000, "x"], 1.0]] }}]
"""
MODELS = {
    "a model file without a mesh": 'file = "model.h5"',
    "Abaqus": 'stiffness = "two_springs_STIF1.mtx"\nmass = "two_springs_MASS1.mtx"',
    "Nastran": 'stiffness = "two_springs.pch:KAAX"\nmass = "two_springs.pch:MAAX"',
}


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_jobs_name_nodes_of_models_without_a_mesh(model, tmp_path, capfd):
    for path in DATA.glob("two_springs*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    import_model(tmp_path / "model.h5", nastran_file=tmp_path / "two_springs.pch")
    (tmp_path / "job.toml").write_text(JOB.format(model=model, direction="x"))
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.h5") as file:
        amplitude = file["monitors/x/amplitude"][0]
    # It sticks: the force 0.1 is far below 0.3 times the normal force, 10 - 10 * 10 / 13 or so. Springs of 10 hold both
    # dofs; damping is modal.
    values, modes = eigh(STIFFNESS[:2, :2] + 10.0 * np.eye(2), MASS[:2, :2])
    omega = 0.4 * np.pi
    response = modes @ (0.1 * modes[1] / (values - omega**2 + 0.02j * np.sqrt(values) * omega))
    assert amplitude == pytest.approx(abs(response[1]), rel=1.0e-9)
    (tmp_path / "job.toml").write_text(JOB.format(model=model, direction="rx"))
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2
    assert 'load[0] cosine = \'["node", 1000, "rx"]\': expected a free dof (this one is held)' in done.stderr
