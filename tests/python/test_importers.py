"""Importers and model.h5: matrices and meshes of other programs arrive as they were meant."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import product
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from edited import edited
from scipy.io import mmwrite
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import eigsh
from two_springs import DATA, MASS, STIFFNESS

from attrito.importers import check_matrices, import_model, read_matrix, read_mesh
from attrito.importers.check import lost_diagonals
from attrito.importers.dof_file import read_dof_file
from attrito.model.model_file import read_model
from attrito.support.errors import InputError

REPOSITORY = Path(__file__).parents[2]


def fault_lines(call, *arguments, **options) -> str:
    """What the call's InputError says."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    return str(caught.value)


def copy_springs(folder: Path, **changes: str) -> dict[str, Path]:
    """The two-springs job in a folder, with some of its files (by ending) replaced."""
    for ending in ("sti", "mas", "dof", "inp"):
        text = changes.get(ending, (DATA / f"two_springs.{ending}").read_text())
        (folder / f"job.{ending}").write_text(text)
    return {"output": folder / "model.h5", "calculix_job": folder / "job", "mesh": folder / "job.inp"}


# --- CalculiX files, by hand -----------------------------------------------------------------------------------------


def test_halves_of_calculix_matrices_are_mirrored_and_zeros_dropped(tmp_path):
    model, _ = import_model(**copy_springs(tmp_path))
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS)
    assert np.array_equal(model.mass.toarray(), MASS)
    assert (model.stiffness.nnz, model.mass.nnz) == (5, 3)
    assert model.dof_node.tolist() == [12, 1000, 1000]
    assert model.dof_direction.tolist() == [2, 1, 3]


