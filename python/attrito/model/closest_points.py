"""Closest points of points on a surface of element faces (tri3, tri6, quad4, quad8), flat or curved.

On one face x(r, s) the closest point makes |x(r, s) - p| / 2 squared least over the reference face. Inside it

    (x - p) . x_r = 0,   (x - p) . x_s = 0,

by Newton's method; where that leaves the face, the least along its edges, likewise. Only faces that look at the point's
own surface count, n_p . n < 0. Which faces are tried: first those whose centres are nearest; with the distance d found
on them, then all whose bounding sphere (centre c, radius R) has |p - c| <= d + R, so that none nearer is missed. A
point at which none of its 32 nearest faces looks has no partner.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from attrito.model.face_shapes import REFERENCE_NODES, corners, shapes

NEWTON_STEPS = 25
# Faces tried first; how far a face bulges beyond the sphere of its nodes; the step (reference face) after which
# Newton's method, whose next one is its square, has nothing left to find
FIRST, BULGE, SMALL_STEP = 2, 1.1, 1e-9
# Faces tried where none of the first looks at the point: the other side of a thin body is nearer
MORE = 32
# How far from the reference face Newton's method may go before the edges take over
BEYOND = 0.5
# Points and faces tried at a time: some 100 MB
BLOCK = 200_000


@dataclass(frozen=True)
class Faces:
    """A surface.

    Parameters
    ----------
    points : `[N, 3]`, user length
    blocks : faces of one kind each, rows of `points`, `[F, 3, 4, 6 or 8]`, outward; faces are numbered through
    """

    points: np.ndarray
    blocks: Sequence[np.ndarray]

    @property
    def first(self) -> np.ndarray:
        """Number of the first face of each block, and how many there are, `[blocks + 1]`."""
        return np.cumsum([0, *map(len, self.blocks)])

    def parts(self, face: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """For each block which of some faces are of it, and their nodes `[part, k]`; no block without any."""
        for first, block in zip(self.first, self.blocks, strict=False):
            part = np.flatnonzero((face >= first) & (face < first + len(block)))
            if len(part):
                yield part, block[face[part] - first]

    def spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres `[faces, 3]` and radii `[faces]` of spheres that hold the faces."""
        centres, radii = np.empty((self.first[-1], 3)), np.empty(self.first[-1])
        for part, nodes in self.parts(np.arange(self.first[-1])):
            x = self.points[nodes]
            centres[part] = x.mean(axis=1)
            radii[part] = BULGE * np.linalg.norm(x - centres[part][:, None], axis=2).max(axis=1)
        return centres, radii

    def at(self, face: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of faces at reference coordinates `[n, 2]`: x, x_r and x_s, `[n, 3]` each."""
        found = np.empty((3, len(face), 3))
        for part, nodes in self.parts(face):
            x = self.points[nodes]
            for which, derivative in enumerate(((0, 0), (1, 0), (0, 1))):
                shape = shapes(nodes.shape[1], *place[part].T, *derivative)
                found[which, part] = np.einsum("nk,nkd->nd", shape, x)
        return found[0], found[1], found[2]


@dataclass(frozen=True)
class Closest:
    """Closest points, one for each point asked for.

    Parameters
    ----------
    face : its face, -1: none looks at the point within the distance asked for
    place : `[n, 2]`, r and s
    position : `[n, 3]`
    distance : `[n]`, infinite where there is none
    """

    face: np.ndarray
    place: np.ndarray
    position: np.ndarray
    distance: np.ndarray


def closest_points(points: np.ndarray, normals: np.ndarray, faces: Faces, farthest: float = np.inf) -> Closest:
    """Closest points on a surface that looks at the points.

    Parameters
    ----------
    points, normals : `[n, 3]`, normals of the points' own surface
    faces : the surface
    farthest : how far faces are looked for beside those nearest by; distances beyond are upper bounds
    """
    from scipy.spatial import cKDTree

    count = len(points)
    best = Closest(np.full(count, -1), np.zeros((count, 2)), np.full((count, 3), np.nan), np.full(count, np.inf))
    centres, radii = faces.spheres()
    if not len(centres) or not count:
        return best
    everything = cKDTree(centres)
    for many in (min(FIRST, len(centres)), min(MORE, len(centres))):
        lost = np.flatnonzero(best.face < 0)
        for part in np.array_split(lost, -(-len(lost) * many // BLOCK) or 1):
            _, nearest = everything.query(points[part], many)
            _improve(best, points, normals, faces, np.repeat(part, many), nearest.ravel())
    # Faces of like size share a tree, so that a few big ones do not widen the search among many small ones.
    size = np.floor(np.log2(np.maximum(radii, 1e-300)))
    seen = np.flatnonzero(best.face >= 0)
    for one in np.unique(size):
        mine = np.flatnonzero(size == one)
        tree = cKDTree(centres[mine])
        for part in np.array_split(seen, -(-len(seen) // BLOCK) or 1):
            reach = np.minimum(best.distance[part], farthest) + radii[mine].max()
            found = tree.query_ball_point(points[part], reach, return_sorted=False)
            point = np.repeat(part, [len(near) for near in found])
            face = mine[np.concatenate([*found, []]).astype(int)]
            apart = np.linalg.norm(points[point] - centres[face], axis=1)
            keep = apart <= np.minimum(best.distance[point], farthest) + radii[face]
            keep &= best.face[point] != face
            _improve(best, points, normals, faces, point[keep], face[keep])
    return best


def _improve(
    best: Closest, points: np.ndarray, normals: np.ndarray, faces: Faces, point: np.ndarray, face: np.ndarray
) -> None:
    """Try faces for points (pairs of numbers) and keep the closest of those that look at them."""
    for begin in range(0, len(point), BLOCK):
        p, f = point[begin : begin + BLOCK], face[begin : begin + BLOCK]
        place = project(points[p], faces, f)
        x, along_r, along_s = faces.at(f, place)
        facing = np.einsum("nd,nd->n", np.cross(along_r, along_s), normals[p]) < 0
        distance = np.where(facing, np.linalg.norm(x - points[p], axis=1), np.inf)
        # The closest of each point, the first face on a tie.
        order = np.lexsort((f, distance, p))
        order = order[np.concatenate([[True], p[order][1:] != p[order][:-1]])]
        order = order[distance[order] < best.distance[p[order]]]
        best.face[p[order]], best.place[p[order]] = f[order], place[order]
        best.position[p[order]], best.distance[p[order]] = x[order], distance[order]


def project(points: np.ndarray, faces: Faces, face: np.ndarray) -> np.ndarray:
    """Reference coordinates `[n, 2]` of the closest point of each point `[n, 3]` on a face of its own `[n]`."""
    place = np.empty((len(face), 2))
    for part, nodes in faces.parts(face):
        place[part] = _project_on_kind(points[part], faces.points[nodes])
    return place


def _project_on_kind(p: np.ndarray, x: np.ndarray) -> np.ndarray:
    """`project` on faces of one kind, whose nodes are x `[n, k, 3]`."""
    count = x.shape[1]
    inner = np.full((len(p), 2), 1 / 3 if corners(count) == 3 else 0.0)
    todo = np.arange(len(p))
    for _ in range(NEWTON_STEPS):
        step = _newton_step(p[todo], x[todo], inner[todo])
        inner[todo] = _near(count, inner[todo] + step)
        todo = todo[np.abs(step).max(axis=1) > SMALL_STEP]
        todo = todo[_outside(count, inner[todo]) < BEYOND]
        if not len(todo):
            break
    outside = np.flatnonzero(_outside(count, inner) > 0)
    if len(outside):
        inner[outside] = _on_edges(p[outside], x[outside])
    return inner


def _newton_step(p: np.ndarray, x: np.ndarray, place: np.ndarray) -> np.ndarray:
    """One step, `[n, 2]`: with the curvature of the face where that leads down, else without."""
    count = x.shape[1]

    def at(*derivative: int) -> np.ndarray:
        return np.einsum("nk,nkd->nd", shapes(count, *place.T, *derivative), x)

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.einsum("nd,nd->n", a, b)

    gap, along_r, along_s = at(0, 0) - p, at(1, 0), at(0, 1)
    slope_r, slope_s = dot(gap, along_r), dot(gap, along_s)
    rr, rs, ss = dot(along_r, along_r), dot(along_r, along_s), dot(along_s, along_s)
    if count != 3:
        full = rr + dot(gap, at(2, 0)), rs + dot(gap, at(1, 1)), ss + dot(gap, at(0, 2))
        convex = (full[0] > 0) & (full[0] * full[2] - full[1] ** 2 > 1e-3 * (rr * ss - rs**2))
        rr, rs, ss = (np.where(convex, new, old) for new, old in zip(full, (rr, rs, ss), strict=True))
    determinant = rr * ss - rs**2
    return np.column_stack([rs * slope_s - ss * slope_r, rs * slope_r - rr * slope_s]) / determinant[:, None]


def _outside(count: int, place: np.ndarray) -> np.ndarray:
    """How far places `[n, 2]` are outside the reference face; at most 0 inside."""
    if corners(count) == 4:
        return np.abs(place).max(axis=1) - 1
    return np.maximum(-place.min(axis=1), place.sum(axis=1) - 1)


def _near(count: int, place: np.ndarray) -> np.ndarray:
    """Places held in the neighbourhood of the reference face, beyond which Newton's method has no business."""
    low, high = (-BEYOND, 1 + BEYOND) if corners(count) == 3 else (-1 - BEYOND, 1 + BEYOND)
    return np.clip(place, low, high)


def _on_edges(p: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Closest places on the edges of faces of one kind."""
    count = x.shape[1]
    nodes = np.array(REFERENCE_NODES[count], dtype=float)
    best, least = np.empty((len(p), 2)), np.full(len(p), np.inf)
    for i in range(corners(count)):
        start = nodes[i]
        along = nodes[(i + 1) % corners(count)] - start
        # An edge is a parabola: through its ends and its middle.
        ends = np.einsum("tk,nkd->tnd", shapes(count, *(start + np.array([[0.0], [0.5], [1.0]]) * along).T), x)
        first, second = -3 * ends[0] + 4 * ends[1] - ends[2], 4 * (ends[0] - 2 * ends[1] + ends[2])
        t = np.full(len(p), 0.5)
        for _ in range(NEWTON_STEPS):
            gap = ends[0] + t[:, None] * first + t[:, None] ** 2 * second / 2 - p
            slope = first + t[:, None] * second
            square = np.einsum("nd,nd->n", slope, slope)
            curved = square + np.einsum("nd,nd->n", gap, second)
            step = -np.einsum("nd,nd->n", gap, slope) / np.where(curved > 1e-3 * square, curved, square)
            moved = np.clip(t + step, 0.0, 1.0)
            done = np.abs(moved - t).max() <= SMALL_STEP
            t = moved
            if done:
                break
        gap = ends[0] + t[:, None] * first + t[:, None] ** 2 * second / 2 - p
        distance = np.linalg.norm(gap, axis=1)
        nearer = distance < least
        best[nearer], least[nearer] = (start + t[:, None] * along)[nearer], distance[nearer]
    return best
