"""Matrices that CalculiX writes with `*FREQUENCY, SOLVER=MATRIXSTORAGE`.

`.sti` and `.mas` hold lines `row column value`, rows and columns from 1, the upper triangle, in one shared pattern;
most entries of the mass are zeros. `.dof` holds a line `node.direction` for each equation. Constrained dofs are absent.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.importers.entries import Entries
from attrito.importers.source import Source, refuse
from attrito.importers.text import read_text

LINE = "row, column and value"


def read_calculix(path: str | Path, key: str, size: int) -> Source:
    """One matrix of a `.sti` or `.mas` file.

    Parameters
    ----------
    path : the file
    key : what is read, for faults
    size : number of equations n, from the `.dof` file
    """
    path = str(path)
    entries, count = Entries(path, key), 0
    for block in read_text(path):
        found = block.entries(np.arange(len(block)), 3)
        if found is not None:
            row, column = found[0] - 1
            if column.max() < size and not np.any(row > column):
                entries.add(row, column, found[1])
                count += len(block)
                continue
        table, lines = block.records(np.arange(len(block)), 3, LINE)
        row, column = table[:, 0], table[:, 1]
        whole = (row == np.floor(row)) & (column == np.floor(column))
        good = whole & (row >= 1) & (row <= size) & (column >= 1) & (column <= size)
        if not good.all():
            expected = f"row and column from 1 to {size}, as in the .dof file"
            raise block.fault(lines[np.argmin(good)], expected, _place(table[np.argmin(good)]))
        lower = row > column
        if lower.any():
            raise block.fault(lines[np.argmax(lower)], "the upper triangle only", _place(table[np.argmax(lower)]))
        entries.add(row - 1, column - 1, table[:, 2])
        count += len(lines)
    if count == 0:
        raise refuse(path, key, "0 entries", f"lines of {LINE}")
    return Source(path, key, entries=entries, size=size, storage="symmetric")


def _place(record: np.ndarray) -> str:
    return f"row {record[0]:g}, column {record[1]:g}"
