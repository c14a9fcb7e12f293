"""Surfaces of sets of nodes: faces of solid elements, nodal areas and normals, tangent frames."""

from __future__ import annotations

import re

import numpy as np

from attrito.model.face_shapes import REFERENCE_NODES, corners, shapes

# Faces of the solid elements in CalculiX node order from 0, corners anticlockwise seen from outside, then the
# mid-side nodes of the edges 0-1, 1-2, ...
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "C3D4": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "C3D8": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    "C3D10": ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9)),
    "C3D20": (
        (0, 3, 2, 1, 11, 10, 9, 8),
        (4, 5, 6, 7, 12, 13, 14, 15),
        (0, 1, 5, 4, 8, 17, 12, 16),
        (1, 2, 6, 5, 9, 18, 13, 17),
        (2, 3, 7, 6, 10, 19, 14, 18),
        (3, 0, 4, 7, 11, 16, 15, 19),
    ),
}

# The facets between the nodes of a face, by its number of nodes.
FACETS: dict[int, tuple[tuple[int, ...], ...]] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2, 3),),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6, 7)),
}


def element_family(name: str) -> str | None:
    """`C3D20` for `C3D20R`, `C3D10` for `C3D10T`, ...; None for elements without known faces."""
    match = re.fullmatch(r"(C3D(?:4|8|10|20))[A-Z]*", name.upper())
    return match[1] if match else None


def set_faces(elements: dict[str, tuple[np.ndarray, np.ndarray]], nodes: np.ndarray) -> list[np.ndarray]:
    """Boundary faces whose nodes all lie in `nodes`, outward.

    Parameters
    ----------
    elements : element type -> (ids [E], connectivity [E, k])
    nodes : int64, node ids

    Returns
    -------
    list of int64 [number of faces, 3, 4, 6 or 8], node ids, one array an element family
    """
    families: dict[str, list[np.ndarray]] = {}
    for name, (_, connectivity) in elements.items():
        family = element_family(name)
        if family and len(connectivity):
            families.setdefault(family, []).append(np.asarray(connectivity, dtype=np.int64))
    faces = []
    for family, parts in families.items():
        connectivity = np.concatenate(parts)
        inside = np.isin(connectivity, nodes)
        candidates = [connectivity[inside[:, face].all(axis=1)][:, face] for face in map(list, FACES[family])]
        found = np.concatenate(candidates)
        # An interior face is found twice, once from each of its elements.
        _, index, count = np.unique(np.sort(found, axis=1), axis=0, return_index=True, return_counts=True)
        if np.any(count == 1):
            faces.append(found[index[count == 1]])
    return faces


def nodal_surface(points: np.ndarray, faces: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Tributary area and outward direction of every node.

    The area of a linear face goes to its nodes by its shape functions, int N_i dA. A second-order face is cut into the
    facets between its nodes (four triangles; or four corner triangles and the quadrilateral of the mid-side nodes),
    each treated as linear: its own shape functions would give corners nothing (triangles) or less than nothing
    (quadrilaterals), and a spring needs a positive area. A flat triangle gives its corners 1/12 and its mid-side nodes
    1/4 each, a flat rectangle 1/24 and 5/24. The total is the area of the facets.

    The direction is the sum over the faces of their normals at the node, of the curved face if it is of second order,
    each as long as the face is large there.

    Parameters
    ----------
    points : [N, 3]
    faces : arrays of rows of `points`, [number of faces, 3, 4, 6 or 8]

    Returns
    -------
    area [N], direction [N, 3] (not normalised)
    """
    area, direction = np.zeros(len(points)), np.zeros((len(points), 3))
    for block in faces:
        count = block.shape[1]
        nodes = np.array(REFERENCE_NODES[count], dtype=float).T
        along_r, along_s = shapes(count, *nodes, 1, 0), shapes(count, *nodes, 0, 1)
        reference_area = 0.5 if corners(count) == 3 else 4.0
        x = points[block]
        np.add.at(direction, block, reference_area * np.cross(along_r @ x, along_s @ x))
        for facet in map(list, FACETS[count]):
            np.add.at(area, block[:, facet], _facet_areas(x[:, facet]))
    return area, direction


def _facet_areas(x: np.ndarray) -> np.ndarray:
    """int N_i dA of linear triangles or bilinear quadrilaterals, from corners [facets, 3 or 4, 3]."""
    if x.shape[1] == 3:
        whole = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
        return np.repeat(whole[:, None] / 3, 3, axis=1)
    areas = np.zeros(x.shape[:2])
    # 2 x 2 Gauss points are exact on a plane.
    for r, s in np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / np.sqrt(3):
        along_r = np.array([s - 1, 1 - s, 1 + s, -1 - s]) / 4
        along_s = np.array([r - 1, -1 - r, 1 + r, 1 - r]) / 4
        shape = np.array([(1 - r) * (1 - s), (1 + r) * (1 - s), (1 + r) * (1 + s), (1 - r) * (1 + s)]) / 4
        areas += np.linalg.norm(np.cross(along_r @ x, along_s @ x), axis=1)[:, None] * shape
    return areas


def tangent_frames(normal: np.ndarray) -> np.ndarray:
    """Frames [nc, 3, 3] (rows t1, t2, n) about unit normals [nc, 3]; the module's docstring says which t1."""
    # Rounded, so that noise in the normals does not decide a tie.
    clearance = np.round(1 - np.abs(normal), 6)
    axis = np.full(len(normal), int(np.argmax(clearance.min(axis=0))))
    # A set that turns every way (a sphere) has no axis for all: nodes too close to it take their own.
    lost = clearance[np.arange(len(normal)), axis] < 1e-3
    axis[lost] = np.argmax(clearance[lost], axis=1)
    t1 = np.eye(3)[axis] - normal * normal[np.arange(len(normal)), axis][:, None]
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    frame = np.stack([t1, np.cross(normal, t1), normal], axis=1)
    # Rounding noise would fill the rows of B.
    frame[np.abs(frame) < 1e-14] = 0
    return frame
