"""Does a stiffness resist a rigid rotation, as no structure at rest does?

For rigid motions r, K r = 0 in every row whose node is not coupled to held dofs, which the matrices lack. Such rows
are known by the translations, K t = 0, and by the mesh, since rows beside a face that slides along a plane may have
K t = 0 by symmetry; over them the rotations decide

    rho = |K r| / | sum_j |K_ij| |r_j| |,   r_j = e x (x_j - x_i)  (e for a node's own rotation),

i being the row's node, e the worst axis. Elements of full rank leave rounding. Hourglass control may not: C3D8R of
CalculiX 2.20 leave some 1e-5, and a free beam of them has two rigid modes at some 20 Hz instead of at 0.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.model import Model

# Rows that are looked at, spread over the model; parts of a row's entries that a translation and a rotation may leave,
# rounding and the digits of a file.
MOST_ROWS = 5000
TRANSLATION, ROTATION = 1e-8, 1e-7


def resisted_rotation(model: Model) -> str | None:
    """What to say of a stiffness that resists a rigid rotation; None if it does not, or if that cannot be decided.

    Stress stiffening resists rotations rightly, and so does what no mesh locates.
    """
    if not model.has_mesh or not model.names_dofs or model.stiffness_holds:
        return None
    ratio = rotation_resistance(model)
    if ratio is None:
        return None
    return (
        f"the stiffness resists a rigid rotation, by {ratio:.1g} of its entries (0 for a structure at rest): bodies"
        " that are held softly, or by contacts alone, come out too stiff; elements with hourglass control do that"
        " (C3D8R of CalculiX 2.20; C3D8, C3D10 and C3D20 do not), and so do springs between nodes that lie apart"
    )


def rotation_resistance(model: Model) -> float | None:
    """rho of the worst axis; None where it is rounding, or no row is away from supports."""
    rows = np.flatnonzero(model.translates)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_ROWS).astype(int))] if len(rows) else rows
    if not len(rows):
        return None
    part = csr_matrix(model.stiffness[rows])
    row, column, value = np.repeat(np.arange(len(rows)), np.diff(part.indptr)), part.indices, part.data
    # Generalised coordinates take no part in a rigid motion.
    placed = np.flatnonzero(np.asarray(model.dof_direction) > 0)
    spatial = np.isin(column, placed)
    row, column, value = row[spatial], column[spatial], value[spatial]
    place = np.zeros((model.size, 3))
    place[placed] = model.coordinates[model.rows_of(placed)]
    direction = np.asarray(model.dof_direction, dtype=int)[column] - 1
    arm = place[column] - place[rows[row]]
    moves, axis = direction < 3, direction % 3
    count = len(rows)

    def resistance(component: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """K r, and the sum of its terms' sizes, by row; `component` is r at each entry's column."""
        terms = value * component
        return np.bincount(row, terms, count), np.bincount(row, np.abs(terms), count)

    entries = np.bincount(row, np.abs(value), count)
    interior = entries > 0.0
    for e in np.eye(3):
        force, _ = resistance(np.where(moves, e[axis], 0.0))
        interior &= np.abs(force) <= TRANSLATION * entries
    interior &= lies_whole(model, rows, row, column)[0]
    if not interior.any():
        return None
    worst = 0.0
    for e in np.eye(3):
        turn = np.cross(e, arm)
        force, size = resistance(np.where(moves, turn[np.arange(len(axis)), axis], e[axis]))
        size = np.linalg.norm(size[interior])
        if size > 0.0:
            worst = max(worst, float(np.linalg.norm(force[interior]) / size))
    return worst if worst > ROTATION else None


def lies_whole(model: Model, rows: np.ndarray, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, csr_matrix]:
    """Rows whose node has no element in common with one that lacks a dof, and that no dependent one moves along with.

    Parameters
    ----------
    rows : dofs that are looked at, `[r]`
    row, column : of their entries, the number in `rows` and the dof, generalised coordinates left out

    Returns
    -------
    these rows, `[r]` bool, and which have elements in common, `[r, r]`
    """
    count, node = len(model.node_ids), np.zeros(model.size, dtype=int)
    placed = np.flatnonzero(np.asarray(model.dof_direction) > 0)
    node[placed] = model.rows_of(placed)
    own, at = np.unique(node[rows], return_inverse=True)
    dofs = np.bincount(node[model.translates], minlength=count)
    order = np.argsort(model.node_ids)
    cells = [order[np.searchsorted(model.node_ids, one, sorter=order)] for _, one in model.elements.values()]
    width = np.concatenate([np.full(len(one), one.shape[1]) for one in cells] or [np.empty(0, int)])
    members = np.concatenate([one.ravel() for one in cells] or [np.empty(0, int)])
    ends = np.concatenate([[0], np.cumsum(width)])
    lies_in = csr_matrix((np.ones(len(members)), members, ends), shape=(len(width), count))
    beside = csr_matrix(lies_in[:, own].T @ lies_in)
    whole = (beside @ (dofs < 3).astype(float))[at] == 0.0
    if len(model.dependent):
        pairs = beside.tocoo()
        known = pairs.row.astype(np.int64) * count + pairs.col
        whole[row[~np.isin(at[row].astype(np.int64) * count + node[column], known)]] = False
    return np.asarray(whole), csr_matrix(beside[at][:, node[rows]])
