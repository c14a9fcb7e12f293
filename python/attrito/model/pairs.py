"""Contacts of one contact set, however they were paired: where they are, and their rows of B.

The outward normal n of side a points from body a into body b, so that

    v = n . (q_a - q_b),   u_j = t_j . (q_a - q_b)

close positive in v, and -B^T (T, N) pushes the bodies apart. The tangents are right-handed, t1 x t2 = n; t1 is the
projection of one global axis on the tangent plane: of x, y and z the one that stays farthest from every normal of the
set, the first of them on a tie. A contact with one tangent slides along t1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.model import Model
from attrito.model.surfaces import FACES
from attrito.support.errors import Fault, InputError

GROUND = "ground"


@dataclass(frozen=True)
class Pairs:
    """Contacts of one contact set.

    Parameters
    ----------
    node_a, node_b : int64 `[nc]`, node ids; of contacts on faces those that bear most; `node_b` is -1 for the ground
    frame : `[nc, 3, 3]`, rows t1, t2, n in global axes
    area : `[nc]`, tributary area on surface a (user length squared)
    position : `[nc, 3]`, of the contact on surface a (user length)
    distance : `[nc]`, from there to its partner (user length); 0 for the ground
    clearance : `[nc]`, along n from a to its partner, negative where the bodies overlap; nan for the ground
    tangents : 1 or 2
    motion_a, motion_b : csr `[3 nc, 3 N]`, what the nodes' motion adds to rows t1, t2, n of each contact
    nodes, shape : `[nc, k]`, rows of the model's nodes (-1: none) on side a, and their shape functions at the contacts
    unmatched_a, unmatched_b : int64, nodes of the sets that found no partner
    notes : what the user should know, one sentence each
    """

    node_a: np.ndarray
    node_b: np.ndarray
    frame: np.ndarray
    area: np.ndarray
    position: np.ndarray
    distance: np.ndarray
    clearance: np.ndarray
    tangents: int
    motion_a: csr_matrix
    motion_b: csr_matrix
    nodes: np.ndarray
    shape: np.ndarray
    unmatched_a: np.ndarray
    unmatched_b: np.ndarray
    notes: list[str] = field(default_factory=list)


def contact_rows(pairs: Pairs, model: Model) -> csr_matrix:
    """The contacts' rows of B on the full model's dofs.

    Constrained dofs have no column: they do not move.

    Returns
    -------
    csr `[nc * (tangents + 1), n]`, rows t1, (t2,) n of contact 0, then of contact 1, ...
    """
    # Rotations and generalised coordinates take no part: contacts lie on nodes.
    moves = np.flatnonzero(model.translates)
    dof = np.full(3 * len(model.node_ids), -1)
    dof[3 * model.rows_of(moves) + np.asarray(model.dof_direction[moves], dtype=int) - 1] = moves
    motion = csr_matrix(pairs.motion_a + pairs.motion_b)
    if pairs.tangents == 1:
        motion = motion[(3 * np.arange(len(pairs.area))[:, None] + [0, 2]).ravel()]
    columns = dof[motion.indices]
    keep = columns >= 0
    offsets = np.concatenate([[0], np.cumsum(keep)])[motion.indptr]
    return csr_matrix((motion.data[keep], columns[keep], offsets), shape=(motion.shape[0], len(model.dof_node)))


def can_move(motion: csr_matrix, model: Model) -> np.ndarray:
    """Which contacts have a node with a free dof on one side, `[nc]` bool; `motion`: that side's rows."""
    free = np.repeat(np.isin(model.node_ids, model.dof_node), 3).astype(float)
    return (abs(motion) @ free).reshape(-1, 3).any(axis=1)


def held_nodes(motion: csr_matrix, model: Model) -> np.ndarray:
    """Ids of the nodes of one side's rows that have no free dof."""
    taking_part = np.zeros(len(model.node_ids), dtype=bool)
    taking_part[motion.indices // 3] = True
    return np.sort(model.node_ids[taking_part & ~np.isin(model.node_ids, model.dof_node)])


def node_rows(model: Model, ids: np.ndarray) -> np.ndarray:
    """Rows of the model's node arrays for node ids that are known to be there."""
    order = np.argsort(model.node_ids)
    return order[np.searchsorted(model.node_ids, ids, sorter=order)]


def set_nodes(model: Model, a: str, b: str, file: str, key: str) -> tuple[np.ndarray, np.ndarray]:
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
            faults.append(Fault(file, f"{key}.{side}", f"{name} ({some(stray)})", "a node set of nodes of the model"))
    if not faults:
        common = np.intersect1d(*found)
        if len(common):
            where = f"{b} ({some(common)})"
            faults.append(Fault(file, f"{key}.b", where, f"a node set without nodes of {a}: two sides of a joint"))
    if faults:
        raise InputError(*faults)
    return found[0], found[1]


def check_pairs(bare: np.ndarray, held: np.ndarray, a: str, file: str, key: str) -> None:
    """Refuse nodes of set `a` without a surface, and contacts that cannot move on either side."""
    faults = []
    if len(bare):
        expected = f"a surface: a boundary face of {', '.join(FACES)} elements, all its nodes in the set, at every node"
        faults.append(Fault(file, f"{key}.a", f"{a} (without: {some(bare)})", expected))
    if len(held):
        expected = "pairs with a free dof on at least one side"
        faults.append(Fault(file, f"{key}.a", f"{a} (held: {some(held)})", expected))
    if faults:
        raise InputError(*faults)


def notes_on_held(pairs: Pairs, model: Model, a: str, b: str) -> list[str]:
    """What to say of nodes that take part and have no free dof."""
    held = ((name, held_nodes(motion, model)) for name, motion in ((a, pairs.motion_a), (b, pairs.motion_b)))
    return [
        f"{len(nodes)} paired nodes of {name} have no free dof and stand still: {some(nodes)}"
        for name, nodes in held
        if len(nodes)
    ]


def some(nodes: np.ndarray) -> str:
    """The first few of a list of node ids, in words."""
    text = ", ".join(str(node) for node in nodes[:5])
    return f"nodes {text}" + (f" and {len(nodes) - 5} more" if len(nodes) > 5 else "")
