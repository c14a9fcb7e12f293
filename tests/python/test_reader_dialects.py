"""What files of one format may look like: headers, blocks, widths and layouts, and what is beside the matrices."""

from __future__ import annotations

import re

import matrix_writers as write
import numpy as np
import pytest
import scipy.sparse as sparse
from two_springs import DATA, MASS, STIFFNESS

from attrito.importers import import_model, read_matrix, read_mesh
from attrito.support.errors import InputError

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
    (tmp_path / "mesh.cdb").write_text(f"NBLOCK,6,SOLID,   12,    1\n{form}\n{line}\nN,R5.3,LOC,       -1,\n")
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
