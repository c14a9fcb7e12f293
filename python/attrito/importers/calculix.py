"""Matrices that CalculiX writes with `*FREQUENCY, SOLVER=MATRIXSTORAGE`.

`.sti` and `.mas` hold lines `row column value`, rows and columns from 1, the upper triangle, in one shared pattern;
most entries of the mass are zeros. `.dof` holds a line `node.direction` for each equation. Constrained dofs are absent.

No file says how many lines it has, so that lines lost of one show only in what both share: the diagonal of every
equation, and as many entries in each row and each column.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.importers.entries import Entries
from attrito.importers.source import Source, refuse
from attrito.importers.text import Block, read_text

ENDINGS = {"stiffness": "sti", "mass": "mas"}
LINE = "row, column and value"


def read_calculix(job: str | Path, size: int) -> dict[str, Source]:
    """Stiffness and mass of a job.

    Parameters
    ----------
    job : its files without their ending
    size : number of equations n, from the `.dof` file
    """
    read: dict[str, Source] = {}
    before: np.ndarray | None = None
    for key, ending in ENDINGS.items():
        path = f"{job}.{ending}"
        read[key], counts = _read(path, key, size)
        if before is not None and (differs := (counts != before).any(axis=0)).any():
            value = f"{counts[0].sum()} entries, others in row or column {np.argmax(differs) + 1}"
            expected = f"those of {read['stiffness'].path}, {before[0].sum()}: lines of one are lost"
            raise refuse(path, key, value, expected)
        before = counts
    return read


def _read(path: str, key: str, size: int) -> tuple[Source, np.ndarray]:
    """One matrix, and how many entries of its file, zeros too, are in each row and each column, `[2, n]`."""
    entries = Entries(path, key)
    counts, diagonal = np.zeros((2, size), np.int64), np.zeros(size, bool)
    for block in read_text(path):
        found = block.entries(np.arange(len(block)), 3)
        if found is not None and found[0][1].max() <= size and not np.any(found[0][0] > found[0][1]):
            (row, column), value = found[0] - 1, found[1]
        else:
            row, column, value = _checked(block, size)
        entries.add(row, column, value)
        counts += [np.bincount(row, minlength=size), np.bincount(column, minlength=size)]
        diagonal[row[row == column]] = True
    if not counts.any():
        raise refuse(path, key, "0 entries", f"lines of {LINE}")
    if not diagonal.all():
        value = f"no diagonal of row {np.argmin(diagonal) + 1} ({np.count_nonzero(~diagonal)} such rows)"
        raise refuse(path, key, value, f"one of each of the {size} equations of the .dof file: lines are lost")
    return Source(path, key, entries=entries, size=size, storage="symmetric"), counts


def _checked(block: Block, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns, from 0, and values of lines that are not all as expected, or the fault of the first."""
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
    return row.astype(np.int64) - 1, column.astype(np.int64) - 1, table[:, 2]


def _place(record: np.ndarray) -> str:
    return f"row {record[0]:g}, column {record[1]:g}"
