"""Mesh and node components of an ANSYS archive (`CDWRITE,DB`, .cdb), blocked format.

`NBLOCK` (nodes in the global system, not rotated), `EBLOCK` with the solid key, `CMBLOCK` of nodes, `ET` and `ETBLOCK`
for what the elements are; Workbench's input files (`ds.dat`) hold the same blocks. Read are solids with 4, 8, 10 or 20
nodes, such as SOLID285, 185, 187 and 186, and bricks that are folded to tetrahedra. A solid that lacks mid-side nodes
(written as 0) is kept by its corners.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from itertools import accumulate, takewhile
from pathlib import Path

import numpy as np

from attrito.importers.mesh_data import Mesh, check_nodes, new_mesh
from attrito.importers.text import Block, whole_text

_BLOCKS = re.compile(rb"^NBLOCK,", re.IGNORECASE | re.MULTILINE)
_FORMAT = re.compile(r"\(((?:,?\s*\d+i\d+)+)(?:,\s*(\d+)e(\d+)\.\d+(?:e\d+)?)?\)", re.IGNORECASE)
# Elements whose nodes are those of a tetrahedron or a brick: structural, thermal and coupled solids
_SOLIDS = {5, 45, 46, 62, 64, 65, 69, 70, 72, 73, 87, 90, 92, 95, 98, 147, 148, 164, 168, 185, 186, 187, 190, 191, 226,
           227, 278, 279, 285, 291}  # fmt: skip
# MESH200 is whatever its options say: sure where it has as many nodes as nothing flat has
_MESH, _SOLID_NODES = 200, (10, 20)
# Corners of a tetrahedron, and its mid-side nodes, among the nodes of a brick that is folded to one.
_TETRAHEDRON = [0, 1, 2, 4]
_TETRAHEDRON_MIDDLES = [8, 9, 11, 16, 17, 18]
_HEAD = 11
# Elements with mid-side nodes, as they are by their corners
_CORNERS = {"C3D10": ("C3D4", 4), "C3D20": ("C3D8", 8)}
# A format says how often a field occurs: no line has more
_MOST_FIELDS = 100


@dataclass(frozen=True)
class _Format:
    """Widths of the whole numbers of a line, how many real ones follow, and their width."""

    widths: list[int]
    reals: int
    wide: int

    @property
    def integers(self) -> list[tuple[int, int]]:
        """Where the whole numbers are: first character and width."""
        return [(begin - width, width) for begin, width in zip(accumulate(self.widths), self.widths, strict=True)]

    @property
    def numbers(self) -> list[tuple[int, int]]:
        """Where the real ones are."""
        begin = sum(self.widths)
        return [(begin + k * self.wide, self.wide) for k in range(self.reals)]


def is_ansys_mesh(start: bytes) -> bool:
    """Whether a block of nodes occurs."""
    return _BLOCKS.search(start) is not None


def read_ansys_mesh(path: str | Path) -> Mesh:
    """Read the mesh; wedges, pyramids and elements that are no solids are left out, and listed in `Mesh.skipped`."""
    block = whole_text(path)
    initials = block.initials()
    keywords = [k for k in np.flatnonzero(np.isin(initials, list(b"NECnec"))) if "," in block.line(k)]
    mesh, elements, surfaces = None, [], 0
    types: dict[int, int] = {}
    sets: dict[str, int] = {}
    axes: dict[int, np.ndarray] = {}
    for line in keywords:
        words = [word.strip() for word in block.line(line).upper().split(",")]
        if words[0] == "NBLOCK":
            ids, points, turned = _nodes(block, line)
            _check_count(block, line, words[4:], len(ids), "nodes")
            axes |= turned
            if mesh is not None:
                ids, points = np.append(mesh.node_ids, ids), np.concatenate([mesh.coordinates, points])
            mesh = new_mesh(block.path, ids, points)
        elif words[0] in ("ET", "ETBLOCK"):
            types |= _types(block, line, words)
        elif words[0] == "EBLOCK" and len(words) > 2 and words[2] == "SOLID":
            found = _elements(block, line)
            _check_count(block, line, words[4:], len(found), "elements")
            elements += [(number, types.get(kind), nodes) for number, kind, nodes in found]
        elif words[0] == "EBLOCK" and "COMPACT" in words:
            raise block.fault(line, "elements in blocks of the SOLID key, as CDWRITE makes them (not COMPACT)")
        elif words[0] == "EBLOCK":
            # Loads and contact on surfaces, by lines of another kind.
            surfaces += len(_section(block, line, "elements")[1])
        elif words[0] == "CMBLOCK" and len(words) > 2 and words[2] in ("NODE", "NODES"):
            sets[words[1]] = line
    if mesh is None:
        raise block.fault(0, "an archive with NBLOCK")
    _sort_elements(mesh, elements)
    if surfaces:
        mesh.skipped.append(f"elements on surfaces ({surfaces} lines in blocks without the solid key)")
    mesh.node_sets = {name: _component(block, line, mesh.node_ids) for name, line in sets.items()}
    mesh.files, mesh.axes = [Path(path)], axes
    check_nodes(block.path, mesh)
    return mesh


def _check_count(block: Block, line: int, words: list[str], count: int, what: str) -> None:
    """Raise where a block ends before, or behind, the number that it declares in the first of some words."""
    declared = words[0].split("!")[0].strip() if words else ""
    if declared.isdecimal() and declared.lstrip("0") not in ("", str(count)):
        raise block.fault(line, f"{declared} {what}, as it declares, not {count}: the file is cut off or damaged")


def _types(block: Block, line: int, words: list[str]) -> dict[int, int]:
    """Which element the types are that one line, or a block, declares."""
    rows = [words[1:3]]
    if words[0] == "ETBLOCK":
        # Numbers, then texts; the block ends with -1.
        rest = (block.line(k).split() for k in range(line + 2, len(block)))
        rows = [words[:2] for words in takewhile(lambda words: bool(words) and words[0].isdecimal(), rest)]
    # `ET,cid,174`: a parameter's value, for elements on surfaces.
    return {int(row[0]): int(row[1]) for row in rows if len(row) == 2 and all(word.isdecimal() for word in row)}


def _section(block: Block, line: int, what: str) -> tuple[_Format, np.ndarray]:
    """Format and lines of a block: all lines after the format that begin like numbers, but for the mark -1."""
    found = _FORMAT.search(block.line(line + 1)) if line + 1 < len(block) else None
    if found is None or re.search(r"[ie]0+\b", found[0].lower()):
        raise block.fault(line, f"a line with the Fortran format of {what} after it")
    groups = re.findall(r"(\d+)i(\d+)", found[1].lower())
    widths = [int(width) for count, width in groups for _ in range(min(int(count), _MOST_FIELDS))]
    form = _Format(widths, min(int(found[2] or 0), _MOST_FIELDS), int(found[3] or 0))
    end = line + 2
    lengths = block.last - block.first
    while end < len(block) and lengths[end] > 0 and block.text[block.first[end]] in b" 0123456789":
        if block.line(end).strip() == "-1":
            break
        end += 1
    return form, np.arange(line + 2, end)


def _nodes(block: Block, line: int) -> tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]]:
    """Ids, coordinates, and the directions 1, 2, 3 of nodes that are rotated (NROTAT)."""
    from scipy.spatial.transform import Rotation

    form, lines = _section(block, line, "nodes")
    if form.reals < 3:
        raise block.fault(line + 1, "the format of nodes, such as (3i9,6e21.13e3)")
    places = [form.integers[0], *form.numbers]
    # Numbers left out at the end of a line are zeros.
    table = np.nan_to_num(block.columns(lines, places, "node, coordinates and rotations"))
    rotated = table[np.any(table[:, 4:7] != 0.0, axis=1)]
    # About z by THXY, then about the new x by THYZ, then about the newest y by THZX, in degrees.
    about = Rotation.from_euler("ZXY", rotated[:, 4:7], degrees=True).as_matrix() if len(rotated) else rotated
    axes = {int(row[0]): turned.T for row, turned in zip(rotated, about, strict=True)}
    return table[:, 0].astype(np.int64), table[:, 1:4], axes


def _elements(block: Block, line: int) -> list[tuple[int, int, np.ndarray]]:
    """Number, type and nodes of each element."""
    form, lines = _section(block, line, "elements")
    count = len(form.widths)
    if count < _HEAD + 1:
        raise block.fault(line + 1, "the format of elements, (19i9) or the like")
    table = block.columns(lines, form.integers, "whole numbers")
    elements, k = [], 0
    while k < len(lines):
        number, nodes, kind = (int(field) for field in np.nan_to_num(table[k, [10, 8, 1]]))
        row = table[k, _HEAD : min(_HEAD + nodes, count)]
        k += 1
        while len(row) < nodes and k < len(lines):
            row = np.append(row, table[k, : nodes - len(row)])
            k += 1
        if nodes < 1 or len(row) < nodes or np.isnan(row).any():
            raise block.fault(lines[k - 1], "an element with as many nodes as it says")
        elements.append((number, kind, row.astype(np.int64)))
    return elements


def _sort_elements(mesh: Mesh, elements: list[tuple[int, int | None, np.ndarray]]) -> None:
    """Put elements into the mesh: number, which element it is (None: not said), nodes."""
    found: dict[str, list[tuple[int, np.ndarray]]] = {}
    left_out = straightened = 0
    others: Counter[int] = Counter()
    for number, element, nodes in elements:
        if element is not None and element not in _SOLIDS and (element != _MESH or len(nodes) not in _SOLID_NODES):
            others[element] += 1
            continue
        kind, nodes = _kind(nodes)
        if kind is None:
            left_out += 1
            continue
        if kind in _CORNERS and not nodes.all():
            kind, nodes = _CORNERS[kind][0], nodes[: _CORNERS[kind][1]]
            straightened += 1
        found.setdefault(kind, []).append((number, nodes))
    for kind, rows in found.items():
        mesh.elements[kind] = (np.array([k for k, _ in rows], np.int64), np.array([nodes for _, nodes in rows]))
    if left_out:
        mesh.skipped.append(f"{left_out} elements that are no tetrahedra or bricks")
    mesh.skipped += [f"{count} elements {element}, which are no solids" for element, count in sorted(others.items())]
    if straightened:
        mesh.skipped.append(f"mid-side nodes of {straightened} elements that lack some of theirs")


def _kind(nodes: np.ndarray) -> tuple[str | None, np.ndarray]:
    """Which element the nodes make."""
    corners = nodes[:8]
    if len(nodes) in (4, 10):
        return ("C3D4" if len(nodes) == 4 else "C3D10"), nodes
    if len(nodes) not in (8, 20):
        return None, nodes
    if len(np.unique(corners)) == 8:
        return ("C3D8" if len(nodes) == 8 else "C3D20"), nodes
    folded = corners[2] == corners[3] and np.all(corners[5:] == corners[4]) and len(np.unique(corners)) == 4
    if not folded:
        return None, nodes
    return ("C3D4", nodes[_TETRAHEDRON]) if len(nodes) == 8 else ("C3D10", nodes[_TETRAHEDRON + _TETRAHEDRON_MIDDLES])


def _component(block: Block, line: int, known: np.ndarray) -> np.ndarray:
    """Node ids; a number below zero stands for all that there are up to it, from the one before."""
    form, lines = _section(block, line, "a component")
    table = block.columns(lines, form.integers, "whole numbers")
    numbers = table[~np.isnan(table)].astype(np.int64)
    _check_count(block, line, block.line(line).split(",")[3:], len(numbers), "numbers")
    if len(numbers) == 0 or numbers[0] < 0:
        raise block.fault(line, "a component with nodes")
    parts = [np.abs(numbers)]
    for k in np.flatnonzero(numbers < 0):
        parts.append(known[(known > numbers[k - 1]) & (known < -numbers[k])])
    return np.unique(np.concatenate(parts))
