"""Meshes that meshio reads: MED (Salome, code_aster), VTK, XDMF, Exodus, medit, Netgen.

Node ids are places in the file, from 1: these formats have none that matrices could name, or meshio does not keep them.
Groups of a MED file and sets of points are node sets. Solids that are inside out, as MED counts their corners, are
mirrored.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.importers.foreign import HDF5, NETCDF
from attrito.importers.mesh_data import Mesh, check_nodes, new_mesh
from attrito.importers.unpacked import bounded
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import stored

if TYPE_CHECKING:
    import meshio

# Modules of meshio by the ending of a file
READERS = {".med": "med", ".vtk": "vtk", ".vtu": "vtu", ".xdmf": "xdmf", ".xmf": "xdmf", ".e": "exodus",
           ".g": "exodus", ".exo": "exodus", ".ex2": "exodus", ".mesh": "medit", ".meshb": "medit",
           ".vol": "netgen"}  # fmt: skip
# What such files begin with: of gigabytes of something else meshio would look for the end of the first line.
_TEXT = b""
_STARTS = {"med": (HDF5,), "vtk": (b"# vtk",), "vtu": (b"<",), "xdmf": (b"<",), "exodus": (HDF5, NETCDF),
           "medit": (_TEXT, b"\1\0\0\0"), "netgen": (_TEXT,)}  # fmt: skip
_SOLIDS = {"tetra": "C3D4", "hexahedron": "C3D8", "tetra10": "C3D10", "hexahedron20": "C3D20"}
_FLAT = ("vertex", "line", "triangle", "quad", "polygon")
# The nodes of a solid's mirror image: two corners of the base are exchanged, and edges with them.
_MIRRORED = {
    "C3D4": [0, 2, 1, 3],
    "C3D8": [0, 3, 2, 1, 4, 7, 6, 5],
    "C3D10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8],
    "C3D20": [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17],
}


def is_meshio_mesh(path: str | Path) -> bool:
    """Whether a file's ending is one of those read here."""
    return Path(path).suffix.lower() in READERS


def read_meshio_mesh(path: str | Path) -> Mesh:
    """Read the mesh; what is no tetrahedron or brick is left out, and solids among that are listed."""
    path = Path(path)
    kind = READERS[path.suffix.lower()]
    expected = f"a mesh that meshio can read as {path.suffix.lower()}"
    with path.open("rb") as file:
        start = file.read(1 << 12).lstrip()
    if not any(b"\0" not in start if begin == _TEXT else start.startswith(begin) for begin in _STARTS[kind]):
        raise InputError(Fault(str(path), "file", start[:20].decode(errors="replace"), expected))
    module = importlib.import_module(f"meshio.{kind}")
    if kind == "exodus" and importlib.util.find_spec("netCDF4") is None:
        remedy = "netCDF4, by which meshio reads Exodus: install python3-netcdf4, or export the mesh as .med or .vtu"
        raise InputError(Fault(str(path), "file", "a mesh of Exodus; Python has no module netCDF4", remedy))
    if start.startswith(HDF5):
        with stored(path, expected):
            pass
    try:
        # `meshio.read` would end the program on a file it cannot read, and its readers print warnings.
        quiet = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
        unpacking = bounded(module._vtu, str(path), "file") if kind == "vtu" else contextlib.nullcontext()
        with quiet[0], quiet[1], unpacking:
            read = module.read(str(path))
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise InputError(Fault(str(path), "file", said, expected)) from error
    _check(str(path), read)
    points = np.zeros((len(read.points), 3))
    points[:, : np.shape(read.points)[1]] = read.points
    mesh = new_mesh(str(path), np.arange(1, len(points) + 1), points)
    _add_solids(mesh, read)
    _add_sets(mesh, read)
    mesh.files = [path]
    check_nodes(str(path), mesh)
    return mesh


