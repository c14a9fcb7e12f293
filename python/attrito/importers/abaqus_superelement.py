"""Matrices of a substructure in the form of a linear user element: `*SUBSTRUCTURE MATRIX OUTPUT` of Abaqus, CalculiX.

    *USER ELEMENT, NODES=3, LINEAR
    ** ELEMENT NODES
    **  113, 38, -1
    1, 2, 3
    3, 1
    *MATRIX, TYPE=STIFFNESS

The nodes are in a comment. The first line after it has the dofs of the first node; a later line the place of a node in
the list and the dofs from there on. Values come by columns of the upper triangle, four a line; all of them where the
element is `UNSYMM`. A node may be listed once for each of its dofs. Dofs of nodes below 1 are generalised coordinates.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.importers.abaqus import dof_numbers
from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.entries import Entries
from attrito.importers.source import Source, no_such_matrix, refuse
from attrito.importers.text import Block, whole_text

# Values on a line; Abaqus and CalculiX write 4.
_VALUES = 16


def is_superelement(start: bytes) -> bool:
    """Whether the first keyword of a file is `*USER ELEMENT`."""
    for line in start.split(b"\n"):
        text = line.strip().upper()
        if not text.startswith(b"**") and text:
            return text.startswith(b"*USER ELEMENT")
    return False


def read_superelement(path: str | Path, key: str, numbers: DofNumbers, name: str | None = None) -> Source:
    """One matrix by the name of its type, or the only one in the file."""
    found = read_superelement_matrices(path, numbers)
    chosen = name.upper().replace(" ", "") if name else next(iter(found)) if len(found) == 1 else None
    if chosen not in found:
        raise no_such_matrix(str(path), key, name, ", ".join(found) or "none")
    return found[chosen]


def read_superelement_matrices(path: str | Path, numbers: DofNumbers) -> dict[str, Source]:
    """All matrices of a file by type: STIFFNESS, MASS and the like."""
    block = whole_text(path)
    keywords = [k for k in np.flatnonzero(block.initials() == ord("*")) if not block.line(k).startswith("**")]
    ends = [*keywords[1:], len(block)]
    found: dict[str, Source] = {}
    dofs = np.zeros(0, np.int32)
    one_triangle = True
    for line, end in zip(keywords, ends, strict=True):
        keyword, options = _keyword(block.line(line))
        if keyword == "USER ELEMENT":
            if len(dofs):
                raise block.fault(line, "the matrices of one substructure (not of elements: *ELEMENT MATRIX OUTPUT)")
            dofs = _dofs(block, line, end, options, numbers)
            one_triangle = "UNSYMM" not in options
        elif keyword == "MATRIX" and options.get("TYPE"):
            kind = options["TYPE"].replace(" ", "")
            if kind in found or not len(dofs):
                raise block.fault(line, "*USER ELEMENT, then each type of *MATRIX once")
            found[kind] = _matrix(block, line, end, dofs, one_triangle, numbers)
    if not found:
        raise refuse(str(path), "*MATRIX", "none", "matrices, such as *MATRIX, TYPE=STIFFNESS")
    return found


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    keyword, *words = line.upper().split(",")
    options = (word.partition("=") for word in words)
    return keyword.strip()[1:].strip(), {name.strip(): value.strip() for name, _, value in options}


def _dofs(block: Block, line: int, end: int, options: dict[str, str], numbers: DofNumbers) -> np.ndarray:
    """Provisional number of each row."""
    nodes: list[int] = []
    listing = False
    places: list[tuple[int, list[int]]] = []
    for k in range(line + 1, end):
        text = block.line(k).strip()
        words = [word for word in text.strip("* ,").replace(",", " ").split() if word]
        if text.startswith("**"):
            listing = listing or "ELEMENT NODES" in text.upper()
            if listing and words and all(_is_whole(word) for word in words):
                nodes += map(int, words)
        elif words:
            if not all(_is_whole(word) for word in words):
                raise block.fault(k, "the place of a node and its dofs")
            given = list(map(int, words))
            places.append((given[0], given[1:]) if places else (1, given))
    count = options.get("NODES", "")
    if count != str(len(nodes)) or not places:
        value = f"{len(nodes)} nodes under ** ELEMENT NODES"
        raise block.fault(line, f"as many as NODES says ({count or 'missing'}), and their dofs", value)
    changes = dict(places)
    if min(changes) < 1 or max(changes) > len(nodes):
        raise block.fault(line, f"places of nodes from 1 to {len(nodes)}", f"place {max(changes)}")
    rows, active = [], changes[1]
    for place, node in enumerate(nodes, start=1):
        active = changes.get(place, active)
        rows += [(node, dof) for dof in active]
    table = np.array(rows, np.int64).reshape(-1, 2)
    found = dof_numbers(block, np.full(len(table), line), table.astype(float), numbers)
    if len(np.unique(found)) < len(found) or len(found) == 0:
        raise block.fault(line, "every dof of the substructure once", f"{len(found)} dofs of {len(nodes)} nodes")
    return found


def _is_whole(word: str) -> bool:
    return word.lstrip("-").isdecimal()


def _matrix(block: Block, line: int, end: int, dofs: np.ndarray, one_triangle: bool, numbers: DofNumbers) -> Source:
    lines = np.array([k for k in range(line + 1, end) if not block.line(k).startswith("*")], int)
    name = _keyword(block.line(line))[1]["TYPE"]
    table = block.separated(lines, _VALUES, f"values of the matrix, at most {_VALUES} a line")
    values = table[~np.isnan(table)]
    size = len(dofs)
    wanted = size * (size + 1) // 2 if one_triangle else size * size
    if len(values) != wanted:
        expected = f"{wanted}, of the {'upper triangle' if one_triangle else 'whole matrix'} of {size} dofs"
        raise block.fault(line, expected, f"{len(values)} values")
    if one_triangle:
        column = np.repeat(np.arange(size), np.arange(1, size + 1))
        row = np.arange(wanted) - column * (column + 1) // 2
    else:
        column, row = np.divmod(np.arange(wanted), size)
    entries = Entries(block.path, name)
    entries.add(dofs[row], dofs[column], values)
    storage = "symmetric" if one_triangle else "full"
    return Source(block.path, name, entries=entries, storage=storage, numbers=numbers)
