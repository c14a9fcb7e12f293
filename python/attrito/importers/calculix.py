"""Matrices that CalculiX writes with `*FREQUENCY, SOLVER=MATRIXSTORAGE`.

`.sti` and `.mas` hold lines `row column value`, rows and columns from 1, the upper triangle, in one shared pattern;
`.dof` holds a line `node.direction` for each equation. Constrained dofs are absent.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from attrito.faults import Fault, InputError


def read_dofs(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Node id `[n]` and direction `[n]` (1, 2, 3) of each equation of a `.dof` file."""
    # As text: read as a number, node 12.1 would do, but 12345678901.1 would be rounded.
    words = _read_text(path).split()
    node, direction = np.empty(len(words), np.int64), np.empty(len(words), np.int8)
    for k, word in enumerate(words):
        left, _, right = word.partition(".")
        if not left.isdecimal() or right not in ("1", "2", "3"):
            raise InputError(Fault(str(path), f"line {k + 1}", word, "node.direction with direction 1, 2 or 3"))
        node[k], direction[k] = int(left), int(right)
    if len(words) == 0:
        raise InputError(Fault(str(path), "file", "empty", "a line node.direction for each equation"))
    if len(np.unique(4 * node + direction)) < len(words):
        raise InputError(Fault(str(path), "file", "a dof that occurs twice", "every dof once"))
    return node, direction


def read_matrix(path: str | Path, size: int) -> csr_matrix:
    """Both triangles `[n, n]` of a `.sti` or `.mas` file.

    Parameters
    ----------
    path : the file
    size : number of equations n, from the `.dof` file
    """
    table = _read_table(path)
    row, column = (table[:, k].astype(np.int32) - 1 for k in (0, 1))
    outside = np.flatnonzero((row < 0) | (row >= size) | (column < 0) | (column >= size))
    if len(outside) > 0:
        first = outside[0]
        value = f"row {row[first] + 1}, column {column[first] + 1}"
        raise InputError(Fault(str(path), f"line {first + 1}", value, f"numbers from 1 to {size}, as in the .dof file"))
    lower = np.flatnonzero(row > column)
    if len(lower) > 0:
        first = lower[0]
        value = f"row {row[first] + 1}, column {column[first] + 1}"
        raise InputError(Fault(str(path), f"line {first + 1}", value, "the upper triangle only"))
    # The pattern is that of the stiffness for both files: most entries of the mass are zeros.
    keep = table[:, 2] != 0.0
    row, column, value = row[keep], column[keep], table[keep, 2]
    del table
    above = row < column
    rows, columns = np.concatenate([row, column[above]]), np.concatenate([column, row[above]])
    return coo_matrix((np.concatenate([value, value[above]]), (rows, columns)), shape=(size, size)).tocsr()


def _read_table(path: str | Path) -> np.ndarray:
    """Numbers `[entries, 3]` of a file of lines of three."""
    try:
        with warnings.catch_warnings():
            # numpy only warns where the text stops being numbers.
            warnings.simplefilter("error", DeprecationWarning)
            numbers = np.fromfile(path, sep=" ")
    except OSError as error:
        raise _unreadable(path, error) from error
    except (DeprecationWarning, ValueError) as error:
        raise InputError(Fault(str(path), "file", str(error), "lines of row, column and value")) from error
    if len(numbers) == 0 or len(numbers) % 3 != 0:
        raise InputError(Fault(str(path), "file", f"{len(numbers)} numbers", "lines of row, column and value"))
    return numbers.reshape(-1, 3)


def _read_text(path: str | Path) -> str:
    try:
        return Path(path).read_text()
    except OSError as error:
        raise _unreadable(path, error) from error
    except UnicodeDecodeError as error:
        raise InputError(Fault(str(path), "file", "not text", "lines node.direction")) from error


def _unreadable(path: str | Path, error: OSError) -> InputError:
    return InputError(Fault(str(path), "file", error.strerror or str(error), "a file that can be read"))
