r"""Contacts of points of one surface with the faces of another, whose meshes need not match.

A point x_a of side a (a node, or a Gauss point of a face) moves by q_a = sum_i N_i q_i. Its partner is the closest
point x_b of side b's faces (`closest_points`), which moves by q_b = sum_j N_j q_j, while the face there turns by

    omega = sum_alpha [-(n x g^alpha) n + (n / 2) (n x g^alpha)] . u_alpha,   u_alpha = sum_j N_j,alpha q_j

(g^alpha the dual base of x_r, x_s, n the face's normal): its normal turns with its two tangents, about the normal it
turns by half the curl. The relative displacement at x_a is that of a against b carried along to x_a,

    d = q_a - q_b - omega x l,   l = x_a - x_b,

of which a contact's rows are the components t_1, t_2, n of side a's frame there, n from a into b. A rigid rotation w
turns every face by w: d vanishes over a gap, too. Hence a force in d acts on both sides with the same resultant and
moment. The gap is n . (x_b - x_a), negative where the bodies overlap.

Nothing here knows of jobs or of node sets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, vstack

from attrito.model.closest_points import Closest, Faces, closest_points, project
from attrito.model.face_cuts import cut_points
from attrito.model.face_shapes import gauss_points, shapes
from attrito.model.surfaces import nodal_surface, tangent_frames

# Coefficients that are rounding, and pairs of rows made at a time
ROUNDING, BLOCK = 1e-15, 50_000
# A cut point counts where its own face of side b is nearest, but for this part of the face's size
OWN_FACE = 0.1


@dataclass(frozen=True)
class SurfacePoints:
    """Points of a surface at which contacts are made.

    Parameters
    ----------
    nodes, shape : `[n, k]`, rows of the surface's points, -1: none, and the shape functions there
    position, normal : `[n, 3]`, unit normals; a normal of a node without a face, or on a sharp fold, is zero
    area : `[n]`, positive
    other : `[n]`, face of the other surface that it was made for; -1: any
    """

    nodes: np.ndarray
    shape: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    other: np.ndarray

    def __len__(self) -> int:
        return len(self.area)

    def only(self, which: np.ndarray) -> SurfacePoints:
        """Some of the points."""
        return SurfacePoints(*(values[which] for values in self.__dict__.values()))


def nodal_points(faces: Faces, nodes: np.ndarray) -> SurfacePoints:
    """Nodes (rows of the points) with their tributary areas and directions (`nodal_surface`)."""
    area, direction = nodal_surface(faces.points, list(faces.blocks))
    length = np.linalg.norm(direction[nodes], axis=1)
    bare = length <= 1e-9 * area[nodes]
    normal = np.where(bare[:, None], 0.0, direction[nodes] / np.where(bare, 1.0, length)[:, None])
    one = np.ones((len(nodes), 1))
    return SurfacePoints(nodes[:, None], one, faces.points[nodes], normal, area[nodes], np.full(len(nodes), -1))


def face_gauss_points(faces: Faces) -> SurfacePoints:
    """Gauss points of every face, 3 on triangles and 2 x 2 on quadrilaterals, area the weight times |x_r x x_s|."""
    face, place, weight = [np.empty(0, int)], [np.empty((0, 2))], [np.empty(0)]
    for first, block in zip(faces.first, faces.blocks, strict=False):
        points, weights = gauss_points(block.shape[1])
        face.append(np.repeat(first + np.arange(len(block)), len(weights)))
        place.append(np.tile(points, (len(block), 1)))
        weight.append(np.tile(weights, len(block)))
    found = _at(faces, np.concatenate(face), np.concatenate(place))
    return SurfacePoints(*found[:4], np.concatenate(weight) * found[4], np.full(len(found[4]), -1))


def cut_gauss_points(faces: Faces, other: Faces, farthest: float) -> SurfacePoints:
    """Gauss points in the faces cut at the edges of the other surface's (`face_cuts`), no farther apart."""
    cut = cut_points(faces, other, farthest)
    return SurfacePoints(*_at(faces, cut.face, cut.place)[:4], cut.area, cut.other)


def _at(faces: Faces, face: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, ...]:
    """Nodes, shape functions, positions, normals and |x_r x x_s| at places of faces."""
    widest = max((block.shape[1] for block in faces.blocks), default=1)
    nodes, shape = np.full((len(face), widest), -1), np.zeros((len(face), widest))
    for part, own in faces.parts(face):
        nodes[part, : own.shape[1]] = own
        shape[part, : own.shape[1]] = shapes(own.shape[1], *place[part].T)
    position, along_r, along_s = faces.at(face, place)
    normal = np.cross(along_r, along_s)
    length = np.linalg.norm(normal, axis=1)
    return nodes, shape, position, normal / np.where(length > 0, length, 1.0)[:, None], length


@dataclass(frozen=True)
class FaceContacts:
    """Contacts of points of side a with faces of side b.

    Parameters
    ----------
    points : of side a
    frame : `[nc, 3, 3]`, rows t1, t2, n
    gap : `[nc]`, n . (x_b - x_a), user length; negative: the bodies overlap
    distance : `[nc]`, |x_b - x_a|
    face : `[nc]`, side b's
    nearest_b : `[nc]`, the node of that face with the largest shape function, a row of the points
    motion_a, motion_b : csr `[3 nc, 3 N]`, rows t1, t2, n of each contact on x, y, z of each node; d is their sum
    """

    points: SurfacePoints
    frame: np.ndarray
    gap: np.ndarray
    distance: np.ndarray
    face: np.ndarray
    nearest_b: np.ndarray
    motion_a: csr_matrix
    motion_b: csr_matrix


