"""Loads by mass have what free nodes share with held ones: against whole bodies, and against CalculiX's static step."""

from __future__ import annotations

import subprocess
from itertools import product

import numpy as np
import pytest
from bricks import brick
from scipy.sparse import block_diag, csr_matrix, diags, identity
from scipy.sparse.linalg import spsolve

from attrito.importers import import_model
from attrito.importers.deck_mesh import read_deck_mesh
from attrito.model.accelerations import rigid_translation
from attrito.model.held_mass import SharedMass, UnknownMassError, inertia_of, other_mass
from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.model.rotation import Spin, centrifugal_load


def distorted(points: np.ndarray) -> np.ndarray:
    """A shape whose bricks are no parallelepipeds."""
    x, y, z = points.T
    return np.stack([x + 0.2 * y * z / 0.03, y + 0.1 * x, z * (1.0 + 2.0 * x) + 0.1 * y], axis=1)


def of_whole(whole: Model, model: Model, acceleration: np.ndarray) -> np.ndarray:
    """M a with the mass of all nodes, at the dofs of a model that lacks the held ones."""
    row = {place: i for i, place in enumerate(zip(whole.dof_node, whole.dof_direction, strict=True))}
    load = whole.mass @ whole.on_dofs(acceleration)
    return load[[row[place] for place in zip(model.dof_node, model.dof_direction, strict=True)]]


@pytest.mark.parametrize("shape", [lambda points: points, distorted])
def test_loads_by_mass_are_those_of_the_whole_body(shape):
    whole, model = brick(shape=shape), brick(held=lambda points: points[:, 0] < 1e-9, shape=shape)
    for acceleration in (np.tile([1.0, -2.0, 3.0], (len(model.node_ids), 1)), model.coordinates * [1.0, 0.0, -1.0]):
        expected = of_whole(whole, model, acceleration)
        assert inertia_of(model, acceleration) == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.abs(expected).max())
        lacking = model.mass @ model.on_dofs(acceleration)
        assert np.abs(lacking - expected).max() > 0.01 * np.abs(expected).max(), "the test is void"
    assert SharedMass(model).unknown_share == 0.0


def test_a_lumped_mass_shares_nothing():
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    model.mass = diags(np.asarray(model.mass.sum(axis=1)).ravel()).tocsr()
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    assert np.array_equal(inertia_of(model, upward), model.mass @ rigid_translation(model, (0.0, 0.0, 1.0)))
    assert SharedMass(model).unknown_share == 0.0


def test_two_densities_that_nothing_tells_apart_are_not_known():
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    height = dict(zip(model.node_ids, model.coordinates[:, 2], strict=True))
    heavy = np.array([height[node] for node in model.dof_node]) > 0.02
    scale = diags(np.where(heavy, np.sqrt(30.0), 1.0))
    model.mass = (scale @ model.mass @ scale).tocsr()
    assert SharedMass(model).unknown_share > 0.01
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    assert inertia_of(model, upward) == pytest.approx(model.mass @ model.on_dofs(upward), rel=1e-12)


def coupled(model: Model, place: tuple[float, float, float], heavy: bool = False) -> tuple[Model, csr_matrix]:
    """The same whose node at a place moves along z as the one at the far end does, and the map T to all free dofs."""
    node, other = (
        int(model.node_ids[np.argmin(np.abs(model.coordinates - at).sum(axis=1))]) for at in (place, (0.1, 0.04, 0.03))
    )
    dof = {at: i for i, at in enumerate(zip(model.dof_node, model.dof_direction, strict=True))}
    gone, stays = dof[node, 3], [i for i in range(model.size) if i != dof[node, 3]]
    onto = identity(model.size, format="lil")
    onto[gone, dof[other, 3]] = 1.0
    onto = csr_matrix(onto[:, stays])
    if heavy:
        height = dict(zip(model.node_ids, model.coordinates[:, 2], strict=True))
        scale = diags([np.sqrt(30.0) if height[one] > 0.02 else 1.0 for one in model.dof_node])
        model.mass = (scale @ model.mass @ scale).tocsr()
    model.stiffness, model.mass = (csr_matrix(onto.T @ matrix @ onto) for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction = (np.asarray(one)[stays] for one in (model.dof_node, model.dof_direction))
    model.dependent, model.size = np.array([[node, 3]]), len(stays)
    return model, onto


def test_a_node_that_moves_as_another_far_away_hides_no_density():
    held = {"held": lambda points: points[:, 0] < 1e-9}
    model, onto = coupled(brick(**held), (0.1, 0.0, 0.0))
    acceleration = np.tile([1.0, -2.0, 3.0], (len(model.node_ids), 1))
    expected = onto.T @ of_whole(brick(), brick(**held), acceleration)
    assert inertia_of(model, acceleration) == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.abs(expected).max())
    assert SharedMass(model).unknown_share == 0.0
    assert SharedMass(coupled(brick(**held), (0.1, 0.0, 0.0), heavy=True)[0]).unknown_share > 0.01


