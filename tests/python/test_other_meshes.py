"""Meshes of gmsh and of what meshio reads, as mesh beside matrices."""

from __future__ import annotations

import importlib
import lzma
import resource
import zlib
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from gmsh_writer import BASE, POINTS, TAGS, gmsh

from attrito.importers import import_model, read_mesh, unpacked
from attrito.support.errors import InputError

FORMATS = [("2.2", False), ("2.2", True), ("4.1", False), ("4.1", True)]


@pytest.mark.parametrize(("version", "binary"), FORMATS)
def test_a_mesh_of_gmsh_has_its_tags_groups_and_edges(version, binary, tmp_path):
    (tmp_path / "mesh.msh").write_bytes(b"$Comments\nby hand\n$EndComments\n" * (not binary) + gmsh(version, binary))
    mesh = read_mesh(tmp_path / "mesh.msh")
    assert mesh.node_ids.tolist() == TAGS.tolist() and np.array_equal(mesh.coordinates, POINTS)
    ids, nodes = mesh.elements["C3D20"]
    assert ids.tolist() == [7] and nodes.tolist() == [TAGS.tolist()]
    assert {name: found.tolist() for name, found in mesh.node_sets.items()} == {
        "body": sorted(TAGS),
        "surface_4": sorted(TAGS[BASE]),
    }


def test_tetrahedra_of_gmsh_have_their_last_edges_exchanged_and_wedges_are_left_out(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (2, 3), (1, 3)]
    points = np.vstack([points, [(points[a] + points[b]) / 2 for a, b in edges]])
    lines = "\n".join(f"{k + 1} {x} {y} {z}" for k, (x, y, z) in enumerate(points))
    elements = "1 11 2 0 1 1 2 3 4 5 6 7 8 9 10\n2 6 2 0 1 1 2 3 4 5 6\n"
    text = (
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n{lines}\n$EndNodes\n$Elements\n2\n{elements}$EndElements\n"
    )
    (tmp_path / "mesh.msh").write_text(text)
    mesh = read_mesh(tmp_path / "mesh.msh")
    assert mesh.elements["C3D10"][1].tolist() == [[1, 2, 3, 4, 5, 6, 7, 8, 10, 9]]
    assert mesh.skipped == ["1 solids with 6 nodes"] and mesh.node_sets == {}


GMSH_FAULTS = {
    "an old format": (lambda data: data.replace(b"2.2 0 8", b"1.0 0 8"), "$MeshFormat = '1.0 0 8'", "save it again"),
    "cut off": (lambda data: data[:400], "$Nodes = 'no end'", "the file is cut off"),
    "no elements": (lambda data: data.partition(b"$Elements")[0], "$Elements is missing", "nodes and elements"),
    "nodes that lack": (lambda data: data.replace(b"$Nodes\n20", b"$Nodes\n21"), "$Nodes = 'ends before", "a whole"),
    "elements that lack": (
        lambda data: data.replace(b"$Elements\n2", b"$Elements\n3"),
        "ends before 3 more",
        "a whole",
    ),
    "no number": (lambda data: data.replace(b"3.0", b"3.x"), "$Nodes = ", "a whole file"),
    "half a tag": (lambda data: data.replace(b"\n100 0.0", b"\n100.5 0.0"), "$Nodes = ", "tag and coordinates"),
    "an unknown type": (lambda data: data.replace(b"7 17 2", b"7 99 2"), "an element of type 99", "that gmsh writes"),
    "an unknown node": (lambda data: data.replace(b"61 58\n", b"61 59\n"), "node 59", "nodes that the file defines"),
    "a node twice": (lambda data: data.replace(b"\n97 ", b"\n100 "), "node 100 twice", "every node id once"),
    "a group without a number": (lambda data: data.replace(b"3 9 ", b"3 x "), "3 x", "number and name of a group"),
}


@pytest.mark.parametrize("fault", GMSH_FAULTS.values(), ids=GMSH_FAULTS)
def test_faulty_meshes_of_gmsh_are_refused_in_one_line(fault, tmp_path):
    change, value, expected = fault
    good = gmsh("2.2", False)
    assert change(good) != good
    (tmp_path / "mesh.msh").write_bytes(change(good))
    with pytest.raises(InputError) as caught:
        read_mesh(tmp_path / "mesh.msh")
    message = str(caught.value)
    assert len(message.splitlines()) == 1 and "mesh.msh" in message and value in message and expected in message


