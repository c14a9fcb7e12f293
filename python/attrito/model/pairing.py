"""Node-to-node contact pairs of two node sets: who meets whom, in which frame, with how much area.

The surface of set a is made of the element faces whose nodes all lie in a and which belong to one element only; what
rows and frames are is in `pairs`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.closest_points import Faces
from attrito.model.face_pairing import SurfacePoints, motion_of, nodal_points
from attrito.model.model import Model
from attrito.model.pairs import GROUND, Pairs, can_move, check_pairs, node_rows, notes_on_held, set_nodes, some
from attrito.model.surfaces import set_faces, tangent_frames
from attrito.support.errors import Fault, InputError


def pair_sets(model: Model, a: str, b: str, tolerance: float, tangents: int, file: str, key: str) -> Pairs:
    """Pair the nodes of set `a` with those of set `b`, each node at most once; ascending in the nodes of `a`.

    Two nodes are a pair if each is the other's nearest and they are no farther apart than `tolerance`. On the ground
    every node of `a` is a contact.

    Parameters
    ----------
    model : a finite-element model
    a, b : names of node sets; `b` may be "ground"
    tolerance : largest distance of a pair (user length); not used on the ground
    tangents : 1 (along t1) or 2
    file, key : where the job asks for this, for faults: `"job.toml"`, `"contact_set[0]"`

    Raises
    ------
    InputError : unknown, empty or overlapping sets, no pair within the tolerance, no surface under a pair, or no free
        dof on either side of a pair
    """
    ids_a, ids_b = set_nodes(model, a, b, file, key)
    rows_a, rows_b = node_rows(model, ids_a), node_rows(model, ids_b)
    if b == GROUND:
        index_a, index_b, distance = np.arange(len(ids_a)), None, np.zeros(len(ids_a))
    else:
        index_a, index_b, distance = _mutual_nearest(model.coordinates[rows_a], model.coordinates[rows_b])
        near = distance <= tolerance
        if not near.any():
            expected = f"a distance that pairs nodes of {a} and {b}; the closest are {distance.min():.4g} apart"
            raise InputError(Fault(file, f"{key}.tolerance", tolerance, expected))
        index_a, index_b, distance = index_a[near], index_b[near], distance[near]

    faces = Faces(model.coordinates, [node_rows(model, face) for face in set_faces(model.elements, ids_a)])
    every = nodal_points(faces, rows_a)
    points = every.only(index_a)
    found = node_pairs(model, points, ids_a[index_a], None if index_b is None else rows_b[index_b], distance, tangents)
    held = ~(can_move(found.motion_a, model) | can_move(found.motion_b, model))
    bare = ~points.normal.any(axis=1)
    check_pairs(found.node_a[bare], found.node_a[held & ~bare], a, file, key)
    pairs = replace(
        found,
        unmatched_a=np.setdiff1d(ids_a, found.node_a),
        unmatched_b=ids_b[~np.isin(ids_b, found.node_b)],
    )
    pairs.notes.extend(_notes(pairs, a, b, every.area.sum()))
    pairs.notes.extend(notes_on_held(pairs, model, a, b))
    return pairs


def node_pairs(
    model: Model,
    points: SurfacePoints,
    node_a: np.ndarray,
    partners: np.ndarray | None,
    distance: np.ndarray,
    tangents: int,
) -> Pairs:
    """Contacts at points of a surface with a node each, or with the ground.

    Parameters
    ----------
    model : a finite-element model
    points : nc points of the surface
    node_a : int64 `[nc]`, ids of the nodes that bear most at them
    partners : `[nc]`, rows of the model's nodes; None: the ground
    distance : `[nc]`, from a point to its partner (user length)
    tangents : 1 or 2
    """
    frame, none = tangent_frames(points.normal), np.empty(0, dtype=np.int64)
    motion_a = motion_of(points.nodes, points.shape, frame, len(model.node_ids))
    if partners is None:
        node_b = np.full(len(node_a), -1, dtype=np.int64)
        clearance = np.full(len(node_a), np.nan)
        motion_b = csr_matrix(motion_a.shape)
    else:
        node_b = np.asarray(model.node_ids[partners], dtype=np.int64)
        clearance = np.einsum("nd,nd->n", points.normal, model.coordinates[partners] - points.position)
        motion_b = -motion_of(partners[:, None], points.shape, frame, len(model.node_ids))
    return Pairs(
        node_a=node_a,
        node_b=node_b,
        frame=frame,
        area=points.area,
        position=points.position,
        distance=distance,
        clearance=clearance,
        tangents=tangents,
        motion_a=motion_a,
        motion_b=motion_b,
        nodes=points.nodes,
        shape=points.shape,
        unmatched_a=none,
        unmatched_b=none,
    )


def _mutual_nearest(points_a: np.ndarray, points_b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices into both clouds of the pairs that are each other's nearest, and their distances."""
    from scipy.spatial import cKDTree

    distance, to_b = cKDTree(points_b).query(points_a)
    _, to_a = cKDTree(points_a).query(points_b)
    index_a = np.flatnonzero(to_a[to_b] == np.arange(len(points_a)))
    return index_a, to_b[index_a], distance[index_a]


def _notes(pairs: Pairs, a: str, b: str, total_area: float) -> list[str]:
    notes = []
    if len(pairs.unmatched_a):
        share = 100 * (1 - pairs.area.sum() / total_area)
        nodes = pairs.unmatched_a
        notes.append(f"{len(nodes)} nodes of {a} found no partner in {b}: {some(nodes)}; {share:.3g} % of the area")
    if len(pairs.unmatched_b):
        notes.append(f"{len(pairs.unmatched_b)} nodes of {b} found no partner in {a}: {some(pairs.unmatched_b)}")
    return notes
