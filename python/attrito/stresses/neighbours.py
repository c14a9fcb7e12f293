"""A sector with elements of those beside it, so that a node on its boundary has a stress from those of both sides.

A node on the axis has elements of all sectors. Nodes of a contact across the boundary may stand at one place, and are
two nonetheless.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from attrito.export.wheel import Wheel
from attrito.model.model import Model
from attrito.model.pairs import node_rows
from attrito.model.sector import PairingError, nodes_on_axis, pair_boundaries
from attrito.support.errors import Fault, InputError

# Part of the sector's extent within which held nodes on the boundary are one
MATCHING = 1e-5


def boundaries_of(keys: dict[str, Any], model: Model, wheel: Wheel) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the nodes of the lower boundary and of their partners on the upper one, `[k]` each.

    Parameters
    ----------
    keys : `[cyclic]` of the job, with node sets or without boundaries
    model : the sector
    wheel : what it is a sector of

    Raises
    ------
    InputError : the sets are not those of the run
    """
    names = keys["lower"], keys["upper"]
    nothing = np.empty(0, dtype=np.int64)
    lower, upper = (model.node_sets.get(name, nothing) for name in names)
    try:
        *paired, _ = pair_boundaries(model, lower, upper, names, wheel.axis, wheel.sectors, keys.get("tolerance"))
    except PairingError as error:
        raise InputError(Fault("stress", "[cyclic] upper", error.value, str(error))) from error
    first, second = (node_rows(model, ids) for ids in paired)
    return first, second


def with_neighbours(
    model: Model, harmonics: np.ndarray, wheel: Wheel, boundaries: tuple[np.ndarray, np.ndarray]
) -> tuple[Model, np.ndarray]:
    """The mesh and the motion of a sector and of the elements of others that touch it.

    Parameters
    ----------
    model : the sector, N nodes
    harmonics : coefficients of its nodes' motion `[nk, N, 3]`
    wheel : what it is a sector of
    boundaries : rows of the nodes of the lower and of the upper one, paired `[k]`; held nodes need not be among them

    Returns
    -------
    a model whose first N nodes are the sector's own, and the motion of its nodes; nodes are numbered again
    """
    order = np.argsort(model.node_ids)
    rows = {
        kind: order[np.searchsorted(model.node_ids, connectivity, sorter=order)]
        for kind, (_, connectivity) in model.elements.items()
    }
    meeting = _Meeting(model, wheel, boundaries)
    points, motions = [model.coordinates], [harmonics]
    elements = {kind: [own_rows] for kind, own_rows in rows.items()}
    elastic = {kind: [values] for kind, values in model.elastic.items()}
    for j in _others(wheel.sectors, bool(meeting.on_axis.any())):
        place = wheel.axis.turned(model.coordinates, wheel.angle(j))
        partner = meeting.partners(j, place)
        meets = partner >= 0
        # Elements without a node of this sector's have no part in its stresses.
        touching = {kind: meets[own_rows].any(axis=1) for kind, own_rows in rows.items()}
        used = np.zeros(len(place), dtype=bool)
        for kind, some in touching.items():
            used[rows[kind][some].ravel()] = True
        new = used & ~meets
        number = partner.copy()
        number[new] = sum(map(len, points)) + np.arange(np.count_nonzero(new))
        points.append(place[new])
        motions.append(wheel.of_sector(harmonics, j)[:, new])
        for kind, some in touching.items():
            elements[kind].append(number[rows[kind][some]])
            if kind in elastic:
                elastic[kind].append(model.elastic[kind][some])
    return _numbered(model, points, elements, elastic), np.concatenate(motions, axis=1)


class _Meeting:
    """Which nodes of another sector are at one place with which of the first."""

    def __init__(self, model: Model, wheel: Wheel, boundaries: tuple[np.ndarray, np.ndarray]):
        own = model.coordinates
        self._sectors, self._boundaries = wheel.sectors, boundaries
        self._tree, self._reach = cKDTree(own), MATCHING * float(np.ptp(own, axis=0).max())
        self.on_axis = np.isin(model.node_ids, nodes_on_axis(model, wheel.axis))
        self._held = ~np.isin(model.node_ids, model.dof_node)

    def partners(self, j: int, place: np.ndarray) -> np.ndarray:
        """Of each node of sector j, at `place` `[N, 3]`, the row of the first sector's that it is, or -1."""
        partner = np.where(self.on_axis, np.arange(len(place)), -1)
        lower, upper = self._boundaries
        for beside, theirs, ours in ((1, lower, upper), (self._sectors - 1, upper, lower)):
            if j == beside:
                partner[theirs] = ours
        distance, nearest = self._tree.query(place)
        stands = self._held & self._held[nearest] & (distance <= self._reach) & (partner < 0)
        partner[stands] = nearest[stands]
        return partner


def _numbered(
    model: Model,
    points: list[np.ndarray],
    elements: dict[str, list[np.ndarray]],
    elastic: dict[str, list[np.ndarray]],
) -> Model:
    """The model of nodes and elements in parts, rows for numbers, without its sets."""
    coordinates = np.concatenate(points)
    connectivity = {kind: np.concatenate(parts) for kind, parts in elements.items()}
    return replace(
        model,
        node_ids=np.arange(len(coordinates)),
        coordinates=coordinates,
        elements={kind: (np.arange(len(nodes)), nodes) for kind, nodes in connectivity.items()},
        elastic={kind: np.concatenate(parts) for kind, parts in elastic.items()},
        node_sets={},
    )


def _others(sectors: int, meet_on_axis: bool) -> list[int]:
    """Sectors that share nodes with the first: those beside it, or all where there are nodes on the axis."""
    return list(range(1, sectors)) if meet_on_axis else sorted({1, sectors - 1} - {0, sectors})