def test_node_ids_with_gaps_keep_their_coordinates_and_elements(tmp_path):
    mesh = read_mesh(DATA / "two_springs.inp")
    assert mesh.node_ids.tolist() == [40, 7, 12, 1000]
    assert np.array_equal(mesh.coordinates, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    ids, connectivity = mesh.elements["C3D4"]
    assert ids.tolist() == [5]
    assert connectivity.tolist() == [[40, 7, 12, 1000]]


def test_node_sets_may_name_sets_ranges_and_go_on_later():
    sets = {name: ids.tolist() for name, ids in read_mesh(DATA / "two_springs.inp").node_sets.items()}
    assert sets == {"Base": [7, 40], "corner": [40, 1000], "both": [7, 12, 1000], "odd": [7, 12]}


def test_constraints_that_hide_dofs_are_told(tmp_path):
    deck = (DATA / "two_springs.inp").read_text() + "*Equation\n2\n7, 1, 1., 40, 1, -1.\n"
    _, notes = import_model(**copy_springs(tmp_path, inp=deck))
    assert "*EQUATION, line 21" in notes[-1]


def test_included_files_are_read_in_place(tmp_path):
    (tmp_path / "nodes.inp").write_text("*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n")
    (tmp_path / "deck.inp").write_text("*INCLUDE, INPUT=nodes.inp\n*ELEMENT, TYPE=C3D4\n9, 1, 2,\n3, 4\n")
    mesh = read_mesh(tmp_path / "deck.inp")
    assert mesh.elements["C3D4"][1].tolist() == [[1, 2, 3, 4]]
    assert mesh.files == [tmp_path / "deck.inp", tmp_path / "nodes.inp"]


def test_model_file_gives_back_what_was_written(tmp_path):
    written, notes = import_model(**copy_springs(tmp_path), damping=DATA / "symmetric.mtx")
    read = read_model(tmp_path / "model.h5")
    for name in ("stiffness", "mass", "damping"):
        assert np.array_equal(getattr(read, name).toarray(), getattr(written, name).toarray())
    assert read.dof_node.tolist() == written.dof_node.tolist()
    assert read.dof_direction.tolist() == written.dof_direction.tolist()
    assert np.array_equal(read.coordinates, written.coordinates)
    assert np.array_equal(read.elements["C3D4"][1], written.elements["C3D4"][1])
    assert {name: ids.tolist() for name, ids in read.node_sets.items()} == {
        name: ids.tolist() for name, ids in written.node_sets.items()
    }
    assert "node set both: 3 nodes" in notes
    light = read_model(tmp_path / "model.h5", matrices=False)
    assert light.stiffness is None and light.size == 3


def test_every_dataset_of_a_model_file_says_what_it_is(tmp_path):
    import_model(**copy_springs(tmp_path))
    bare = []
    with h5py.File(tmp_path / "model.h5") as file:

        def visit(name, thing):
            if isinstance(thing, h5py.Dataset) and not {"description", "unit"} <= set(thing.attrs):
                bare.append(name)

        file.visititems(visit)
        assert {"format", "format_version", "attrito_version", "description", "source"} <= set(file.attrs)
        assert file["stiffness/columns"].dtype == np.int32 and file["stiffness/row_offsets"].dtype == np.int64
    assert bare == []


# --- CalculiX files, by CalculiX -------------------------------------------------------------------------------------

TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
HEXA = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
TETRA_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
RING = [(0, 1), (1, 2), (2, 3), (3, 0)]
HEXA_EDGES = RING + [(4 + a, 4 + b) for a, b in RING] + [(k, k + 4) for k in range(4)]
ELEMENTS = {
    "C3D4": TETRA,
    "C3D8": HEXA,
    "C3D10": np.concatenate([TETRA, [(TETRA[a] + TETRA[b]) / 2 for a, b in TETRA_EDGES]]),
    "C3D20": np.concatenate([HEXA, [(HEXA[a] + HEXA[b]) / 2 for a, b in HEXA_EDGES]]),
}
SHEAR = np.array([[2.0, 0.3, -0.1], [0.2, 1.5, 0.4], [0.5, -0.2, 1.0]])
ORIGIN = np.array([3.0, -2.0, 5.0])
DENSITY = 7.85


def write_one_element(folder: Path, kind: str) -> Path:
    """Matrices of one sheared element, written by CalculiX; ids have gaps and run downwards."""
    points = ELEMENTS[kind] @ SHEAR.T + ORIGIN
    ids = 1000 - 7 * np.arange(len(points))
    nodes = "\n".join(f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in zip(ids.tolist(), points.tolist(), strict=True))
    words = [str(word) for word in (3, *ids.tolist())]
    element = ",\n".join(", ".join(words[k : k + 11]) for k in range(0, len(words), 11))
    (folder / "one.inp").write_text(
        f"*NODE\n{nodes}\n*ELEMENT, TYPE={kind}, ELSET=body\n{element}\n*MATERIAL, NAME=m\n*ELASTIC\n1000., 0.3\n"
        f"*DENSITY\n{DENSITY}\n*SOLID SECTION, ELSET=body, MATERIAL=m\n"
        "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"
    )
    subprocess.run(["ccx", "-i", "one"], cwd=folder, check=True, capture_output=True)
    return folder / "one"


def rigid_motions(model) -> np.ndarray:
    """Three translations and three rotations about the axes, `[n, 6]`."""
    position = model.coordinates[np.argsort(model.node_ids)][np.searchsorted(np.sort(model.node_ids), model.dof_node)]
    axes = np.eye(3)
    columns = [axes[k][model.dof_direction - 1] for k in range(3)]
    columns += [np.cross(axes[k], position)[np.arange(model.size), model.dof_direction - 1] for k in range(3)]
    return np.column_stack(columns)


def second_moment(kind: str) -> tuple[float, np.ndarray]:
    """Mass, and the integral of density x x^T, of the sheared element in closed form."""
    corners = (TETRA if kind in ("C3D4", "C3D10") else HEXA) @ SHEAR.T + ORIGIN
    if len(corners) == 4:
        mass = DENSITY * np.linalg.det(SHEAR) / 6.0
        return mass, mass / 20.0 * (corners.T @ corners + np.outer(corners.sum(0), corners.sum(0)))
    mass = DENSITY * np.linalg.det(SHEAR)
    centre = corners.mean(axis=0)
    return mass, mass * (np.outer(centre, centre) + SHEAR @ SHEAR.T / 12.0)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_rigid_motions_of_one_element_have_no_stiffness_and_its_inertia(kind, tmp_path):
    job = write_one_element(tmp_path, kind)
    model, _ = import_model(tmp_path / "model.h5", calculix_job=job, mesh=f"{job}.inp")
    assert list(model.elements) == [kind] and model.size == 3 * len(ELEMENTS[kind])
    motions = rigid_motions(model)
    scale = abs(model.stiffness).max() * abs(motions).max()
    assert np.abs(model.stiffness @ motions).max() < 1.0e-11 * scale
    inertia = motions.T @ model.mass @ motions
    mass, moment = second_moment(kind)
    if kind == "C3D4":
        # CalculiX integrates the mass of this element at one point: all of it acts at the centroid.
        centre = TETRA.mean(axis=0) @ SHEAR.T + ORIGIN
        moment = mass * np.outer(centre, centre)
    rotation = np.trace(moment) * np.eye(3) - moment
    assert inertia[:3, :3] == pytest.approx(mass * np.eye(3), rel=1e-9, abs=1e-9)
    assert inertia[3:, 3:] == pytest.approx(rotation, rel=1e-9)


def test_gmsh_meshes_arrive_with_their_sets_once_surface_elements_are_deleted(tmp_path):
    script = """
        SetFactory("OpenCASCADE");
        Box(1) = {0, 0, 0, 2, 1, 1};
        Mesh.SaveGroupsOfNodes = 1;
        Mesh.SecondOrderIncomplete = 1;
        Transfinite Curve {:} = 2; Transfinite Surface {:}; Recombine Surface {:}; Transfinite Volume {:};
        Physical Surface("left") = {1};
        Physical Volume("body") = {1};
    """
    (tmp_path / "box.geo").write_text(script)
    command = ["gmsh", "-3", "-order", "2", "box.geo", "-o", "box.inp"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert "TYPE=CPS8" in fault_lines(read_mesh, tmp_path / "box.inp")
    text = (tmp_path / "box.inp").read_text()
    (tmp_path / "box.inp").write_text(re.sub(r"\*ELEMENT, type=CPS8.*\n([^*].*\n)*", "", text))
    mesh = read_mesh(tmp_path / "box.inp")
    _, connectivity = mesh.elements["C3D20"]
    position = dict(zip(mesh.node_ids.tolist(), mesh.coordinates, strict=True))
    corners = [position[node] for node in connectivity[0, :8].tolist()]
    middles = [position[node] for node in connectivity[0, 8:].tolist()]
    assert np.allclose(middles, [(corners[a] + corners[b]) / 2 for a, b in HEXA_EDGES])
    left = {tuple(position[node]) for node in mesh.node_sets["left"].tolist()}
    assert len(left) == 8 and {x for x, _, _ in left} == {0.0}


@pytest.fixture(scope="module")
def coarse_blade(tmp_path_factory):
    """The coarse blade and CalculiX's own frequencies of it, Hz."""
    folder = tmp_path_factory.mktemp("blade")
    script = REPOSITORY / "meshes" / "blade.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", folder], check=True)
    model, _ = import_model(folder / "model.h5", calculix_job=folder / "blade", mesh=folder / "blade.inp")
    table = (folder / "blade_frequencies.dat").read_text().split("P A R T I C I P A T I O N")[0]
    rows = [line.split() for line in table.splitlines() if re.match(r"\s+\d+\s+\S+E\S+\s", line)]
    return model, np.sqrt(np.maximum([float(row[1]) for row in rows], 0.0)) / (2.0 * np.pi)


