"""Patch test of contact on faces: a uniform stress goes through meshes that do not match."""

from __future__ import annotations

import numpy as np
import patch_test
import pytest
from patch_test import STRESSES, patch
from solids import LAME, SHEAR, stiffness, stress
from unlike_meshes import TURN, flat, unlike_joint

POINTS = ("node", "gauss", "cut")
KINDS = [("C3D10", "C3D20"), ("C3D20", "C3D10"), ("C3D10", "C3D10"), ("C3D20", "C3D20"), ("C3D8", "C3D4")]
COUNTS = [(3, 2), (2, 3), (3, 1), (1, 3)]


@pytest.mark.parametrize("name", STRESSES)
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kinds", KINDS)
def test_cut_faces_pass_a_uniform_stress_exactly(kinds, counts, name):
    found = patch(kinds, counts, "flat", "cut", STRESSES[name], turn=TURN)
    assert found["largest"] < 1e-10
    assert found["resultants"] < 1e-10


def test_cut_faces_pass_a_pressure_exactly_over_a_gap():
    for counts in COUNTS:
        assert patch(("C3D10", "C3D20"), counts, "flat", "cut", STRESSES["pressure"], 0.05, TURN)["largest"] < 1e-10


@pytest.mark.parametrize("shape", ("flat", "cylinder"))
@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("name", STRESSES)
@pytest.mark.parametrize("counts", COUNTS)
def test_resultants_of_the_two_sides_cancel_for_every_choice(counts, name, points, shape):
    for gap in (0.0, 0.05):
        assert patch(("C3D10", "C3D20"), counts, shape, points, STRESSES[name], gap, TURN)["resultants"] < 1e-10


@pytest.mark.parametrize("points", POINTS)
def test_the_test_would_see_a_stress_that_is_wrong(points):
    # Nodes and whole faces are not exact here, nor is anything with another traction than the stress has.
    exact = patch(("C3D10", "C3D20"), (3, 2), "flat", points, STRESSES["pressure"])["largest"]
    assert exact < 1e-10 if points == "cut" else exact > 0.01


@pytest.mark.parametrize("points", ("node", "gauss"))
def test_errors_of_nodes_and_gauss_points_fall_as_the_root_of_the_mesh_size(points):
    # An error of fixed size in a layer one element thick: h^(1/2) in the mean square.
    found = [
        {"shape": "flat", "factor": "1.5", "stress": "shear", "points": points, "cells": counts}
        | patch(("C3D8", "C3D8"), counts, "flat", points, STRESSES["shear"])
        for counts in ((3, 2), (6, 4))
    ]
    assert 0.4 < patch_test.orders(found)[0]["order"] < 0.6


def test_cut_faces_on_a_cylinder_converge_fast():
    errors = [
        patch(("C3D8", "C3D8"), counts, "cylinder", "cut", STRESSES["pressure"])["mean"] for counts in ((3, 2), (6, 4))
    ]
    assert errors[1] < errors[0] / 3 < 0.01


def test_stress_of_a_linear_displacement_is_exact_in_every_element():
    gradient = np.random.default_rng(0).normal(size=(3, 3))
    for kind in ("C3D4", "C3D8", "C3D10", "C3D20"):
        model = unlike_joint((kind, kind), (2, 1), flat, layers=(2, 1))
        found, volume = stress(model, model.coordinates @ gradient.T)
        exact = LAME * np.trace(gradient) * np.eye(3) + SHEAR * (gradient + gradient.T)
        assert found == pytest.approx(np.broadcast_to(exact, found.shape), abs=1e-12)
        assert volume.sum() == pytest.approx(2.0)
        # K u are the tractions' consistent forces: none at nodes inside a body.
        forces = (stiffness(model) @ (model.coordinates @ gradient.T).ravel()).reshape(-1, 3)
        inside = np.all((model.coordinates > 1e-9) & (model.coordinates < 1 - 1e-9), axis=1)
        assert inside.any() and np.abs(forces[inside]).max() < 1e-12
