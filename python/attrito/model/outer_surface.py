"""The outer surface of a mesh with few vertices, for views that are drawn again many times a second.

Where there are more vertices than asked for, those of one body within one cell of a grid become one, the one nearest to
their middle (vertex clustering; Rossignac & Borrel 1993, doi:10.1007/978-3-642-78114-8_29). Faces that lose more than
one corner vanish. Vertices that stay are nodes of the mesh, with their own motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from attrito.model.face_shapes import corners
from attrito.model.model import Model
from attrito.model.pairs import node_rows
from attrito.model.surfaces import set_faces

# A grid's cells become wider by this factor until vertices are few enough
WIDER = 1.2


@dataclass(frozen=True)
class OuterSurface:
    """Faces that see the outside.

    Parameters
    ----------
    nodes : `[V]`, rows of the model's nodes
    faces : `[F, 4]`, corners as places in `nodes`, outward; a triangle's last is -1
    """

    nodes: np.ndarray
    faces: np.ndarray


def outer_surface(model: Model, most: int, hidden: tuple[np.ndarray, ...] = ()) -> OuterSurface:
    """The surface of a model with at most so many vertices.

    Parameters
    ----------
    model : with a mesh
    most : vertices
    hidden : sets of node ids; a face whose corners all lie in one of them is left out
    """
    blocks = [np.full((0, 4), -1)]
    for block in set_faces(model.elements, model.node_ids):
        outline = block[:, : corners(block.shape[1])]
        for ids in hidden:
            outline = outline[~np.isin(outline, ids).all(axis=1)]
        rows = node_rows(model, outline)
        blocks.append(np.pad(rows, ((0, 0), (0, 4 - rows.shape[1])), constant_values=-1))
    faces = np.concatenate(blocks)
    nodes, place = np.unique(faces[faces >= 0], return_inverse=True)
    numbered = np.full(faces.shape, -1)
    numbered[faces >= 0] = place
    if len(nodes) <= most:
        return OuterSurface(nodes, numbered)
    points, body = model.coordinates[nodes], _bodies(numbered, len(nodes))
    width = float(np.ptp(points, axis=0).max()) / most
    group = np.arange(len(nodes))
    while len(np.unique(group)) > most:
        width *= WIDER
        cell = np.floor((points - points.min(axis=0)) / width).astype(np.int64)
        group = np.unique(np.column_stack([body, cell]), axis=0, return_inverse=True)[1].ravel()
    kept = _nearest_to_middle(points, group)
    return _without_empty(OuterSurface(nodes[kept], np.where(numbered >= 0, group[numbered], -1)))


def _bodies(faces: np.ndarray, count: int) -> np.ndarray:
    """Which connected part of the surface each vertex is of."""
    last = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 0])
    ends = np.concatenate([faces[:, :2], faces[:, 1:3], np.column_stack([faces[:, 2], last])])
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    found: np.ndarray = connected_components(graph, directed=False)[1]
    return found


def _nearest_to_middle(points: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Of each group the point nearest to its mean."""
    count = np.bincount(group)
    middle = np.column_stack([np.bincount(group, values) for values in points.T]) / count[:, None]
    order = np.lexsort((np.linalg.norm(points - middle[group], axis=1), group))
    found: np.ndarray = order[np.concatenate([[0], np.cumsum(count)[:-1]])]
    return found


def _without_empty(surface: OuterSurface) -> OuterSurface:
    """Without faces of fewer than three corners, without doubles, and without vertices of none.

    Two sides of a thin part that has become a sheet are no doubles: each looks its own way.
    """
    rings = [list(dict.fromkeys(corner for corner in face if corner >= 0)) for face in surface.faces.tolist()]
    different = {_from_least(ring): ring for ring in rings if len(ring) > 2}
    faces = np.array([ring + [-1] * (4 - len(ring)) for ring in different.values()], dtype=int).reshape(-1, 4)
    used, place = np.unique(faces[faces >= 0], return_inverse=True)
    faces[faces >= 0] = place
    return OuterSurface(surface.nodes[used], faces)


def _from_least(ring: list[int]) -> tuple[int, ...]:
    """A ring of corners, begun at the least of them."""
    first = ring.index(min(ring))
    return tuple(ring[first:] + ring[:first])
