"""Stresses at nodes from the motion of nodes: CalculiX's own, constant strains, bending, materials that meet."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from calculix_beam import solve, write_mesh
from scipy.sparse.linalg import spsolve

from attrito.importers import import_model
from attrito.model.model import Model
from attrito.model.solid_shapes import KINDS
from attrito.stresses.recovery import NodalStress, nodal_stress, recoverable
from attrito.support.errors import InputError

YOUNG, POISSON = 210000.0, 0.3
LENGTH, COUNTS = (4.0, 1.0, 1.5), (4, 2, 2)
# A general state of strain, of the tensor: xx, yy, zz, xy, yz, zx
STRAIN = 1e-3 * np.array([1.0, -2.0, 0.5, 0.3, -0.7, 0.9])


def family(kind: str) -> str:
    return kind.rstrip("RI")


def skewed(points: np.ndarray) -> np.ndarray:
    """Parallelepipeds of cubes."""
    return points @ np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.1], [0.15, 0.0, 1.0]])


def bent(points: np.ndarray) -> np.ndarray:
    """No edge is straight, no element like another."""
    return points + 0.08 * np.sin(1.3 * points[:, [1, 2, 0]] + points)


def body_of(kind: str, shape=bent) -> synthetic.Body:
    body = synthetic.block(family(kind), COUNTS, LENGTH, shape)
    return synthetic.Body(kind, body.points, body.connectivity)


def model_of(body: synthetic.Body, young: float = YOUNG, poisson: float = POISSON) -> Model:
    count = len(body.connectivity)
    return Model(
        None,
        None,
        node_ids=np.arange(1, len(body.points) + 1),
        coordinates=body.points,
        elements={body.kind: (np.arange(1, count + 1), body.connectivity + 1)},
        elastic={body.kind: np.tile([young, poisson], (count, 1))},
    )


def everywhere(model: Model, displacement: np.ndarray) -> NodalStress:
    return nodal_stress(model, displacement[None], np.ones(len(model.node_ids), dtype=bool))


def hooke(strain: np.ndarray, young: float = YOUNG, poisson: float = POISSON) -> np.ndarray:
    """By the compliance matrix of textbooks, with engineers' shear strains."""
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = (np.eye(3) * (1.0 + poisson) - poisson) / young
    compliance[3:, 3:] = np.eye(3) * 2.0 * (1.0 + poisson) / young
    return np.linalg.solve(compliance, strain * [1, 1, 1, 2, 2, 2])


@pytest.mark.parametrize("kind", KINDS)
def test_constant_strain_is_exact_on_distorted_elements_and_rotations_strain_nothing(kind):
    model = model_of(body_of(kind))
    xx, yy, zz, xy, yz, zx = STRAIN
    gradient = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    spin = np.array([[0, -3.0, 1.0], [3.0, 0, -2.0], [-1.0, 2.0, 0]]) * 1e-3
    found = everywhere(model, model.coordinates @ (gradient + spin).T + [7.0, -1.0, 2.0])
    assert np.array_equal(found.node, np.arange(len(model.node_ids)))
    # Rounding of displacements up to 8, over elements of size 0.5, by the stiffness: 1e-16 x 16 x 3e5.
    assert found.harmonics[0] == pytest.approx(np.tile(hooke(STRAIN), (len(found.node), 1)), abs=1e-8)
    assert found.strains()[0] == pytest.approx(np.tile(STRAIN, (len(found.node), 1)), abs=1e-13)


