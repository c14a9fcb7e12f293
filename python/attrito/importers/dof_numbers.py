"""Dofs named by node and direction: numbers for them while files are read, and their final order.

Directions 1, 2, 3 are displacements along x, y, z; 4, 5, 6 rotations about them, as in Abaqus and Nastran. Direction 0
is a generalised coordinate (a scalar point of Nastran), whose node is a number of its own.
"""

from __future__ import annotations

import numpy as np

DIRECTIONS = 6
# Above this node id, ids are looked up by bisection instead of in a table (4 bytes an id).
LARGEST_TABLE = 1 << 26


class DofNumbers:
    """Provisional numbers, 8 a node in the order in which nodes are met. One object serves all matrices of a model."""

    def __init__(self) -> None:
        self._ids: list[np.ndarray] = []
        self._count = 0
        self._table = np.full(1024, -1, np.int32)
        self._large = np.zeros(0, np.int64)
        self._large_index = np.zeros(0, np.int32)

    def __len__(self) -> int:
        return 8 * self._count

    def numbers(self, node: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Number of each dof, int32; `node` any but 0, `direction` from 0 to 6."""
        return 8 * self._index(node) + direction.astype(np.int32)

    def order(self, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Dofs by node, then direction.

        Parameters
        ----------
        used : which provisional numbers are dofs of the model, bool

        Returns
        -------
        new number of each provisional one (-1: not used), node id `[n]` and direction `[n]` of each dof
        """
        found = np.flatnonzero(used)
        ids = np.concatenate(self._ids) if self._ids else np.zeros(0, np.int64)
        node, direction = ids[found // 8], (found % 8).astype(np.int8)
        order = np.lexsort((direction, node))
        renumber = np.full(len(used), -1, np.int32)
        renumber[found[order]] = np.arange(len(found), dtype=np.int32)
        return renumber, node[order], direction[order]

    def _index(self, node: np.ndarray) -> np.ndarray:
        if len(node) == 0:
            return np.zeros(0, np.int32)
        highest = int(node.max())
        if highest >= LARGEST_TABLE or int(node.min()) < 0:
            return self._index_large(node)
        if highest >= len(self._table):
            grown = np.full(max(highest + 1, 2 * len(self._table)), -1, np.int32)
            grown[: len(self._table)] = self._table
            self._table = grown
        index = self._table[node]
        new = index < 0
        if new.any():
            ids = np.unique(node[new])
            self._table[ids] = self._append(ids)
            index = self._table[node]
        return index

    def _index_large(self, node: np.ndarray) -> np.ndarray:
        index = np.empty(len(node), np.int32)
        small = (node >= 0) & (node < LARGEST_TABLE)
        index[small] = self._index(node[small])
        large = node[~small]
        new = np.setdiff1d(large, self._large)
        if len(new) > 0:
            ids, indices = np.append(self._large, new), np.append(self._large_index, self._append(new))
            order = np.argsort(ids)
            self._large, self._large_index = ids[order], indices[order]
        index[~small] = self._large_index[np.searchsorted(self._large, large)]
        return index

    def _append(self, ids: np.ndarray) -> np.ndarray:
        first, self._count = self._count, self._count + len(ids)
        self._ids.append(ids.astype(np.int64))
        return np.arange(first, self._count, dtype=np.int32)
