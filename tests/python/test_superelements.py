"""Reduced models of other programs: generalised coordinates are dofs of a name, without a place in space."""

from __future__ import annotations

import h5py
import matrix_writers as write
import numpy as np
import pytest
from jobs import attrito_here
from scipy import sparse
from scipy.linalg import eigh

from attrito.importers import import_model, read_matrix
from attrito.model.model_file import read_model
from attrito.support.errors import InputError

# A grid point, 7, and two scalar points; fixed-interface modes of 4 and 9 rad/s.
NODE, DIRECTION = [7, 7, 1001, 1002], [1, 3, 0, 0]
STIFFNESS = np.array([[3.0, -1.0, 0.0, 0.0], [-1.0, 2.5, 0.0, 0.0], [0.0, 0.0, 16.0, 0.0], [0.0, 0.0, 0.0, 81.0]])
MASS = np.array([[0.5, 0.0, 0.1, 0.2], [0.0, 0.25, 0.3, 0.0], [0.1, 0.3, 1.0, 0.0], [0.2, 0.0, 0.0, 1.0]])


def write_punch(path, blank):
    """Both matrices; scalar points with component 0, or with a blank."""

    def field(direction):
        return f"{'' if blank and direction == 0 else direction:16}".rjust(16)

    lines = []
    for name, matrix in (("KAAX", STIFFNESS), ("MAAX", MASS)):
        lines.append(f"DMIG    {name:8s}{0:8d}{6:8d}{2:8d}{0:8d}{'':16s}{4:8d}")
        for j in range(4):
            lines.append(f"DMIG*   {name:16s}{NODE[j]:16d}{field(DIRECTION[j])}")
            for i in range(j, 4):
                if matrix[i, j]:
                    lines.append(f"*       {NODE[i]:16d}{field(DIRECTION[i])}{matrix[i, j]:16.9E}")
    path.write_text("\n".join(lines) + "\n")


DOF_TABLES = {
    "EXTRN": "EXTRN          7      13    1001       0    1002       0\n",
    "ASET": "ASET           7      13    1001       0    1002\n",
    "ASET beside EXTRN": "EXTRN,7,13,1001,0,1002,0\nASET,7,13\nASET,1001,0,1002,0\n",
    "ASET1": "ASET1,13,7\nASET1,0,1001,THRU,1002\n",
    "lines": "7.1\n7.3\n1001.0\n1002.0\n",
}


def is_the_superelement(model) -> bool:
    return (
        np.array_equal(model.stiffness.toarray(), STIFFNESS)
        and np.array_equal(model.mass.toarray(), MASS)
        and model.dof_node.tolist() == NODE
        and model.dof_direction.tolist() == DIRECTION
    )


@pytest.mark.parametrize("blank", [False, True], ids=["component 0", "no component"])
def test_scalar_points_of_a_punch_are_generalised_coordinates(blank, tmp_path):
    write_punch(tmp_path / "job.pch", blank)
    model, notes = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")
    assert is_the_superelement(model) and is_the_superelement(read_model(tmp_path / "model.h5"))
    assert '2 of the dofs are generalised coordinates: ["node", number, "q"] in a job' in notes
    assert any(note.startswith("1 nodes, with a mass of 0.5") for note in notes)


@pytest.mark.parametrize("table", DOF_TABLES.values(), ids=DOF_TABLES)
def test_an_a_set_with_scalar_points_names_the_rows_of_output4(table, tmp_path):
    (tmp_path / "job.aset").write_text(table)
    matrices = {"KAA": sparse.csr_matrix(STIFFNESS), "MAA": sparse.csr_matrix(MASS)}
    write.write_op4_binary(tmp_path / "job.op4", matrices, "dense")
    files = {"nastran_file": tmp_path / "job.op4", "dofs": tmp_path / "job.aset"}
    assert is_the_superelement(import_model(tmp_path / "model.h5", **files)[0])


