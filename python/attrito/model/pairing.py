"""Node-to-node contact pairs of two node sets: who meets whom, in which frame, with how much area.

The surface of set a is made of the element faces whose nodes all lie in a and which belong to one element only.
Its outward normal n points from body a into body b, so that

    v = n . (q_a - q_b),   u_j = t_j . (q_a - q_b)

close positive in v, and -B^T (T, N) pushes the bodies apart. The tangents are right-handed, t1 x t2 = n; t1 is the
projection of one global axis on the tangent plane: of x, y and z the one that stays farthest from every normal of the
set, the first of them on a tie. A contact with one tangent slides along t1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from attrito.model.surfaces import FACES, nodal_surface, set_faces, tangent_frames
from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    from attrito.model.model import Model

GROUND = "ground"


@dataclass(frozen=True)
class Pairs:
    """Node-to-node contacts of one contact set, ascending in `node_a`.

    Parameters
    ----------
    node_a, node_b : int64 [nc], node ids; `node_b` is -1 for the ground
    frame : [nc, 3, 3], rows t1, t2, n in global axes
    area : [nc], tributary area on surface a (user length squared)
    position : [nc, 3], coordinates of node a (user length)
    distance : [nc], between the two nodes (user length); 0 for the ground
    tangents : 1 or 2
    unmatched_a, unmatched_b : int64, nodes of the sets that found no partner
    notes : what the user should know, one sentence each
    """

    node_a: np.ndarray
    node_b: np.ndarray
    frame: np.ndarray
    area: np.ndarray
    position: np.ndarray
    distance: np.ndarray
    tangents: int
    unmatched_a: np.ndarray
    unmatched_b: np.ndarray
    notes: list[str] = field(default_factory=list)


def pair_sets(model: Model, a: str, b: str, tolerance: float, tangents: int, file: str, key: str) -> Pairs:
    """Pair the nodes of set `a` with those of set `b`, each node at most once.

    Two nodes are a pair if each is the other's nearest and they are no farther apart than `tolerance`. On the ground
    every node of `a` is a contact.

    Parameters
    ----------
    model : a finite-element model
    a, b : names of node sets; `b` may be "ground"
    tolerance : largest distance of a pair (user length); not used on the ground
    tangents : 1 (along t1) or 2
    file, key : where the job asks for this, for faults: `"job.toml"`, `"contact_set[0]"`

    Raises
    ------
    InputError : unknown, empty or overlapping sets, no pair within the tolerance, no surface under a pair, or no free
        dof on either side of a pair
    """
    ids_a, ids_b = _set_nodes(model, a, b, file, key)
    rows_a, rows_b = _node_rows(model, ids_a), _node_rows(model, ids_b)
    if b == GROUND:
        index_a, index_b, distance = np.arange(len(ids_a)), np.empty(0, dtype=int), np.zeros(len(ids_a))
    else:
        index_a, index_b, distance = _mutual_nearest(model.coordinates[rows_a], model.coordinates[rows_b])
        near = distance <= tolerance
        if not near.any():
            expected = f"a distance that pairs nodes of {a} and {b}; the closest are {distance.min():.4g} apart"
            raise InputError(Fault(file, f"{key}.tolerance", tolerance, expected))
        index_a, index_b, distance = index_a[near], index_b[near], distance[near]
    node_a = ids_a[index_a]
    node_b = np.full(len(node_a), -1, dtype=np.int64) if b == GROUND else ids_b[index_b]

    faces = [_node_rows(model, face) for face in set_faces(model.elements, ids_a)]
    area, direction = nodal_surface(model.coordinates, faces)
    rows = rows_a[index_a]
    length = np.linalg.norm(direction[rows], axis=1)
    # A node without a face, or on a fold whose two sides cancel, has no direction to press in.
    bare = length <= 1e-9 * area[rows]
    free = [np.isin(nodes, model.dof_node) for nodes in (node_a, node_b)]
    _check_pairs(node_a[bare], node_a[~(free[0] | free[1])], a, file, key)

    pairs = Pairs(
        node_a=node_a,
        node_b=node_b,
        frame=tangent_frames(direction[rows] / length[:, None]),
        area=area[rows],
        position=model.coordinates[rows],
        distance=distance,
        tangents=tangents,
        unmatched_a=np.setdiff1d(ids_a, node_a),
        unmatched_b=ids_b[~np.isin(ids_b, node_b)],
    )
    pairs.notes.extend(_notes(pairs, a, b, area[rows_a].sum(), free))
    return pairs


def _check_pairs(bare: np.ndarray, held: np.ndarray, a: str, file: str, key: str) -> None:
    """Refuse nodes of set `a` without a surface, and pairs that cannot move on either side."""
    faults = []
    if len(bare):
        expected = f"a surface: a boundary face of {', '.join(FACES)} elements, all its nodes in the set, at every node"
        faults.append(Fault(file, f"{key}.a", f"{a} (without: {_some(bare)})", expected))
    if len(held):
        expected = "pairs with a free dof on at least one side"
        faults.append(Fault(file, f"{key}.a", f"{a} (held: {_some(held)})", expected))
    if faults:
        raise InputError(*faults)


def contact_rows(pairs: Pairs, model: Model) -> csr_matrix:
    """The contacts' rows of B on the full model's dofs.

    Constrained dofs have no column: they do not move.

    Returns
    -------
    csr [nc * (tangents + 1), n], rows t1, (t2,) n of contact 0, then of contact 1, ...
    """
    nodes, index = np.unique(model.dof_node, return_inverse=True)
    dof = np.full((len(nodes), 3), -1)
    # Rotations and generalised coordinates take no part: contacts lie on nodes.
    moves = model.translates
    dof[index[moves], np.asarray(model.dof_direction[moves], dtype=int) - 1] = np.flatnonzero(moves)
    directions = pairs.frame[:, [0, 2] if pairs.tangents == 1 else [0, 1, 2]]
    per_contact = directions.shape[1]
    row = np.broadcast_to(np.arange(len(pairs.node_a) * per_contact).reshape(-1, per_contact, 1), directions.shape)
    entries = []
    for side, sign in ((pairs.node_a, 1.0), (pairs.node_b, -1.0)):
        place = np.minimum(np.searchsorted(nodes, side), len(nodes) - 1)
        columns = np.where((nodes[place] == side)[:, None], dof[place], -1)[:, None, :]
        columns = np.broadcast_to(columns, directions.shape)
        keep = (columns >= 0) & (directions != 0)
        entries.append((sign * directions[keep], row[keep], columns[keep]))
    values, rows, columns = (np.concatenate(part) for part in zip(*entries, strict=True))
    return csr_matrix((values, (rows, columns)), shape=(row.size // 3, len(model.dof_node)))


def _node_rows(model: Model, ids: np.ndarray) -> np.ndarray:
    """Rows of the model's node arrays for node ids that are known to be there."""
    order = np.argsort(model.node_ids)
    return order[np.searchsorted(model.node_ids, ids, sorter=order)]


