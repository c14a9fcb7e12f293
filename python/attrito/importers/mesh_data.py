"""What a mesh file holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from attrito.support.errors import Fault, InputError

# Ids from a first to a last: more are a typing error, and more than there is memory for.
LONGEST_RANGE = 10_000_000
# Eight times an id, and a direction, are a number of 64 bits.
DIGITS = 18


def is_id(word: str) -> bool:
    """Whether a word is a number that can be an id."""
    return word.isdecimal() and len(word.lstrip("0")) <= DIGITS


@dataclass
class Mesh:
    """A mesh.

    Parameters
    ----------
    node_ids, coordinates : `[N]`, `[N, 3]` (user length), in the order of the file
    elements : for each type its ids `[E]` and its connectivity `[E, k]` (node ids, CalculiX order)
    elastic : for each type Young's modulus (user force/length^2) and Poisson's ratio `[E, 2]`, NaN where not known
    density : for each type that of its elements `[E]` (user mass/length^3), NaN where not known
    point_mass : at nodes, user mass by id; None where the file does not tell it
    node_sets : for each name its node ids, ascending
    files : every file read, the deck first
    constraints : keywords, with their line, that make dofs depend on others
    held : `[k, 2]`, nodes and directions that supports hold
    angles, elongations : nodes whose dofs 1 to 3 are rotations, and nodes whose dof 1 is no displacement of a place
    skipped : elements that were not read, in words
    remarks : what else of the file has no effect, in words
    axes : of nodes that move along axes of their own their directions 1, 2, 3 as rows `[3, 3]`, by id
    load_axes : of nodes whose forces go along axes of their own, likewise
    """

    node_ids: np.ndarray
    coordinates: np.ndarray
    elements: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    elastic: dict[str, np.ndarray] = field(default_factory=dict)
    density: dict[str, np.ndarray] = field(default_factory=dict)
    point_mass: dict[int, float] | None = None
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    constraints: list[str] = field(default_factory=list)
    held: np.ndarray = field(default_factory=lambda: np.empty((0, 2), np.int64))
    angles: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    elongations: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    skipped: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    axes: dict[int, np.ndarray] = field(default_factory=dict)
    load_axes: dict[int, np.ndarray] = field(default_factory=dict)


def new_mesh(path: str, ids: np.ndarray, coordinates: np.ndarray) -> Mesh:
    """A mesh of nodes that differ, at finite coordinates, and no elements yet."""
    if len(ids) == 0:
        raise InputError(Fault(path, "nodes", "missing", "a mesh with nodes"))
    check_coordinates(path, ids, coordinates)
    unique, count = np.unique(ids, return_counts=True)
    if len(unique) < len(ids):
        raise InputError(Fault(path, "nodes", f"node {unique[count > 1][0]} twice", "every node id once"))
    return Mesh(ids, coordinates)


def check_coordinates(path: str, ids: np.ndarray, coordinates: np.ndarray) -> None:
    """Raise where a node is at no finite place."""
    bad = np.flatnonzero(~np.all(np.isfinite(coordinates), axis=1))
    if len(bad):
        more = f" and {len(bad) - 1} more nodes" if len(bad) > 1 else ""
        value = f"{coordinates[bad[0]].tolist()} at node {ids[bad[0]]}{more}"
        raise InputError(Fault(path, "coordinates", value, "finite numbers"))


def check_nodes(path: str, mesh: Mesh) -> None:
    """Raise where elements or sets name nodes that are not there."""
    named = [(f"elements {kind}", nodes) for kind, (_, nodes) in mesh.elements.items()]
    named += [(f"node set {name}", nodes) for name, nodes in mesh.node_sets.items()]
    for what, nodes in named:
        unknown = np.setdiff1d(nodes, mesh.node_ids)
        if len(unknown) > 0:
            raise InputError(Fault(path, what, f"node {unknown[0]}", "nodes that the file defines"))
