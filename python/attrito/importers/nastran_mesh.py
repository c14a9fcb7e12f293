"""Mesh and node sets of Nastran's bulk data.

`GRID` in the basic coordinate system, `CTETRA` (4 or 10 grid points) and `CHEXA` (8 or 20); `SET1` n is the node set
`set_n`. Nastran counts the upright edges of a brick before those of its top, CalculiX after them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from attrito.importers.mesh_data import Mesh, check_nodes, new_mesh
from attrito.importers.nastran_cards import Card, read_cards, whole_numbers
from attrito.support.errors import InputError

# Grid points may all be in files that INCLUDE names.
_BULK = re.compile(rb"^(GRID[*, \t]|BEGIN\s+BULK|CEND\b|ENDDATA\b)", re.IGNORECASE | re.MULTILINE)
_KINDS = {("CTETRA", 4): "C3D4", ("CTETRA", 10): "C3D10", ("CHEXA", 8): "C3D8", ("CHEXA", 20): "C3D20"}
_ORDER = {"C3D20": [*range(12), *range(16, 20), *range(12, 16)]}
_REAL = re.compile(r"([-+]?\d*\.?\d*)[EeDd]?([-+]?\d*)")


def is_nastran_mesh(start: bytes) -> bool:
    """Whether a card GRID occurs, or what comes before or after the bulk data."""
    return _BULK.search(start) is not None


def read_nastran_mesh(path: str | Path) -> Mesh:
    """Read the mesh; other elements are left out, and listed in `Mesh.skipped`."""
    path = Path(path)
    ids, points, files = [], [], {path: None}
    elements: dict[str, list[tuple[int, list[int]]]] = {}
    sets: list[Card] = []
    skipped: dict[str, int] = {}
    for card in read_cards(path):
        files[Path(card.path)] = None
        if card.name == "GRID":
            ids.append(_whole(card, card.fields[0]))
            points.append(_point(card))
        elif card.name == "SET1":
            sets.append(card)
        elif card.name in ("CTETRA", "CHEXA"):
            nodes = [_whole(card, word) for word in card.fields[2:] if word]
            if (card.name, len(nodes)) not in _KINDS:
                raise InputError(card.fault("4 or 10 grid points of a CTETRA, 8 or 20 of a CHEXA"))
            kind = _KINDS[card.name, len(nodes)]
            elements.setdefault(kind, []).append((_whole(card, card.fields[0]), nodes))
        elif re.fullmatch(r"C[A-Z]+\d*R?", card.name) and not card.name.startswith(("CORD", "CEND")):
            skipped[card.name] = skipped.get(card.name, 0) + 1
    mesh = new_mesh(str(path), np.array(ids, np.int64), np.array(points, float).reshape(-1, 3))
    for kind, found in elements.items():
        nodes = np.array([nodes for _, nodes in found], np.int64)
        mesh.elements[kind] = (np.array([k for k, _ in found], np.int64), nodes[:, _ORDER.get(kind, slice(None))])
    known = set(ids)
    for card in sets:
        name, nodes = f"set_{_whole(card, card.fields[0])}", np.array(whole_numbers(card, 1, known), np.int64)
        mesh.node_sets[name] = np.union1d(mesh.node_sets.get(name, nodes), nodes)
    mesh.skipped = [f"{count} elements {name}" for name, count in skipped.items()]
    mesh.files = list(files)
    check_nodes(str(path), mesh)
    return mesh


def _point(card: Card) -> list[float]:
    """Coordinates; fields are id, system of the position, x, y, z, system of the displacement."""
    fields = [*card.fields, *[""] * 6][:6]
    if fields[1] not in ("", "0") or fields[5] not in ("", "0"):
        raise InputError(card.fault("position and displacements in the basic coordinate system (CP and CD blank or 0)"))
    return [_real(card, word) for word in fields[2:5]]


def _real(card: Card, word: str) -> float:
    """A real number, whose exponent may lack its letter; a blank is zero."""
    found = _REAL.fullmatch(word)
    try:
        return float(f"{found[1] or 0}e{found[2] or 0}")
    except (TypeError, ValueError):
        raise InputError(card.fault("real coordinates")) from None


def _whole(card: Card, word: str) -> int:
    if not word.isdecimal():
        raise InputError(card.fault("whole numbers"))
    return int(word)