def _set_nodes(model: Model, a: str, b: str, file: str, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Ascending node ids of both sets (none for the ground), or every fault in them at once."""
    faults = []
    found = []
    known = ", ".join(sorted(model.node_sets)) or "none: the model has no node set"
    for side, name in (("a", a), ("b", b)):
        if side == "b" and name == GROUND:
            found.append(np.empty(0, dtype=np.int64))
            continue
        if name not in model.node_sets:
            choice = f'"{GROUND}" or a node set' if side == "b" else "a node set"
            faults.append(Fault(file, f"{key}.{side}", name, f"{choice} of the model ({known})"))
            continue
        found.append(np.unique(np.asarray(model.node_sets[name], dtype=np.int64)))
        if not len(found[-1]):
            faults.append(Fault(file, f"{key}.{side}", name, "a node set that has nodes"))
        stray = np.setdiff1d(found[-1], model.node_ids)
        if len(stray):
            faults.append(Fault(file, f"{key}.{side}", f"{name} ({_some(stray)})", "a node set of nodes of the model"))
    if not faults:
        common = np.intersect1d(*found)
        if len(common):
            where = f"{b} ({_some(common)})"
            faults.append(Fault(file, f"{key}.b", where, f"a node set without nodes of {a}: two sides of a joint"))
    if faults:
        raise InputError(*faults)
    return found[0], found[1]


def _mutual_nearest(points_a: np.ndarray, points_b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices into both clouds of the pairs that are each other's nearest, and their distances."""
    distance, to_b = cKDTree(points_b).query(points_a)
    _, to_a = cKDTree(points_a).query(points_b)
    index_a = np.flatnonzero(to_a[to_b] == np.arange(len(points_a)))
    return index_a, to_b[index_a], distance[index_a]


def _notes(pairs: Pairs, a: str, b: str, total_area: float, free: list[np.ndarray]) -> list[str]:
    notes = []
    if len(pairs.unmatched_a):
        share = 100 * (1 - pairs.area.sum() / total_area)
        nodes = pairs.unmatched_a
        notes.append(f"{len(nodes)} nodes of {a} found no partner in {b}: {_some(nodes)}; {share:.3g} % of the area")
    if len(pairs.unmatched_b):
        notes.append(f"{len(pairs.unmatched_b)} nodes of {b} found no partner in {a}: {_some(pairs.unmatched_b)}")
    for name, nodes, moves in ((a, pairs.node_a, free[0]), (b, pairs.node_b, free[1])):
        held = nodes[~moves & (nodes >= 0)]
        if len(held):
            notes.append(f"{len(held)} paired nodes of {name} have no free dof and stand still: {_some(held)}")
    return notes


def _some(nodes: np.ndarray) -> str:
    """The first few of a list of node ids, in words."""
    text = ", ".join(str(node) for node in nodes[:5])
    return f"nodes {text}" + (f" and {len(nodes) - 5} more" if len(nodes) > 5 else "")