def test_calculix_matrices_meet_its_own_frequencies(coarse_blade):
    model, expected = coarse_blade
    # The blade floats; a shift below zero keeps the factorised matrix regular.
    values = eigsh(model.stiffness, 16, model.mass, sigma=-1.0e6, which="LM", return_eigenvectors=False)
    frequencies = np.sqrt(np.maximum(np.sort(values), 0.0)) / (2.0 * np.pi)
    assert np.all(frequencies[:6] < 1.0) and frequencies[6] > 100.0
    assert frequencies[6:] == pytest.approx(expected[6:], rel=1.0e-5)


def test_flank_nodes_of_the_blade_lie_on_those_of_the_slot(coarse_blade):
    model, _ = coarse_blade
    position = dict(zip(model.node_ids.tolist(), model.coordinates, strict=True))
    for side in ("left", "right"):
        sets = [model.node_sets[f"{body}_{side}"].tolist() for body in ("root", "slot")]
        root, slot = (np.array([position[node] for node in nodes]) for nodes in sets)
        assert len(root) == 15
        assert np.array_equal(root[np.lexsort(root.T)], slot[np.lexsort(slot.T)])
        assert not np.isin(model.node_sets[f"root_{side}"], model.node_sets[f"slot_{side}"]).any()


def test_rigid_motions_of_the_blade_body_have_no_stiffness(coarse_blade):
    """The flanks are not joined: the blade alone moves freely."""
    model, _ = coarse_blade
    motions = rigid_motions(model)
    disc = {node for name in ("slot_left", "slot_right", "disc_fixed") for node in model.node_sets[name].tolist()}
    connectivity = model.elements["C3D10"][1]
    while True:
        touched = {n for row in connectivity.tolist() if disc.intersection(row) for n in row}
        if touched <= disc:
            break
        disc |= touched
    motions[np.isin(model.dof_node, list(disc))] = 0.0
    assert np.abs(model.stiffness @ motions).max() < 1.0e-9 * abs(model.stiffness).max() * abs(motions).max()


