"""The mass that free nodes share with held ones: matrices without held dofs lack it, and so do loads by mass.

With shape functions N and a density that is the same everywhere its part of the whole is

    integral F (1 - F) dV / integral dV,    F = sum of N_i over the nodes that are free.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.model.solid_shapes import KINDS, solid_shapes

if TYPE_CHECKING:
    from attrito.model.model import Model


def held_share(model: Model) -> float:
    """That part, of the solids of a mesh; dependent nodes have their mass in the matrices."""
    moves = model.dof_node[model.translates]
    ids, count = np.unique(moves, return_counts=True)
    free = np.isin(model.node_ids, np.union1d(ids[count == 3], model.dependent[:, 0]))
    order = np.argsort(model.node_ids)
    shared = whole = 0.0
    for kind, (_, connectivity) in model.elements.items():
        if kind not in KINDS:
            continue
        rows = order[np.searchsorted(model.node_ids, connectivity, sorter=order)]
        shapes = solid_shapes(kind)
        jacobian = np.linalg.det(np.einsum("eix,pir->eprx", model.coordinates[rows], shapes.gradients))
        volume = np.abs(jacobian) * shapes.weights
        moving = free[rows] @ shapes.values.T
        shared += float(np.sum(volume * moving * (1.0 - moving)))
        whole += float(np.sum(volume))
    return abs(shared) / whole if whole else 0.0