def test_a_mesh_has_grid_points_and_no_scalar_points(tmp_path):
    write_punch(tmp_path / "job.pch", False)
    (tmp_path / "job.bdf").write_text("GRID,7,,1.0,2.0,3.0\nGRID,8,,0.0,0.0,0.0\nSPOINT,1001,1002\n")
    model, notes = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch", mesh=tmp_path / "job.bdf")
    read = read_model(tmp_path / "model.h5")
    assert read.has_mesh and any("2 nodes, 1 of them free" in note for note in notes)
    assert read.on_dofs(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])).tolist() == [1.0, 3.0, 0.0, 0.0]
    assert model.translates.tolist() == [True, True, False, False]


def test_a_point_is_scalar_or_in_space(tmp_path):
    write_punch(tmp_path / "job.pch", False)
    text = (tmp_path / "job.pch").read_text().replace(f"{1002:16d}", f"{7:16d}")
    (tmp_path / "job.pch").write_text(text)
    with pytest.raises(InputError, match=r"job\.pch: dofs = 'point 7 without a component and with one'"):
        import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")


def test_temperatures_of_calculix_are_no_generalised_coordinates(tmp_path):
    (tmp_path / "job.dof").write_text("1.1\n1.0\n")
    with pytest.raises(InputError, match="'1.0, a temperature': expected displacements"):
        import_model(tmp_path / "model.h5", calculix_job=tmp_path / "job", mesh=tmp_path / "job.inp")


JOB = """
[model]
file = "model.h5"
[reduction]
modes = 2
[damping]
ratio = 0.01
[[contact]]
normal = [[["node", 7, "x"], 1.0]]
tangents = [[[["node", 7, "z"], 1.0]]]
normal_stiffness = 10.0
tangential_stiffness = 10.0
friction_coefficient = 0.3
preload = 10.0
[[load]]
kind = "harmonic"
cosine = [[["node", 1002, "q"], 0.1]]
[balance]
harmonics = 1
[sweep]
frequencies_hz = [0.2]
[output]
file = "result.h5"
monitors = [{ name = "q", dofs = [[["node", 1001, "q"], 1.0]] }]
"""


def test_a_reduced_model_is_reduced_again_and_a_job_names_its_generalised_coordinates(tmp_path, capfd):
    write_punch(tmp_path / "job.pch", False)
    import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")
    (tmp_path / "job.toml").write_text(JOB)
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.h5") as file:
        amplitude = file["monitors/q/amplitude"][0]
    # All modes are kept; the contact sticks and holds both dofs of the grid point by springs of 10.
    values, modes = eigh(STIFFNESS + np.diag([10.0, 10.0, 0.0, 0.0]), MASS)
    omega = 0.4 * np.pi
    response = modes @ (0.1 * modes[3] / (values - omega**2 + 0.02j * np.sqrt(values) * omega))
    assert amplitude == pytest.approx(abs(response[2]), rel=1.0e-9)


# --- Abaqus ----------------------------------------------------------------------------------------------------------

VALUES = {kind: matrix[np.tril_indices(4)] for kind, matrix in (("STIFFNESS", STIFFNESS), ("MASS", MASS))}
# By Abaqus: a node once, its dofs on a line. By CalculiX: a node once for each of its dofs.
ELEMENTS = {
    "Abaqus": "*USER ELEMENT, NODES=3, LINEAR\n** ELEMENT NODES\n** 7, -2,\n** -3\n1, 3\n2, 1\n",
    "CalculiX": "**\n*USER ELEMENT,NODES=  4,LINEAR\n** ELEMENT NODES\n**  7, 7, -2, -3,\n 1\n 2, 3\n 3, 1\n 4, 1\n",
}


def substructure(element: str, kinds=("STIFFNESS", "MASS")) -> str:
    """The file; four values a line."""
    text = element
    for kind in kinds:
        text += f"*MATRIX,TYPE={kind}\n"
        for k in range(0, 10, 4):
            text += ", ".join(f"{value:.13e}" for value in VALUES[kind][k : k + 4]) + ",\n"
    return text


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_a_substructure_is_a_model_whose_internal_dofs_are_generalised_coordinates(element, tmp_path):
    (tmp_path / "sub.mtx").write_text("** ABAQUS\n" + substructure(element))
    model, _ = import_model(tmp_path / "model.h5", abaqus_job=tmp_path / "sub.mtx")
    order = [2, 3, 0, 1] if model.dof_node[0] == -21 else [3, 2, 0, 1]
    assert np.array_equal(model.stiffness.toarray(), STIFFNESS[np.ix_(order, order)])
    assert np.array_equal(model.mass.toarray(), MASS[np.ix_(order, order)])
    assert [model.dof_node[order.index(k)] for k in range(4)] == [7, 7, -21, -31]
    assert model.dof_direction[[order.index(k) for k in range(4)]].tolist() == DIRECTION


