"""Contacts of points of one node set's surface with the element faces of another's: whose meshes need not match.

Surfaces are made of the element faces whose nodes all lie in the set and which belong to one element only. Points are
the nodes of set a, Gauss points of its faces, or Gauss points of its faces cut at the edges of set b's. The geometry
is in `face_pairing`, what rows and frames are in `pairs`.
"""

from __future__ import annotations

import numpy as np

from attrito.model.closest_points import Closest, Faces, closest_points
from attrito.model.face_pairing import (
    SurfacePoints,
    cut_gauss_points,
    face_gauss_points,
    find_partners,
    nodal_points,
    pair_with_faces,
)
from attrito.model.face_shapes import corners
from attrito.model.model import Model
from attrito.model.pairing import node_pairs
from attrito.model.pairs import GROUND, Pairs, can_move, check_pairs, node_rows, notes_on_held, set_nodes, some
from attrito.model.surfaces import FACES, set_faces
from attrito.support.errors import Fault, InputError

# Kinds of points, and what they are called
POINTS = {"node": "nodes", "gauss": "Gauss points", "cut": "Gauss points in cut faces"}
# Part of the surface's extent below which a gap is rounding, and of its area that may go missing without a word
COINCIDENT, MISSING = 1e-9, 1e-3


def pair_faces(model: Model, a: str, b: str, tolerance: float, tangents: int, kind: str, file: str, key: str) -> Pairs:
    """Pair points of set `a` with the closest points of set `b`'s faces.

    A pair is made where the closest point is no farther than `tolerance` and the two surfaces look at each other. On
    the ground every point is a contact.

    Parameters
    ----------
    model : a finite-element model
    a, b : names of node sets; `b` may be "ground"
    tolerance : largest distance of a point and the face (user length); not used on the ground
    tangents : 1 (along t1) or 2
    kind : of points, one of `POINTS`; "cut" needs a set b
    file, key : where the job asks for this, for faults: `"job.toml"`, `"contact_set[0]"`

    Raises
    ------
    InputError : unknown, empty or overlapping sets, sets without faces, no face within the tolerance, or no free dof on
        either side of a contact
    """
    ids_a, ids_b = set_nodes(model, a, b, file, key)
    side_a, side_b = (_faces(model, ids) for ids in (ids_a, ids_b))
    _check_surfaces({"a": (a, side_a), "b": (b, side_b)}, file, key)
    points = _points(model, ids_a, side_a, side_b, tolerance, kind)
    if kind == "node":
        check_pairs(ids_a[~points.normal.any(axis=1)], np.empty(0, int), a, file, key)
    if b == GROUND:
        return _on_ground(model, points, a, tangents, file, key)

    whole = face_gauss_points(side_a).area.sum() if kind == "cut" else points.area.sum()
    closest, paired = find_partners(points, side_b, tolerance)
    if not paired.any():
        raise InputError(Fault(file, f"{key}.tolerance", tolerance, _no_face(a, b, side_a, side_b)))
    lost = points.only(~paired)
    points = points.only(paired)
    closest = Closest(*(values[paired] for values in closest.__dict__.values()))
    contacts = pair_with_faces(points, side_b, closest)
    pairs = Pairs(
        node_a=_bearing_most(model, points),
        node_b=model.node_ids[contacts.nearest_b],
        frame=contacts.frame,
        area=points.area,
        position=points.position,
        distance=contacts.distance,
        clearance=contacts.gap,
        tangents=tangents,
        motion_a=contacts.motion_a,
        motion_b=contacts.motion_b,
        nodes=points.nodes,
        shape=points.shape,
        unmatched_a=_bearing_most(model, lost) if kind == "node" else np.empty(0, dtype=np.int64),
        unmatched_b=np.empty(0, dtype=np.int64),
    )
    held = ~(can_move(pairs.motion_a, model) | can_move(pairs.motion_b, model))
    check_pairs(np.empty(0, int), np.unique(pairs.node_a[held]), a, file, key)
    pairs.notes.extend(_notes(pairs, kind, a, b, (side_a, side_b), contacts.face, whole, tolerance))
    pairs.notes.extend(notes_on_held(pairs, model, a, b))
    return pairs


