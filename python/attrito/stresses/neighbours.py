"""A sector with elements of those beside it, so that a node on its boundary has a stress from those of both sides.

A node on the axis has elements of all sectors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from attrito.export.wheel import Wheel
from attrito.model.model import Model

# Part of the sector's extent within which nodes on the boundary are one
MATCHING = 1e-5


def with_neighbours(model: Model, harmonics: np.ndarray, wheel: Wheel) -> tuple[Model, np.ndarray]:
    """The mesh and the motion of a sector and of the elements of others that touch it.

    Parameters
    ----------
    model : the sector, N nodes
    harmonics : coefficients of its nodes' motion `[nk, N, 3]`
    wheel : what it is a sector of

    Returns
    -------
    a model whose first N nodes are the sector's own, and the motion of its nodes; nodes are numbered anew
    """
    own = model.coordinates
    tree, reach = cKDTree(own), MATCHING * float(np.ptp(own, axis=0).max())
    order = np.argsort(model.node_ids)
    rows = {
        kind: order[np.searchsorted(model.node_ids, connectivity, sorter=order)]
        for kind, (_, connectivity) in model.elements.items()
    }
    on_axis = np.linalg.norm(wheel.axis.turned(own, wheel.angle(1)) - own, axis=1) <= reach
    points, motions = [own], [harmonics]
    elements = {kind: [own_rows] for kind, own_rows in rows.items()}
    elastic = {kind: [values] for kind, values in model.elastic.items()}
    for j in _others(wheel.sectors, bool(on_axis.any())):
        place, nearest, meets = wheel.axis.turned(own, wheel.angle(j)), np.arange(len(own)), on_axis
        if j in (1, wheel.sectors - 1):
            distance, nearest = tree.query(place)
            meets = distance <= reach
        # Elements without a node of this sector's have no part in its stresses.
        touching = {kind: meets[own_rows].any(axis=1) for kind, own_rows in rows.items()}
        used = np.zeros(len(own), dtype=bool)
        for kind, some in touching.items():
            used[rows[kind][some].ravel()] = True
        new = used & ~meets
        number = nearest.copy()
        number[new] = sum(map(len, points)) + np.arange(np.count_nonzero(new))
        points.append(place[new])
        motions.append(wheel.of_sector(harmonics, j)[:, new])
        for kind, some in touching.items():
            elements[kind].append(number[rows[kind][some]])
            if kind in elastic:
                elastic[kind].append(model.elastic[kind][some])
    coordinates = np.concatenate(points)
    connectivity = {kind: np.concatenate(parts) for kind, parts in elements.items()}
    whole = replace(
        model,
        node_ids=np.arange(len(coordinates)),
        coordinates=coordinates,
        elements={kind: (np.arange(len(nodes)), nodes) for kind, nodes in connectivity.items()},
        elastic={kind: np.concatenate(parts) for kind, parts in elastic.items()},
        node_sets={},
    )
    return whole, np.concatenate(motions, axis=1)


def _others(sectors: int, meet_on_axis: bool) -> list[int]:
    """Sectors that share nodes with the first: those beside it, or all where there are nodes on the axis."""
    return list(range(1, sectors)) if meet_on_axis else sorted({1, sectors - 1} - {0, sectors})
