"""The same model through every reader, by hand and at the size of the coarse blade; and what faulty files are told."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import matrix_writers as write
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
from elastic import elastic_block
from jobs import attrito_here
from mpi4py import MPI
from scipy.linalg import eigh, subspace_angles
from scipy.sparse.linalg import eigsh

from attrito.importers import entries, import_model, read_matrix, read_mesh, text
from attrito.library.reduction import reduce_model
from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.support.errors import InputError

DATA = Path(__file__).parent / "data"
REPOSITORY = Path(__file__).resolve().parents[2]
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 2.5, 0.0], [0.0, 0.0, 4.0]])
MASS = np.diag([0.5, 0.25, 0.25])
NODE, DIRECTION = np.array([12, 1000, 1000]), np.array([2, 1, 3])

# --- by hand ---------------------------------------------------------------------------------------------------------

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


# --- a real model ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def blade(tmp_path_factory) -> tuple[Path, Model]:
    """The coarse blade of CalculiX in a folder, its matrices divided by three, so that they need all 17 digits."""
    folder = tmp_path_factory.mktemp("readers")
    script = REPOSITORY / "meshes" / "blade.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", folder], check=True)
    model, _ = import_model(folder / "given.h5", calculix_job=folder / "blade", mesh=folder / "blade.inp")
    model.stiffness, model.mass = model.stiffness / 3.0, model.mass / 3.0
    mesh = (model.node_ids, model.coordinates, model.elements, model.node_sets)
    write.write_deck(folder / "mesh.inp", *mesh)
    write.write_cdb(folder / "mesh.cdb", *mesh)
    write.write_bdf(folder / "mesh.bdf", *mesh)
    write.write_dofs(folder / "rows.dof", model.dof_node, model.dof_direction)
    write.write_mapping(folder / "rows.mapping", model.dof_node, model.dof_direction)
    return folder, model


@dataclass(frozen=True)
class Format:
    """How a model is written and read; `{}` in a file's name stands for K or M. `digits`: significant ones; 17: all."""

    write: Callable[[Path, Model], None]
    read: dict[str, str]
    digits: int = 17


def each(writer: Callable, name: str, *options: object) -> Callable[[Path, Model], None]:
    """Write one file a matrix."""

    def write_both(folder: Path, model: Model) -> None:
        for letter, matrix in (("K", model.stiffness), ("M", model.mass)):
            writer(folder / name.format(letter), matrix, *options)

    return write_both


def together(writer: Callable, name: str, stiffness: str, mass: str, *options: object) -> Callable[[Path, Model], None]:
    """Write both matrices into one file."""
    return lambda folder, model: writer(folder / name, {stiffness: model.stiffness, mass: model.mass}, *options)


def named(writer: Callable, *options: object) -> Callable[[Path, Model], None]:
    """Hand the dofs' names to the writer, too."""
    return lambda folder, model: writer(folder, model, *options)


def abaqus(folder: Path, model: Model, triangle: str) -> None:
    for part, matrix in (("STIF1", model.stiffness), ("MASS1", model.mass)):
        path = folder / f"job_{part}.mtx"
        write.write_abaqus(path, matrix, model.dof_node, model.dof_direction, triangle)


def punch(folder: Path, model: Model, fields: str, form: int) -> None:
    matrices = {"KAAX": model.stiffness, "MAAX": model.mass}
    write.write_dmig(folder / "job.pch", matrices, model.dof_node, model.dof_direction, fields, form)


def market(path: Path, matrix: sparse.csr_matrix, symmetry: str) -> None:
    scipy.io.mmwrite(path, matrix, symmetry=symmetry, precision=17)


def petsc(path: Path, matrix: sparse.csr_matrix) -> None:
    path.write_bytes(write.petsc_bytes(matrix))


def calculix(folder: Path, model: Model) -> None:
    write.write_calculix(folder / "job.sti", model.stiffness)
    write.write_calculix(folder / "job.mas", model.mass)
    write.write_dofs(folder / "job.dof", model.dof_node, model.dof_direction)


def files(name: str, **others: str) -> dict[str, str]:
    """What to read of files named after K and M."""
    return {"stiffness": name.format("K"), "mass": name.format("M")} | others


