"""Mesh and node sets, whichever code wrote them."""

from __future__ import annotations

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

from attrito.importers.ansys_mesh import is_ansys_mesh, read_ansys_mesh
from attrito.importers.deck_mesh import read_deck_mesh
from attrito.importers.foreign import HDF5, NETCDF, foreign
from attrito.importers.gmsh_mesh import HEADER as GMSH
from attrito.importers.gmsh_mesh import read_gmsh_mesh
from attrito.importers.mesh_data import Mesh
from attrito.importers.meshio_mesh import is_meshio_mesh, read_meshio_mesh
from attrito.importers.nastran_mesh import is_nastran_mesh, read_nastran_mesh
from attrito.support.errors import Fault, InputError
from attrito.support.text_files import decoded

__all__ = ["Mesh", "read_mesh"]

_KEYWORD = re.compile(rb"^[ \t]*\*", re.MULTILINE)
KINDS = (
    "a deck of CalculiX or Abaqus (.inp), an ANSYS archive (.cdb), Nastran bulk data (.bdf), gmsh's .msh, or, by its"
    " ending, a mesh that meshio reads (.med, .vtu, ...)"
)


def read_mesh(path: str | Path, skip: bool = False) -> Mesh:
    """Read nodes, solid elements and node sets.

    Parameters
    ----------
    path : a deck of CalculiX or Abaqus (`.inp`), an ANSYS archive (`.cdb`), Nastran bulk data (`.bdf`), gmsh's `.msh`,
        or one that meshio reads (`.med`, `.vtu` and others)
    skip : leave out elements of a deck that are not known, and say so in `Mesh.skipped`, instead of raising a fault
    """
    try:
        with Path(path).open("rb") as file:
            start = file.read(1 << 20)
    except OSError as error:
        expected = "a mesh file that can be read"
        raise InputError(Fault(str(path), "file", error.strerror or str(error), expected)) from error
    if start.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        start = decoded(start).encode()
    known = None if is_meshio_mesh(path) and start.startswith((HDF5, NETCDF)) else foreign(start)
    if known is not None:
        raise InputError(Fault(str(path), "file", known.what, known.mesh))
    if start.startswith(b"$") and GMSH in start:
        return read_gmsh_mesh(path)
    if is_meshio_mesh(path):
        return read_meshio_mesh(path)
    if is_ansys_mesh(start) or Path(path).suffix.lower() == ".cdb":
        return read_ansys_mesh(path)
    if is_nastran_mesh(start):
        return read_nastran_mesh(path)
    if not _KEYWORD.search(start):
        raise InputError(Fault(str(path), "file", "no keyword", KINDS))
    return read_deck_mesh(path, skip)
