"""Matrices in Nastran's OUTPUT4 files, text or binary, by columns: dense, sparse, or sparse with 65536 rows and more.

A header `columns, rows, form, type, name` (text: and the format of numbers), then for each column that is not empty
`column, first row, words` and its numbers, then a column beyond the last. First row 0: the column is made of strings,
each with a head of its own: `65536 (L + 1) + row`, or `L + 1, row` where the header's number of rows is negative
("bigmat"); L words of 4 bytes follow. Types 1 and 2 are real, of 4 and 8 bytes; forms 4 and 5 triangular factors.

The file does not name dofs: rows are in the order of the set that was written (such as the a-set).
"""

from __future__ import annotations

from pathlib import Path

from attrito.importers.op4_binary import is_op4_binary, matrices_of_binary
from attrito.importers.op4_text import is_op4_text, matrices_of_text
from attrito.importers.source import Source, no_such_matrix


def is_op4(start: bytes) -> bool:
    """Whether a file begins like one of OUTPUT4."""
    return is_op4_binary(start) or is_op4_text(start)


def read_op4_matrices(
    path: str | Path, key: str, wanted: set[str] | None = None
) -> tuple[dict[str, Source], dict[str, str]]:
    """The matrices of a file by name (in capitals), and of all names in it why they are left out, "" if not."""
    with Path(path).open("rb") as file:
        binary = is_op4_binary(file.read(64))
    found: dict[str, Source] = {}
    names: dict[str, str] = {}
    for matrix in (matrices_of_binary if binary else matrices_of_text)(str(path), key, wanted):
        names[matrix.name] = matrix.left_out
        if matrix.entries is not None:
            found[matrix.name] = matrix.source()
    return found, names


def read_op4(path: str | Path, key: str, name: str | None = None) -> Source:
    """One matrix of a file, by its name or the only one in it."""
    found, names = read_op4_matrices(path, key, None if name is None else {name.upper()})
    if name is None and not found and len(names) == 1:
        # Asked for by its name it is refused.
        read_op4_matrices(path, key, set(names))
    if len(found) != 1:
        raise no_such_matrix(str(path), key, name, ", ".join(names) or "none")
    return next(iter(found.values()))
