"""Matrices of Abaqus's `*MATRIX GENERATE` and `*MATRIX OUTPUT`: job_STIF1.mtx, job_MASS1.mtx, job_DMPV1.mtx.

`FORMAT=MATRIX INPUT` (the default) and `FORMAT=LABELS`: lines `row node, dof, column node, dof, value`.
`FORMAT=COORDINATE`: lines `row, column, value`, numbers from 1, without names. A symmetric matrix may be stored as one
triangle or as both. Nodes below zero are those that Abaqus made itself (internal nodes of elements and connectors,
Lagrange multipliers): their dofs are generalised coordinates, -(10 n + dof) of the node -n. So are dofs 1 of nodes
that a comment `** GENERALISED COORDINATES: NODES 2001 TO 2020` names, as attrito exports them. The diagonal of a held
dof is 1e36; the importer takes those dofs out.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from attrito.importers.dof_numbers import DIRECTIONS, DofNumbers
from attrito.importers.entries import Entries
from attrito.importers.source import Source, integers, refuse
from attrito.importers.text import Block, read_text

NAMED = "row node, dof, column node, dof, value"
PLAIN = "row, column, value"
NODES = "node ids, but for 0"
INTERNAL_ROWS = "row and column from 1 (those below are Abaqus's own: write FORMAT=MATRIX INPUT, which names dofs)"
LARGEST = 2**31 - 1
# Dofs of an internal node
_MOST_INTERNAL = 9
COMMENT = ord("*")
_GENERALISED = re.compile(r"\*\*GENERALISEDCOORDINATES:NODES(\d+)TO(\d+)")
# The value has a point or an exponent: three whole numbers are the sizes of a Matrix Market file without its header.
_ENTRY = re.compile(rb"(-?\d+[\s,]+){2}((-?\d+[\s,]+){2})?(?=[-+\d]*[.ED])[-+.\dED]+[\s,]*")


def is_abaqus(start: bytes) -> bool:
    """Whether a file begins with lines of three or five numbers, or a comment or keyword of Abaqus before them."""
    for line in start.split(b"\n"):
        text = line.strip().upper()
        if text.startswith(b"*") and not text.startswith(b"**"):
            return text.startswith((b"*MATRIX", b"*USER ELEMENT"))
        if text and not text.startswith(b"*"):
            return _ENTRY.fullmatch(text) is not None
    return False


def read_abaqus(path: str | Path, key: str, numbers: DofNumbers) -> Source:
    """One matrix; `numbers` gives the dofs theirs in the formats that name nodes."""
    path = str(path)
    entries = Entries(path, key)
    columns, size = None, 0
    generalised: list[tuple[int, int]] = []
    for block in read_text(path):
        lines = _data_lines(block, generalised)
        if len(lines) == 0:
            continue
        if columns is None:
            columns = len(block.line(lines[0]).replace(",", " ").split())
        if columns not in (3, 5):
            raise block.fault(lines[0], f"lines {NAMED}, or {PLAIN}")
        found = block.entries(lines, columns)
        if found is not None and (columns == 3 or found[0][1::2].max() <= DIRECTIONS):
            whole, value = found
            if columns == 5:
                row, column = (numbers.numbers(*_placed(*whole[k : k + 2], generalised)) for k in (0, 2))
            else:
                row, column = whole - 1
            size = max(size, int(row.max()) + 1, int(column.max()) + 1)
            entries.add(row, column, value)
            continue
        expected = f"numbers {NAMED if columns == 5 else PLAIN}"
        table, lines = block.records(lines, columns, expected)
        if len(lines) == 0:
            continue
        if columns == 5:
            names = (table[:, k : k + 2] for k in (0, 2))
            row, column = (dof_numbers(block, lines, name, numbers, generalised) for name in names)
        else:
            row, column = (integers(block, lines, table[:, k], (1, LARGEST), INTERNAL_ROWS) - 1 for k in (0, 1))
            size = max(size, int(row.max()) + 1, int(column.max()) + 1)
        entries.add(row, column, table[:, -1])
    if columns is None:
        raise refuse(path, key, "no entries", f"lines {NAMED}, or {PLAIN}")
    if columns == 3:
        return Source(path, key, entries=entries, size=size, storage="either", open_size=True)
    return Source(path, key, entries=entries, storage="either", numbers=numbers)


def _data_lines(block: Block, generalised: list[tuple[int, int]]) -> np.ndarray:
    """Lines of numbers; ranges of nodes that comments name are added to `generalised`."""
    initials = block.initials()
    for index in np.flatnonzero(initials == COMMENT):
        line = "".join(block.line(index).upper().split())
        # *ELEMENT MATRIX OUTPUT writes files of this kind, too.
        if not line.startswith(("**", "*MATRIXINPUT", "*MATRIXASSEMBLE")):
            raise block.fault(index, "a global matrix, of *MATRIX OUTPUT")
        if found := _GENERALISED.match(line):
            generalised.append((int(found[1]), int(found[2])))
    return np.flatnonzero((initials != COMMENT) & (initials != ord("\n")))


def _placed(node: np.ndarray, dof: np.ndarray, generalised: Sequence[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and directions; dof 1 of nodes in ranges is a generalised coordinate."""
    for first, last in generalised:
        dof = np.where((dof == 1) & (node >= first) & (node <= last), 0, dof)
    return node, dof


def dof_numbers(
    block: Block,
    lines: np.ndarray,
    names: np.ndarray,
    numbers: DofNumbers,
    generalised: Sequence[tuple[int, int]] = (),
) -> np.ndarray:
    """Number of each dof of a table `[n, 2]` of nodes and dofs; faults quote one of `lines`, `[n]`."""
    node = integers(block, lines, names[:, 0], (-LARGEST // 16, 2**53), NODES)
    if not node.all():
        raise block.fault(lines[np.argmin(node != 0)], NODES)
    expected = "dofs 1 to 6: displacements and rotations (8 is a pressure, 11 a temperature)"
    inside = node < 0
    dof = integers(block, lines, names[:, 1], (1, _MOST_INTERNAL if inside.all() else DIRECTIONS), expected)
    return numbers.numbers(*_placed(np.where(inside, 10 * node - dof, node), np.where(inside, 0, dof), generalised))
