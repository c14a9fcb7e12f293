"""Matrices written into the job file as nested lists."""

from __future__ import annotations

from numbers import Real

import numpy as np
from scipy.sparse import csr_matrix

from attrito.support.errors import Fault, InputError


def read_inline(rows: list[list[float]], key: str, file: str) -> csr_matrix:
    """A matrix `[n, n]` from its rows.

    Parameters
    ----------
    rows : n lists of n numbers
    key : its path in the job file
    file : the job file
    """
    is_table = bool(rows) and all(isinstance(row, list) and len(row) == len(rows[0]) > 0 for row in rows)
    if not is_table or not all(isinstance(x, Real) and not isinstance(x, bool) for row in rows for x in row):
        raise InputError(Fault(file, key, rows, "rows of numbers, all of one length"))
    try:
        return csr_matrix(np.array(rows, dtype=np.float64))
    except OverflowError:
        raise InputError(Fault(file, key, rows, "numbers that floating point can hold")) from None
