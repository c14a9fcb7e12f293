"""Mesh and node components of an ANSYS archive (`CDWRITE,DB`, .cdb), blocked format.

`NBLOCK` (nodes in the global system, not rotated), `EBLOCK` with the solid key, `CMBLOCK` of nodes. Read are SOLID285,
185, 45 (4 or 8 nodes) and SOLID187, 92, 186, 95 (10 or 20 nodes), their tetrahedra with nodes that coincide, too.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from attrito.importers.mesh_data import Mesh, check_nodes, new_mesh
from attrito.importers.text import Block, whole_text

_BLOCKS = re.compile(rb"^NBLOCK,", re.IGNORECASE | re.MULTILINE)
_FORMAT = re.compile(r"\((\d+)i(\d+)(?:,\s*(\d+)e(\d+)\.\d+(?:e\d+)?)?\)", re.IGNORECASE)
# Corners of a tetrahedron, and its mid-side nodes, among the nodes of a brick that is folded to one.
_TETRAHEDRON = [0, 1, 2, 4]
_TETRAHEDRON_MIDDLES = [8, 9, 11, 16, 17, 18]
_HEAD = 11


def is_ansys_mesh(start: bytes) -> bool:
    """Whether a block of nodes occurs."""
    return _BLOCKS.search(start) is not None


def read_ansys_mesh(path: str | Path) -> Mesh:
    """Read the mesh; wedges, pyramids and elements that are no solids are left out, and listed in `Mesh.skipped`."""
    block = whole_text(path)
    initials = block.initials()
    keywords = [k for k in np.flatnonzero(np.isin(initials, list(b"NECnec"))) if "," in block.line(k)]
    mesh, elements = None, []
    sets: dict[str, int] = {}
    for line in keywords:
        words = [word.strip() for word in block.line(line).upper().split(",")]
        if words[0] == "NBLOCK":
            ids, points = _nodes(block, line)
            if mesh is not None:
                ids, points = np.append(mesh.node_ids, ids), np.concatenate([mesh.coordinates, points])
            mesh = new_mesh(block.path, ids, points)
        elif words[0] == "EBLOCK":
            if len(words) < 3 or words[2] != "SOLID":
                raise block.fault(line, "EBLOCK,19,SOLID: elements with the solid key")
            elements += _elements(block, line)
        elif words[0] == "CMBLOCK" and len(words) > 2 and words[2] in ("NODE", "NODES"):
            sets[words[1]] = line
    if mesh is None:
        raise block.fault(0, "an archive with NBLOCK")
    _sort_elements(mesh, elements)
    mesh.node_sets = {name: _component(block, line, mesh.node_ids) for name, line in sets.items()}
    mesh.files = [Path(path)]
    check_nodes(block.path, mesh)
    return mesh


def _section(block: Block, line: int, what: str) -> tuple[re.Match, np.ndarray]:
    """Format and lines of a block: all lines after the format that begin like numbers, but for the mark -1."""
    found = _FORMAT.search(block.line(line + 1)) if line + 1 < len(block) else None
    if found is None:
        raise block.fault(line, f"a line with the Fortran format of {what} after it")
    end = line + 2
    lengths = block.last - block.first
    while end < len(block) and lengths[end] > 0 and block.text[block.first[end]] in b" 0123456789":
        if block.line(end).strip() == "-1":
            break
        end += 1
    return found, np.arange(line + 2, end)


def _nodes(block: Block, line: int) -> tuple[np.ndarray, np.ndarray]:
    found, lines = _section(block, line, "nodes")
    if found[4] is None:
        raise block.fault(line + 1, "the format of nodes, such as (3i9,6e21.13e3)")
    count, width, reals, wide = (int(found[k]) for k in range(1, 5))
    places = [(0, width), *((count * width + k * wide, wide) for k in range(reals))]
    # Numbers left out at the end of a line are zeros.
    table = np.nan_to_num(block.columns(lines, places, "node, coordinates and rotations"))
    rotated = np.flatnonzero(np.any(table[:, 4:] != 0.0, axis=1))
    if len(rotated) > 0:
        raise block.fault(lines[rotated[0]], "nodes that are not rotated (NROTAT): dofs along global x, y, z")
    return table[:, 0].astype(np.int64), table[:, 1:4]


def _elements(block: Block, line: int) -> list[tuple[int, np.ndarray]]:
    """Element number and nodes of each element."""
    found, lines = _section(block, line, "elements")
    count, width = int(found[1]), int(found[2])
    if count < _HEAD + 1:
        raise block.fault(line + 1, "the format of elements, (19i9) or the like")
    table = block.columns(lines, [(k * width, width) for k in range(count)], "whole numbers")
    elements, k = [], 0
    while k < len(lines):
        number, nodes = (int(field) for field in np.nan_to_num(table[k, [10, 8]]))
        row = table[k, _HEAD : min(_HEAD + nodes, count)]
        k += 1
        while len(row) < nodes and k < len(lines):
            row = np.append(row, table[k, : nodes - len(row)])
            k += 1
        if nodes < 1 or len(row) < nodes or np.isnan(row).any():
            raise block.fault(lines[k - 1], "an element with as many nodes as it says")
        elements.append((number, row.astype(np.int64)))
    return elements


def _sort_elements(mesh: Mesh, elements: list[tuple[int, np.ndarray]]) -> None:
    found: dict[str, list[tuple[int, np.ndarray]]] = {}
    left_out = 0
    for number, nodes in elements:
        kind, nodes = _kind(nodes)
        if kind is None:
            left_out += 1
        else:
            found.setdefault(kind, []).append((number, nodes))
    for kind, rows in found.items():
        mesh.elements[kind] = (np.array([k for k, _ in rows], np.int64), np.array([nodes for _, nodes in rows]))
    if left_out:
        mesh.skipped.append(f"{left_out} elements that are no tetrahedra or bricks")


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
    found, lines = _section(block, line, "a component")
    count, width = int(found[1]), int(found[2])
    table = block.columns(lines, [(k * width, width) for k in range(count)], "whole numbers")
    numbers = table[~np.isnan(table)].astype(np.int64)
    if len(numbers) == 0 or numbers[0] < 0:
        raise block.fault(line, "a component with nodes")
    parts = [np.abs(numbers)]
    for k in np.flatnonzero(numbers < 0):
        parts.append(known[(known > numbers[k - 1]) & (known < -numbers[k])])
    return np.unique(np.concatenate(parts))