def test_binary_data_of_gmsh_with_the_last_byte_first_is_refused(tmp_path):
    data = gmsh("4.1", True).replace(b"8\n\x01\x00\x00\x00", b"8\n\x00\x00\x00\x01")
    (tmp_path / "mesh.msh").write_bytes(data)
    with pytest.raises(InputError, match="the last byte first"):
        read_mesh(tmp_path / "mesh.msh")


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".med", ".xdmf"])
@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize("kind", ["tetra", "tetra10", "hexahedron", "hexahedron20"])
def test_meshes_that_meshio_reads_have_solids_with_their_faces_outward(kind, inside_out, ending, tmp_path):
    cells = {
        "hexahedron20": range(20),
        "hexahedron": range(8),
        # Corners 0, 1, 3, 4 of the brick, and their edges; a mid-side node of its own for those that are diagonals
        "tetra10": [0, 1, 3, 4, 8, 20, 11, 16, 21, 22],
        "tetra": [0, 1, 3, 4],
    }[kind]
    mirrored = {
        "hexahedron20": [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17],
        "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
        "tetra10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8],
        "tetra": [0, 2, 1, 3],
    }[kind]
    extra = [(POINTS[a] + POINTS[b]) / 2 for a, b in ((1, 3), (1, 4), (3, 4))]
    points, nodes = np.vstack([POINTS, extra]), np.array(cells)
    path = tmp_path / f"mesh{ending}"
    written = nodes[mirrored] if inside_out else nodes
    meshio.write_points_cells(path, points, [(kind, written[None])])
    mesh = read_mesh(path)
    assert mesh.node_ids.tolist() == list(range(1, 24))
    ((_, found),) = mesh.elements.values()
    assert found.tolist() == [(nodes + 1).tolist()]
    assert mesh.coordinates[found[0] - 1] == pytest.approx(points[nodes], abs=1e-6)


def test_groups_of_a_med_file_are_node_sets(tmp_path):
    mesh = meshio.Mesh(
        POINTS,
        [("hexahedron20", np.arange(20)[None]), ("quad8", np.array([BASE]))],
        point_data={"point_tags": np.array([2, 2] + [0] * 18)},
        cell_data={"cell_tags": [np.array([-6]), np.array([-7])]},
    )
    mesh.point_tags = {2: ["corner", "edge"]}
    mesh.cell_tags = {-6: ["body"], -7: ["base"]}
    meshio.med.write(str(tmp_path / "mesh.med"), mesh)
    sets = {name: nodes.tolist() for name, nodes in read_mesh(tmp_path / "mesh.med").node_sets.items()}
    assert sets == {
        "corner": [1, 2],
        "edge": [1, 2],
        "body": list(range(1, 21)),
        "base": [k + 1 for k in sorted(BASE)],
    }


def test_what_meshio_cannot_read_is_refused_in_one_line(tmp_path):
    for name in ("mesh.med", "mesh.vtu", "mesh.vtk", "mesh.mesh"):
        (tmp_path / name).write_bytes(b"\x00not a mesh\n" * 10)
        with pytest.raises(InputError) as caught:
            read_mesh(tmp_path / name)
        assert len(str(caught.value).splitlines()) == 1
        assert f"a mesh that meshio can read as {(tmp_path / name).suffix}" in str(caught.value)