def test_bricks_with_incompatible_modes_bend_as_beams_do():
    """u = c x z, v = -nu c y z, w = -c (x^2 + nu (z^2 - y^2)) / 2 has sigma_xx = E c z alone; bricks without lock."""
    curvature = 1e-3
    worst = {}
    for kind in ("C3D8I", "C3D8"):
        body = body_of(kind, shape=lambda points: points - np.array(LENGTH) / 2)
        model = model_of(body)
        x, y, z = body.points.T
        w = -(x**2 + POISSON * (z**2 - y**2)) / 2
        found = everywhere(model, curvature * np.stack([x * z, -POISSON * y * z, w], axis=1))
        exact = np.zeros((len(x), 6))
        exact[:, 0] = YOUNG * curvature * z
        worst[kind] = np.abs(found.harmonics[0] - exact).max() / np.abs(exact).max()
    assert worst["C3D8I"] < 1e-12 and worst["C3D8"] > 0.1


def calculix_stress(path) -> dict[int, list[float]]:
    """Stresses at nodes of a .frd file, xx, yy, zz, xy, yz, zx."""
    found, is_stress = {}, False
    for line in path.read_text().splitlines():
        if line.startswith(" -4"):
            is_stress = line.split()[1] == "STRESS"
        elif line.startswith(" -1") and is_stress:
            found[int(line[3:13])] = [float(line[at : at + 12]) for at in range(13, 85, 12)]
    return found


def calculix_displacement(path, count: int) -> np.ndarray:
    """Displacements of all nodes of a .dat file, seven digits."""
    found = np.zeros((count, 3))
    for words in map(str.split, path.read_text().splitlines()):
        if len(words) == 4 and words[0].isdigit():
            found[int(words[0]) - 1] = [float(word) for word in words[1:]]
    return found


