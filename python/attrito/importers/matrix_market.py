"""Matrix Market files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io
from scipy.sparse import csr_matrix

from attrito.faults import Fault, InputError

HEADER = b"%%MatrixMarket"


def read_matrix_market(path: str | Path, key: str) -> csr_matrix:
    """A real matrix `[n, n]`, sparse or dense, general or symmetric storage."""
    try:
        matrix = scipy.io.mmread(path)
    except (ValueError, OverflowError, TypeError, IndexError) as error:
        raise InputError(Fault(str(path), key, str(error), "a Matrix Market file")) from error
    if np.iscomplexobj(matrix):
        raise InputError(Fault(str(path), key, "complex entries", "a real matrix"))
    return csr_matrix(matrix, dtype=np.float64)
