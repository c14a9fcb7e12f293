"""Nodes whose dofs have axes of their own: ANSYS's rotated nodes, CalculiX's `*TRANSFORM`."""

from __future__ import annotations

import subprocess

import matrix_writers as write
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from attrito.importers import import_model
from attrito.importers.deck_mesh import read_deck_mesh
from attrito.model.model_file import read_model
from attrito.scene.deck_loads import deck_force
from attrito.support.errors import InputError


def rotated_axes(xy: float, yz: float, zx: float) -> np.ndarray:
    """ANSYS's nodal directions as rows, as its theory manual writes them."""
    (c1, c2, c3), (s1, s2, s3) = np.cos(np.radians([xy, yz, zx])), np.sin(np.radians([xy, yz, zx]))
    return np.array(
        [
            [c1 * c3 - s1 * s2 * s3, s1 * c3 + c1 * s2 * s3, -c2 * s3],
            [-s1 * c2, c1 * c2, s2],
            [c1 * s3 + s1 * s2 * c3, s1 * s3 - c1 * s2 * c3, c2 * c3],
        ]
    )


ANGLES = [(90.0, 0.0, 0.0), (30.0, 0.0, 0.0), (0.0, 50.0, 0.0), (0.0, 0.0, -70.0), (30.0, 50.0, -70.0)]


@pytest.mark.parametrize("angles", ANGLES)
def test_dofs_of_rotated_ansys_nodes_are_turned_to_global_axes(angles, tmp_path):
    rng = np.random.default_rng(3)
    local = np.diag([50.0, 60.0, 70.0, 55.0, 65.0, 75.0]) + rng.uniform(-1, 1, (6, 6))
    local = local + local.T
    node, direction = np.repeat([7, 12], 3), np.tile([1, 2, 3], 2)
    write.write_mapping(tmp_path / "rows.mapping", node, direction)
    for name, matrix in (("K", local), ("M", local / 2)):
        write.write_harwell_boeing(tmp_path / f"{name}.hb", sparse.csr_matrix(matrix))
    fields = [f"{7:9d}{0:9d}{0:9d}", *(f"{x:21.13E}" for x in (1.0, 2.0, 3.0, *angles))]
    lines = [
        "NBLOCK,6,SOLID,       12,        2",
        "(3i9,6e21.13e2)",
        "".join(fields),
        f"{12:9d}{0:9d}{0:9d}{1.0:21.13E}",
    ]
    (tmp_path / "mesh.cdb").write_text("\n".join([*lines, "N,R5.3,LOC,       -1,"]) + "\n")
    model, notes = import_model(
        tmp_path / "model.h5",
        stiffness=tmp_path / "K.hb",
        mass=tmp_path / "M.hb",
        dofs=tmp_path / "rows.mapping",
        mesh=tmp_path / "mesh.cdb",
    )
    turning = np.eye(6)
    turning[:3, :3] = rotated_axes(*angles)
    # Harwell-Boeing has some thirteen digits.
    assert model.stiffness.toarray() == pytest.approx(turning.T @ local @ turning, abs=1e-9)
    assert model.mass.toarray() == pytest.approx(turning.T @ local @ turning / 2, abs=1e-9)
    assert any("1 nodes with displacements along axes of their own" in note for note in notes)


BODY = """*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,2
6,1,0,2
7,1,1,2
8,0,1,2
*ELEMENT,TYPE=C3D8,ELSET=E
1,1,2,3,4,5,6,7,8
*MATERIAL,NAME=S
*ELASTIC
210000,0.3
*DENSITY
7.8e-9
*SOLID SECTION,ELSET=E,MATERIAL=S
"""
TRANSFORM = "*TRANSFORM,NSET=ALL,TYPE=R\n0.8,0.6,0,-0.6,0.8,0\n"
STEP = "*STEP\n*FREQUENCY,SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"