# CalculiX's C3D8I leaves out det J_0 / det J, so that constant strains are exact on parallelepipeds alone.
@pytest.mark.parametrize("kind", KINDS)
def test_stresses_at_nodes_are_those_of_calculix_at_a_static_load(kind, tmp_path):
    """Within 1e-4 of the largest: CalculiX's extrapolation has four digits, which leave 4e-5, and its file six."""
    flat = synthetic.block(family(kind), COUNTS, LENGTH).points
    body = body_of(kind, skewed if kind == "C3D8I" else bent)
    clamp, tip = (np.flatnonzero(np.abs(flat[:, 0] - at) < 1e-9) for at in (0.0, LENGTH[0]))
    write_mesh(tmp_path / "mesh.inp", body, {"clamp": clamp, "tip": tip, "all": np.arange(len(flat))})
    held = "*BOUNDARY\nclamp, 1, 3\n*STEP\n"
    force = np.array([20.0, 7.0, -4.0])
    loads = "\n".join(f"tip, {k}, {value}" for k, value in enumerate(force, start=1))
    outputs = "*EL FILE\nS\n*NODE PRINT, NSET=all\nU\n*END STEP\n"
    solve(tmp_path, "static", f"{held}*STATIC\n*CLOAD\n{loads}\n{outputs}")
    calculix = calculix_stress(tmp_path / "static.frd")
    expected = np.array([calculix[node] for node in range(1, len(flat) + 1)])
    if kind == "C3D8I":
        # Its matrices have dofs of the modes without nodes, and are refused.
        model, displacement = model_of(body), calculix_displacement(tmp_path / "static.dat", len(flat))
    else:
        solve(tmp_path, "beam", f"{held}*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
        deck = tmp_path / "beam.inp"
        model, _ = import_model(tmp_path / "model.h5", calculix_job=tmp_path / "beam", mesh=deck)
        loaded = np.isin(model.dof_node, tip + 1) * force[model.dof_direction - 1]
        displacement = np.zeros((len(flat), 3))
        solution = spsolve(model.stiffness.tocsc(), loaded)
        displacement[model.rows_of(np.arange(model.size)), model.dof_direction - 1] = solution
    found = everywhere(model, displacement)
    assert model.elastic[kind] == pytest.approx(np.tile([YOUNG, POISSON], (len(body.connectivity), 1)))
    assert np.abs(found.harmonics[0] - expected).max() < 1e-4 * np.abs(expected).max()


def two_bars() -> tuple[Model, np.ndarray]:
    """Bricks in a row, the first two of another material than the last two, without lateral contraction; pulled."""
    body = synthetic.block("C3D8", (4, 1, 1), LENGTH)
    model = model_of(body)
    model.elastic = {"C3D8": np.array([[100.0, 0.0], [100.0, 0.0], [300.0, 0.0], [300.0, 0.0]])}
    return model, 1e-3 * body.points * [1.0, 0.0, 0.0]


def test_a_node_between_two_materials_has_a_stress_in_each():
    model, pulled = two_bars()
    found = everywhere(model, pulled)
    between = np.flatnonzero(np.abs(model.coordinates[:, 0] - 2.0) < 1e-9)
    assert len(found.node) == 20 + 4 and np.array_equal(np.unique(found.node), np.arange(20))
    for node in between:
        own = found.node == node
        assert found.elastic[own, 0].tolist() == [100.0, 300.0]
        assert found.harmonics[0][own][:, 0] == pytest.approx([0.1, 0.3], rel=1e-12)
    assert found.harmonics[0, :, 1:] == pytest.approx(np.zeros((24, 5)), abs=1e-14)


def test_only_chosen_nodes_have_a_stress_from_all_of_their_elements():
    model = model_of(body_of("C3D10"))
    motion = np.random.default_rng(3).normal(size=(3, len(model.node_ids), 3))
    whole = nodal_stress(model, motion, np.ones(len(model.node_ids), dtype=bool))
    chosen = np.zeros(len(model.node_ids), dtype=bool)
    chosen[[5, 17, 40]] = True
    some = nodal_stress(model, motion, chosen)
    assert some.node.tolist() == [5, 17, 40]
    assert some.harmonics == pytest.approx(whole.harmonics[:, some.node], rel=1e-12, abs=1e-6)


def test_blocks_of_elements_give_what_all_at_once_give(monkeypatch):
    model = model_of(body_of("C3D20R"))
    motion = np.random.default_rng(3).normal(size=(3, len(model.node_ids), 3))
    whole = nodal_stress(model, motion, np.ones(len(model.node_ids), dtype=bool))
    monkeypatch.setattr("attrito.stresses.recovery._BLOCK", 2000)
    blocks = nodal_stress(model, motion, np.ones(len(model.node_ids), dtype=bool))
    assert blocks.harmonics == pytest.approx(whole.harmonics, rel=1e-12, abs=1e-6)


def test_elements_without_volume_are_refused():
    model, pulled = two_bars()
    model.coordinates = model.coordinates * [1.0, 1.0, 0.0]
    with pytest.raises(InputError, match=r"elements = '2 elements C3D8 that are flat or inside out'"):
        everywhere(model, pulled)


def test_what_an_element_lacks_is_said_and_its_nodes_can_be_left_out():
    model, pulled = two_bars()
    model.elastic["C3D8"][3] = np.nan
    motion = pulled[None].copy()
    motion[0, np.flatnonzero(model.coordinates[:, 0] < 0.5)[0]] = np.nan
    nodes, reasons = recoverable(model, motion)
    assert reasons == {"motion": 1, "elastic constants": 1}
    # Of five layers the first two touch the first brick, the last two the last.
    assert model.coordinates[nodes, 0] == pytest.approx(np.full(4, 2.0))
    assert len(nodal_stress(model, motion, nodes).node) == 8
    with pytest.raises(InputError, match=r"motion = '1 elements C3D8 at the chosen nodes': expected .*recovery"):
        nodal_stress(model, motion, np.ones(20, dtype=bool))
    with pytest.raises(InputError, match=r"elastic constants = '1 elements C3D8 .*--young and --poisson"):
        nodal_stress(model, pulled[None], np.ones(20, dtype=bool))
    model.elements = {"C3D10M": model.elements["C3D8"]}
    with pytest.raises(InputError, match=r"type = '4 elements C3D10M"):
        nodal_stress(model, pulled[None], np.ones(20, dtype=bool))
