"""The parts of a surface that belong to its contacts, as polygons: what a map of contacts colours.

A contact at a node has the dual cell of the node: of each facet at the node the quadrilateral

    node, middle of one edge, centroid of the facet, middle of the other edge.

Of a triangle that is a third of its area, of a parallelogram a quarter: there the area of a cell is the tributary area
of the node (`surfaces.nodal_surface`). Quadrilaterals side by side make one outline. Contacts at points within a face
share it by distance: a point of the face belongs to the nearest of them (Voronoi cells). Either way the cells cover the
faces once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from attrito.model.closest_points import Faces, closest_points
from attrito.model.face_shapes import corners
from attrito.model.surfaces import FACETS

# Part of the surface's extent by which a contact may lie off its node, or off its face
COINCIDENT = 1e-6


@dataclass(frozen=True)
class Cells:
    """Polygons on a surface.

    Parameters
    ----------
    outlines : of each cell `[k, 3]`, user length, anticlockwise seen from outside
    contact : `[cells]`, whose it is, numbered as the contacts were given; -1: no contact's
    """

    outlines: list[np.ndarray]
    contact: np.ndarray


def contact_cells(faces: Faces, position: np.ndarray, normal: np.ndarray, node: np.ndarray) -> Cells | None:
    """Cells of contacts on a surface; None where the contacts do not lie on it.

    Parameters
    ----------
    faces : of side a
    position, normal : of the contacts, `[nc, 3]`, normals outward
    node : `[nc]`, row of the node that a contact may stand at
    """
    if not len(faces.blocks) or not len(position):
        return None
    used = np.unique(np.concatenate([block.ravel() for block in faces.blocks]))
    near = COINCIDENT * float(np.ptp(faces.points[used], axis=0).max())
    if np.all(np.linalg.norm(faces.points[node] - position, axis=1) <= near):
        contact_at = dict(zip(node.tolist(), range(len(node)), strict=True))
        if not set(contact_at) <= set(used.tolist()):
            return None
        outlines, owners = _dual_cells(faces)
        return Cells(outlines, np.array([contact_at.get(owner, -1) for owner in owners]))
    # Faces look at what faces them; the surface's own lie the other way.
    found = closest_points(position, -normal, faces, near)
    if np.any(found.face < 0) or np.any(found.distance > near):
        return None
    return _shared_faces(faces, found.face, position)


def _dual_cells(faces: Faces) -> tuple[list[np.ndarray], list[int]]:
    """Outlines about each node, and the nodes."""
    places, sides = dict(enumerate(faces.points)), {}
    for block in faces.blocks:
        for face in block.tolist():
            for facet in FACETS[block.shape[1]]:
                _add_facet([face[corner] for corner in facet], places, sides)
    outlines, owners = [], []
    for owner, edges in sides.items():
        for loop in _loops(edges):
            outlines.append(np.array([places[one] for one in loop]))
            owners.append(owner)
    return outlines, owners


def _add_facet(nodes: list[int], places: dict, sides: dict[int, set[tuple]]) -> None:
    """The parts of one facet: their vertices by name, and their edges by node, without those between two parts."""
    centre = ("centre", *nodes)
    places[centre] = np.mean([places[node] for node in nodes], axis=0)
    middles = [tuple(sorted(pair)) for pair in zip(nodes, [*nodes[1:], nodes[0]], strict=True)]
    for pair in middles:
        places[pair] = 0.5 * (places[pair[0]] + places[pair[1]])
    for index, node in enumerate(nodes):
        corner = [node, middles[index], centre, middles[index - 1]]
        own = sides.setdefault(node, set())
        for edge in zip(corner, [*corner[1:], corner[0]], strict=True):
            if edge[::-1] in own:
                own.remove(edge[::-1])
            else:
                own.add(edge)


def _loops(edges: set[tuple]) -> list[list]:
    """Closed ways along directed edges."""
    onward: dict = {}
    for begin, end in sorted(edges, key=str):
        onward.setdefault(begin, []).append(end)
    loops = []
    while onward:
        begin = next(iter(onward))
        way, place = [begin], onward[begin].pop()
        if not onward[begin]:
            del onward[begin]
        while place != begin:
            way.append(place)
            follows = onward[place].pop()
            if not onward[place]:
                del onward[place]
            place = follows
        loops.append(way)
    return loops


def _shared_faces(faces: Faces, face_of: np.ndarray, position: np.ndarray) -> Cells:
    """Each face divided among the contacts in it."""
    outlines, owners = [], []
    number = 0
    for block in faces.blocks:
        count = corners(block.shape[1])
        ring = np.arange(count)
        if block.shape[1] > count:
            ring = np.column_stack([ring, ring + count]).ravel()
        for nodes in block:
            whole = faces.points[nodes[ring]]
            here = np.flatnonzero(face_of == number)
            number += 1
            if not len(here):
                outlines.append(whole)
                owners.append(-1)
            for own in here:
                cell = whole
                for other in here[here != own]:
                    cell = cut(cell, position[own], position[other])
                if len(cell) > 2:
                    outlines.append(cell)
                    owners.append(int(own))
    return Cells(outlines, np.array(owners))


def cut(polygon: np.ndarray, near: np.ndarray, far: np.ndarray) -> np.ndarray:
    """The part of a convex polygon `[k, 3]` that is nearer to one point than to another."""
    beyond = (polygon - 0.5 * (near + far)) @ (far - near)
    kept = []
    for index, after in enumerate(np.roll(np.arange(len(polygon)), -1)):
        if beyond[index] <= 0:
            kept.append(polygon[index])
        if (beyond[index] <= 0) != (beyond[after] <= 0):
            part = beyond[index] / (beyond[index] - beyond[after])
            kept.append(polygon[index] + part * (polygon[after] - polygon[index]))
    return np.array(kept).reshape(-1, 3)


def polygon_area(outlines: Sequence[np.ndarray]) -> np.ndarray:
    """Areas of polygons `[k, 3]`: |sum of x_i x x_(i+1)| / 2, exact where they are flat."""
    return np.array(
        [0.5 * np.linalg.norm(np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)) for outline in outlines]
    )
