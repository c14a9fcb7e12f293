"""Coriolis forces on a model in axes that turn.

In axes that turn with speed Omega about the unit vector a a moving point feels -2 Omega a x q' by its mass, so that

    M q'' + (C + Omega G) q' + K q = f,    Omega G = 2 Omega integral rho N^T [a x] N,    G^T = -G.

Where shape functions are the same along x, y and z, as those of isoparametric solids are in axes that all nodes share,
the mass is m_ij I_3 between the nodes i and j, whether consistent or lumped, and

    G_ij = 2 m_ij [a x]

is known by the mass alone. `coriolis_matrix` looks at every entry of the mass for that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from attrito.model.rotation import NEGLIGIBLE

if TYPE_CHECKING:
    from attrito.model.model import Model

# Part of (m_ii m_jj)^0.5 by which entries of the mass that should be equal, or zero, may differ: files have few digits.
SAME_MASS = 1e-6


def cross_matrix(direction: np.ndarray) -> np.ndarray:
    """[a x] `[3, 3]` of a unit vector a `[3]`."""
    x, y, z = np.where(np.abs(direction) < NEGLIGIBLE, 0.0, direction)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def coriolis_matrix(model: Model, direction: np.ndarray) -> csr_matrix:
    """G of one unit of speed about a unit vector `[3]`: `[n, n]`, skew, user mass.

    Raises
    ------
    ValueError : the mass does not tell it; the message says where, and is followed by what to expect of it
    """
    mass = model.mass.tocoo()
    row, column, value = (part[mass.data != 0.0] for part in (mass.row, mass.col, mass.data))
    moves = model.translates
    other = ~(moves[row] & moves[column])
    if other.any():
        raise ValueError(f"mass on {_name(model, row[other][0])} and {_name(model, column[other][0])}")
    nodes, node = np.unique(model.dof_node, return_inverse=True)
    along = np.asarray(model.dof_direction, dtype=int) - 1
    root = np.sqrt(model.mass.diagonal())
    mixed = (along[row] != along[column]) & (np.abs(value) > SAME_MASS * root[row] * root[column])
    if mixed.any():
        raise _refusal(model, row[mixed][0], column[mixed][0], value[mixed][0], 0.0)
    dof = np.full((len(nodes), 3), -1)
    dof[node[moves], along[moves]] = np.flatnonzero(moves)
    _check_held(model, direction, node, dof)
    first, second, entries = _of_pairs(node, along, row, column, value, len(nodes))
    # Held directions have no entry; those that both nodes have must be equal.
    both = (dof[first] >= 0) & (dof[second] >= 0)
    shared = np.where(both, entries, 0.0).sum(axis=1) / both.sum(axis=1)
    bound = SAME_MASS * root[dof[first]] * root[dof[second]]
    differs = both & (np.abs(entries - shared[:, None]) > bound)
    if differs.any():
        pair, which = np.argwhere(differs)[0]
        place = dof[first[pair], which], dof[second[pair], which]
        raise _refusal(model, *place, entries[pair, which], shared[pair])
    cross = 2.0 * cross_matrix(direction)
    parts = []
    for i, j in zip(*np.nonzero(cross), strict=True):
        there = (dof[first, i] >= 0) & (dof[second, j] >= 0)
        parts.append((cross[i, j] * shared[there], dof[first[there], i], dof[second[there], j]))
    values, rows, columns = (np.concatenate(part) for part in zip(*parts, strict=True))
    made = coo_matrix((values, (rows, columns)), shape=model.mass.shape).tocsr()
    # Both triangles of the mass may differ by rounding.
    return csr_matrix((made - made.T) / 2)


def _of_pairs(
    node: np.ndarray, along: np.ndarray, row: np.ndarray, column: np.ndarray, value: np.ndarray, nodes: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of nodes that the mass couples along any direction, and its entries for each, `[pairs, 3]`."""
    same = along[row] == along[column]
    pair = node[row[same]].astype(np.int64) * nodes + node[column[same]]
    pairs, place = np.unique(pair, return_inverse=True)
    entries = np.zeros((len(pairs), 3))
    np.add.at(entries, (place, along[row[same]]), value[same])
    return pairs // nodes, pairs % nodes, entries


def _check_held(model: Model, direction: np.ndarray, node: np.ndarray, dof: np.ndarray) -> None:
    """Two neighbours that move along no common direction: the mass that Coriolis forces need of them is not known."""
    free = dof >= 0
    partly = free.any(axis=1) & ~free.all(axis=1)
    if not partly.any():
        return
    coupled = model.stiffness.tocoo()
    first, second = node[coupled.row], node[coupled.col]
    looked_at = partly[first] & partly[second]
    first, second = first[looked_at], second[looked_at]
    needed = np.einsum("pi,ij,pj->p", free[first], np.abs(cross_matrix(direction)), free[second])
    unknown = ~(free[first] & free[second]).any(axis=1) & (needed > 0.0)
    if unknown.any():
        names = np.unique(model.dof_node)[[first[unknown][0], second[unknown][0]]]
        raise ValueError(f"nodes {names[0]} and {names[1]}, held so that they move along no common direction")


def _name(model: Model, dof: int) -> str:
    """A dof for the user."""
    word = ("q", "x", "y", "z", "rx", "ry", "rz")[model.dof_direction[dof]]
    return f"node {model.dof_node[dof]} {word}"


def _refusal(model: Model, first: int, second: int, value: float, expected: float) -> ValueError:
    return ValueError(
        f"a mass of {value:.6g} between {_name(model, first)} and {_name(model, second)} instead of {expected:.6g}"
    )