def _check_surfaces(sides: dict[str, tuple[str, Faces]], file: str, key: str) -> None:
    """Raise where sets, by their sides, have no faces; the ground needs none."""
    without = [
        Fault(file, f"{key}.{side}", name, f"a surface: boundary faces of {', '.join(FACES)} elements, all nodes in it")
        for side, (name, faces) in sides.items()
        if not faces.blocks and name != GROUND
    ]
    if without:
        raise InputError(*without)


def _no_face(a: str, b: str, side_a: Faces, side_b: Faces) -> str:
    """What is expected where no face of side b is within the tolerance."""
    expected = f"a distance within which faces of {b} look at those of {a}"
    own = face_gauss_points(side_a)
    nearest = closest_points(own.position, own.normal, side_b, 0.0).distance.min()
    return expected + (f"; the closest are {nearest:.4g} apart" if np.isfinite(nearest) else "; none near by does")


def _faces(model: Model, ids: np.ndarray) -> Faces:
    return Faces(model.coordinates, [node_rows(model, face) for face in set_faces(model.elements, ids)])


def _points(
    model: Model, ids_a: np.ndarray, side_a: Faces, side_b: Faces, tolerance: float, kind: str
) -> SurfacePoints:
    if kind == "node":
        return nodal_points(side_a, node_rows(model, ids_a))
    if kind == "gauss":
        return face_gauss_points(side_a)
    return cut_gauss_points(side_a, side_b, tolerance)


def _bearing_most(model: Model, points: SurfacePoints) -> np.ndarray:
    """Ids of the nodes whose shape functions are largest at points."""
    largest = points.nodes[np.arange(len(points)), points.shape.argmax(axis=1)]
    return np.asarray(model.node_ids[largest], dtype=np.int64)


def _on_ground(model: Model, points: SurfacePoints, a: str, tangents: int, file: str, key: str) -> Pairs:
    pairs = node_pairs(model, points, _bearing_most(model, points), None, np.zeros(len(points)), tangents)
    held = pairs.node_a[~can_move(pairs.motion_a, model)]
    check_pairs(np.empty(0, dtype=np.int64), np.unique(held), a, file, key)
    pairs.notes.extend(notes_on_held(pairs, model, a, GROUND))
    return pairs


def _notes(
    pairs: Pairs, kind: str, a: str, b: str, sides: tuple[Faces, Faces], face: np.ndarray, whole: float, reach: float
) -> list[str]:
    """What was paired, how far apart, and what found no partner.

    `face`: of side b, of each contact; `whole`: area of side a; `reach`: the tolerance.
    """
    share, total = pairs.area.sum() / whole, sides[1].first[-1]
    extent = np.linalg.norm(np.ptp(pairs.position, axis=0))
    apart = {"gaps": pairs.clearance.max(), "overlaps": -pairs.clearance.min()}
    apart_words = [f"{name} up to {size:.3g}" for name, size in apart.items() if size > COINCIDENT * extent]
    notes = [
        f"{len(pairs.area)} {POINTS[kind]} of {a} on {len(np.unique(face))} of {total} faces of {b}: area"
        f" {pairs.area.sum():.5g}, {100 * share:.4g} % of {a}; {', '.join(apart_words) or 'no gaps or overlaps'}"
    ]
    lost = np.unique(pairs.unmatched_a)
    if len(lost):
        notes.append(
            f"{len(lost)} nodes of {a} found no face of {b}: {some(lost)}; {100 * (1 - share):.3g} % of the area"
        )
    elif 1 - share > MISSING:
        notes.append(f"{100 * (1 - share):.3g} % of the area of {a} found no face of {b}")
    empty = np.setdiff1d(np.arange(total), face)
    opposite = _opposite(*sides, empty, reach) if len(empty) and kind != "cut" else 0
    if opposite:
        notes.append(
            f"{opposite} faces of {b} opposite {a} hold no contact: let the side with the smaller faces be a, or take"
            ' points = "cut"'
        )
    return notes


def _opposite(side_a: Faces, side_b: Faces, which: np.ndarray, reach: float) -> int:
    """How many of some faces of side b have side a within `reach` of their middle."""
    middle = np.zeros((len(which), 2))
    for part, nodes in side_b.parts(which):
        middle[part] = 1 / 3 if corners(nodes.shape[1]) == 3 else 0.0
    position, along_r, along_s = side_b.at(which, middle)
    closest = closest_points(position, np.cross(along_r, along_s), side_a, reach)
    return int(np.count_nonzero(closest.distance <= reach))
