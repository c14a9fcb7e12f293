"""`attrito linear-modes` of one sector of a wheel: modes of every nodal diameter, against wheels assembled whole."""

from __future__ import annotations

from dataclasses import replace

import h5py
import meshio
import numpy as np
import pytest
from cyclic_scenes import random_sector
from jobs import attrito_here, table, write_job
from mpi4py import MPI
from scipy.linalg import eigh
from scipy.spatial import cKDTree
from wheels import lumped_sector, ring, sector_job

from attrito.job.reading import read_job
from attrito.library.names import REFERENCES
from attrito.library.session import Options, Solver
from attrito.model.model_file import write_model
from attrito.modes.families import families_of
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.wheel import of_sector, whole_wheel

EVERY = 10_000


def at_rest(scene):
    solver = Solver(MPI.COMM_SELF, scene, Options(harmonics=1))
    solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.15)
    return solver


def springs(laws, state, closed):
    """Of each row; contacts in the state `tangent` as they are closed."""
    found = []
    for i, tangents in enumerate(laws["tangents"]):
        held = state != "tangent" or closed[i]
        along = 0.0 if state == "frictionless" or not held else laws["tangential_stiffness"][i]
        found += [along] * tangents + [laws["normal_stiffness"][i] * held]
    return np.array(found)


def opened(scene):
    """The same with the contact across far apart: at rest it is open."""
    return replace(scene, laws=scene.laws | {"gap": np.array([0.0, 100.0]), "preload": np.array([5.0, 0.0])})


def twice(families, sectors, values):
    """Values of all modes of the wheel: nodal diameters above 0 and below N/2 stand for N - n too."""
    times = [1 if (2 * family.diameter) % sectors == 0 else 2 for family in families]
    return np.sort(np.concatenate([np.repeat(values(family), n) for family, n in zip(families, times, strict=True)]))