def test_a_load_that_a_node_which_moves_as_another_shares_with_a_support_is_refused():
    model, _ = coupled(brick(held=lambda points: points[:, 0] < 1e-9), (0.1 / 3.0, 0.0, 0.0))
    with pytest.raises(UnknownMassError, match="the matrices do not tell"):
        inertia_of(model, np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1)))


def test_a_density_that_is_not_known_far_from_what_moves_as_another_is_no_fault():
    """A layer of another material at the support, whose free nodes all have elements of the body, too."""
    model, _ = coupled(brick(held=lambda points: points[:, 0] < 1e-9, layers=5), (0.1, 0.0, 0.0))
    x = dict(zip(model.node_ids, model.coordinates[:, 0], strict=True))
    for kind, (_, nodes) in model.elements.items():
        at_support = np.array([min(x[node] for node in row) < 1e-9 for row in nodes])
        model.elastic[kind] = np.where(at_support[:, None], [7.0e10, 0.3], [2.0e11, 0.3])
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    assert inertia_of(model, upward) == pytest.approx(model.mass @ model.on_dofs(upward), rel=1e-12)
    # The integral of x (1 - x) over one of five layers
    assert SharedMass(model).unknown_share == pytest.approx(1.0 / 6.0 / 5.0, rel=1e-12)


def with_density(depth: float) -> tuple[Model, np.ndarray]:
    """A brick held up to a depth along x whose density is known, and its supports."""
    whole, model = brick(), brick(held=lambda points: points[:, 0] < depth)
    along = rigid_translation(whole, (1.0, 0.0, 0.0))
    density = along @ whole.mass @ along / (0.1 * 0.04 * 0.03)
    model.density = {kind: np.full(len(ids), density) for kind, (ids, _) in model.elements.items()}
    free = set(zip(model.dof_node, model.dof_direction, strict=True))
    return model, np.array([place for place in product(model.node_ids, (1, 2, 3)) if place not in free])


@pytest.mark.parametrize("depth", [1e-9, 0.04, 0.07])
def test_elements_that_supports_hold_as_a_whole_lack_no_mass(depth):
    model, supports = with_density(depth)
    assert other_mass(model, supports) is None
    model.mass = 1.05 * model.mass
    assert "% more mass" in other_mass(model, supports)
    # Without dofs for other reasons: reduced, as by Guyan
    assert other_mass(model, supports[1:]) is None