def find_partners(points: SurfacePoints, faces: Faces, tolerance: float) -> tuple[Closest, np.ndarray]:
    """Closest points of the faces, and which points `[n]` have a partner no farther than `tolerance`."""
    closest = closest_points(points.position, points.normal, faces, tolerance)
    paired = closest.distance <= tolerance
    made = np.flatnonzero(paired & (points.other >= 0) & (points.other != closest.face))
    if len(made):
        # Points in pieces under a face that others hide would count the same area again.
        own = project_distance(points.only(made), faces)
        radii = faces.spheres()[1][points.other[made]]
        paired[made] = own <= closest.distance[made] + OWN_FACE * radii
    return closest, paired


def project_distance(points: SurfacePoints, faces: Faces) -> np.ndarray:
    """Distance `[n]` of each point from the face it was made for."""
    position = faces.at(points.other, project(points.position, faces, points.other))[0]
    return np.linalg.norm(position - points.position, axis=1)


def pair_with_faces(points: SurfacePoints, faces: Faces, closest: Closest) -> FaceContacts:
    """Contacts of points with their closest points on faces, all of which have one.

    Points' nodes and faces are rows of the same array, `faces.points`.
    """
    frame = tangent_frames(points.normal)
    lever = points.position - closest.position
    nearest = np.empty(len(points), dtype=np.int64)
    order, blocks = [np.empty(0, int)], [csr_matrix((0, 3 * len(faces.points)))]
    for part, nodes in faces.parts(closest.face):
        for begin in range(0, len(part), BLOCK):
            mine, own = part[begin : begin + BLOCK], nodes[begin : begin + BLOCK]
            place = closest.place[mine]
            nearest[mine] = own[np.arange(len(own)), shapes(own.shape[1], *place.T).argmax(axis=1)]
            coefficients = _carried_along(faces.points[own], place, frame[mine], lever[mine])
            blocks.append(_rows(own, -coefficients, len(faces.points)))
            order.append(mine)
    place_of = np.argsort(np.concatenate(order))
    motion_b = csr_matrix(vstack(blocks))[(3 * place_of[:, None] + np.arange(3)).ravel()]
    return FaceContacts(
        points=points,
        frame=frame,
        gap=-np.einsum("nd,nd->n", frame[:, 2], lever),
        distance=closest.distance,
        face=closest.face,
        nearest_b=nearest,
        motion_a=motion_of(points.nodes, points.shape, frame, len(faces.points)),
        motion_b=motion_b,
    )


def motion_of(nodes: np.ndarray, shape: np.ndarray, frame: np.ndarray, count: int) -> csr_matrix:
    """Motion of points in their frames, csr `[3 n, 3 count]` on the motion of `count` nodes.

    Parameters
    ----------
    nodes, shape : `[n, k]`, rows of the nodes (-1: none) and shape functions of the points
    frame : `[n, 3, 3]`
    count : number of all nodes
    """
    parts = np.array_split(np.arange(len(nodes)), -(-max(len(nodes), 1) // BLOCK))
    blocks = [_rows(nodes[i], shape[i][:, None, :, None] * frame[i][:, :, None, :], count) for i in parts]
    return csr_matrix(vstack(blocks))


def _carried_along(x: np.ndarray, place: np.ndarray, frame: np.ndarray, lever: np.ndarray) -> np.ndarray:
    """Motion of a point that faces carry along, as coefficients of their nodes' motion.

    Parameters
    ----------
    x : nodes of the faces, `[n, k, 3]`
    place : of the closest points, `[n, 2]`
    frame : directions whose components are asked for, `[n, 3, 3]`
    lever : from the closest point to the one carried along, `[n, 3]`

    Returns
    -------
    `[n, direction, k, axis]`
    """
    count = x.shape[1]
    along = np.stack([shapes(count, *place.T, 1, 0), shapes(count, *place.T, 0, 1)], axis=1)
    base = along @ x
    normal = np.cross(base[:, 0], base[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    dual = np.linalg.solve(base @ base.transpose(0, 2, 1), base)
    # omega . m, m = l x e, of each direction e: (n x g^alpha) . m turns the normal, n . m turns about it.
    moment = np.cross(lever[:, None, :], frame)
    turned = np.cross(normal[:, None, :], dual)
    tilt = -np.einsum("ned,nad,nc->neac", moment, turned, normal)
    about = np.einsum("ned,nd,nac->neac", moment, normal, turned) / 2
    shape = shapes(count, *place.T)
    return shape[:, None, :, None] * frame[:, :, None, :] + np.einsum("nak,neac->nekc", along, tilt + about)


def _rows(nodes: np.ndarray, coefficients: np.ndarray, count: int) -> csr_matrix:
    """Coefficients `[n, direction, k, axis]` of nodes `[n, k]` (-1: none) as rows on the axes of `count` nodes."""
    columns = np.broadcast_to(3 * nodes[:, None, :, None] + np.arange(3), coefficients.shape)
    keep = (np.abs(coefficients) > ROUNDING) & (nodes >= 0)[:, None, :, None]
    length = keep.sum(axis=(2, 3)).ravel()
    offsets = np.concatenate([[0], np.cumsum(length)])
    return csr_matrix((coefficients[keep], columns[keep], offsets), shape=(len(length), 3 * count))
