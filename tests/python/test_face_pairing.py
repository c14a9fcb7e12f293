"""Contact of points with faces of other meshes: partners, areas, gaps, resultants, rows of B, faults."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from unlike_meshes import TURN, cylinder, flat, rigid_motions, unlike_joint

from attrito.model.closest_points import Faces, closest_points
from attrito.model.face_pairing import face_gauss_points
from attrito.model.face_sets import pair_faces
from attrito.model.pairing import pair_sets
from attrito.model.pairs import contact_rows, node_rows
from attrito.model.pressure import pressure_forces
from attrito.model.surfaces import set_faces
from attrito.support.errors import InputError

JOB = ("job.toml", "contact_set[0]")
POINTS = ("node", "gauss", "cut")
KINDS = [("C3D4", "C3D8"), ("C3D8", "C3D4"), ("C3D10", "C3D20"), ("C3D20", "C3D10"), ("C3D10", "C3D10")]
# Mesh size factors 1.5 and 3
COUNTS = [(3, 2), (3, 1), (2, 3), (1, 3)]


def faces_of(model, name):
    return [node_rows(model, faces) for faces in set_faces(model.elements, model.node_sets[name])]


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("shape", (flat, cylinder))
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kinds", KINDS)
def test_a_rigid_motion_makes_no_relative_displacement_over_a_gap_either(kinds, counts, shape, points):
    for gap in (0.0, 0.07, -0.03):
        model = unlike_joint(kinds, counts, shape, gap, TURN, seed=3)
        rows = contact_rows(pair_faces(model, "top", "bottom", 0.4, 2, points, *JOB), model)
        assert rows.shape[0] > 0
        # Motions of unit size on bodies of unit size.
        assert np.abs(rows @ rigid_motions(model)).max() < 1e-12


def test_without_the_faces_rotation_a_gap_would_resist_a_rotation():
    model = unlike_joint(("C3D10", "C3D20"), (3, 2), flat, 0.07)
    pairs = pair_faces(model, "top", "bottom", 0.4, 2, "gauss", *JOB)
    rigid = rigid_motions(model)
    # Coefficients of the face's motion alone: those without the lever arm.
    together = unlike_joint(("C3D10", "C3D20"), (3, 2), flat, 0.0)
    without = contact_rows(pair_faces(together, "top", "bottom", 0.4, 2, "gauss", *JOB), model)
    assert np.abs(without @ rigid).max() == pytest.approx(0.07)
    assert np.abs(contact_rows(pairs, model) @ rigid).max() < 1e-12


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("shape", (flat, cylinder))
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kinds", [("C3D10", "C3D20"), ("C3D20", "C3D10")])
def test_pressure_and_shear_have_opposite_forces_and_moments_on_both_sides(kinds, counts, shape, points):
    for gap in (0.0, 0.05):
        model = unlike_joint(kinds, counts, shape, gap, TURN)
        pairs = pair_faces(model, "top", "bottom", 0.4, 2, points, *JOB)
        rows, rigid = contact_rows(pairs, model), rigid_motions(model)
        lower = np.isin(model.dof_node, model.node_sets["top"])
        for traction in np.eye(3):
            force = -rows.T @ np.outer(pairs.area, traction).ravel()
            resultants = [rigid[side].T @ force[side] for side in (lower, ~lower)]
            assert np.abs(resultants[0]).max() > 0.1
            assert resultants[0] == pytest.approx(-resultants[1], abs=1e-10)
            # They are those of the tractions at the contacts.
            exact = -(pairs.area[:, None] * np.einsum("r,nrd->nd", traction, pairs.frame))
            assert resultants[0][:3] == pytest.approx(exact.sum(axis=0), abs=1e-10)
            assert resultants[0][3:] == pytest.approx(np.cross(pairs.position, exact).sum(axis=0), abs=1e-10)


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kinds", KINDS)
def test_a_pressure_on_flat_faces_has_the_exact_force_and_moment(kinds, counts, points):
    model = unlike_joint(kinds, counts, flat, 0.02, TURN)
    pairs = pair_faces(model, "top", "bottom", 0.4, 2, points, *JOB)
    assert (pairs.area > 0).all()
    assert pairs.area.sum() == pytest.approx(1.0, rel=1e-12)
    force = -(contact_rows(pairs, model).T @ np.outer(pairs.area, [0.0, 0.0, 1.0]).ravel())
    push, lower = TURN @ [0, 0, -1], np.isin(model.dof_node, model.node_sets["top"])
    moment = np.cross(TURN @ [0.5, 0.5, 1.0], push)
    rigid = rigid_motions(model)
    assert rigid[lower].T @ force[lower] == pytest.approx(np.concatenate([push, moment]), abs=1e-10)
    assert rigid[~lower].T @ force[~lower] == pytest.approx(-np.concatenate([push, moment]), abs=1e-10)


@pytest.mark.parametrize("counts", [*COUNTS, (4, 5)])
@pytest.mark.parametrize(
    "kinds", [(a, b) for a in ("C3D4", "C3D8", "C3D10", "C3D20") for b in ("C3D8", "C3D10", "C3D20")]
)
def test_a_pressure_at_gauss_points_of_cut_faces_is_each_node_s_consistent_force_on_both_sides(kinds, counts):
    model = unlike_joint(kinds, counts, flat, 0.0, TURN)
    pairs = pair_faces(model, "top", "bottom", 1e-6, 2, "cut", *JOB)
    force = -(contact_rows(pairs, model).T @ np.outer(pairs.area, [0.0, 0.0, 1.0]).ravel()).reshape(-1, 3)
    exact = sum(
        pressure_forces(model.coordinates, faces, np.ones(len(faces)))
        for name in ("top", "bottom")
        for faces in faces_of(model, name)
    )
    assert force == pytest.approx(exact[node_rows(model, model.dof_node[::3])], abs=1e-13)


@pytest.mark.parametrize("kind", ("C3D4", "C3D8", "C3D10", "C3D20"))
@pytest.mark.parametrize("shape", (flat, cylinder))
def test_nodes_on_faces_of_the_same_mesh_are_the_node_pairs(kind, shape):
    model = unlike_joint((kind, kind), (3, 3), shape, 0.0, TURN, seed=1)
    nodes = pair_sets(model, "top", "bottom", 1e-6, 2, *JOB)
    faces = pair_faces(model, "top", "bottom", 1e-6, 2, "node", *JOB)
    for name in ("node_a", "node_b"):
        assert (getattr(nodes, name) == getattr(faces, name)).all()
    for name in ("frame", "area", "position"):
        assert getattr(nodes, name) == pytest.approx(getattr(faces, name), abs=1e-14)
    difference = contact_rows(nodes, model) - contact_rows(faces, model)
    assert np.abs(difference.toarray()).max() < 1e-13


@pytest.mark.parametrize("points", POINTS)
def test_the_gap_of_concentric_cylinders_converges_to_the_difference_of_their_radii(points):
    errors = []
    for counts in ((4, 6), (8, 12)):
        pairs = pair_faces(
            unlike_joint(("C3D10", "C3D20"), counts, cylinder, 0.05), "top", "bottom", 0.2, 2, points, *JOB
        )
        assert pairs.distance == pytest.approx(np.abs(pairs.clearance), rel=1e-3)
        errors.append(np.abs(pairs.clearance - 0.05).max())
    # Chords of quadratic edges: the error falls with at least the third power.
    assert errors[1] < errors[0] / 8 < 1e-4


@pytest.mark.parametrize("points", ("gauss", "cut"))
def test_the_area_of_a_cylinder_is_that_of_its_curved_faces(points):
    model = unlike_joint(("C3D20", "C3D10"), (4, 6), cylinder)
    pairs = pair_faces(model, "top", "bottom", 0.01, 2, points, *JOB)
    assert (pairs.area > 0).all()
    # Four parabolas through three points of the circle each.
    chord, rise = 2 * np.sin(np.pi / 16), 1 - np.cos(np.pi / 16)
    t, weight = np.polynomial.legendre.leggauss(20)
    arc = 4 * weight @ np.hypot(chord / 2, 2 * rise * t)
    assert arc == pytest.approx(np.pi / 2, rel=3e-5)
    assert pairs.area.sum() == pytest.approx(arc, rel=2e-5 if points == "gauss" else 1e-6)


def test_the_closest_points_are_those_of_a_search_over_all_faces():
    rng = np.random.default_rng(0)
    bump = lambda points: points + 0.1 * np.sin(3 * points[:, [1]] + 2 * points[:, [0]]) * [0, 0, 1]  # noqa: E731
    model = unlike_joint(("C3D10", "C3D20"), (2, 3), bump)
    for name in ("top", "bottom"):
        faces = Faces(model.coordinates, faces_of(model, name))
        points = rng.uniform([0, 0, 0.8], [1, 1, 1.3], (300, 3))
        up = np.tile([0.0, 0.0, -1.0 if name == "top" else 1.0], (300, 1))
        found = closest_points(points, up, faces)
        grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 81)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
        least = np.full(300, np.inf)
        for face in range(faces.first[-1]):
            triangle = faces.first[1] > face and faces.blocks[0].shape[1] == 6
            place = grid[grid.sum(axis=1) <= 1] if triangle else 2 * grid - 1
            x = faces.at(np.full(len(place), face), place)[0]
            least = np.minimum(least, np.linalg.norm(points[:, None] - x, axis=2).min(axis=1))
        # A grid of 1/80 of a face is never nearer, and nearly as near.
        assert (found.distance <= least + 1e-12).all()
        assert (found.distance >= least - 0.01).all()
        assert np.linalg.norm(found.position - points, axis=1) == pytest.approx(found.distance)


def test_faces_that_look_away_are_no_partners():
    # A plate thinner than the tolerance, all of whose surface is in the set.
    plate = synthetic.block("C3D8", (3, 3, 1), (1.0, 1.0, 0.05), shape=lambda points: points + np.array([0, 0, 1.0]))
    body = synthetic.block("C3D8", (2, 2, 1))
    sets = {
        "top": lambda points, owner: (owner == 0) & (np.abs(points[:, 2] - 1) < 1e-9),
        "plate": lambda points, owner: owner == 1,
    }
    model = synthetic.assemble([body, plate], sets)
    for points in POINTS:
        pairs = pair_faces(model, "top", "plate", 0.2, 2, points, *JOB)
        assert pairs.area.sum() == pytest.approx(1.0)
        assert pairs.clearance == pytest.approx(np.zeros(len(pairs.area)), abs=1e-12)


def test_points_without_a_partner_gaps_and_overlaps_are_reported():
    model = unlike_joint(("C3D8", "C3D8"), (4, 3))
    upper = np.arange(len(model.coordinates)) >= 50
    model.coordinates[upper, 0] += 0.5
    model.coordinates[upper, 2] += 0.02 * (model.coordinates[upper, 0] - 1.0)
    notes = pair_faces(model, "top", "bottom", 0.05, 2, "node", *JOB).notes
    assert notes[0].startswith("15 nodes of top on ")
    assert "62.5 % of top; overlaps up to 0.01" in notes[0]
    assert any(note.startswith("10 nodes of top found no face of bottom: nodes ") for note in notes)
    notes = pair_faces(model, "top", "bottom", 0.05, 2, "cut", *JOB).notes
    assert "50 % of top" in notes[0] and "50 % of the area of top found no face of bottom" in notes[1]


def test_faces_of_b_that_hold_no_contact_are_reported():
    notes = pair_faces(unlike_joint(("C3D8", "C3D8"), (1, 6)), "top", "bottom", 1e-6, 2, "gauss", *JOB).notes
    assert notes[-1].startswith("32 faces of bottom opposite top hold no contact: let the side with the smaller faces")
    assert not any(
        "opposite" in note
        for note in pair_faces(unlike_joint(("C3D8", "C3D8"), (1, 6)), "top", "bottom", 1e-6, 2, "cut", *JOB).notes
    )


def test_gauss_points_meet_the_ground():
    model = unlike_joint(("C3D20", "C3D20"), (2, 2), turn=TURN)
    pairs = pair_faces(model, "top", "ground", 0.0, 2, "gauss", *JOB)
    rows = contact_rows(pairs, model)
    assert (pairs.node_b == -1).all() and len(pairs.area) == 16
    assert rows @ rigid_motions(model)[:, :3] == pytest.approx(pairs.frame.reshape(-1, 3), abs=1e-12)


def test_one_tangent_is_the_first_of_two():
    model = unlike_joint(("C3D10", "C3D8"), (2, 3))
    one, two = (
        contact_rows(pair_faces(model, "top", "bottom", 1e-6, n, "node", *JOB), model).toarray() for n in (1, 2)
    )
    assert one.reshape(25, 2, -1) == pytest.approx(two.reshape(25, 3, -1)[:, [0, 2]])


def test_held_nodes_of_a_face_lose_their_coefficients_and_are_reported():
    held = lambda points: (points[:, 2] > 0.9) & (points[:, 0] < 1e-9)  # noqa: E731
    model = unlike_joint(("C3D8", "C3D8"), (4, 3), held=held)
    whole = unlike_joint(("C3D8", "C3D8"), (4, 3))
    pairs = pair_faces(model, "top", "bottom", 1e-6, 2, "gauss", *JOB)
    kept = np.isin(whole.dof_node, model.dof_node)
    full = contact_rows(pair_faces(whole, "top", "bottom", 1e-6, 2, "gauss", *JOB), whole).toarray()
    assert contact_rows(pairs, model).toarray() == pytest.approx(full[:, kept])
    assert any(note.startswith("4 paired nodes of bottom have no free dof and stand still") for note in pairs.notes)


def test_contacts_held_on_both_sides_are_a_fault():
    model = unlike_joint(("C3D8", "C3D8"), (4, 3), held=lambda points: points[:, 0] < 0.34)
    with pytest.raises(InputError, match=r"contact_set\[0\]\.a = 'top \(held: nodes .*free dof on at least one side"):
        pair_faces(model, "top", "bottom", 1e-6, 2, "gauss", *JOB)


def test_no_face_within_the_tolerance_is_a_fault_that_names_the_smallest_distance():
    model = unlike_joint(("C3D8", "C3D8"), (2, 3), gap=0.125)
    for points in POINTS:
        with pytest.raises(InputError) as caught:
            pair_faces(model, "top", "bottom", 0.01, 2, points, *JOB)
        expected = "a distance within which faces of bottom look at those of top; the closest are 0.125 apart"
        assert str(caught.value) == f"job.toml: contact_set[0].tolerance = 0.01: expected {expected}"


def test_sets_that_look_the_same_way_are_a_fault():
    model = unlike_joint(("C3D8", "C3D8"), (2, 3), lambda points: points * [1, 1, 0.5])
    ids = model.node_ids[np.abs(model.coordinates[:, 2] - 1.0) < 1e-9]
    model.node_sets["bottom"] = np.sort(ids)
    with pytest.raises(InputError, match="; none near by does"):
        pair_faces(model, "top", "bottom", 1.0, 2, "node", *JOB)


def test_sets_without_faces_are_faults_of_both_sides():
    model = unlike_joint(("C3D8", "C3D8"), (2, 3))
    model.node_sets = {name: nodes[:2] for name, nodes in model.node_sets.items()}
    with pytest.raises(InputError) as caught:
        pair_faces(model, "top", "bottom", 1e-6, 2, "gauss", *JOB)
    assert [fault.key for fault in caught.value.faults] == ["contact_set[0].a", "contact_set[0].b"]
    assert "expected a surface: boundary faces of C3D4, C3D8, C3D10, C3D20 elements, all nodes in it" in str(
        caught.value
    )


def test_a_node_outside_all_faces_of_its_set_is_a_fault():
    model = unlike_joint(("C3D8", "C3D8"), (2, 3))
    below = model.node_ids[np.argmin(model.coordinates[:, 2])]
    model.node_sets["top"] = np.sort(np.append(model.node_sets["top"], below))
    with pytest.raises(InputError, match=rf"top \(without: nodes {below}\)'.*a surface"):
        pair_faces(model, "top", "bottom", 1e-6, 2, "node", *JOB)


def test_gauss_points_integrate_the_area_of_faces_with_straight_sides():
    model = unlike_joint(("C3D10", "C3D20"), (2, 3), turn=TURN)
    for name in ("top", "bottom"):
        points = face_gauss_points(Faces(model.coordinates, faces_of(model, name)))
        assert points.area.sum() == pytest.approx(1.0)
        assert points.shape.sum(axis=1) == pytest.approx(np.ones(len(points)))
