"""Files that no reader here takes, known by what they begin with: what they are, and what to give instead."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np


class Foreign(NamedTuple):
    """What a file is, and what is expected in its place where a mesh and where a matrix is asked for."""

    what: str
    mesh: str
    matrix: str


HDF5, ZIP, NETCDF = b"\x89HDF", b"PK\x03\x04", b"CDF"
_UNPACKED = "the file that is packed in it: unpack it first"
_MESHED = "a mesh of solid elements: mesh the geometry first, as with gmsh"
_ANSYS_MATRIX = "its matrices as text: HBMAT, or *SMAT and *EXPORT (docs/how-to/import.md)"
_ANSYS_FILES = {2: ".emat", 3: ".esav", 4: ".full", 8: ".sub", 9: ".mode", 12: ".rst"}
# A mark is where a file begins, or a pattern of its first bytes.
_KINDS = {
    rb".{0,64}NASTRAN FORT TAPE ID CODE": Foreign(
        "Nastran's OUTPUT2 (.op2)", "the bulk data (.bdf)", "matrices as DMIG (.pch) or OUTPUT4 (docs/how-to/import.md)"
    ),
    rb"\s*-1[ \t]*\r?\n\s*\d+[ \t]*\r?\n": Foreign(
        "a universal file (.unv)", "a deck (.inp), bulk data (.bdf) or MED (.med)", "Matrix Market or MATLAB"
    ),
    rb"[ \t]+1C": Foreign(
        "results of CalculiX (.frd)", "the deck (.inp)", "the job: --calculix (docs/how-to/import.md)"
    ),
    rb"HKSRD0": Foreign("Abaqus's database (.odb)", "the deck (.inp)", "*MATRIX OUTPUT's .mtx (docs/how-to/import.md)"),
    rb"ISO-10303-21": Foreign("geometry in STEP", _MESHED, "a matrix file"),
    rb"solid\b[^\n]*\n\s*(facet|endsolid)\b": Foreign("a surface in STL", _MESHED, "a matrix file"),
    rb"version https://git-lfs": Foreign("a pointer of Git LFS", "the file itself: git lfs pull", "git lfs pull"),
    rb"\x1f\x8b": Foreign("packed by gzip", _UNPACKED, _UNPACKED),
    rb"BZh\d1AY": Foreign("packed by bzip2", _UNPACKED, _UNPACKED),
    rb"\xfd7zXZ\0": Foreign("packed by xz", _UNPACKED, _UNPACKED),
    rb"\x28\xb5\x2f\xfd": Foreign("packed by zstd", _UNPACKED, _UNPACKED),
    rb"7z\xbc\xaf": Foreign("packed by 7-Zip", _UNPACKED, _UNPACKED),
    re.escape(ZIP): Foreign("a zip archive", _UNPACKED, "SciPy's .npz, or the file that is packed in it"),
    re.escape(HDF5): Foreign(
        "an HDF5 file", "MED or Exodus, by the ending .med or .exo", "MATLAB's .mat; a job takes model.h5 as it is"
    ),
    NETCDF + rb"[\1\2\5]": Foreign("a NetCDF file", "Exodus, by the ending .exo or .g", "a matrix file"),
}
_PATTERNS = {re.compile(mark, re.DOTALL): kind for mark, kind in _KINDS.items()}


def foreign(start: bytes) -> Foreign | None:
    """What a file that begins so is; None where that is not known."""
    if what := _ansys_binary(start):
        return Foreign(what, "an archive: CDWRITE, DB (.cdb)", _ANSYS_MATRIX)
    return next((kind for pattern, kind in _PATTERNS.items() if pattern.match(start)), None)


def _ansys_binary(start: bytes) -> str:
    """Which binary file of ANSYS one is by its beginning; "" for others.

    The first record, of 100 integers, begins with the number of the kind of file.
    """
    for order in "<>":
        if len(start) >= 12 and start[:8] == np.array([100, -(2**31)], f"{order}i4").tobytes():
            number = int(np.frombuffer(start[8:12], f"{order}i4")[0])
            return f"ANSYS's binary file {_ANSYS_FILES.get(number, f'of kind {number}')}"
    return ""