FORMATS = {
    "CalculiX": Format(calculix, {"calculix_job": "job", "mesh": "mesh.inp"}, 14),
    "Abaqus, lower triangle": Format(named(abaqus, "lower"), {"abaqus_job": "job", "mesh": "mesh.inp"}, 15),
    "Abaqus, both triangles": Format(named(abaqus, "both"), {"abaqus_job": "job", "mesh": "mesh.inp"}, 15),
    "Abaqus, coordinates": Format(
        each(write.write_abaqus_coordinate, "{}.mtx"), files("{}.mtx", dofs="rows.dof", mesh="mesh.inp")
    ),
    "ANSYS, Harwell-Boeing": Format(
        each(write.write_harwell_boeing, "{}.hb"), files("{}.hb", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "ANSYS, unsymmetric Harwell-Boeing": Format(
        each(write.write_harwell_boeing, "{}.hb", False), files("{}.hb", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "ANSYS, Matrix Market": Format(
        each(market, "{}.mmf.mtx", "symmetric"), files("{}.mmf.mtx", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "Nastran punch": Format(named(punch, "large", 6), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}, 10),
    "Nastran punch, square": Format(named(punch, "large", 1), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}, 10),
    "Nastran free fields": Format(named(punch, "free", 6), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}),
    "Nastran OUTPUT4, text": Format(
        together(write.write_op4_text, "job.op4", "KAA", "MAA", "sparse"),
        {"nastran_file": "job.op4", "dofs": "rows.dof", "mesh": "mesh.bdf"},
    ),
    "Nastran OUTPUT4, binary": Format(
        together(write.write_op4_binary, "job.op4", "KAA", "MAA", "bigmat", ">"),
        {"nastran_file": "job.op4", "dofs": "rows.dof", "mesh": "mesh.bdf"},
    ),
    "Matrix Market": Format(each(market, "{}.mtx", "general"), files("{}.mtx", dofs="rows.dof", mesh="mesh.inp")),
    "PETSc": Format(each(petsc, "{}.petsc"), files("{}.petsc", dofs="rows.dof", mesh="mesh.inp")),
    "SciPy npz": Format(each(sparse.save_npz, "{}.npz"), files("{}.npz", dofs="rows.dof", mesh="mesh.inp")),
    "MATLAB 5": Format(
        together(write.write_matlab, "job.mat", "K", "M"),
        {"stiffness": "job.mat:K", "mass": "job.mat:M", "dofs": "rows.dof", "mesh": "mesh.inp"},
    ),
    "MATLAB 7.3": Format(
        together(write.write_matlab_73, "job.mat", "K", "M"),
        {"stiffness": "job.mat:K", "mass": "job.mat:M", "dofs": "rows.dof", "mesh": "mesh.inp"},
    ),
}
EXACT = [name for name, one in FORMATS.items() if one.digits == 17]
PRINTED = [name for name, one in FORMATS.items() if one.digits < 17]


def imported(blade: tuple[Path, Model], name: str, monkeypatch: pytest.MonkeyPatch) -> Model:
    folder, model = blade
    monkeypatch.chdir(folder)
    FORMATS[name].write(folder, model)
    read, _ = import_model(folder / "read.h5", **FORMATS[name].read)
    assert np.array_equal(read.dof_node, model.dof_node)
    assert np.array_equal(read.dof_direction, model.dof_direction)
    assert np.array_equal(read.node_ids, model.node_ids)
    assert np.array_equal(read.elements["C3D10"][1], model.elements["C3D10"][1])
    assert sorted(map(tuple, read.node_sets.values())) == sorted(map(tuple, model.node_sets.values()))
    return read


def reduced(folder: Path, model: Model) -> dict[str, np.ndarray]:
    """The reduced model onto the flanks of the root, of the file that was read last."""
    flanks = np.concatenate([model.node_sets[name] for name in ("root_left", "root_right", "slot_left", "slot_right")])
    boundary = np.flatnonzero(np.isin(model.dof_node, flanks))
    # SCOTCH draws random numbers that go on from one reduction of a process to the next: not the same to the last bit.
    reduce_model(MPI.COMM_WORLD, folder / "read.h5", folder / "rom.h5", boundary, modes=10, ordering="pord")
    with h5py.File(folder / "rom.h5") as file:
        return {name: file[name][()] for name in ("mass", "stiffness", "modes/frequency_hz")}


@pytest.fixture(scope="module")
def reference_rom(blade) -> dict[str, np.ndarray]:
    from attrito.model.model_file import write_model

    folder, model = blade
    write_model(folder / "read.h5", model, [])
    return reduced(folder, model)


@pytest.mark.parametrize("name", EXACT)
def test_files_with_all_digits_give_the_same_reduced_model(blade, reference_rom, name, monkeypatch):
    folder, model = blade
    read = imported(blade, name, monkeypatch)
    for given, got in ((model.stiffness, read.stiffness), (model.mass, read.mass)):
        assert np.array_equal(given.indptr, got.indptr) and np.array_equal(given.indices, got.indices)
        assert np.array_equal(given.data, got.data)
    rom = reduced(folder, model)
    for part, expected in reference_rom.items():
        assert np.array_equal(rom[part], expected), part


@pytest.fixture(scope="module")
def reference_modes(blade) -> tuple[np.ndarray, np.ndarray]:
    return elastic_modes(blade[1])


def elastic_modes(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and modes above the six rigid motions of the floating blade."""
    values, modes = eigsh(model.stiffness.tocsc(), 16, model.mass.tocsc(), sigma=-1.0e6)
    order = np.argsort(values)[6:]
    return values[order], modes[:, order]


@pytest.mark.parametrize("name", PRINTED)
def test_files_with_fewer_digits_give_what_they_print(blade, reference_modes, name, monkeypatch):
    _, model = blade
    read = imported(blade, name, monkeypatch)
    # Half a unit in the last digit printed, of a number as small as its first digit allows.
    precision = 0.5 * 10.0 ** (1 - FORMATS[name].digits)
    for given, got in ((model.stiffness, read.stiffness), (model.mass, read.mass)):
        assert np.array_equal(given.indptr, got.indptr) and np.array_equal(given.indices, got.indices)
        # The decimal written and the double read are each rounded once more.
        assert np.all(np.abs(got.data - given.data) <= (precision + 2.0e-16) * np.abs(given.data))
    values, modes = reference_modes
    got_values, got_modes = elastic_modes(read)
    change = np.abs(np.sqrt(got_values / values) - 1.0)
    # To first order |d lambda| <= |phi|^T (|dK| + lambda |dM|) |phi|: a slender model loses many digits.
    lost = [
        abs(phi) @ (abs(model.stiffness) + value * abs(model.mass)) @ abs(phi)
        for value, phi in zip(values, modes.T, strict=True)
    ]
    bound = precision * np.array(lost) / (2.0 * values)
    assert np.all(change <= 1.01 * bound + 1.0e-9)
    if FORMATS[name].digits > 10:
        assert change.max() < 1.0e-8
    # Up to sign, and to the subspace of all of them.
    overlap = np.abs(np.einsum("ij,ij->j", got_modes, model.mass @ modes))
    assert overlap == pytest.approx(np.ones(len(overlap)), abs=1.0e-6)
    assert subspace_angles(got_modes, modes).max() < 1.0e-3


WORKBENCH = """/com,*********** Nodes for the whole assembly ***********
nblock,3,,20
(1i9,3e20.9e3)
{nodes}
-1
/wb,elem,start
et,1,186
et,2,281
ETBLOCK,        1,        1
(2i9,19a9)
        3      187
eblock,19,solid,,3
(19i9)
{brick}
{tetrahedron}
{shell}
-1
et,4,154
eblock,10,,,160
(15i9)
     1003        4        4        4        0        1        2        3        4
-1
CMBLOCK,HELD,NODE,        2
(8i10)
         1        -4
"""


def ansys_element(kind: int, number: int, nodes: list[int]) -> str:
    """Lines of an element with the solid key: eleven numbers of its own, then nodes, nineteen a line."""
    fields = [1, kind, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
    lines = [fields[:19], fields[19:]] if len(fields) > 19 else [fields]
    return "\n".join("".join(f"{field:9d}" for field in line) for line in lines)


def test_what_workbench_writes_is_read_and_shells_are_no_bricks(tmp_path):
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    points = corners + [(2.0 + k, 0.0, 0.0) for k in range(12)]
    nodes = "\n".join(f"{k + 1:9d}" + "".join(f"{x:20.9E}" for x in point) for k, point in enumerate(points))
    brick = ansys_element(1, 7, list(range(1, 21)))
    tetrahedron = ansys_element(3, 8, [1, 2, 3, 5, 9, 10, 0, 12, 13, 14])
    shell = ansys_element(2, 9, list(range(1, 9)))
    (tmp_path / "ds.dat").write_text(WORKBENCH.format(nodes=nodes, brick=brick, tetrahedron=tetrahedron, shell=shell))
    mesh = read_mesh(tmp_path / "ds.dat")
    assert mesh.coordinates.tolist() == [list(point) for point in points]
    assert {kind: (ids.tolist(), nodes.tolist()) for kind, (ids, nodes) in mesh.elements.items()} == {
        "C3D20": ([7], [list(range(1, 21))]),
        "C3D4": ([8], [[1, 2, 3, 5]]),
    }
    assert mesh.node_sets["HELD"].tolist() == [1, 2, 3, 4]
    assert mesh.skipped == [
        "1 elements 281, which are no solids",
        "mid-side nodes of 1 elements that lack some of theirs",
        "elements on surfaces (1 lines in blocks without the solid key)",
    ]


@pytest.mark.parametrize("form", ["(3i9,6e21.13e3)", "(1i9,2i9,6e21.13)", "(1i7,2i9,6e21.13)", "(3i8,6e16.9)"])
def test_nodes_of_ansys_come_in_many_formats(form, tmp_path):
    widths = [int(width) for count, width in re.findall(r"(\d+)i(\d+)", form) for _ in range(int(count))]
    wide, digits = map(int, re.search(r"e(\d+)\.(\d+)", form).groups())
    line = "".join(f"{number:{width}d}" for number, width in zip((12, 0, 0), widths, strict=True))
    line += "".join(f"{x:{wide}.{digits}E}" for x in (0.25, -1.5, 8.0))
    (tmp_path / "mesh.cdb").write_text(f"NBLOCK,6,SOLID,    3,    3\n{form}\n{line}\nN,R5.3,LOC,       -1,\n")
    mesh = read_mesh(tmp_path / "mesh.cdb")
    assert (mesh.node_ids.tolist(), mesh.coordinates.tolist()) == ([12], [[0.25, -1.5, 8.0]])


COMPANIONS = """DMIG    VAX            0       9       2       0                       1
DMIG*   VAX                            1               0
*                     12               2 1.000000000D+00
DMIG    MUG1T          0       2       2       0                       2
DMIG*   MUG1T                          1               0
*                   1000               3 1.000000000D+00
DMIG,K4AAX,0,6,4,0,,,2
DMIG,K4AAX,12,2,,12,2,1.0,2.0
"""


@pytest.mark.parametrize("first", [True, False], ids=["before", "after"])
def test_a_punch_file_may_hold_load_vectors_and_output_maps_beside_the_matrices(first, tmp_path):
    text = (DATA / "two_springs.pch").read_text()
    (tmp_path / "job.pch").write_text(COMPANIONS + text if first else text + COMPANIONS)
    read, notes = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")
    plain, _ = import_model(tmp_path / "plain.h5", nastran_file=DATA / "two_springs.pch")
    assert np.array_equal(read.stiffness.toarray(), plain.stiffness.toarray())
    assert np.array_equal(read.dof_node, plain.dof_node)
    assert "left out of the matrices: K4AAX (complex); VAX, MUG1T (rectangular)" in notes
    with pytest.raises(InputError, match="line .*VAX, rectangular.: expected a square matrix"):
        import_model(tmp_path / "model.h5", stiffness=tmp_path / "job.pch:VAX", mass=tmp_path / "job.pch:MAAX")


@pytest.mark.parametrize("kind", ["text", "binary"])
def test_an_output4_file_may_hold_rectangular_matrices_beside_square_ones(kind, tmp_path):
    matrices = {
        "PA": sparse.csr_matrix(np.ones((3, 1))),
        "KAA": sparse.csr_matrix(STIFFNESS),
        "MUG": sparse.csr_matrix(np.ones((2, 3))),
    }
    matrices["MAA"] = sparse.csr_matrix(MASS)
    writer = write.write_op4_text if kind == "text" else write.write_op4_binary
    writer(tmp_path / "job.op4", matrices, "dense")
    model, notes = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.op4")
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS)
    assert np.array_equal(model.mass.toarray(), MASS)
    assert "left out of the matrices: PA, MUG (rectangular)" in notes


@pytest.mark.parametrize("form", [4, 5])
@pytest.mark.parametrize("kind", ["text", "binary"])
def test_a_triangular_factor_of_output4_is_no_symmetric_matrix(kind, form, tmp_path):
    matrices = {"KAA": sparse.csr_matrix(STIFFNESS), "MAA": sparse.csr_matrix(MASS), "LAA": np.tril(STIFFNESS)}
    matrices["LAA"] = sparse.csr_matrix(matrices["LAA"])
    path = tmp_path / "job.op4"
    (write.write_op4_text if kind == "text" else write.write_op4_binary)(path, matrices, "dense")
    data = path.read_bytes()
    header = f"{6:8d}{2:8d}LAA".encode() if kind == "text" else np.array([6, 2], "<i4").tobytes() + b"LAA"
    factor = f"{form:8d}{2:8d}LAA".encode() if kind == "text" else np.array([form, 2], "<i4").tobytes() + b"LAA"
    assert data.count(header) == 1
    path.write_bytes(data.replace(header, factor))
    _, notes = import_model(tmp_path / "model.h5", nastran_file=path)
    assert "left out of the matrices: LAA (triangular factor)" in notes
    with pytest.raises(InputError, match="LAA = 'triangular factor': expected a matrix, not a factor of one"):
        read_matrix(f"{path}:LAA", "stiffness")


HEADERS = {
    "a format of integers": lambda text: text.replace("1P,3E23.16", "1P,3E23.16|I16"),
    "a blank line": lambda text: text + " \n",
    "lower case": lambda text: text.replace("KAA", "Kaa"),
}


@pytest.mark.parametrize("change", HEADERS.values(), ids=HEADERS)
def test_headers_of_output4_come_in_many_ways(change, tmp_path):
    text = (DATA / "two_springs.op4").read_text()
    assert change(text) != text
    (tmp_path / "job.op4").write_text(change(text))
    assert np.array_equal(read_matrix(f"{tmp_path / 'job.op4'}:KAA", "stiffness").toarray(), STIFFNESS)


def test_a_header_of_output4_without_a_format_has_five_numbers_of_16_characters_a_line(tmp_path):
    lines = [f"{3:8d}{3:8d}{6:8d}{2:8d}KAA"]
    for j in range(3):
        lines += [f"{j + 1:8d}{1:8d}{6:8d}", "".join(f"{value:16.9E}" for value in STIFFNESS[:, j])]
    lines += [f"{4:8d}{1:8d}{1:8d}", f"{1.0:16.9E}"]
    (tmp_path / "job.op4").write_text("\n".join(lines) + "\n")
    assert np.array_equal(read_matrix(tmp_path / "job.op4", "stiffness").toarray(), STIFFNESS)


def test_extseout_has_one_matrix_of_the_set_beside_square_output_maps(tmp_path):
    matrices = {name: sparse.csr_matrix(STIFFNESS) for name in ("KXX", "KASMX", "MUG1", "MES1")}
    matrices |= {"MXX": sparse.csr_matrix(MASS), "BXX1": sparse.csr_matrix((1, 1))}
    write.write_op4_binary(tmp_path / "job.op4", matrices, "dense")
    model, notes = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.op4")
    assert np.array_equal(model.mass.toarray(), MASS) and model.damping is None
    assert "left out of the matrices: BXX1 (empty); KASMX, MUG1, MES1 (square, of another name)" in notes


def test_bulk_data_may_end_in_the_midst_of_its_last_line_if_that_is_enddata(tmp_path):
    text = (DATA / "two_springs_small.bdf").read_text()
    (tmp_path / "job.bdf").write_text(text + "ENDDATA 58e050da")
    assert np.array_equal(read_matrix(f"{tmp_path / 'job.bdf'}:MAAX", "mass").toarray(), MASS)


def test_grid_points_may_all_be_in_a_file_that_include_names(tmp_path):
    (tmp_path / "grid.blk").write_text("GRID,7,,1.0,2.0,3.0\n")
    (tmp_path / "job.bdf").write_text("SOL 101\nCEND\nBEGIN BULK\nINCLUDE 'grid.blk'\nENDDATA\n")
    assert read_mesh(tmp_path / "job.bdf").node_ids.tolist() == [7]


BINARIES = {4: ".full", 8: ".sub", 77: "of kind 77"}


@pytest.mark.parametrize(("number", "name"), BINARIES.items())
@pytest.mark.parametrize("order", "<>")
def test_binary_files_of_ansys_are_refused_by_their_names(number, name, order, tmp_path):
    (tmp_path / "file").write_bytes(np.array([100, -(2**31), number, *[0] * 99], f"{order}i4").tobytes())
    with pytest.raises(InputError, match=f'"ANSYS\'s binary file {name}": expected its matrices as text: HBMAT'):
        read_matrix(tmp_path / "file", "stiffness")


def test_a_punch_file_of_results_is_refused_as_such(tmp_path):
    (tmp_path / "job.pch").write_text("$TITLE   =\n$DISPLACEMENTS\n")
    with pytest.raises(InputError, match="'a punch file of results': expected one of matrices"):
        read_matrix(tmp_path / "job.pch", "stiffness")


def test_three_whole_numbers_are_no_entry_of_abaqus(tmp_path):
    # The sizes of a Matrix Market file that has lost its header
    (tmp_path / "k.mtx").write_text("2 2 2\n1 1 1.0\n2 2 1.0\n")
    with pytest.raises(InputError, match="expected a matrix file"):
        read_matrix(tmp_path / "k.mtx", "stiffness")


def test_ten_digits_of_a_punch_keep_frequencies_of_a_stout_block_to_eight_digits(tmp_path):
    # A floating, slender blade loses more, as its bound to first order tells above; for a block on a wall that is 3e-8.
    given, points = elastic_block((3, 3, 3), (0.02, 0.02, 0.02), lambda points: points[:, 2] < 1e-9)
    node, direction = np.repeat(np.arange(1, len(points) + 1), 3), np.tile([1, 2, 3], len(points))
    write.write_dmig(tmp_path / "job.pch", {"KAAX": given.stiffness, "MAAX": given.mass}, node, direction, "large")
    read, _ = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")
    assert not np.array_equal(read.stiffness.toarray(), given.stiffness.toarray())
    values, got = (eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True) for model in (given, read))
    assert np.abs(np.sqrt(got / values) - 1.0).max() < 1.0e-8


@pytest.mark.parametrize("layout", ["dense", "sparse", "bigmat"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("kind", [1, 2])
def test_every_layout_of_output4_holds_the_same_numbers(layout, order, width, kind, tmp_path):
    matrix = sparse.csr_matrix(STIFFNESS / 3.0 if kind == 2 or width == 8 else STIFFNESS)
    write.write_op4_binary(tmp_path / "k.op4", {"KAA": matrix, "MAA": matrix}, layout, order, width, kind)
    read = read_matrix(f"{tmp_path / 'k.op4'}:maa", "stiffness")
    assert np.array_equal(read.toarray(), matrix.toarray())
    write.write_op4_text(tmp_path / "k.op4", {"KAA": matrix}, layout)
    assert np.array_equal(read_matrix(tmp_path / "k.op4", "stiffness").toarray(), matrix.toarray())


@pytest.mark.parametrize("name", ["Abaqus, both triangles", "Nastran punch", "Nastran OUTPUT4, text", "CalculiX"])
def test_files_are_the_same_in_blocks_of_any_size(blade, name, monkeypatch):
    whole = imported(blade, name, monkeypatch)
    monkeypatch.setattr(text, "BLOCK_BYTES", 5003)
    monkeypatch.setattr(entries, "CHUNK", 977)
    monkeypatch.setattr(entries, "BUFFER", 7919)
    parts = imported(blade, name, monkeypatch)
    for a, b in ((whole.stiffness, parts.stiffness), (whole.mass, parts.mass)):
        assert np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices)
        assert np.array_equal(a.data, b.data)


# --- from the command line, and into a job ---------------------------------------------------------------------------


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
