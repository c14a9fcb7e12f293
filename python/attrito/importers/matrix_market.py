"""Matrix Market files: real or integer, sparse or dense, both triangles or the lower one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.entries import Entries
from attrito.importers.source import Source, integers, refuse
from attrito.importers.text import read_text

HEADER = b"%%MatrixMarket"
ENTRY = "row, column and value, finite numbers"


def read_matrix_market(path: str | Path, key: str) -> Source:
    """One matrix; entries that occur again are summed, as the format's own programs do."""
    import scipy.io

    path = str(path)
    layout, field, symmetry = _header(path, key)
    if layout == "array":
        try:
            return Source(path, key, matrix=csr_matrix(scipy.io.mmread(path), dtype=np.float64))
        except (ValueError, OverflowError, TypeError, IndexError) as error:
            raise refuse(path, key, str(error), "a Matrix Market file") from error
    sizes, entries, count = None, Entries(path, key), 0
    for block in read_text(path, counted=True):
        lines = np.flatnonzero(block.initials() != ord("%"))
        while sizes is None and len(lines) > 0:
            if not block.line(lines[0]).strip():
                lines = lines[1:]
                continue
            words = block.line(lines[0]).split()
            if len(words) != 3 or not all(word.isdecimal() for word in words):
                raise block.fault(lines[0], "a Matrix Market file: rows, columns and entries")
            sizes, lines = [int(word) for word in words], lines[1:]
        if len(lines) == 0:
            continue
        found = block.entries(lines, 3)
        if found is not None:
            (row, column), value = found[0] - 1, found[1]
            if (
                row.max() < sizes[0]
                and column.max() < sizes[1]
                and not (symmetry == "symmetric" and np.any(row < column))
            ):
                entries.add(row, column, value)
                count += len(lines)
                continue
        table, lines = block.records(lines, 3, ENTRY)
        expected = f"a row from 1 to {sizes[0]} and a column from 1 to {sizes[1]}"
        row, column = (integers(block, lines, table[:, k], (1, sizes[k]), expected) - 1 for k in (0, 1))
        if symmetry == "symmetric" and np.any(row < column):
            raise block.fault(lines[np.argmax(row < column)], "the lower triangle only, as the header says: symmetric")
        entries.add(row, column, table[:, 2])
        count += len(lines)
    if sizes is None:
        raise refuse(path, key, "nothing after the header", "a Matrix Market file")
    if count != sizes[2]:
        raise refuse(path, key, f"{count} entries", f"a Matrix Market file of {sizes[2]} entries, as its header says")
    if sizes[0] != sizes[1]:
        raise refuse(path, key, f"{sizes[0]} x {sizes[1]}", "a square matrix")
    storage = "symmetric" if symmetry == "symmetric" else "full"
    return Source(path, key, entries=entries, size=sizes[0], storage=storage, repeated="sum")


def _header(path: str, key: str) -> tuple[str, str, str]:
    with Path(path).open("rb") as file:
        words = file.readline(200).decode(errors="replace").lower().split()
    if len(words) != 5 or words[1] != "matrix" or words[2] not in ("coordinate", "array"):
        raise refuse(path, "line 1", " ".join(words), "%%MatrixMarket matrix coordinate real symmetric, or the like")
    if words[3] == "complex":
        raise refuse(path, key, "complex entries", "a real matrix")
    if words[3] not in ("real", "double", "integer") or words[4] not in ("general", "symmetric"):
        raise refuse(path, "line 1", " ".join(words[3:]), "real or integer entries, general or symmetric")
    return words[2], words[3], words[4]
