"""Matrices that SciPy keeps with `scipy.sparse.save_npz`, any of its formats, with both triangles."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np
import scipy.sparse
from scipy.sparse import csr_matrix

from attrito.importers.source import Source, refuse
from attrito.importers.unpacked import check_zip
from attrito.support.hdf5_reading import UNREADABLE


def read_npz(path: str | Path, key: str) -> Source:
    """One real matrix `[n, n]`."""
    path = str(path)
    try:
        check_zip(path, key)
        matrix = scipy.sparse.load_npz(path)
    except (*UNREADABLE, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise refuse(path, key, str(error), "a file of scipy.sparse.save_npz") from error
    return Source(path, key, matrix=real_matrix(matrix, path, key))


def real_matrix(matrix: object, path: str, key: str) -> csr_matrix:
    """A matrix of real numbers, sparse or dense, as CSR; columns taken for rows where that costs less.

    A symmetric matrix by columns is the same by rows. Where it is not symmetric, the fault that says so names the entry
    and its mirror image.
    """
    if not scipy.sparse.issparse(matrix) and (not isinstance(matrix, np.ndarray) or matrix.ndim != 2):
        raise refuse(path, key, type(matrix).__name__, "a matrix")
    if matrix.dtype.kind not in "iufb":
        what = "complex entries" if matrix.dtype.kind == "c" else f"entries of type {matrix.dtype}"
        raise refuse(path, key, what, "a real matrix")
    if scipy.sparse.issparse(matrix) and matrix.format == "csc":
        matrix = matrix.T
    if scipy.sparse.issparse(matrix) and matrix.format == "csr":
        check_parts(matrix, path, key)
    matrix = csr_matrix(matrix, dtype=np.float64)
    matrix.sum_duplicates()
    return matrix


def check_parts(matrix: csr_matrix, path: str, key: str) -> None:
    """Raise unless rows and columns are within the matrix: SciPy takes them as they are, and writes where they say."""
    try:
        matrix.check_format(full_check=True)
    except ValueError as error:
        raise refuse(path, key, str(error), "rows and columns that fit") from error
