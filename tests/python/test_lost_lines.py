"""Lines lost of a matrix file, off its diagonal, are refused or named where mesh and matrices show it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matrix_writers as write
import numpy as np
import pytest
from bricks import brick
from scipy.sparse import diags, lil_matrix

from attrito.importers import import_model
from attrito.model.model import Model
from attrito.support.errors import InputError

FORMATS = ["abaqus", "large", "small", "free"]


def at_one_end(points: np.ndarray) -> np.ndarray:
    return points[:, 0] < 1e-9


def body(held: Callable[[np.ndarray], np.ndarray] = at_one_end) -> Model:
    """Five layers of bricks, held at one end or elsewhere; bent: no entries between neighbours are zero by symmetry."""

    def bent(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        return np.stack([x + 0.2 * y * z / 0.03, y + 0.1 * x, z * (1.0 + 2.0 * x) + 0.1 * y], axis=1)

    return brick(held=held, shape=bent, layers=5)


def imported(folder: Path, model: Model, form: str, meshed: bool = True) -> list[str]:
    """Notes of the import."""
    write.write_deck(folder / "m.inp", model.node_ids, model.coordinates, model.elements, model.node_sets)
    names = np.asarray(model.dof_node), np.asarray(model.dof_direction)
    matrices = {"KAAX": model.stiffness, "MAAX": model.mass}
    if form == "abaqus":
        for name, matrix in zip(("STIF1", "MASS1"), matrices.values(), strict=True):
            write.write_abaqus(folder / f"j_{name}.mtx", matrix, *names)
        return import_model(folder / "o.h5", abaqus_job=folder / "j", mesh=folder / "m.inp" if meshed else None)[1]
    write.write_dmig(folder / "j.pch", matrices, *names, fields=form)
    return import_model(folder / "o.h5", nastran_file=folder / "j.pch", mesh=folder / "m.inp")[1]


def without(model: Model, name: str, chosen: list[int], beyond: float) -> None:
    """Take out entries off the diagonal, by numbers among those of dofs at nodes further along x than a place."""
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    matrix = getattr(model, name).tolil()
    far = np.array([x[node] > beyond for node in model.dof_node])
    row, column = (abs(getattr(model, name)) > 1e-3 * abs(getattr(model, name)).max()).nonzero()
    places = [(i, j) for i, j in zip(row, column, strict=True) if i < j and far[i] and far[j]]
    for number in chosen:
        i, j = places[number % len(places)]
        matrix[i, j] = matrix[j, i] = 0.0
    setattr(model, name, matrix.tocsr())


@pytest.mark.parametrize("form", FORMATS)
def test_whole_files_are_not_said_to_lack_lines(tmp_path, form):
    assert not any("rigid translation" in note for note in imported(tmp_path, body(), form))


@pytest.mark.parametrize("form", ["abaqus", "large", "free"])
@pytest.mark.parametrize("name", ["stiffness", "mass"])
@pytest.mark.parametrize("chosen", [[7], [300], [1001], [40, 500, 901], list(range(0, 2000, 97))])
def test_a_lost_line_is_refused(tmp_path, form, name, chosen):
    """Between nodes that share no element with a held one."""
    model = body()
    without(model, name, chosen, beyond=0.03)
    with pytest.raises(InputError, match=f"{name} = 'no entry of dof .* the entry that others of both rows ask for"):
        imported(tmp_path, model, form)


def test_a_lost_line_is_refused_where_most_rows_lie_beside_supports(tmp_path):
    """What these leave had been taken for rounding of the file."""
    model = body(lambda points: at_one_end(points) | (np.abs(points[:, 0] - 0.062) < 0.008))
    without(model, "stiffness", [7], beyond=0.09)
    with pytest.raises(InputError, match="stiffness = 'no entry of dof"):
        imported(tmp_path, model, "abaqus")


def test_a_line_lost_between_a_node_at_a_support_and_another_is_noted(tmp_path):
    model = body()
    stiffness = model.stiffness.tolil()
    at = {place: i for i, place in enumerate(zip(model.dof_node, model.dof_direction, strict=True))}
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    near, far = (min(x, key=lambda node: abs(x[node] - place)) for place in (0.02, 0.04))
    i, j = at[near, 1], at[far, 1]
    assert stiffness[i, j] != 0.0
    stiffness[i, j] = stiffness[j, i] = 0.0
    model.stiffness = stiffness.tocsr()
    (note,) = [note for note in imported(tmp_path, model, "abaqus") if "rigid translation" in note]
    assert "resist a rigid translation: 1, the first" in note and f"node {far} x" in note


def test_springs_to_the_ground_are_no_lost_lines(tmp_path):
    model = body()
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    far = np.array([x[node] > 0.09 for node in model.dof_node])
    model.stiffness = model.stiffness + 0.01 * model.stiffness.max() * diags(far.astype(float)).tocsr()
    (note,) = [note for note in imported(tmp_path, model, "abaqus") if "rigid translation" in note]
    assert f"resist a rigid translation: {np.count_nonzero(far)}, the first" in note


def test_equal_springs_to_the_ground_are_no_lost_lines(tmp_path):
    """Inclined ones leave equal sums in rows of neighbours, between which bricks have zeros by symmetry."""
    model = brick(held=lambda points: points[:, 0] < 1e-9, layers=5)
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    springs = lil_matrix((model.size, model.size))
    for node in [node for node in x if x[node] > 0.09]:
        own = np.flatnonzero(model.dof_node == node)
        springs[np.ix_(own, own)] = 0.01 * model.stiffness.max() * np.ones((3, 3))
    stiffness = (model.stiffness + springs).tocsr()
    model.stiffness = stiffness.multiply(abs(stiffness) > 1e-9 * stiffness.max()).tocsr()
    assert any("resist a rigid translation" in note for note in imported(tmp_path, model, "abaqus"))


@pytest.mark.parametrize("meshed", [True, False])
def test_mass_along_two_directions_of_nodes_without_a_common_element_is_no_lost_line(tmp_path, meshed):
    """As a fluid in a gap, or an equation of x and y, makes it."""
    model = body()
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    mass = model.mass.tolil()
    at = {place: i for i, place in enumerate(zip(model.dof_node, model.dof_direction, strict=True))}
    near, far = (min(x, key=lambda node: abs(x[node] - place)) for place in (0.04, 0.1))
    for direction in (1, 2):
        i, j = at[near, direction], at[far, direction]
        assert mass[i, j] == 0.0
        mass[i, j] = mass[j, i] = 0.1 * min(mass[i, i], mass[j, j])
    model.mass = mass.tocsr()
    notes = imported(tmp_path, model, "abaqus", meshed)
    (note,) = [note for note in notes if "none along the third" in note]
    (i, node), (j, other) = sorted((at[node, 3], node) for node in (near, far))
    assert f"third: 1, the first without an entry of dof {i}, node {node} z and dof {j}, node {other} z" in note