# --- other matrix files ----------------------------------------------------------------------------------------------


def petsc_bytes(matrix: np.ndarray, integer: str = ">i4", number: str = ">f8") -> bytes:
    """A sparse matrix as PETSc's MatView writes it."""
    sparse = csr_matrix(matrix)
    head = [1211216, *sparse.shape, sparse.nnz, *np.diff(sparse.indptr), *sparse.indices]
    return np.array(head, integer).tobytes() + sparse.data.astype(number).tobytes()


def test_one_matrix_reads_the_same_from_every_kind_of_file(tmp_path):
    scipy.io.mmwrite(tmp_path / "general.mtx", csr_matrix(STIFFNESS), symmetry="general")
    scipy.io.mmwrite(tmp_path / "dense.mtx", STIFFNESS)
    (tmp_path / "short.petsc").write_bytes(petsc_bytes(STIFFNESS))
    (tmp_path / "long.dat").write_bytes(petsc_bytes(STIFFNESS, ">i8"))
    names = ["general.mtx", "dense.mtx", "short.petsc", "long.dat"]
    for source in [*(tmp_path / name for name in names), DATA / "symmetric.mtx", STIFFNESS.tolist()]:
        assert np.array_equal(read_matrix(source, "model.stiffness").toarray(), STIFFNESS), source


def test_matrices_written_by_petsc_are_read(tmp_path):
    program = (
        "from petsc4py import PETSc; import sys;"
        "a = PETSc.Mat().createAIJ([3, 3], csr=([0, 2, 4, 5], [0, 1, 0, 1, 2], [3., -1., -1., 2.5, 4.]));"
        "a.assemble(); a.view(PETSc.Viewer().createBinary(sys.argv[1], 'w'))"
    )
    subprocess.run([sys.executable, "-c", program, tmp_path / "k.petsc"], check=True, capture_output=True)
    assert np.array_equal(read_matrix(tmp_path / "k.petsc", "stiffness").toarray(), STIFFNESS)


def test_matrix_files_with_dofs_and_mesh_make_an_fe_model(tmp_path):
    scipy.io.mmwrite(tmp_path / "m.mtx", csr_matrix(MASS))
    files = {"stiffness": DATA / "symmetric.mtx", "mass": tmp_path / "m.mtx", "mesh": DATA / "two_springs.inp"}
    model, _ = import_model(tmp_path / "model.h5", **files, dofs=DATA / "two_springs.dof")
    assert read_model(tmp_path / "model.h5").has_mesh and model.dof_direction.tolist() == [2, 1, 3]
    said = fault_lines(import_model, tmp_path / "model.h5", **files)
    assert "dofs" in said and "missing" in said


# --- faults ----------------------------------------------------------------------------------------------------------


def change(matrix: np.ndarray, row: int, column: int, value: float, mirror: bool = False) -> csr_matrix:
    """The matrix with another value at one place, or at that and its mirror image."""
    changed = matrix.copy()
    changed[row, column] = value
    if mirror:
        changed[column, row] = value
    return csr_matrix(changed)


