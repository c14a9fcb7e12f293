"""A matrix of an OUTPUT4 file while its columns are read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.importers.entries import Entries
from attrito.importers.source import USABLE, Source, refuse

# The head of a string is this times one more than its words, plus its row.
STRING = 65536
# Forms of lower and upper triangular factors
_FACTORS = (4, 5)


@dataclass
class Op4Matrix:
    """Header of a matrix, and its entries as far as they were read; None where it is not wanted.

    `left_out`: what it is, in words, where nobody asked for it by name and it cannot be used.
    """

    path: str
    name: str
    columns: int
    kind: int
    bigmat: bool
    entries: Entries | None = None
    left_out: str = ""

    def add(self, column: np.ndarray, row: np.ndarray, count: np.ndarray, values: np.ndarray) -> None:
        """Add runs of `count` values down a column, from a row; columns and rows from 1."""
        bad = (column < 1) | (column > self.columns) | (row < 1) | (row + count - 1 > self.columns)
        if bad.any():
            k = int(np.argmax(bad))
            value = f"column {column[k]}, rows {row[k]} to {row[k] + count[k] - 1}"
            raise refuse(self.path, self.name, value, f"columns and rows from 1 to {self.columns}")
        if self.entries is not None:
            within = np.arange(len(values)) - np.repeat(np.cumsum(count) - count, count)
            self.entries.add(np.repeat(row - 1, count) + within, np.repeat(column - 1, count), values)

    def source(self) -> Source:
        """The matrix; form 6, symmetric, is written with both triangles, but some programs write one."""
        return Source(self.path, self.name, entries=self.entries, size=self.columns, storage="either")


def new_matrix(path: str, name: str, header: list[int], wanted: set[str] | None) -> Op4Matrix:
    """A matrix from the numbers of its header: columns, rows, form, type."""
    name = name.strip().upper()
    columns, rows, form, kind = header
    what = ""
    if columns > 0:
        what = "rectangular" if columns != abs(rows) else "complex" if kind in (3, 4) else ""
        what = "triangular factor" if not what and form in _FACTORS else what
    left_out = what if wanted is None else ""
    use = (wanted is None and not left_out) or (wanted is not None and name in wanted)
    if use and (columns != abs(rows) or columns < 1):
        raise refuse(path, name, f"{abs(rows)} x {columns}", "a square matrix")
    if use and what:
        raise refuse(path, name, f"type {kind}" if what == "complex" else what, USABLE[what])
    if use and kind not in (1, 2):
        raise refuse(path, name, f"type {kind}", "type 1 or 2, a real matrix")
    return Op4Matrix(path, name, columns, kind, rows < 0, Entries(path, name) if use else None, left_out)