@pytest.mark.parametrize("state", REFERENCES)
@pytest.mark.parametrize(
    ("sectors", "tangents", "boundary"), [(1, 1, True), (2, 1, True), (3, 2, True), (5, 1, False), (6, 1, True)]
)
def test_modes_of_all_nodal_diameters_are_those_of_the_wheel(sectors, tangents, boundary, state):
    for seed in range(3):
        scene = random_sector(seed, sectors, 2, tangents=tangents, boundary=boundary)
        scene = opened(scene) if state == "tangent" else scene
        with at_rest(scene) as solver:
            families, closed = families_of(solver, state, EVERY), solver.closed_contacts()
        assert [family.diameter for family in families] == list(range(sectors // 2 + 1))
        if state == "tangent":
            assert closed.tolist() == [True, False], "no contact is open: the test is void"
        whole = whole_wheel(scene)
        held = springs(whole.laws, state, np.tile(closed, sectors))
        stiffness = whole.stiffness + whole.directions.T @ (held[:, None] * whole.directions)
        values = eigh(stiffness, whole.mass, eigvals_only=True)
        found = twice(families, sectors, lambda family: family.modes.natural_hz)
        assert not any(family.modes.rigid for family in families)
        # Rounding of 1e-16 times the ratio of the largest to the least eigenvalue, below 1e3.
        assert found == pytest.approx(np.sqrt(values) / (2.0 * np.pi), rel=1e-9)
        for family in families:
            check_shapes(scene, family, stiffness, whole.mass)


def check_shapes(scene, family, stiffness, mass):
    """Spread over the wheel, sector j later by n j / N, shapes are its modes; those of one sector have x^H M x = 1."""
    modes, sector = family.modes, scene.sector
    turn = np.exp(-2j * np.pi * family.diameter / sector.sectors)
    onto = [of_sector(sector, len(scene.mass), j) for j in range(sector.sectors)]
    inside = np.delete(np.arange(len(scene.mass)), sector.upper)
    shapes = sum(turn**j * modes.shapes[:, inside] @ t[:, inside].T for j, t in enumerate(onto))
    force = shapes @ stiffness - (2.0 * np.pi * modes.natural_hz[:, None]) ** 2 * (shapes @ mass)
    # Eigenvectors satisfy their equation to rounding of the largest eigenvalue, some 50.
    assert np.abs(force).max() < 1e-11
    gram = modes.shapes.conj() @ scene.mass @ modes.shapes.T
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-11)
    own = modes.shapes[:, inside]
    largest = own[np.arange(len(own)), np.abs(own).argmax(axis=1)]
    assert np.all(largest.real > 0.0) and np.abs(largest.imag).max() < 1e-14
    assert modes.shapes[:, sector.upper] == pytest.approx(turn * modes.shapes[:, sector.lower], abs=1e-12)


@pytest.mark.parametrize("kind", ["mass", "ratio", "viscous", "loss_factor"])
def test_damping_ratios_are_those_of_the_wheel(kind):
    """In the tangent system, where a ratio is of other modes: the wheel's own modes come in pairs of equal damping."""
    sectors = 5
    scene = opened(random_sector(1, sectors, 1))
    viscous = 0.01 * scene.mass + 0.02 * scene.stiffness + 0.05 * np.diag(np.arange(len(scene.mass)))
    scene = replace(
        scene,
        damping_kind=kind,
        damping_value=0.03,
        damping=np.ascontiguousarray(viscous) if kind == "viscous" else None,
    )
    with at_rest(scene) as solver:
        families = families_of(solver, "tangent", EVERY)
    with at_rest(whole_wheel(scene)) as solver:
        whole = solver.linear_modes("tangent", EVERY)
    pairs = [
        (hz, ratio, 1 if family.diameter == 0 else 2)
        for family in families
        for hz, ratio in zip(family.modes.natural_hz, family.modes.damping_ratio, strict=True)
    ]
    ratios = [ratio for _, ratio, count in sorted(pairs) for _ in range(count)]
    assert len(set(np.round(ratios, 6))) > 5, "all ratios are alike: the test is void"
    # Damping couples the modes of a pair to none but each other: what the two take together is invariant.
    firsts = np.cumsum([0, *(count for *_, count in sorted(pairs))])[:-1]
    assert np.add.reduceat(ratios, firsts) == pytest.approx(np.add.reduceat(whole.damping_ratio, firsts), rel=1e-9)


def test_motions_that_nothing_holds_are_rigid_body_modes_of_their_nodal_diameter():
    """A chain of masses closed to a ring, held by contacts that slide freely: it turns as a whole."""
    scene = random_sector(0, 4, 1)
    size = len(scene.mass)
    lower, upper = scene.sector.lower[0], scene.sector.upper[0]
    stiffness = np.diag(np.full(size, 2.0))
    for dof in (lower, upper):
        stiffness[dof, dof] = 3.0
    stiffness[lower, upper] = stiffness[upper, lower] = -3.0
    here, ahead = np.zeros((4, size)), np.zeros((4, size))
    # Each contact's tangent, then its normal.
    here[0, lower] = here[1, 0] = here[2, 1] = here[3, 2] = 1.0
    scene = replace(
        scene,
        mass=np.eye(size),
        stiffness=stiffness,
        directions=here,
        sector=replace(scene.sector, next_directions=ahead),
    )
    with at_rest(scene) as solver:
        sliding, stuck = (families_of(solver, state, EVERY) for state in ("frictionless", "stuck"))
    assert [family.modes.rigid for family in sliding] == [1, 0, 0]
    assert sliding[0].modes.natural_hz[0] < 1e-6 and sliding[0].modes.damping_ratio[0] == 0.0
    assert "nodal diameter 0" in sliding[0].in_words() and "1 rigid-body mode" in sliding[0].in_words()
    assert not any(family.modes.rigid for family in stuck)


def test_the_command_lists_the_lowest_modes_of_each_nodal_diameter(tmp_path, capfd):
    job = lumped_sector()
    job["output"] = {"file": "result.h5", "monitors": [{"name": "blade", "dofs": [[0, 1.0]]}]}
    name = write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "linear-modes", name, "--state", "stuck", "--count", "2")
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.stuck.modes.h5")
    assert list(rows[0]) == [
        "mode",
        "nodal_diameter",
        "frequency_hz",
        "kind",
        "damping_ratio",
        "blade_cosine",
        "blade_sine",
    ]
    assert [row["nodal_diameter"] for row in rows] == ["0", "0", "1", "1", "2", "2"]
    assert [row["mode"] for row in rows] == ["1", "2", "3", "4", "5", "6"]
    checked = read_job(job)
    scene = reduced_scene(checked, build_scene(checked))
    whole = whole_wheel(scene)
    held = springs(whole.laws, "stuck", [])
    values, vectors = eigh(whole.stiffness + whole.directions.T @ (held[:, None] * whole.directions), whole.mass)
    hz = np.sqrt(values) / (2.0 * np.pi)
    for row in rows:
        pair = np.isclose(hz, float(row["frequency_hz"]), rtol=1e-9)
        assert pair.sum() == (1 if row["nodal_diameter"] == "0" else 2)
        # C = 8 M; and what the blade moves in one mode of a pair or in a standing one, with x^H M x = 1 of a sector.
        assert float(row["damping_ratio"]) == pytest.approx(8.0 / (4.0 * np.pi * float(row["frequency_hz"])))
        moves = np.hypot(float(row["blade_cosine"]), float(row["blade_sine"]))
        in_wheel = np.sqrt(5 / pair.sum()) * np.linalg.norm(vectors[0, pair])
        assert moves == pytest.approx(in_wheel, rel=1e-9)