@pytest.mark.parametrize(
    ("stiffness", "mass", "said"),
    [
        (csr_matrix(STIFFNESS[:2]), MASS, ["stiffness", "2 x 3", "square"]),
        (STIFFNESS, MASS[:2, :2], ["mass", "2 x 2", "3 x 3"]),
        (change(STIFFNESS, 1, 2, np.nan), MASS, ["stiffness", "nan", "row 1, column 2"]),
        (change(STIFFNESS, 2, 2, np.inf), MASS, ["stiffness", "inf", "row 2, column 2"]),
        (change(STIFFNESS, 0, 1, -1.1), MASS, ["stiffness", "-1.1", "row 0, column 1", "symmetric"]),
        (STIFFNESS, change(MASS, 1, 1, -0.25), ["mass", "-0.25 at dof 1", "above zero"]),
        (STIFFNESS, change(MASS, 1, 1, 0.0), ["mass", "no mass at dof 1"]),
        (STIFFNESS, change(MASS, 0, 2, 0.5, mirror=True), ["mass", "row 0, column 2", "geometric mean"]),
    ],
)
def test_faulty_matrices_are_named_with_their_place(stiffness, mass, said):
    faults = check_matrices(csr_matrix(stiffness), csr_matrix(mass), None, "job.toml", without_mass="mass everywhere")
    assert len(faults) == 1
    for words in said:
        assert words in str(faults[0])


def test_all_faults_of_a_set_of_matrices_come_together():
    faults = check_matrices(change(STIFFNESS, 0, 1, 9.0), change(MASS, 1, 1, -1.0), csr_matrix(np.eye(2)), "job.toml")
    assert [fault.key for fault in faults] == ["stiffness", "mass", "damping"]


def test_a_dof_without_mass_is_carried_by_stiffness_and_is_not_damped():
    light = change(MASS, 1, 1, 0.0)
    assert check_matrices(csr_matrix(STIFFNESS), light, None, "job.toml") == []
    (fault,) = check_matrices(change(STIFFNESS, 1, 1, 0.0), light, None, "job.toml")
    assert (fault.key, fault.value) == ("stiffness", "no stiffness at dof 1")
    (fault,) = check_matrices(csr_matrix(STIFFNESS), light, csr_matrix(np.eye(3)), "job.toml")
    assert (fault.key, fault.value) == ("damping", "damping at dof 1")
    (fault,) = check_matrices(csr_matrix(STIFFNESS), csr_matrix((3, 3)), None, "job.toml")
    assert (fault.key, fault.value) == ("mass", "no mass at dof 0 and 2 more")


def test_coupled_dofs_without_a_diagonal_are_faults():
    """As where the first line of a matrix file is lost."""
    (fault,) = lost_diagonals(change(STIFFNESS, 0, 0, 0.0), "k.mtx", "dof {}".format)
    assert (fault.key, fault.value) == ("stiffness", "0 on the diagonal at dof 0")
    assert "have lines of the file been lost?" in str(fault)


def test_rows_of_a_job_and_couplings_of_rounding_may_have_no_diagonal():
    # A pendulum upside down, between two springs
    falling = np.array([[2.0, -1.0, 0.0], [-1.0, 0.0, -1.0], [0.0, -1.0, 2.0]])
    assert check_matrices(csr_matrix(falling), csr_matrix(np.eye(3)), None, "job.toml") == []
    # A free body's own motion among generalised coordinates
    free = np.array([[1e6, -1e6, 1e-10], [-1e6, 1e6, -1e-10], [1e-10, -1e-10, 0.0]])
    assert lost_diagonals(csr_matrix(free), "k.mtx", "dof {}".format) == []


def test_a_geometric_stiffness_of_shear_has_no_diagonal(tmp_path):
    """Of a regular membrane of bilinear elements in pure shear, its inner nodes."""
    shear, stretch = np.zeros((16, 16)), np.zeros((16, 16))
    for i, j in product(range(3), range(3)):
        own = [4 * i + j, 4 * i + j + 4, 4 * i + j + 5, 4 * i + j + 1]
        for s, t in product((-(3.0**-0.5), 3.0**-0.5), repeat=2):
            x, y = np.array([t - 1, 1 - t, 1 + t, -1 - t]) / 2, np.array([s - 1, -1 - s, 1 + s, 1 - s]) / 2
            shear[np.ix_(own, own)] += (np.outer(x, y) + np.outer(y, x)) / 4
            stretch[np.ix_(own, own)] += (np.outer(x, x) + np.outer(y, y)) / 4
    inner = [5, 6, 9, 10]
    shear = np.where(np.abs(shear) > 1e-14, shear, 0.0)[np.ix_(inner, inner)]
    assert not shear.diagonal().any() and shear.any(), "the test is void"
    matrices = {"stiffness": 100.0 * stretch[np.ix_(inner, inner)], "mass": np.eye(4), "geometric_stiffness": shear}
    for name, matrix in matrices.items():
        mmwrite(tmp_path / f"{name}.mtx", coo_matrix(matrix), precision=17)
    files = {name: tmp_path / f"{name}.mtx" for name in matrices}
    model, _ = import_model(tmp_path / "m.h5", holds=["spin_softening"], spin_hz=10.0, **files)
    assert model.size == 4
    matrices["stiffness"][0, 0] = 0.0
    mmwrite(tmp_path / "stiffness.mtx", coo_matrix(matrices["stiffness"]), precision=17)
    with pytest.raises(InputError, match="stiffness.mtx.*0 on the diagonal"):
        import_model(tmp_path / "m.h5", stiffness=files["stiffness"], mass=files["mass"])


