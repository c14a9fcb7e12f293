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
    _require_sizes(path, key)
    try:
        matrix = scipy.io.mmread(path)
    except (ValueError, OverflowError, TypeError, IndexError) as error:
        raise InputError(Fault(str(path), key, str(error), "a Matrix Market file")) from error
    if np.iscomplexobj(matrix):
        raise InputError(Fault(str(path), key, "complex entries", "a real matrix"))
    return csr_matrix(matrix, dtype=np.float64)


def _require_sizes(path: str | Path, key: str) -> None:
    """Raise if the file ends before its line of sizes: scipy (1.10) would look for it forever."""
    with Path(path).open("rb") as file:
        if not any(line.strip() and not line.startswith(b"%") for line in file):
            raise InputError(Fault(str(path), key, "nothing after the header", "a Matrix Market file"))