def test_one_matrix_of_a_substructure_has_a_name(tmp_path):
    path = tmp_path / "sub.mtx"
    path.write_text(substructure(ELEMENTS["Abaqus"]))
    assert read_matrix(f"{path}:mass", "mass").diagonal().tolist() == [1.0, 1.0, 0.5, 0.25]
    with pytest.raises(InputError, match="no name.*it holds: STIFFNESS, MASS"):
        read_matrix(path, "mass")
    path.write_text(substructure(ELEMENTS["Abaqus"], ["STIFFNESS"]))
    assert read_matrix(path, "stiffness").shape == (4, 4)
    with pytest.raises(InputError, match="mass = 'STIFFNESS': expected .*TYPE=MASS: mass=YES"):
        import_model(tmp_path / "model.h5", abaqus_job=path)


FAULTS = {
    "a value too few": (
        lambda text: text.replace("8.1000000000000e+01,", ""),
        "9 values",
        "10, of the upper triangle",
    ),
    "a value too many": (lambda text: text + "1.0\n", "11 values", "10, of the upper triangle of 4 dofs"),
    "fewer nodes": (lambda text: text.replace("** -3\n", ""), "2 nodes", "as many as NODES says (3)"),
    "no nodes": (lambda text: text.replace("** ELEMENT NODES\n", ""), "0 nodes", "as many as NODES says"),
    "a dof that is none": (lambda text: text.replace("\n1, 3\n", "\n1, 11\n"), "line 1", "11 a temperature"),
    "a dof twice": (lambda text: text.replace("\n1, 3\n", "\n1, 1\n"), "4 dofs of 3 nodes", "every dof"),
    "a place beyond": (lambda text: text.replace("\n2, 1\n", "\n4, 1\n"), "place 4", "from 1 to 3"),
    "two elements": (lambda text: text + text, "*USER ELEMENT", "of one substructure"),
    "a type twice": (lambda text: text.replace("TYPE=MASS", "TYPE=STIFFNESS"), "TYPE=STIFFNESS", "once"),
    "no number": (lambda text: text.replace("e+01", "x+01"), "line", "values of the matrix"),
    "no matrix": (lambda text: text.partition("*MATRIX")[0], "none", "*MATRIX, TYPE=STIFFNESS"),
}


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_faulty_substructures_are_refused_in_one_line(fault, tmp_path):
    change, value, expected = fault
    (tmp_path / "sub.mtx").write_text(change(substructure(ELEMENTS["Abaqus"])))
    with pytest.raises(InputError) as caught:
        import_model(tmp_path / "model.h5", abaqus_job=tmp_path / "sub.mtx")
    message = str(caught.value)
    assert len(message.splitlines()) == 1 and "sub.mtx" in message
    assert value in message and expected in message


def test_internal_nodes_with_stiffness_and_mass_are_generalised_and_multipliers_are_refused(tmp_path):
    def write_job(internal: str) -> None:
        for kind, value in (("STIF", 2.0), ("MASS", 1.0)):
            lines = f"4,1, 4,1, {value:.1e}\n" + (internal.format(value) if kind == "STIF" or "{" in internal else "")
            (tmp_path / f"job_{kind}1.mtx").write_text(lines)

    write_job("-1,2, -1,2, {:.1e}\n")
    model, _ = import_model(tmp_path / "model.h5", abaqus_job=tmp_path / "job")
    assert model.dof_node.tolist() == [-12, 4] and model.dof_direction.tolist() == [0, 1]
    write_job("-1,1, 4,1, 1.0e+00\n")
    with pytest.raises(InputError, match="no stiffness at dof 0, node -11 q': .*a Lagrange multiplier has none"):
        import_model(tmp_path / "model.h5", abaqus_job=tmp_path / "job")
