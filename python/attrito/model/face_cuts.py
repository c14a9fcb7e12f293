"""Faces of one surface cut at the edges of another's, and Gauss points in the pieces.

Both are laid on the plane through the corners of the face that is cut. There the polygon of its corners is clipped by
the polygon of the other's corners, edge by edge (Sutherland & Hodgman 1974, doi:10.1145/360767.360802), and the piece
is cut into triangles from one of its vertices. Where both meshes are flat and have straight sides, shape functions of
both sides are polynomials on each triangle (of quadrilaterals: of parallelograms), which the points integrate exactly.

A curved face is cut likewise: a point y of the plane belongs to the place (r, s) at which the corners' own linear or
bilinear map G is y, and carries the area |x_r x x_s| / |det dG| dA. Pieces of faces side by side leave nothing out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.model.closest_points import Faces
from attrito.model.face_shapes import corners, shapes, triangle_points

# Part of a face's area below which a triangle of a piece is rounding; pairs of faces cut at a time
SLIVER, BLOCK = 1e-13, 100_000
INVERSION_STEPS = 50


@dataclass(frozen=True)
class CutPoints:
    """Gauss points in the pieces.

    Parameters
    ----------
    face, place : of the surface that is cut, `[n]`, and reference coordinates on it, `[n, 2]`
    area : `[n]`, user area, positive
    other : `[n]`, the other surface's face over the piece
    """

    face: np.ndarray
    place: np.ndarray
    area: np.ndarray
    other: np.ndarray


def cut_points(surface: Faces, other: Faces, farthest: float) -> CutPoints:
    """Gauss points in the faces of a surface, cut at the edges of another's faces that look at them.

    Parameters
    ----------
    surface, other : the two surfaces
    farthest : how far apart, user length, faces may be that cut each other
    """
    face, across = _overlapping(surface, other, farthest)
    degree = 3 if any(block.shape[1] == 8 for block in (*surface.blocks, *other.blocks)) else 2
    found = [CutPoints(np.empty(0, int), np.empty((0, 2)), np.empty(0), np.empty(0, int))]
    for part, nodes in surface.parts(face):
        for begin in range(0, len(part), BLOCK):
            mine = part[begin : begin + BLOCK]
            x = surface.points[nodes[begin : begin + BLOCK]]
            found.append(_cut_kind(x, face[mine], other, across[mine], degree))
    return CutPoints(*(np.concatenate([getattr(one, key) for one in found]) for key in found[0].__dict__))


def _overlapping(surface: Faces, other: Faces, farthest: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of faces whose bounding spheres come as near as `farthest`, and that look at each other."""
    from scipy.spatial import cKDTree

    (centre_a, radius_a), (centre_b, radius_b) = surface.spheres(), other.spheres()
    size = np.floor(np.log2(np.maximum(radius_b, 1e-300)))
    pairs = [(np.empty(0, int), np.empty(0, int))]
    for one in np.unique(size):
        mine = np.flatnonzero(size == one)
        reach = radius_a + radius_b[mine].max() + farthest
        near = cKDTree(centre_b[mine]).query_ball_point(centre_a, reach, return_sorted=False)
        a = np.repeat(np.arange(len(centre_a)), [len(found) for found in near])
        b = mine[np.concatenate([*near, []]).astype(int)]
        keep = np.linalg.norm(centre_a[a] - centre_b[b], axis=1) <= radius_a[a] + radius_b[b] + farthest
        pairs.append((a[keep], b[keep]))
    a, b = (np.concatenate(part) for part in zip(*pairs, strict=True))
    normal_a, normal_b = _normals(surface), _normals(other)
    facing = np.einsum("nd,nd->n", normal_a[a], normal_b[b]) < 0
    return a[facing], b[facing]


def _normals(faces: Faces) -> np.ndarray:
    """Normals `[faces, 3]` of the faces' corners, not of unit length."""
    normals = np.empty((faces.first[-1], 3))
    for part, nodes in faces.parts(np.arange(len(normals))):
        x = faces.points[nodes[:, : corners(nodes.shape[1])]]
        normals[part] = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        if x.shape[1] == 4:
            normals[part] = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    return normals