def test_sound_matrices_have_no_faults():
    slightly = change(STIFFNESS, 0, 1, -1.0 - 1.0e-12)
    assert check_matrices(slightly, csr_matrix(MASS), csr_matrix((3, 3)), "job.toml") == []


TETRA_LINES = "*ELEMENT, TYPE=C3D4\n1,1,1,1,1\n"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sti": "1 1 2.0\n1 2 x\n"}, ["job.sti", "row, column and value"]),
        ({"sti": "1 1 2.0\n1 2\n"}, ["job.sti: line 2 = '1 2'", "row, column and value"]),
        ({"sti": ""}, ["job.sti", "0 entries"]),
        ({"mas": "1 1 2.0\n4 4 1.0\n"}, ["job.mas", "line 2", "row 4", "1 to 3"]),
        ({"sti": "1 1 2.0\n2 1 1.0\n"}, ["job.sti", "line 2", "upper triangle"]),
        ({"dof": "12.2\n1000.7\n1000.3\n"}, ["job.dof", "line 2", "1000.7"]),
        ({"dof": "12.2\n12.2\n1000.3\n"}, ["job.dof", "twice"]),
        ({"dof": ""}, ["job.dof", "empty"]),
        ({"dof": "12.2\n1000.1\n1001.3\n"}, ["job.dof", "node 1001", "job.inp"]),
        ({"inp": "no deck"}, ["job.inp", "no keyword"]),
        ({"inp": "*NODE\n1,0,0,0\n"}, ["job.inp", "*ELEMENT", "missing"]),
        ({"inp": "*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D15\n1,1,1\n"}, ["job.inp", "line 3", "C3D15", "C3D10"]),
        ({"inp": "*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n1,1,1,1,2\n"}, ["job.inp", "node 2"]),
        (
            {"inp": "*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n1,1,1,1\n"},
            ["job.inp: line 4", "4 numbers", "an id and 4 nodes for each element C3D4"],
        ),
        ({"inp": "*NODE\n1,0,0,0\n1,1,0,0\n" + TETRA_LINES}, ["job.inp", "node 1 twice"]),
        ({"inp": "*NODE\na,0,0,0\n" + TETRA_LINES}, ["job.inp", "line 1", "'a'"]),
        ({"inp": "*NODE\n1,0,x,0\n" + TETRA_LINES}, ["job.inp", "x"]),
        ({"inp": "*NODE\n1,0,0,0\n" + TETRA_LINES + "*NSET,NSET=s\n5\n"}, ["job.inp", "line 5", "node 5 in set s"]),
        ({"inp": "*NODE\n1,0,0,0\n" + TETRA_LINES + "*NSET,NSET=s\nt\n"}, ["job.inp", "line 5", "'t'"]),
        ({"inp": "*NODE\n1,0,0,0\n" + TETRA_LINES + "*NSET,NSET=s,GENERATE\n1,1,0\n"}, ["line 5", "first, last, step"]),
        (
            {"inp": "*NODE\n1,0,0,0\n" + TETRA_LINES + "*NSET,NSET=s,GENERATE\n1,9999999999\n"},
            ["line 5", "at most 10000000 ids"],
        ),
        ({"inp": "*INCLUDE, INPUT=absent.inp\n"}, ["job.inp", "line 1", "absent.inp"]),
        ({"inp": "*INCLUDE, INPUT=job.inp\n"}, ["job.inp", "include itself"]),
    ],
)
def test_faulty_calculix_files_are_named_with_their_place(changes, said, tmp_path):
    lines = fault_lines(import_model, **copy_springs(tmp_path, **changes))
    for words in said:
        assert words in lines
    assert not (tmp_path / "model.h5").exists()


