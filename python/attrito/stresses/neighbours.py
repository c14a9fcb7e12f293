"""A sector with the sectors beside it, so that a node on its boundary has a stress from the elements of both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from attrito.export.wheel import Wheel
from attrito.model.model import Model

# Part of the sector's extent within which nodes on the boundary are one
MATCHING = 1e-5


def with_neighbours(model: Model, harmonics: np.ndarray, wheel: Wheel) -> tuple[Model, np.ndarray]:
    """The mesh and the motion of a sector and of those beside it.

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
    numbers, points, motions = [np.arange(len(own))], [own], [harmonics]
    for j in sorted({1, wheel.sectors - 1} - {0}):
        place = wheel.axis.turned(own, wheel.angle(j))
        distance, nearest = tree.query(place)
        new = distance > reach
        number = nearest.copy()
        number[new] = sum(map(len, points)) + np.arange(np.count_nonzero(new))
        numbers.append(number)
        points.append(place[new])
        motions.append(wheel.of_sector(harmonics, j)[:, new])
    coordinates = np.concatenate(points)
    parts = len(numbers)
    elements = {}
    for kind, own_rows in rows.items():
        connectivity = np.concatenate([number[own_rows] for number in numbers])
        elements[kind] = (np.arange(len(connectivity)), connectivity)
    whole = replace(
        model,
        node_ids=np.arange(len(coordinates)),
        coordinates=coordinates,
        elements=elements,
        elastic={kind: np.tile(values, (parts, 1)) for kind, values in model.elastic.items()},
        node_sets={},
    )
    return whole, np.concatenate(motions, axis=1)