def test_supports_may_hold_a_direction_everywhere():
    model, _ = with_density(0.04)
    stays = np.flatnonzero(np.asarray(model.dof_direction) != 3)
    model.stiffness, model.mass = (matrix[stays][:, stays] for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction = (np.asarray(one)[stays] for one in (model.dof_node, model.dof_direction))
    model.size = len(stays)
    free = set(zip(model.dof_node, model.dof_direction, strict=True))
    supports = np.array([place for place in product(model.node_ids, (1, 2, 3)) if place not in free])
    assert other_mass(model, supports) is None
    assert SharedMass(model).unknown_share == 0.0


@pytest.mark.parametrize("depth", [1e-9, 0.04, 0.07])
def test_a_lumped_mass_is_not_said_to_be_another(depth):
    model, supports = with_density(depth)
    free = {place: i for i, place in enumerate(zip(model.dof_node, model.dof_direction, strict=True))}
    lumped = np.asarray(brick().mass.sum(axis=1)).ravel()
    place = zip(brick().dof_node, brick().dof_direction, strict=True)
    model.mass = diags([m for m, at in zip(lumped, place, strict=True) if at in free]).tocsr()
    assert other_mass(model, supports) is None


def test_a_lumped_body_beside_a_consistent_one_lacks_nothing():
    """As first-order elements of Abaqus are and second-order ones: two bodies, distinguished by their constants."""
    (one, supports), (other, _) = (with_density(1e-9) for _ in range(2))
    place = {at: i for i, at in enumerate(zip(brick().dof_node, brick().dof_direction, strict=True))}
    own = [place[at] for at in zip(other.dof_node, other.dof_direction, strict=True)]
    lumped = diags(np.asarray(brick().mass.sum(axis=1)).ravel()[own]).tocsr()
    far = one.node_ids.max()
    both = Model(
        block_diag([one.stiffness, other.stiffness], format="csr"), block_diag([one.mass, lumped], format="csr"),
        dof_node=np.append(one.dof_node, np.asarray(other.dof_node) + far),
        dof_direction=np.append(one.dof_direction, other.dof_direction),
        node_ids=np.append(one.node_ids, other.node_ids + far),
        coordinates=np.vstack([one.coordinates, other.coordinates + 1.0]),
    )  # fmt: skip
    for kind, (ids, rows) in one.elements.items():
        both.elements[kind] = (np.append(ids, ids + ids.max()), np.vstack([rows, rows + far]))
        both.density[kind] = np.tile(one.density[kind], 2)
        both.elastic[kind] = np.repeat([[2.0e11, 0.3], [7.0e10, 0.3]], len(ids), axis=0)
    assert other_mass(both, np.vstack([supports, supports + [far, 0]])) is None
    assert SharedMass(both).unknown_share == 0.0
    upward = np.tile([0.0, 0.0, 1.0], (len(both.node_ids), 1))
    expected = np.append(
        inertia_of(one, upward[: len(one.node_ids)]), lumped @ rigid_translation(other, (0.0, 0.0, 1.0))
    )
    assert inertia_of(both, upward) == pytest.approx(expected, rel=1e-12)


def test_densities_count_where_supports_hold_elements_as_a_whole():
    """Of two layers of free nodes, all in an element with one at the end that depends on another."""
    held = {"held": lambda points: points[:, 0] < 0.07, "layers": 5}
    density = {kind: np.full(20, one[0]) for kind, one in with_density(0.0)[0].density.items()}
    model, onto = coupled(brick(**held), (0.1, 0.02, 0.015))
    model.density = density
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    expected = onto.T @ of_whole(brick(layers=5), brick(**held), upward)
    assert inertia_of(model, upward) == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.abs(expected).max())
    # What a mass is wrong by, 2e-3 of all, counts as a part of what shows it.
    model.density = {kind: 1.002 * one for kind, one in density.items()}
    with pytest.raises(UnknownMassError, match="DENSITY in the deck"):
        inertia_of(model, upward)


@pytest.mark.parametrize("bricks", [2, 5])
def test_a_mass_that_the_mesh_does_not_tell_is_left_out_and_its_share_said(bricks):
    """Of bricks with one face held F = x, and the integral of x (1 - x) is a sixth."""
    grid = list(product(range(bricks + 1), (0, 1), (0, 1)))
    number = {place: k + 1 for k, place in enumerate(grid)}
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    rows = np.array([[number[x + i, j, k] for i, j, k in corners] for x in range(bricks)])
    free = [number[place] for place in grid if place[0] > 0]
    random = np.random.default_rng(1)
    mass = random.uniform(1.0, 2.0, (3 * len(free), 3 * len(free)))
    model = Model(
        diags(np.ones(len(mass))).tocsr(),
        type(diags([1.0]).tocsr())(mass + mass.T),
        dof_node=np.repeat(free, 3),
        dof_direction=np.tile([1, 2, 3], len(free)),
        node_ids=np.arange(1, len(grid) + 1),
        coordinates=np.array(grid, float),
        elements={"C3D8": (np.arange(1, bricks + 1), rows)},
    )
    assert SharedMass(model).unknown_share == pytest.approx(1.0 / 6.0 / bricks, rel=1e-12)
    upward = np.tile([0.0, 0.0, 1.0], (len(grid), 1))
    assert inertia_of(model, upward) == pytest.approx(model.mass @ model.on_dofs(upward), rel=1e-12)