@pytest.mark.parametrize("ending", ["sti", "mas", "dof"])
def test_no_line_of_calculix_files_is_lost_in_silence(ending, tmp_path):
    lines = (DATA / f"two_springs.{ending}").read_text().splitlines(keepends=True)
    for i in range(len(lines)):
        for some in ([*lines[:i], *lines[i + 1 :]], lines[:i], lines[i + 1 :]):
            said = fault_lines(import_model, **copy_springs(tmp_path, **{ending: "".join(some)}))
            assert f"job.{ending}" in said or "of the .dof file" in said or "in the .dof file" in said


def test_files_that_are_not_there_are_named(tmp_path):
    job = {"calculix_job": tmp_path / "absent", "mesh": tmp_path / "absent.inp"}
    assert "absent.dof" in fault_lines(import_model, tmp_path / "m.h5", **job)
    assert "absent.inp" in fault_lines(read_mesh, tmp_path / "absent.inp")
    assert "absent.mtx" in fault_lines(read_matrix, str(tmp_path / "absent.mtx"), "mass")
    assert "absent.h5" in fault_lines(read_model, tmp_path / "absent.h5")
    assert "stiffness is missing" in fault_lines(import_model, tmp_path / "m.h5", mass="m.mtx")


@pytest.mark.parametrize(
    ("contents", "said"),
    [
        (b"what is this", "a matrix file: Matrix Market, PETSc binary"),
        (b"%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 1.0\n", "a Matrix Market file"),
        (petsc_bytes(STIFFNESS)[:-3], "bytes for 5 entries"),
        (petsc_bytes(STIFFNESS, number=">c16"), "complex values"),
        (np.array([1211216, 3, 3, -1], ">i4").tobytes(), "a dense matrix"),
        (np.array([1211216, 1, 1, 1, 1, 7], ">i4").tobytes() + bytes(8), "out of range"),
    ],
)
def test_faulty_matrix_files_are_named(contents, said, tmp_path):
    (tmp_path / "k.dat").write_bytes(contents)
    lines = fault_lines(read_matrix, tmp_path / "k.dat", "model.stiffness")
    assert said in lines and "k.dat" in lines and "model.stiffness" in lines


@pytest.mark.parametrize("rows", [[], [1.0, 2.0], [[1.0, 2.0], [3.0]], [["a"]], [[True]], 3.0])
def test_faulty_inline_matrices_are_named(rows):
    assert fault_lines(read_matrix, rows, "model.mass", "wedge.toml").startswith("wedge.toml: model.mass = ")


def test_files_that_are_no_models_are_refused(tmp_path):
    (tmp_path / "text.h5").write_text("not HDF5")
    assert "attrito import" in fault_lines(read_model, tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["format"] = "attrito result"
    assert "attrito result" in fault_lines(read_model, tmp_path / "other.h5")


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("mass/columns", [0, 1, 3], "mass"),
        ("stiffness/row_offsets", [0, 2, 4, 9], "stiffness"),
        ("dofs/node", [12, 1000], "one node for each of 3 dofs"),
        ("dofs/direction", [2, 1, 7], "1, 2, 3"),
        ("nodes/coordinates", [[0.0, 0.0]], "shape (4, 3)"),
        ("node_sets/odd", [7, 13], "[13]"),
        ("elements/C3D4/id", [5, 6], "2 elements"),
        ("nodes/id", None, "nodes/id is missing"),
        ("mass/values", "text", "mass/values"),
    ],
)
def test_model_files_whose_parts_do_not_fit_are_refused(name, values, said, tmp_path):
    import_model(**copy_springs(tmp_path))
    with edited(tmp_path / "model.h5") as file:
        del file[name]
        if values is not None:
            file[name] = values
    lines = fault_lines(read_model, tmp_path / "model.h5")
    assert said in lines and "model.h5" in lines


def test_dof_numbers_beyond_a_double_are_exact(tmp_path):
    (tmp_path / "job.dof").write_text("123456789012345678.3\n")
    assert read_dof_file(tmp_path / "job.dof")[0].tolist() == [123456789012345678]
