"""Grid points in coordinate systems of their own, positions and displacements; dofs are turned to global directions."""

from __future__ import annotations

import matrix_writers as write
import numpy as np
import pytest
from scipy import sparse

from attrito.importers import import_model, read_mesh
from attrito.support.errors import InputError

# x' = y, y' = z, z' = x, at (1, 2, 3); cylinder and sphere about the same axes, in that system's coordinates
AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ORIGIN = np.array([1.0, 2.0, 3.0])
SYSTEMS = """CORD2R  10              1.      2.      3.      2.      2.      3.      +
+       1.      3.      3.
CORD2C,11,10,0.,0.,0.,0.,0.,1.,
,1.,0.,0.
CORD2S* 12                            10              0.              0.
*                     0.              0.              0.              1.
*                     1.              0.              0.
GRID    90              1.      2.      3.
GRID    91              2.      2.      3.
GRID    92              1.      3.      3.
CORD1R  13      90      91      92
"""


def grid(tmp_path, cards: str):
    path = tmp_path / "mesh.bdf"
    path.write_text(SYSTEMS + cards)
    return read_mesh(path)


POSITIONS = {
    "GRID,7,10,1.0,2.0,4.0": ORIGIN + [4.0, 1.0, 2.0],
    "GRID,7,13,1.0,2.0,4.0": ORIGIN + [4.0, 1.0, 2.0],
    "GRID,7,11,2.0,30.0,5.0": ORIGIN + [5.0, 3.0**0.5, 1.0],
    "GRID,7,12,2.0,60.0,90.0": ORIGIN + [1.0, 0.0, 3.0**0.5],
    "GRDSET,,10\nGRID,7,,1.0,2.0,4.0": ORIGIN + [4.0, 1.0, 2.0],
    f"GRID   *{7:16d}{10:16d}             1.0             2.0\n*                   4.0": ORIGIN + [4.0, 1.0, 2.0],
}


@pytest.mark.parametrize(("cards", "position"), POSITIONS.items())
def test_grid_points_are_where_their_systems_say(cards, position, tmp_path):
    mesh = grid(tmp_path, cards + "\n")
    assert mesh.coordinates[mesh.node_ids == 7][0] == pytest.approx(position, rel=1e-14)


def directions(system: int, place: str) -> np.ndarray:
    """What 1, 2, 3 are at a point in the cylinder at 30 degrees, or on the sphere at 60 and 90 degrees."""
    half, root = 0.5, 0.75**0.5
    along = {
        10: np.eye(3),
        11: [[root, half, 0.0], [-half, root, 0.0], [0.0, 0.0, 1.0]],
        12: [[0.0, root, half], [0.0, half, -root], [-1.0, 0.0, 0.0]],
    }[system]
    return np.array(along) @ AXES


CASES = [(10, "10,1.0,2.0,4.0"), (11, "11,2.0,30.0,5.0"), (12, "12,2.0,60.0,90.0")]


@pytest.mark.parametrize(("system", "place"), CASES)
@pytest.mark.parametrize("source", ["mesh", "dofs"])
def test_dofs_along_axes_of_their_own_are_turned(source, system, place, tmp_path):
    """Springs 5, 6, 7 along the point's own axes, rotations likewise, coupled with a point that is not turned."""
    rng = np.random.default_rng(system)
    local = np.diag([5.0, 6.0, 7.0, 1.0, 2.0, 3.0, 9.0, 4.0])
    local[:6, 6:] = rng.uniform(-0.5, 0.5, (6, 2))
    local = np.triu(local) + np.triu(local, 1).T
    node, direction = np.array([7] * 6 + [8, 1001]), np.array([1, 2, 3, 4, 5, 6, 2, 0])
    turning = np.eye(8)
    turning[:3, :3] = turning[3:6, 3:6] = directions(system, place)
    cards = f"GRID,7,{place},{system}\nGRID,8,,9.0,9.0,9.0\n"
    matrices = {"KAAX": sparse.csr_matrix(local), "MAAX": sparse.csr_matrix(local / 2)}
    if source == "mesh":
        write.write_dmig(tmp_path / "job.pch", matrices, node, direction, "free")
        (tmp_path / "job.bdf").write_text(SYSTEMS + cards)
        files = {"nastran_file": tmp_path / "job.pch", "mesh": tmp_path / "job.bdf"}
    else:
        write.write_op4_binary(tmp_path / "job.op4", matrices, "dense")
        (tmp_path / "job.asm").write_text(SYSTEMS + cards + "EXTRN,7,123456,8,2,1001,0\n")
        files = {"nastran_file": tmp_path / "job.op4", "dofs": tmp_path / "job.asm"}
    model, notes = import_model(tmp_path / "model.h5", **files)
    assert model.stiffness.toarray() == pytest.approx(turning.T @ local @ turning, abs=1e-14)
    assert model.mass.toarray() == pytest.approx(turning.T @ local @ turning / 2, abs=1e-14)
    assert abs(model.stiffness - model.stiffness.T).max() == 0.0
    assert "1 nodes with displacements along axes of their own (CD): turned to x, y, z" in notes


def test_a_dof_held_along_an_axis_of_its_own_is_refused(tmp_path):
    matrices = {"KAAX": sparse.eye(2).tocsr(), "MAAX": sparse.eye(2).tocsr()}
    write.write_dmig(tmp_path / "job.pch", matrices, np.array([7, 7]), np.array([1, 2]))
    (tmp_path / "job.bdf").write_text(SYSTEMS + "GRID,7,,1.0,2.0,4.0,10\n")
    with pytest.raises(InputError, match=r"job\.bdf: axes = 'node 7, some of whose dofs .*: expected all three"):
        import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch", mesh=tmp_path / "job.bdf")


FAULTS = {
    "GRID,7,99,1.0": "coordinate system 99",
    "CORD2R,20,20,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,7,20": "not made of itself",
    "CORD2R,20,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\nGRID,7,20": "three points that are not on one line",
    "CORD1R,20,90,91,95\nGRID,7,20": "three grid points of the file",
    "CORD2R,20,,0.,0.,x,0.,0.,1.\nGRID,7,20": "real coordinates",
    "GRID,7,a,1.0": "whole numbers",
}


@pytest.mark.parametrize(("cards", "message"), FAULTS.items())
def test_faulty_systems_are_refused_in_one_line(cards, message, tmp_path):
    with pytest.raises(InputError, match=message) as caught:
        grid(tmp_path, cards + "\n")
    assert len(str(caught.value).splitlines()) == 1 and "mesh.bdf: line" in str(caught.value)