def test_a_mode_drawn_on_the_whole_ring_is_a_mode_of_it(tmp_path, capfd):
    """Both parts, cosine and sine, of a shape with its contact stuck; nodes of the ring meshed whole."""
    sectors, number = 6, 2
    model, whole = ring(sectors, seed=3), ring(sectors, span=sectors)
    write_model(tmp_path / "model.h5", model, [])
    job = sector_job(model, sectors)
    rim = int(model.node_sets["rim"][1])
    law = {"tangential_stiffness": 1e8, "normal_stiffness": 2e8, "friction_coefficient": 0.3}
    job["contact"] = [{"normal": [[["node", rim, "z"], 1.0]], "tangents": [[[["node", rim, "x"], 1.0]]], **law}]
    del job["contact_set"], job["load"], job["sweep"]
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job), "--state", "stuck", "--count", "4")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.stuck.modes.h5") as file:
        mode = int(np.flatnonzero(file["points/nodal_diameter"][:] == number)[2]) + 1
        omega = 2.0 * np.pi * file["points/frequency_hz"][mode - 1]
    done = attrito_here(tmp_path, capfd, "export", "result.stuck.modes.h5", "--mode", str(mode), "--wheel")
    assert done.returncode == 0, done.stderr
    mesh = meshio.read(tmp_path / "result.stuck.modes.shape.vtu")

    stiffness = whole.stiffness.toarray()
    place = model.coordinates[np.flatnonzero(model.node_ids == rim)[0]]
    for j in range(sectors):
        angle = 2.0 * np.pi * j / sectors
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        turned = np.array(
            [place[0] * along[0] - place[1] * along[1], place[0] * along[1] + place[1] * along[0], place[2]]
        )
        row = cKDTree(whole.coordinates).query(turned)[1]
        for direction, spring in ((along, 1e8), (np.array([0.0, 0.0, 1.0]), 2e8)):
            force = np.zeros((len(whole.node_ids), 3))
            force[row] = direction
            stiffness += spring * np.outer(whole.on_dofs(force), whole.on_dofs(force))
    row = cKDTree(mesh.points).query(whole.coordinates)[1]
    for name in ("cosine", "sine"):
        shape = whole.on_dofs(mesh.point_data[name][row])
        force = stiffness @ shape
        assert np.abs(shape).max() > 0.1 * mesh.point_data["amplitude"].max()
        # Rounding of the stiffness, 1e-16 times the ratio of the largest to this eigenvalue, some 1e4.
        assert force == pytest.approx(
            omega**2 * (whole.mass @ shape), abs=1e-9 * np.abs(stiffness).max() * np.abs(shape).max()
        )
    # One sector alone has the same fields.
    done = attrito_here(tmp_path, capfd, "export", "result.stuck.modes.h5", "--mode", str(mode))
    assert done.returncode == 0, done.stderr
    one = meshio.read(tmp_path / "result.stuck.modes.shape.vtu")
    count = len(one.points)
    for name in ("cosine", "sine", "amplitude"):
        assert one.point_data[name] == pytest.approx(mesh.point_data[name][:count], abs=1e-12)
