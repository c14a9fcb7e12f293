"""Mesh and node sets of Nastran's bulk data.

`GRID` in any coordinate system, `CTETRA` (4 or 10 grid points) and `CHEXA` (8 or 20); `SET1` n is the node set `set_n`.
Nastran counts the upright edges of a brick before those of its top, CalculiX after them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from attrito.importers.mesh_data import Mesh, check_nodes, is_id, new_mesh
from attrito.importers.nastran_cards import Card, read_cards, whole_numbers
from attrito.importers.nastran_systems import CARDS, Systems
from attrito.support.errors import InputError

# Grid points may all be in files that INCLUDE names.
_BULK = re.compile(rb"^(GRID[*, \t]|BEGIN\s+BULK|CEND\b|ENDDATA\b)", re.IGNORECASE | re.MULTILINE)
_KINDS = {("CTETRA", 4): "C3D4", ("CTETRA", 10): "C3D10", ("CHEXA", 8): "C3D8", ("CHEXA", 20): "C3D20"}
_ORDER = {"C3D20": [*range(12), *range(16, 20), *range(12, 16)]}


def is_nastran_mesh(start: bytes) -> bool:
    """Whether a card GRID occurs, or what comes before or after the bulk data."""
    return _BULK.search(start) is not None


def read_nastran_mesh(path: str | Path) -> Mesh:
    """Read the mesh; other elements are left out, and listed in `Mesh.skipped`."""
    path = Path(path)
    files = {path: None}
    placed: list[Card] = []
    elements: dict[str, list[tuple[int, list[int]]]] = {}
    sets: list[Card] = []
    skipped: dict[str, int] = {}
    for card in read_cards(path):
        files[Path(card.path)] = None
        if card.name == "GRID":
            _whole(card, card.fields[0])
            placed.append(card)
        elif card.name == "GRDSET" or card.name in CARDS:
            placed.append(card)
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
    ids, points, axes = _points(placed)
    mesh = new_mesh(str(path), ids, points)
    mesh.axes = axes
    for kind, found in elements.items():
        nodes = np.array([nodes for _, nodes in found], np.int64)
        mesh.elements[kind] = (np.array([k for k, _ in found], np.int64), nodes[:, _ORDER.get(kind, slice(None))])
    known = set(ids.tolist())
    for card in sets:
        name, nodes = f"set_{_whole(card, card.fields[0])}", np.array(whole_numbers(card, 1, known), np.int64)
        mesh.node_sets[name] = np.union1d(mesh.node_sets.get(name, nodes), nodes)
    mesh.skipped = [f"{count} elements {name}" for name, count in skipped.items()]
    mesh.files = list(files)
    check_nodes(str(path), mesh)
    return mesh


def read_axes(path: str | Path) -> dict[int, np.ndarray]:
    """Directions of the grid points in a file that move along axes of their own, as rows `[3, 3]`, by id."""
    cards = [card for card in read_cards(path) if card.name in ("GRID", "GRDSET", *CARDS)]
    return _points(cards)[2]


def _points(cards: list[Card]) -> tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]]:
    """Ids, coordinates `[N, 3]` and, where they are not global, directions of grid points."""
    systems = Systems(cards)
    grids = [card for card in cards if card.name == "GRID"]
    ids = np.array([_whole(card, card.fields[0]) for card in grids], np.int64)
    points = np.array([systems.place(card) for card in grids]).reshape(-1, 3)
    axes = {}
    for number, card, place in zip(ids.tolist(), grids, points, strict=True):
        if (found := systems.directions(card, place)) is not None:
            axes[number] = found
    return ids, points, axes


def _whole(card: Card, word: str) -> int:
    if not is_id(word):
        raise InputError(card.fault("whole numbers of at most 18 digits"))
    return int(word)