@pytest.mark.parametrize("ending", [".vtk", ".vtu", ".med", ".mesh", ".exo"])
def test_gigabytes_of_zeros_are_no_mesh_and_are_not_read_to_their_end(ending, tmp_path):
    path = tmp_path / f"mesh{ending}"
    with path.open("wb") as file:
        file.truncate(1 << 33)
    # Reading them would take all of the memory that is allowed here, or seconds.
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match="a mesh that meshio can read as"):
        read_mesh(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 18


@pytest.mark.parametrize("compression", ["zlib", "lzma"])
def test_a_packed_mesh_unpacks_no_more_than_fits_into_memory(compression, tmp_path, monkeypatch):
    points = np.vstack([np.eye(4)[:, :3], np.zeros((20_000, 3))])
    write = importlib.import_module("meshio.vtu").write
    write(tmp_path / "mesh.vtu", meshio.Mesh(points, [("tetra", [[3, 0, 1, 2]])]), compression=compression)
    assert len(read_mesh(tmp_path / "mesh.vtu").node_ids) == len(points)
    monkeypatch.setattr(unpacked, "most_bytes", lambda: 100_000)
    with pytest.raises(InputError, match="bytes when it is unpacked.*expected at most 100000, half of the memory"):
        read_mesh(tmp_path / "mesh.vtu")


def test_a_mesh_of_gmsh_goes_with_matrices(tmp_path):
    (tmp_path / "mesh.msh").write_bytes(gmsh("4.1", True))
    (tmp_path / "k.mtx").write_text("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 2.0\n2 2 3.0\n")
    (tmp_path / "rows.dof").write_text("100.1\n43.3\n")
    files = {"stiffness": tmp_path / "k.mtx", "mass": tmp_path / "k.mtx", "dofs": tmp_path / "rows.dof"}
    model, notes = import_model(tmp_path / "model.h5", **files, mesh=tmp_path / "mesh.msh")
    assert model.has_mesh and "1 elements C3D20" in notes and "node set body: 20 nodes" in notes


def test_a_mesh_without_solids_says_so(tmp_path):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    meshio.Mesh(corners, [("quad", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "plate.vtu")
    numbers = "".join(f"{node},{way}, {node},{way}, 1.0\n" for node in range(1, 5) for way in range(1, 4))
    for name in ("STIF1", "MASS1"):
        (tmp_path / f"plate_{name}.mtx").write_text(numbers)
    _, notes = import_model(tmp_path / "plate.h5", abaqus_job=tmp_path / "plate", mesh=tmp_path / "plate.vtu")
    assert [note for note in notes if note.startswith("no solid elements in the mesh: contacts go by nodes alone")]


SPOILT = {
    "corners that are missing": lambda mesh: mesh.cells.__setitem__(0, fake("hexahedron", np.zeros((2, 6), int))),
    "corners that are no numbers of nodes": lambda mesh: mesh.cells.__setitem__(0, fake("tetra", np.zeros((2, 4)))),
    "corners in no rows": lambda mesh: mesh.cells.__setitem__(0, fake("tetra", np.zeros(4, int))),
    "nodes of four coordinates": lambda mesh: setattr(mesh, "points", np.zeros((4, 4))),
    "nodes in no rows": lambda mesh: setattr(mesh, "points", np.zeros(12)),
    "nodes that are text": lambda mesh: setattr(mesh, "points", np.full((4, 3), "x")),
    "families of fewer nodes": lambda mesh: mesh.point_data.update(point_tags=np.zeros(2, int)),
    "families of more elements": lambda mesh: mesh.cell_data.update(cell_tags=[np.zeros(5, int)]),
    "a set of no numbers": lambda mesh: mesh.point_sets.update(foot=np.array([0.5])),
}


def fake(kind: str, nodes: np.ndarray) -> SimpleNamespace:
    """Elements as meshio's readers make them, which check nothing."""
    return SimpleNamespace(type=kind, data=nodes)


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_what_meshio_hands_on_is_looked_over(spoil, tmp_path, monkeypatch):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    mesh = meshio.Mesh(corners, [("tetra", np.array([[0, 1, 2, 3]]))])
    mesh.write(tmp_path / "mesh.med")
    spoil(mesh)
    monkeypatch.setattr(meshio.med, "read", lambda path: mesh)
    with pytest.raises(InputError, match="mesh.med: "):
        read_mesh(tmp_path / "mesh.med")


def test_a_packed_block_that_ends_too_early_is_a_fault(tmp_path):
    packed = zlib.compress(bytes(1000))
    module = SimpleNamespace(zlib=zlib, lzma=lzma)
    with unpacked.bounded(module, "mesh.vtu", "file"):
        assert module.zlib.decompress(packed) == bytes(1000)
        with pytest.raises(ValueError, match="ends too early"):
            module.zlib.decompress(packed[:-2])
