"""What an import says of a model so that a wrong unit is seen: extents, centre of gravity, natural frequencies."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from elastic import DENSITY, elastic_block
from jobs import attrito_here, write_job
from scipy.linalg import eigh
from scipy.sparse import block_diag, diags

from attrito.importers.first_look import centre_of_gravity, first_look, natural_frequencies
from attrito.model.model import Model
from attrito.model.model_file import write_model

SIZE = (0.12, 0.03, 0.02)


def block(fixed=lambda points: np.zeros(len(points), bool)) -> Model:
    """A block of steel whose dofs belong to nodes 3, 5, 7, ..., the last ones first."""
    model, points = elastic_block((6, 2, 2), SIZE, fixed=fixed)
    ids = 3 + 2 * np.arange(len(points))[::-1]
    model.node_ids, model.coordinates = ids, points + [1.0, 2.0, 3.0]
    model.dof_node, model.dof_direction = np.repeat(ids, 3), np.tile([1, 2, 3], len(points))
    return model


def test_the_centre_of_gravity_of_a_block_is_its_middle_and_its_extents_are_its_size():
    model = block()
    assert centre_of_gravity(model) == pytest.approx(np.array([1.0, 2.0, 3.0]) + np.array(SIZE) / 2, rel=1e-12)
    assert first_look(model)[0] == "extents along x, y, z: 0.12 x 0.03 x 0.02; centre of gravity: 1.06, 2.015, 3.01"
    along_x = (model.dof_direction == 1).astype(float)
    assert along_x @ model.mass @ along_x == pytest.approx(DENSITY * np.prod(SIZE), rel=1e-12)


def test_natural_frequencies_of_a_floating_body_are_those_of_dense_matrices_after_six_rigid_body_modes():
    model = block()
    exact = np.sqrt(eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)[6:9]) / (2 * np.pi)
    found = natural_frequencies(model, 9)
    assert found[:6].tolist() == [0.0] * 6
    assert found[6:] == pytest.approx(exact, rel=1e-8)
    said = ", ".join(f"{f:.5g}" for f in exact)
    assert first_look(model)[1] == f"natural frequencies without contacts: {said} Hz and 6 rigid-body modes"
    assert "[model] suspension_hz" in first_look(model)[2]


@pytest.mark.parametrize("seed", range(8))
def test_rigid_body_modes_are_six_where_rounding_leaves_their_squares_above_zero(seed):
    """No negative one shows then how much that is."""
    model = block()
    exact = natural_frequencies(model, 9)[6:]
    lost = 16.0 * np.finfo(float).eps * np.random.default_rng(seed).uniform(0.5, 1.0, model.size)
    model.stiffness = (model.stiffness + diags(lost * model.stiffness.diagonal())).tocsr()
    found = natural_frequencies(model, 9)
    assert np.count_nonzero(found == 0.0) == 6
    assert found[6:] == pytest.approx(exact, rel=1e-8)


def test_of_two_bodies_that_float_all_rigid_body_modes_are_counted_and_elastic_ones_are_listed():
    one = block()
    two = Model(*(block_diag([matrix, matrix], format="csr") for matrix in (one.stiffness, one.mass)))
    listed, floats = first_look(two)[0].split(" Hz")
    assert floats == " and 12 rigid-body modes"
    exact = np.sqrt(eigh(one.stiffness.toarray(), one.mass.toarray(), eigvals_only=True)[6:8]) / (2 * np.pi)
    found = [float(f) for f in listed.split(": ")[1].split(", ")]
    assert found == pytest.approx([exact[0], exact[0], exact[1]], rel=1e-4)


def test_a_held_body_has_no_rigid_body_modes_and_dofs_without_mass_follow():
    model = block(lambda points: points[:, 0] < 1e-9)
    model.damping = None
    last = model.size - 1
    model.mass = model.mass.tolil()
    model.mass[last], model.mass[:, last] = 0.0, 0.0
    model.mass = model.mass.tocsr()
    # Condensed: the massless dof moves as the others make it.
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    follows = -stiffness[last, :last] / stiffness[last, last]
    condensed = stiffness[:last, :last] + np.outer(stiffness[:last, last], follows)
    exact = np.sqrt(eigh(condensed, mass[:last, :last], eigvals_only=True)[:3]) / (2 * np.pi)
    assert natural_frequencies(model, 3) == pytest.approx(exact, rel=1e-8)
    assert first_look(model)[1].endswith(" Hz")


def test_a_large_model_is_not_held_up_and_numbered_dofs_have_no_extents(monkeypatch):
    model = block()
    monkeypatch.setattr("attrito.importers.first_look.MOST_DOFS", 100)
    assert first_look(model)[1].startswith("natural frequencies: not computed here above 100 dofs")
    bare = Model(model.stiffness, model.mass)
    assert len(first_look(bare)) == 1


def test_a_structure_without_stiffness_anywhere_is_said_to_have_no_natural_frequencies():
    model = block()
    model.stiffness = 0.0 * model.stiffness
    assert first_look(model)[1].startswith("natural frequencies: not found (")


def with_digits(model: Model, digits: int = 13) -> Model:
    """Its matrices as a text file of so many digits holds them."""
    model.damping = None
    for name in ("stiffness", "mass"):
        matrix = getattr(model, name).tocsr()
        matrix.data = np.array([float(f"{value:.{digits - 1}e}") for value in matrix.data])
        setattr(model, name, 0.5 * (matrix + matrix.T))
    return model


@pytest.mark.parametrize("digits", [10, 12, 13])
def test_six_rigid_body_modes_are_six_whatever_the_digits_of_the_file(digits, tmp_path, capfd):
    model = with_digits(block(), digits)
    exact = np.sqrt(eigh(block().stiffness.toarray(), block().mass.toarray(), eigvals_only=True)[6]) / (2 * np.pi)
    assert first_look(model)[1].endswith(" Hz and 6 rigid-body modes")
    write_model(tmp_path / "model.h5", model, [])
    law = {"normal_stiffness": 1.0e6, "tangential_stiffness": 1.0e6, "friction_coefficient": 0.3, "gap": 1.0}
    job = {
        "model": {"file": "model.h5"},
        "damping": {"ratio": 0.01},
        # Three nodes that are not in line hold the body where all stick.
        "contact": [
            {"normal": [[i + 2, 1.0]], "tangents": [[[i, 1.0]], [[i + 1, 1.0]]], **law} for i in (0, 18, model.size - 3)
        ],
        "load": [{"kind": "harmonic", "cosine": [[0, 1.0]]}],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [exact]},
        "output": {"file": "result.h5", "monitors": [{"name": "tip", "dofs": [[0, 1.0]]}]},
    }
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(attrito_here(tmp_path, capfd, "table", "result.modes.h5").stdout)))
    assert [row["kind"] for row in rows[:7]] == ["rigid"] * 6 + ["elastic"]
    assert float(rows[6]["frequency_hz"]) == pytest.approx(exact, rel=1e-6)