def _cut_kind(x: np.ndarray, face: np.ndarray, other: Faces, across: np.ndarray, degree: int) -> CutPoints:
    """Points in faces of one kind, with nodes x `[pairs, k, 3]`, each cut by a face of the other surface."""
    count = corners(x.shape[1])
    origin, axes = _plane(x[:, :count])
    outline = np.einsum("nkd,nad->nka", x[:, :count] - origin[:, None], axes)
    size = np.abs(_area(outline))
    clipper = np.empty((len(x), 4, 2))
    for part, nodes in other.parts(across):
        y = other.points[nodes[:, : corners(nodes.shape[1])]] - origin[part][:, None]
        flat = np.einsum("nkd,nad->nka", y, axes[part])
        # The other surface is seen from below; a triangle is a quadrilateral with a corner twice.
        clipper[part] = np.concatenate([flat[:, ::-1], flat[:, :1][:, : 4 - flat.shape[1]]], axis=1)
    piece = _clip(outline, clipper)
    place, weight = triangle_points(degree)
    corner = np.column_stack([1 - place.sum(axis=1), place])
    found = []
    for j in range(1, piece.shape[1] - 1):
        triangle = piece[:, [0, j, j + 1]]
        area = _area(triangle)
        keep = np.flatnonzero(area > SLIVER * size)
        point = np.einsum("gc,ncd->ngd", corner, triangle[keep]).reshape(-1, 2)
        pair = np.repeat(keep, len(weight))
        at, stretch = _invert(outline[pair], point)
        k = x.shape[1]
        along_r = np.einsum("nk,nkd->nd", shapes(k, *at.T, 1, 0), x[pair])
        along_s = np.einsum("nk,nkd->nd", shapes(k, *at.T, 0, 1), x[pair])
        share = np.outer(area[keep], 2 * weight).ravel()
        surface = np.linalg.norm(np.cross(along_r, along_s), axis=1)
        found.append(CutPoints(face[pair], at, share * surface / stretch, across[pair]))
    return CutPoints(*(np.concatenate([getattr(one, key) for one in found]) for key in found[0].__dict__))


def _plane(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origin `[n, 3]` and two directions `[n, 2, 3]` of the plane of corners `[n, 3 or 4, 3]`."""
    first = x[:, 1] - x[:, 0]
    normal = np.cross(first, x[:, 2] - x[:, 0]) if x.shape[1] == 3 else np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    first = first - normal * np.einsum("nd,nd->n", first, normal)[:, None]
    first /= np.linalg.norm(first, axis=1)[:, None]
    return x.mean(axis=1), np.stack([first, np.cross(normal, first)], axis=1)


def _area(polygon: np.ndarray) -> np.ndarray:
    """Signed areas `[n]` of polygons `[n, vertices, 2]`."""
    after = np.roll(polygon, -1, axis=1)
    return (polygon[..., 0] * after[..., 1] - polygon[..., 1] * after[..., 0]).sum(axis=1) / 2


def _clip(polygon: np.ndarray, clipper: np.ndarray) -> np.ndarray:
    """What of convex polygons `[n, vertices, 2]` is inside others `[n, 4, 2]`, all anticlockwise.

    Polygons with fewer vertices than others repeat their last one; what is empty is one point.
    """
    for edge in range(clipper.shape[1]):
        start = clipper[:, edge]
        along = clipper[:, (edge + 1) % clipper.shape[1]] - start
        away = polygon - start[:, None]
        depth = along[:, :1] * away[..., 1] - along[:, 1:] * away[..., 0]
        after, depth_after = np.roll(polygon, -1, axis=1), np.roll(depth, -1, axis=1)
        inside, crosses = depth >= 0, (depth >= 0) != (depth_after >= 0)
        part = np.where(crosses, depth, 0.0) / np.where(crosses, depth - depth_after, 1.0)
        crossing = polygon + part[..., None] * (after - polygon)
        vertices = np.stack([polygon, crossing], axis=2).reshape(len(polygon), -1, 2)
        present = np.stack([inside, crosses], axis=2).reshape(len(polygon), -1)
        count = present.sum(axis=1)
        order = np.argsort(~present, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
        # Behind the last vertex it is repeated.
        order = np.take_along_axis(
            order, np.minimum(np.arange(order.shape[1])[None], np.maximum(count - 1, 0)[:, None]), axis=1
        )
        polygon = np.take_along_axis(vertices, order[..., None], axis=1)
    return polygon


def _invert(outline: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places `[n, 2]` where the (bi)linear map of corners `[n, 3 or 4, 2]` is `point`, and its |det| there."""
    count = outline.shape[1]
    place = np.full(point.shape, 1 / 3 if count == 3 else 0.0)
    for _ in range(INVERSION_STEPS):
        gap = np.einsum("nk,nkd->nd", shapes(count, *place.T), outline) - point
        r = np.einsum("nk,nkd->nd", shapes(count, *place.T, 1, 0), outline)
        s = np.einsum("nk,nkd->nd", shapes(count, *place.T, 0, 1), outline)
        determinant = r[:, 0] * s[:, 1] - r[:, 1] * s[:, 0]
        step = np.column_stack([s[:, 0] * gap[:, 1] - s[:, 1] * gap[:, 0], r[:, 1] * gap[:, 0] - r[:, 0] * gap[:, 1]])
        step /= determinant[:, None]
        place = place + step
        if np.abs(step).max(initial=0.0) <= 1e-14:
            break
    return place, np.abs(determinant)
