"""Faulty twins of meshes and files of dofs, and files that do not go together: each is told in one message."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import scipy.io
import scipy.sparse as sparse
from faulty_files import fault_of, replaced
from jobs import attrito_here
from two_springs import DATA

from attrito.importers import import_model, read_mesh
from attrito.importers.dof_file import read_dof_file

# Sample, its change, place, what was expected.
DOF_FILES = {
    "a label that is no displacement": ("two_springs.mapping", replaced("UZ", "PRES"), "line 4", "UX, UY, UZ, ROTX"),
    "a Lagrange multiplier": ("two_springs.mapping", replaced("UZ", "LAG"), "line 4", "no Lagrange multipliers"),
    "rows out of order": (
        "two_springs.mapping",
        replaced("         3      1000", "         4      1000"),
        "line 4",
        "row 3",
    ),
    "a dof twice in a mapping": (
        "two_springs.mapping",
        replaced("UZ", "UX"),
        "node 1000 direction 1",
        "every dof once",
    ),
    "components that are none": (
        "two_springs.aset",
        replaced("ASET,12,2", "ASET,12,7"),
        "line 3, ASET",
        "made of 1 to 6",
    ),
    "grid points that are none": (
        "two_springs.aset",
        replaced("ASET,12,2", "ASET,x,2"),
        "line 3, ASET",
        "made of 1 to 6",
    ),
    "a direction that is none": (
        "two_springs.dof",
        replaced("1000.3", "1000.7"),
        "line 3 = '1000.7'",
        "node.direction",
    ),
    "nothing": ("two_springs.dof", lambda text: "", "empty", "a line node.direction"),
}


@pytest.mark.parametrize("twin", DOF_FILES.values(), ids=DOF_FILES)
def test_faulty_dof_files_are_told_with_their_place(twin, tmp_path):
    name, change, place, expected = twin
    (tmp_path / name).write_text(change((DATA / name).read_text()))
    told = fault_of(read_dof_file, tmp_path / name)
    assert name in told and place in told and expected in told


MESHES = {
    "ANSYS: no format of nodes": ("two_springs.cdb", replaced("(3i9,6e21.13e3)", "3i9"), "line 3", "Fortran format"),
    "ANSYS: a node that is not there": (
        "two_springs.cdb",
        replaced("       40        7       12       12", "       40        8       12       12"),
        "node 8",
        "nodes that the file defines",
    ),
    "ANSYS: a node twice": (
        "two_springs.cdb",
        replaced("     1000        0        0", "        7        0        0"),
        "node 7 twice",
        "every node id once",
    ),
    "ANSYS: nodes missing in an element": (
        "two_springs.cdb",
        replaced("     1000     1000     1000     1000\n", "\n"),
        "line 12",
        "as many nodes",
    ),
    "Nastran: another coordinate system": (
        "two_springs_mesh.bdf",
        replaced("GRID,1000,0,", "GRID,1000,3,"),
        "line 9, GRID",
        "coordinate system 3: CORD1 or CORD2",
    ),
    "Nastran: rotated displacements": (
        "two_springs_mesh.bdf",
        replaced("10.-1,0", "10.-1,5"),
        "line 9, GRID",
        "coordinate system 5: CORD1 or CORD2",
    ),
    "Nastran: a coordinate that is none": (
        "two_springs_mesh.bdf",
        replaced("10.-1", "here"),
        "line 9, GRID",
        "real coordinates",
    ),
    "Nastran: five corners": (
        "two_springs_mesh.bdf",
        replaced("      12      1000\n", "      12      1000    40\n"),
        "line 10, CTETRA",
        "4 or 10",
    ),
    "Nastran: a range far beyond the nodes": (
        "two_springs_mesh.bdf",
        replaced("SET1,2,7,THRU,40", "SET1,2,7,THRU,1000000000000"),
        "node 1000000000000",
        "nodes that the file defines",
    ),
    "Nastran: a set of a node that is not there": (
        "two_springs_mesh.bdf",
        replaced("SET1,2,7", "SET1,2,8"),
        "node 8",
        "nodes that the file defines",
    ),
    "Abaqus: a node that is nowhere": (
        "two_springs.inp",
        replaced("12, 0., 1., 0.", "12, 0., nan, 0."),
        "[0.0, nan, 0.0] at node 12",
        "finite numbers",
    ),
    "Nastran: a node that is nowhere": (
        "two_springs_mesh.bdf",
        replaced("10.-1", "1.+400"),
        "at node 1000",
        "finite numbers",
    ),
    "Abaqus: two instances": (
        "two_springs.inp",
        lambda text: text + "*INSTANCE, NAME=A\n*END INSTANCE\n*INSTANCE, NAME=B\n*END INSTANCE\n",
        "*INSTANCE = 'B'",
        "noPartsInputFile",
    ),
    "Abaqus: an instance moved": (
        "two_springs.inp",
        lambda text: text + "*INSTANCE, NAME=A\n1., 0., 0.\n",
        "*INSTANCE = 'A'",
        "noPartsInputFile",
    ),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("twin", MESHES.values(), ids=MESHES)
def test_faulty_meshes_are_told_with_their_place(twin, tmp_path):
    name, change, place, expected = twin
    (tmp_path / name).write_text(change((DATA / name).read_text()))
    told = fault_of(read_mesh, tmp_path / name)
    assert name in told and place in told and expected in told


# --- files that do not go together -----------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path) -> Path:
    """All samples in a folder, and one of more rows."""
    for path in DATA.iterdir():
        shutil.copy(path, tmp_path)
    scipy.io.mmwrite(tmp_path / "four.mtx", sparse.eye(4).tocsr())
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--abaqus", "absent"], "import: abaqus = 'absent_STIF1.mtx: no such file': expected the stiffness"),
        (["--nastran", "absent.pch"], "absent.pch: file = "),
        (["--nastran", "two_springs.inp"], "two_springs.inp: file = 'no DMIG': expected a file with matrices"),
        (
            ["--nastran", "two_springs.pch", "--dofs", "two_springs.dof"],
            "two_springs.dof: dofs = 'given': expected no such",
        ),
        (
            ["--nastran", "two_springs.op4", "--mesh", "two_springs_mesh.bdf"],
            "import: dofs is missing: expected a file that",
        ),
        (["--nastran", "two_springs.pch", "--abaqus", "two_springs"], "import: nastran = 'given': expected one source"),
        (["--nastran", "two_springs.pch", "--stiffness", "K.mtx"], "import: stiffness = 'given': expected one source"),
        (
            ["--nastran", "two_springs.pch", "--damping", "symmetric.mtx"],
            "symmetric.mtx: damping = 'numbered rows': expected",
        ),
        (
            ["--stiffness", "symmetric.mtx", "--mass", "four.mtx", "--dofs", "two_springs.dof"],
            "four.mtx: mass = '4 x 4': expected",
        ),
        (
            ["--stiffness", "two_springs.pch:XXX", "--mass", "two_springs.pch:MAAX"],
            "two_springs.pch: stiffness = 'XXX': expected",
        ),
        (
            ["--stiffness", "symmetric.mtx:K", "--mass", "two_springs.pch:MAAX"],
            "import: stiffness = 'symmetric.mtx:K': expected",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "told",
)
def test_files_that_do_not_go_together_are_told(folder, capfd, arguments, message):
    done = attrito_here(folder, capfd, "import", "model.h5", *arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"attrito: {message}") and len(done.stderr.splitlines()) == 1
    assert not (folder / "model.h5").exists()


def test_a_node_of_the_matrices_that_the_mesh_lacks_is_told(folder):
    text = (folder / "two_springs_mesh.bdf").read_text().replace("GRID,1000", "GRID,1001").replace("1000", "1001")
    (folder / "two_springs_mesh.bdf").write_text(text)
    files = {"nastran_file": folder / "two_springs.pch", "mesh": folder / "two_springs_mesh.bdf"}
    told = fault_of(import_model, folder / "model.h5", **files)
    assert "two_springs.pch" in told and "node 1000 (1 such nodes)" in told and "two_springs_mesh.bdf" in told


@pytest.mark.parametrize(("kind", "remedy"), [("SPRING1", "C3D8I add nodes"), ("S4", "expands shells")])
def test_a_remedy_for_nodes_that_the_mesh_lacks_is_that_of_its_elements(folder, kind, remedy):
    nodes = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
    (folder / "mesh.inp").write_text(f"{nodes}*ELEMENT, TYPE={kind}, ELSET=e\n2, 1\n")
    files = {"abaqus_job": folder / "two_springs", "mesh": folder / "mesh.inp"}
    assert remedy in fault_of(import_model, folder / "model.h5", **files)


def test_dofs_without_mass_are_counted(folder):
    text = (folder / "two_springs_MASS1.mtx").read_text().replace("1000,1, 1000,1,  2.5", "1000,1, 1000,1,  0.0")
    (folder / "two_springs_MASS1.mtx").write_text(text)
    _, notes = import_model(folder / "model.h5", abaqus_job=folder / "two_springs")
    assert any(note.startswith("dofs without mass: 1, 0 of them rotations") for note in notes)
