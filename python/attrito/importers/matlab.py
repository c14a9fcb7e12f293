"""Matrices in MATLAB's .mat files: versions 4 to 7 by SciPy, 7.3 (HDF5) by h5py; sparse or full, both triangles."""

from __future__ import annotations

import zlib
from pathlib import Path

import h5py
import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.mat_records import fault_of_version_4, is_version_4
from attrito.importers.npz import check_parts, real_matrix
from attrito.importers.source import Source, no_such_matrix, refuse
from attrito.importers.unpacked import check_mat
from attrito.support.hdf5_reading import UNREADABLE, as_text, check_datasets

# Version 4 has no such header, and is known by its ending.
HEADER = b"MATLAB "
_HDF5 = b"MATLAB 7.3"
# What MATLAB calls variables of numbers; others are text, cells, structures or objects.
_NUMBERS = (
    "double",
    "single",
    "logical",
    "sparse",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


def read_matlab(path: str | Path, key: str, name: str | None = None) -> Source:
    """One real matrix `[n, n]`: the variable `name`, or the only matrix in the file."""
    path = str(path)
    with Path(path).open("rb") as file:
        modern = file.read(10) == _HDF5
    matrix = (_from_hdf5 if modern else _from_mat)(path, key, name)
    return Source(path, key, matrix=matrix)


def _from_mat(path: str, key: str, name: str | None) -> csr_matrix:
    import scipy.io
    from scipy.io.matlab import MatReadError

    if is_version_4(path) and (fault := fault_of_version_4(path)):
        raise refuse(path, key, fault, "a MATLAB file")
    try:
        if not is_version_4(path):
            check_mat(path, key)
        listed = scipy.io.whosmat(path)
        name = _choose(path, key, name, *({one[0]: one[part] for one in listed} for part in (1, 2)))
        matrix = scipy.io.loadmat(path, variable_names=[name])[name]
    except (*UNREADABLE, EOFError, MatReadError, zlib.error) as error:
        raise refuse(path, key, f"SciPy: {error}", "a MATLAB file of matrices, without objects") from error
    return real_matrix(matrix, path, f"{key} ({name})")


def _from_hdf5(path: str, key: str, name: str | None) -> csr_matrix:
    try:
        with h5py.File(path, "r") as file:
            check_datasets(file, path)
            things = {found: thing for found, thing in file.items() if not found.startswith("#")}
            shapes = {found: _shape(thing) for found, thing in things.items()}
            name = _choose(path, key, name, shapes, {found: _class(thing) for found, thing in things.items()})
            thing = file[name]
            if isinstance(thing, h5py.Dataset):
                return real_matrix(thing[()], path, f"{key} ({name})")
            # A matrix of zeros has no entries at all.
            parts = [thing[part][()] if part in thing else np.zeros(0, int) for part in ("data", "ir", "jc")]
    except UNREADABLE as error:
        raise refuse(path, key, str(error), "a MATLAB file") from error
    size = shapes[name][0]
    values, rows, offsets = parts
    fits = len(offsets) == shapes[name][1] + 1 and len(values) == len(rows) and offsets[-1] == len(rows)
    if not fits or (len(rows) and rows.max() >= size) or values.dtype.kind not in "iuf":
        what = f"{len(values)} values of type {values.dtype}, {len(rows)} rows"
        if values.dtype.names:
            what = "complex entries"
        raise refuse(path, f"{key} ({name})", what, "a real sparse matrix")
    # By columns; `real_matrix` says why that will do.
    index = np.int32 if len(rows) < np.iinfo(np.int32).max else np.int64
    parts = (values.astype(np.float64, copy=False), rows.astype(index), offsets.astype(index))
    try:
        matrix = csr_matrix(parts, shape=(shapes[name][1], size))
    except ValueError as error:
        raise refuse(path, f"{key} ({name})", str(error), "a real sparse matrix") from error
    check_parts(matrix, path, f"{key} ({name})")
    matrix.sum_duplicates()
    return matrix


def _shape(thing: h5py.Dataset | h5py.Group) -> tuple[int, ...]:
    """Rows and columns; none of what is no matrix."""
    if isinstance(thing, h5py.Dataset):
        return thing.shape
    rows = thing.attrs.get("MATLAB_sparse")
    return () if rows is None or "jc" not in thing else (int(rows), len(thing["jc"]) - 1)


def _class(thing: h5py.Dataset | h5py.Group) -> str:
    """What MATLAB calls a variable; files of other programs may not say it."""
    numbers = isinstance(thing, h5py.Dataset) or "MATLAB_sparse" in thing.attrs
    return as_text(thing.attrs.get("MATLAB_class", "double" if numbers else "struct"))


def _choose(path: str, key: str, name: str | None, shapes: dict[str, tuple[int, ...]], classes: dict[str, str]) -> str:
    """The variable of that name, or the only one that is a square matrix, which a single number is not."""
    numbers = [found for found in shapes if classes[found] in _NUMBERS]
    matrices = [found for found in numbers if len(shapes[found]) == 2 and shapes[found][0] == shapes[found][1] > 1]
    if name is None and len(matrices) == 1:
        return matrices[0]
    if name is None or name not in shapes:
        held = matrices or [found if found in numbers else f"{found} ({classes[found]})" for found in shapes]
        raise no_such_matrix(path, key, name, ", ".join(held) or "none")
    if name not in numbers:
        expected = "a matrix, full or sparse: take it out of what holds it, as K = model.K, and save that"
        raise refuse(path, f"{key} ({name})", f"of MATLAB's class {classes[name]}", expected)
    return name
