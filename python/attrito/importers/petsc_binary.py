"""PETSc binary files with one sparse matrix, as `MatView` writes them.

Big-endian: class id, rows, columns, entries; then the length of each row, the columns, the values. The integers have
32 or 64 bits, whichever PETSc was built with.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from attrito.support.errors import Fault, InputError

MATRIX_CLASS = 1211216
HEADERS = (np.array([MATRIX_CLASS], ">i4").tobytes(), np.array([MATRIX_CLASS], ">i8").tobytes())


def read_petsc_binary(path: str | Path, key: str) -> csr_matrix:
    """A real AIJ matrix `[n, n]`."""
    data = Path(path).read_bytes()
    integer = np.dtype(">i4") if data.startswith(HEADERS[0]) else np.dtype(">i8")
    head = np.frombuffer(data, integer, min(4, len(data) // integer.itemsize))
    if len(head) < 4 or head[0] != MATRIX_CLASS or min(head[1:3]) < 0:
        raise InputError(Fault(str(path), key, head[:1], f"a PETSc matrix, which begins with {MATRIX_CLASS}"))
    rows, columns, entries = (int(number) for number in head[1:])
    if entries < 0:
        raise InputError(Fault(str(path), key, "a dense matrix", "a sparse (AIJ) matrix"))
    starts = [integer.itemsize * count for count in (4, 4 + rows, 4 + rows + entries)]
    size = starts[-1] + 8 * entries
    if len(data) == size + 8 * entries and entries > 0:
        raise InputError(Fault(str(path), key, "complex values", "a matrix written by a real build of PETSc"))
    if len(data) != size:
        raise InputError(Fault(str(path), key, f"{len(data)} bytes", f"{size} bytes for {entries} entries"))
    lengths = np.frombuffer(data, integer, rows, starts[0])
    indices = np.frombuffer(data, integer, entries, starts[1])
    values = np.frombuffer(data, ">f8", entries, starts[2])
    if lengths.sum() != entries or np.any(lengths < 0) or np.any((indices < 0) | (indices >= columns)):
        raise InputError(Fault(str(path), key, "rows or columns out of range", "row lengths and columns that fit"))
    offsets = np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)])
    matrix = csr_matrix((values.astype(np.float64), indices.astype(np.int64), offsets), shape=(rows, columns))
    matrix.sum_duplicates()
    return matrix
