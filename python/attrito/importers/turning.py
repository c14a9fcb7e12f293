"""Dofs of nodes that move along axes of their own, turned to the global ones.

At such a node `u' = A u`, with the node's own directions as the rows of A; rotations go the same way. With T made of
these blocks, a matrix K' on the dofs as they were is `T' K' T` on those along x, y, z.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from attrito.support.errors import Fault, InputError


def turn(
    matrices: dict[str, csr_matrix], node: np.ndarray, direction: np.ndarray, axes: dict[int, np.ndarray], file: str
) -> int:
    """Turn matrices to global directions, in place; how many nodes have directions of their own.

    Parameters
    ----------
    matrices : by name `[n, n]`
    node, direction : of each dof, `[n]`
    axes : for a node id its directions 1, 2, 3 as rows, `[3, 3]`
    file : where they are said, for faults
    """
    ids = np.intersect1d(np.array(list(axes), np.int64), node[direction > 0])
    if len(ids) == 0:
        return 0
    size = len(node)
    own = np.isin(node, ids) & (direction > 0)
    others = np.flatnonzero(~own)
    rows, columns, values = [others], [others], [np.ones(len(others))]
    for kind in (np.arange(1, 4), np.arange(4, 7)):
        some = np.flatnonzero(own & np.isin(direction, kind))
        some = some[np.lexsort((direction[some], node[some]))]
        nodes, count = np.unique(node[some], return_counts=True)
        if np.any(count != 3):
            held = nodes[count != 3][0]
            value = f"node {held}, some of whose dofs along its own axes are held"
            raise InputError(Fault(file, "axes", value, "all three of its displacements (or rotations) free, or none"))
        dofs = some.reshape(-1, 3)
        blocks = np.array([axes[int(k)] for k in nodes]).reshape(-1, 3, 3)
        rows.append(np.repeat(dofs, 3, axis=1).ravel())
        columns.append(np.tile(dofs, (1, 3)).ravel())
        values.append(blocks.reshape(-1))
    parts = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    turned = coo_matrix(parts, shape=(size, size)).tocsr()
    turned.eliminate_zeros()
    for name, matrix in matrices.items():
        product = (turned.T @ matrix @ turned).tocsr()
        matrices[name] = (0.5 * (product + product.T)).tocsr()
    return len(ids)