def imported(folder, deck: str):
    folder.mkdir()
    (folder / "job.inp").write_text(deck)
    subprocess.run(["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True)
    return import_model(folder / "model.h5", calculix_job=folder / "job", mesh=folder / "job.inp")


def test_calculix_keeps_dofs_along_x_y_z_at_nodes_of_transform(tmp_path):
    plain, _ = imported(tmp_path / "plain", BODY + STEP)
    turned, notes = imported(tmp_path / "turned", BODY + TRANSFORM + STEP)
    assert (plain.stiffness != turned.stiffness).nnz == 0 and (plain.mass != turned.mass).nnz == 0
    assert not any("depend on others" in note for note in notes)


def test_matrices_along_axes_of_transform_are_refused(tmp_path):
    """What CalculiX 2.20 writes so is along the axes of each node, and the file of dofs looks the same."""
    with pytest.raises(InputError, match="GLOBAL=NO.*: GLOBAL=YES"):
        imported(tmp_path / "own", BODY + TRANSFORM + STEP.replace("MATRIXSTORAGE", "MATRIXSTORAGE, GLOBAL=NO"))


@pytest.mark.parametrize("output", ["*NODE FILE", "*NODE PRINT, NSET=ALL", "*EL FILE"])
def test_output_along_axes_of_transform_changes_no_matrices(tmp_path, output):
    deck = BODY + TRANSFORM + STEP.replace("*END", f"{output}, GLOBAL=NO\n{'S' if 'EL' in output else 'U'}\n*END")
    assert imported(tmp_path / "printed", deck)[0].size == 24


def test_a_support_along_axes_of_transform_is_said_to_be_an_equation(tmp_path):
    model, notes = imported(tmp_path / "held", BODY + TRANSFORM + "*BOUNDARY\n2,2,2\n" + STEP)
    # One displacement of node 2 depends on the other.
    assert model.size == 23
    assert any("*BOUNDARY at nodes of *TRANSFORM, line 18" in note and "depend on others" in note for note in notes)


@pytest.mark.parametrize(
    "axes",
    [
        "*TRANSFORM,NSET=TOP,TYPE=R\n0.8,0.6,0.1,-0.6,0.8,0.3\n",
        "*TRANSFORM,NSET=TOP,TYPE=C\n0.3,0.2,0.1,0.4,-0.1,2.5\n",
        "*TRANSFORM,NSET=TOP,TYPE=C\n0.3,0.2,0.1,0.4,-0.1,2.5\n*TRANSFORM,NSET=END\n0,1,0,0,0,1\n",
        "*TRANSFORM,NSET=END,TYPE=R\n1,1,0,0,0,-2\n",
        "*TRANSFORM,NSET=TOP,TYPE=C\n0.3,0.2,0.1,0.4,-0.1\n",
    ],
)
def test_forces_at_nodes_of_transform_go_as_calculix_has_them(tmp_path, axes):
    deck = f"{BODY}*NSET,NSET=TOP\n5,6,7,8\n*NSET,NSET=END\n7\n{axes}*BOUNDARY\n1,1,3\n2,1,3\n3,1,3\n4,1,3\n"
    force = "*CLOAD\nTOP,1,3.0\n7,2,-5.0\n6,3,2.0\n"
    model, notes = imported(tmp_path / "job", deck + STEP)
    assert any("go along these (*TRANSFORM, line" in note for note in notes)
    (tmp_path / "load.inp").write_text(force)
    load, said = deck_force(tmp_path / "load.inp", read_model(tmp_path / "job" / "model.h5"))
    along = model.load_axes.get(6, np.eye(3))
    assert set(model.load_axes) == ({5, 6, 7, 8} if "=TOP" in axes else {7})
    assert np.allclose(along @ along.T, np.eye(3), atol=1e-14)
    (tmp_path / "job" / "st.inp").write_text(
        f"{deck}*STEP\n*STATIC\n{force}*NODE PRINT,NSET=TOP,GLOBAL=YES\nU\n*END STEP\n"
    )
    subprocess.run(["ccx", "-i", "st"], cwd=tmp_path / "job", check=True, capture_output=True)
    rows = [line.split() for line in (tmp_path / "job" / "st.dat").read_text().splitlines()]
    printed = {int(row[0]): [float(word) for word in row[1:]] for row in rows if row and row[0].isdigit()}
    expected = [printed[node][d - 1] for node, d in zip(model.dof_node, model.dof_direction, strict=True)]
    found = spsolve(model.stiffness.tocsc(), load)
    assert found == pytest.approx(np.array(expected), abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("axes", ["TYPE=R\n1,0,0,2,0,0", "TYPE=C\n1,1,0,1,1,0", "TYPE=S\n0,0,0,0,0,2", "TYPE=C\n0,0,0"])
def test_transform_without_axes_is_refused(tmp_path, axes):
    (tmp_path / "mesh.inp").write_text(f"{BODY}*TRANSFORM,NSET=ALL,{axes}\n")
    with pytest.raises(InputError, match=r"\*TRANSFORM"):
        read_deck_mesh(tmp_path / "mesh.inp")


def test_a_force_on_the_axis_of_transform_is_refused(tmp_path):
    """Node 5 has no direction away from it; other nodes have."""
    imported(tmp_path / "job", f"{BODY}*TRANSFORM,NSET=ALL,TYPE=C\n0,0,0,0,0,2\n{STEP}")
    model = read_model(tmp_path / "job" / "model.h5")
    for node in (5, 6):
        (tmp_path / "load.inp").write_text(f"*CLOAD\n{node},1,3.0\n")
        if node == 6:
            force, _ = deck_force(tmp_path / "load.inp", model)
            assert force.sum() == pytest.approx(3.0, rel=1e-15)
            continue
        with pytest.raises(InputError, match="node 5.*off the axis"):
            deck_force(tmp_path / "load.inp", model)


def test_transform_beside_matrices_of_another_program_is_refused(tmp_path):
    node, direction = np.repeat(np.arange(1, 9), 3), np.tile([1, 2, 3], 8)
    for name in ("STIF", "MASS"):
        write.write_abaqus_coordinate(tmp_path / f"{name}.mtx", sparse.eye(24).tocsr())
    write.write_dofs(tmp_path / "rows.dof", node, direction)
    (tmp_path / "job.inp").write_text(BODY + TRANSFORM)
    files = {"stiffness": tmp_path / "STIF.mtx", "mass": tmp_path / "MASS.mtx", "dofs": tmp_path / "rows.dof"}
    with pytest.raises(InputError, match=r"\*TRANSFORM = 'ALL': expected dofs along x, y, z at every node"):
        import_model(tmp_path / "model.h5", **files, mesh=tmp_path / "job.inp")