def beam(kind: str) -> str:
    """Three by two by one elements of a kind, clamped at x = 0."""
    steps = 2 if "20" in kind else 1
    size = np.array([30.0, 16.0, 7.0]) / steps / [3, 2, 1]
    numbers: dict[tuple[int, ...], int] = {}
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    # A cube in six tetrahedra about its diagonal
    tetrahedra = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    lines = []
    for place in product(range(3), range(2), range(1)):
        own = [tuple(steps * (np.array(place) + corner)) for corner in corners]
        if steps == 2:
            own += [tuple((np.array(own[a]) + own[b]) // 2) for a, b in edges]
        nodes = [numbers.setdefault(tuple(map(int, at)), len(numbers) + 1) for at in own]
        for chosen in tetrahedra if kind == "C3D4" else [range(len(nodes))]:
            words = [str(len(lines) + 1), *(str(nodes[i]) for i in chosen)]
            lines.append(",\n".join(", ".join(words[i : i + 10]) for i in range(0, len(words), 10)))
    nodes = [f"{node}, {', '.join(f'{v:.9g}' for v in np.array(at) * size)}" for at, node in numbers.items()]
    held = ",\n".join(str(node) for at, node in numbers.items() if at[0] == 0)
    return (
        "*NODE, NSET=all\n" + "\n".join(nodes) + f"\n*ELEMENT, TYPE={kind}, ELSET=E\n" + "\n".join(lines)
        + f"\n*NSET, NSET=clamp\n{held}\n*MATERIAL, NAME=s\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.8e-9\n"
        "*SOLID SECTION, ELSET=E, MATERIAL=s\n*BOUNDARY\nclamp, 1, 3\n"
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["C3D8", "C3D8R", "C3D4", "C3D20", "C3D20R"])
def test_displacements_are_those_of_calculix_s_static_step(tmp_path, kind):
    (tmp_path / "m.inp").write_text(f"{beam(kind)}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    speed = 300.0
    for name, load in (("g", "E, GRAV, 9810., 0., 0., -1."), ("c", f"E, CENTRIF, {speed**2}, -5., 0., 0., 0., 1., 0.")):
        steps = f"*STEP\n*STATIC\n*DLOAD\n{load}\n*NODE PRINT, NSET=all\nU\n*END STEP\n"
        (tmp_path / f"{name}.inp").write_text(beam(kind) + steps)
    for name in "mgc":
        subprocess.run(["ccx", "-i", name], cwd=tmp_path, check=True, capture_output=True)
    import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
    model = read_model(tmp_path / "m.h5")
    loads = {
        "g": inertia_of(model, np.tile([0.0, 0.0, -9810.0], (len(model.node_ids), 1))),
        "c": centrifugal_load(model, Spin(speed, np.array([-5.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))),
    }
    for name, load in loads.items():
        rows = [line.split() for line in (tmp_path / f"{name}.dat").read_text().splitlines() if line.strip()]
        printed = {int(row[0]): [float(value) for value in row[1:]] for row in rows if row[0].isdigit()}
        found = spsolve(model.stiffness.tocsc(), load)
        expected = [printed[node][d - 1] for node, d in zip(model.dof_node, model.dof_direction, strict=True)]
        # Seven digits are printed, and a C3D20R's load is integrated by fewer points than its mass.
        assert found == pytest.approx(np.array(expected), abs=1e-5 * np.abs(expected).max())


def test_rotation_of_what_a_rigid_body_moves_is_refused_and_its_weight_is_not(tmp_path):
    nodes = "*NODE, NSET=ref\n9001, 35., 8., 3.\n*NODE, NSET=rot\n9002, 35., 8., 3.\n"
    rows = [line.split(",") for line in beam("C3D8").split("*ELEMENT")[0].splitlines()[1:]]
    end = ",\n".join(row[0] for row in rows if float(row[1]) == 30.0)
    deck = beam("C3D8").replace("*MATERIAL", f"{nodes}*NSET, NSET=end\n{end}\n*MATERIAL")
    deck = deck.replace("*BOUNDARY", "*RIGID BODY, NSET=end, REF NODE=9001, ROT NODE=9002\n*BOUNDARY")
    (tmp_path / "m.inp").write_text(f"{deck}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    subprocess.run(["ccx", "-i", "m"], cwd=tmp_path, check=True, capture_output=True)
    import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
    model = read_model(tmp_path / "m.h5")
    with pytest.raises(UnknownMassError, match="the matrices do not tell"):
        centrifugal_load(model, Spin(300.0, np.array([20.0, 8.0, 3.0]), np.array([0.0, 1.0, 0.0])))
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    # Of all nodes but the held ones, which support a half of their row of elements
    shared = 0.5 / 3.0 * 30.0 * 16.0 * 7.0 * 7.8e-9
    weight = inertia_of(model, upward)[np.asarray(model.dof_direction) == 3].sum()
    assert weight == pytest.approx(30.0 * 16.0 * 7.0 * 7.8e-9 - shared, rel=1e-6)


@pytest.mark.parametrize("density", [7.8e-9, 7.0e-9])
def test_a_density_of_the_deck_counts_if_it_gives_the_mass_of_the_matrices(tmp_path, density):
    """Of a beam whose free nodes all lie next to one that depends on another, so that no entries can be compared."""
    lines = [line.split(",") for line in beam("C3D8").split("*ELEMENT")[0].splitlines()[1:]]
    place = {int(row[0]): [float(word) for word in row[1:]] for row in lines}
    kept = [node for node, at in place.items() if at[0] <= 20.0]
    rows = [line.split(",") for line in beam("C3D8").split("ELSET=E\n")[1].split("*NSET")[0].splitlines()]
    rows = [row for row in rows if all(int(word) in kept for word in row[1:])]
    # All free nodes have an element with the one that depends.
    one, two = (next(node for node in kept if place[node] == [20.0, y, 0.0]) for y in (8.0, 16.0))
    text = (
        "*NODE\n" + "".join(f"{node}, {', '.join(map(str, place[node]))}\n" for node in kept)
        + "*ELEMENT, TYPE=C3D8, ELSET=E\n" + "".join(",".join(row) + "\n" for row in rows)
        + "*NSET, NSET=clamp\n" + "".join(f"{node}\n" for node in kept if place[node][0] == 0.0)
        + f"*EQUATION\n2\n{one}, 3, 1.0, {two}, 3, -1.0\n*MATERIAL, NAME=s\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.8e-9\n"
        "*SOLID SECTION, ELSET=E, MATERIAL=s\n*BOUNDARY\nclamp, 1, 3\n"
    )  # fmt: skip
    (tmp_path / "m.inp").write_text(f"{text}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    subprocess.run(["ccx", "-i", "m"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "m.inp").write_text(text.replace("7.8e-9", str(density)))
    model, _ = import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
    assert read_model(tmp_path / "m.h5").density["C3D8"].tolist() == [density] * 4
    upward = np.tile([0.0, 0.0, 1.0], (len(model.node_ids), 1))
    if density != 7.8e-9:
        with pytest.raises(UnknownMassError, match="the matrices do not tell"):
            inertia_of(model, upward)
        return
    # Of two elements in a row the held nodes' own is a quarter of the mass.
    weight = inertia_of(model, upward)[np.asarray(model.dof_direction) == 3].sum()
    assert weight == pytest.approx(0.75 * 20.0 * 16.0 * 7.0 * 7.8e-9, rel=1e-6)


def test_matrices_of_another_mass_than_the_mesh_are_told(tmp_path):
    (tmp_path / "m.inp").write_text(f"{beam('C3D8')}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    subprocess.run(["ccx", "-i", "m"], cwd=tmp_path, check=True, capture_output=True)
    for density in (7.8e-9, 8.0e-9):
        (tmp_path / "m.inp").write_text(beam("C3D8").replace("7.8e-9", str(density)))
        _, notes = import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
        # 1 - 7.8 / 8
        assert any("2.5 % less mass" in note for note in notes) == (density != 7.8e-9)


@pytest.mark.parametrize("mass", ["1e-6", "2e-6"])
def test_another_mass_at_points_than_the_matrices_have_is_told(tmp_path, mass):
    """Any mass more than the mesh's had been put down to them, and their density did not count."""
    point = POINT.replace("900, 30", "900, 24\n901, 1")
    (tmp_path / "m.inp").write_text(f"{beam('C3D8')}{point}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    subprocess.run(["ccx", "-i", "m"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "m.inp").write_text(beam("C3D8") + point.replace("1e-6", mass))
    _, notes = import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
    assert any("% less mass" in note for note in notes) == (mass == "2e-6")
    model = read_model(tmp_path / "m.h5")
    assert model.point_mass == {24: float(mass), 1: float(mass)}
    errors = SharedMass(model).mass_errors
    whole = 7.8e-9 * 30.0 * 16.0 * 7.0 + float(mass)  # One is held
    assert np.abs(errors - (float(mass) - 1e-6) / whole).min(axis=0) == pytest.approx(0.0, abs=1e-6)


# Ids of an instance, as no node or element of the deck's own has them
INSTANCE = "*ELEMENT, TYPE=MASS, ELSET=P\nPart-1-1.7, Part-1-1.24\n*ELSET, ELSET=Q\nPart-1-1.7\n"


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ("", {}),
        ("*ELEMENT, TYPE=MASS, ELSET=P\n900, 24\n*MASS, ELSET=P\n1e-6\n", {24: 1e-6}),
        ("*ELEMENT, TYPE=MASS, ELSET=P\n900, 24\n901, 24\n*MASS, ELSET=P, TYPE=ISOTROPIC\n1e-6\n", {24: 2e-6}),
        ("*ELEMENT, TYPE=MASS, ELSET=P\n900, 24\n*MASS, ELSET=P, TYPE=ANISOTROPIC\n1e-6, 2e-6, 3e-6\n", None),
        ("*ELEMENT, TYPE=MASS, ELSET=P\n900, 24\n", None),
        (f"{INSTANCE}*MASS, ELSET=P\n1e-6\n", None),
        (f"{INSTANCE}*MASS, ELSET=Q\n1e-6\n", None),
        (f"*ELEMENT, TYPE=MASS\n900, 24\n{INSTANCE.split(chr(10), 2)[2]}*MASS, ELSET=Q\n1e-6\n", None),
        (INSTANCE, None),
        (f"{INSTANCE}*NSET, NSET=near\n1\n*NSET, NSET=near, ELSET=P\n", None),
    ],
)
def test_a_deck_is_read_whatever_it_says_of_masses_at_points(tmp_path, points, expected):
    (tmp_path / "m.inp").write_text(beam("C3D8") + points)
    mesh = read_deck_mesh(tmp_path / "m.inp")
    assert mesh.point_mass == expected
    assert mesh.density["C3D8"].tolist() == [7.8e-9] * 6


POINT = "*ELEMENT, TYPE=MASS, ELSET=P\n900, 30\n*MASS, ELSET=P\n1e-6\n"


@pytest.mark.parametrize("says", [POINT, "", "nonstructural"])
def test_mass_of_which_the_deck_speaks_is_no_other_mass(tmp_path, says):
    """At a point, of which CalculiX makes no node; spread over elements, which CalculiX does not know."""
    step = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"
    heavier = beam("C3D8").replace("7.8e-9", "8.0e-9") if says == "nonstructural" else beam("C3D8") + says
    (tmp_path / "m.inp").write_text(heavier + step)
    subprocess.run(["ccx", "-i", "m"], cwd=tmp_path, check=True, capture_output=True)
    if says == "nonstructural":
        (tmp_path / "m.inp").write_text(f"{beam('C3D8')}*NONSTRUCTURAL MASS, ELSET=E, UNITS=MASS PER VOLUME\n2e-10\n")
    model, notes = import_model(tmp_path / "m.h5", calculix_job=tmp_path / "m", mesh=tmp_path / "m.inp")
    assert not [note for note in notes if note.startswith("warning")]
    assert any("type MASS" in note and "loads by mass" not in note for note in notes) == (says == POINT)
    assert bool(model.density) == (says != "nonstructural")
    # Of the layer at the support free nodes have the integral of x^2, a third, between them.
    solid = (8.0e-9 if says == "nonstructural" else 7.8e-9) * 30.0 * 16.0 * 7.0 * 7.0 / 9.0
    along = rigid_translation(model, (1.0, 0.0, 0.0))
    assert along @ model.mass @ along == pytest.approx(solid + (1e-6 if says == POINT else 0.0), rel=1e-6)