def _check(path: str, read: meshio.Mesh) -> None:
    """Raise where parts of a mesh do not fit together: meshio hands on what a file holds."""
    faults = []
    points = np.asarray(read.points)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3 or points.dtype.kind not in "iuf":
        faults.append(Fault(path, "points", f"{points.dtype} of shape {points.shape}", "x, y, z of each node"))
    for cells in read.cells:
        corners = len(_MIRRORED[_SOLIDS[cells.type]]) if cells.type in _SOLIDS else None
        nodes = np.asarray(cells.data)
        if corners and (nodes.ndim != 2 or nodes.shape[1] != corners or nodes.dtype.kind not in "iu"):
            shown = f"{nodes.dtype} of shape {nodes.shape}"
            faults.append(Fault(path, f"elements {cells.type}", shown, f"{corners} nodes of each element"))
    tagged = [("nodes", read.point_data.get("point_tags"), len(points))]
    tagged += [
        (f"elements {cells.type}", tags, len(cells.data))
        for cells, tags in zip(read.cells, read.cell_data.get("cell_tags", []), strict=False)
    ]
    for what, tags, count in tagged:
        if tags is not None and np.shape(tags) != (count,):
            faults.append(
                Fault(path, f"groups of {what}", f"shape {np.shape(tags)}", f"a family of each of the {count}")
            )
    for name, nodes in read.point_sets.items():
        if np.asarray(nodes).dtype.kind not in "iu":
            faults.append(Fault(path, f"set {name}", f"{np.asarray(nodes).dtype}", "numbers of nodes"))
    if faults:
        raise InputError(*faults)


def _add_solids(mesh: Mesh, read: meshio.Mesh) -> None:
    parts: dict[str, list[np.ndarray]] = {}
    for cells in read.cells:
        if cells.type in _SOLIDS:
            parts.setdefault(_SOLIDS[cells.type], []).append(np.asarray(cells.data, np.int64) + 1)
        elif not cells.type.startswith(_FLAT):
            mesh.skipped.append(f"{len(cells.data)} elements {cells.type}")
    first = 1
    for name, found in parts.items():
        nodes = np.concatenate(found)
        if nodes.size and nodes.min() >= 1 and nodes.max() <= len(mesh.node_ids):
            corners = 4 if name in ("C3D4", "C3D10") else 8
            inside_out = _volumes(mesh.coordinates[nodes[:, :corners] - 1]) < 0.0
            nodes[inside_out] = nodes[inside_out][:, _MIRRORED[name]]
        mesh.elements[name] = (np.arange(first, first + len(nodes)), nodes)
        first += len(nodes)


def _volumes(corners: np.ndarray) -> np.ndarray:
    """Determinants of three edges at the first corner of tetrahedra, or of the axes of bricks, `[E]`."""
    if corners.shape[1] == 4:
        edges = corners[:, 1:4] - corners[:, :1]
    else:
        faces = [([1, 2, 5, 6], [0, 3, 4, 7]), ([2, 3, 6, 7], [0, 1, 4, 5]), ([4, 5, 6, 7], [0, 1, 2, 3])]
        edges = np.stack([corners[:, a].sum(axis=1) - corners[:, b].sum(axis=1) for a, b in faces], axis=1)
    return np.linalg.det(edges)


def _add_sets(mesh: Mesh, read: meshio.Mesh) -> None:
    """Groups of a MED file: families of nodes and of elements, each with the names of its groups."""
    members: dict[str, list[np.ndarray]] = {}

    def add(name: Any, nodes: np.ndarray) -> None:
        members.setdefault(str(name).strip().replace("/", "_"), []).append(np.asarray(nodes, np.int64).ravel() + 1)

    for name, nodes in read.point_sets.items():
        add(name, nodes)
    family = read.point_data.get("point_tags")
    for tag, names in getattr(read, "point_tags", {}).items():
        for name in names:
            add(name, np.flatnonzero(family == tag) if family is not None else np.zeros(0))
    for tag, names in getattr(read, "cell_tags", {}).items():
        for cells, tags in zip(read.cells, read.cell_data.get("cell_tags", []), strict=False):
            for name in names:
                add(name, cells.data[np.asarray(tags) == tag])
    mesh.node_sets = {name: np.unique(np.concatenate(parts)) for name, parts in members.items() if name}
    mesh.node_sets = {name: nodes for name, nodes in mesh.node_sets.items() if len(nodes)}
