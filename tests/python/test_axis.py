"""Nodes on the axis of a sector: in all sectors at once, against wheels that have them once."""

from __future__ import annotations

from dataclasses import replace

import meshio
import numpy as np
import pytest
from cyclic_scenes import random_sector
from jobs import attrito_here, run, table, write_job
from mpi4py import MPI
from scipy.linalg import eigh
from scipy.spatial import cKDTree
from wheels import ring, sector_job, sector_on_axis

from attrito.cli import main
from attrito.job.reading import read_job
from attrito.library.session import Options, Solver
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.modes.families import families_of
from attrito.results.result import Result
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.wheel import wave_in_wheel, whole_wheel
from attrito.stresses.cycle import cycle_of
from attrito.stresses.recovery import nodal_stress
from attrito.support.errors import InputError

LEVEL, FREQUENCIES = 2.0, [0.24, 0.2, 0.17, 0.15, 0.12]
# Both are solved to 1e-13 of the motion; the condition of the balance is below 1e3 at these frequencies.
CLOSE = 1e-9


def in_space(sector, size, number):
    """What a sector's coordinates are of the wheel's: its own and the next one's, and vectors in space at the axis.

    Written as geometry: a displacement vector seen along axes that are turned by an angle has the components R^T a.
    """
    angle = 2.0 * np.pi * number / sector.sectors
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    on_axis = np.column_stack([sector.across, sector.along])
    own = np.setdiff1d(np.arange(size), np.concatenate([sector.upper, on_axis.ravel()]))
    seen = np.zeros((size, sector.sectors * len(own) + on_axis.size))
    for i, coordinate in enumerate(own):
        seen[coordinate, number * len(own) + i] = 1.0
    for lower, upper in zip(sector.lower, sector.upper, strict=True):
        seen[upper, (number + 1) % sector.sectors * len(own) + np.flatnonzero(own == lower)[0]] = 1.0
    for i, node in enumerate(on_axis):
        first = sector.sectors * len(own) + 3 * i
        seen[np.ix_(node, np.arange(first, first + 3))] = turn.T
    return seen


@pytest.mark.parametrize("sectors", [1, 2, 3, 6])
def test_the_whole_wheel_has_a_node_on_the_axis_once(sectors):
    """Matrices, rows and loads of all sectors, by displacements in space; the order of coordinates is free."""
    scene = random_sector(7, sectors, 1, axis_nodes=1)
    wheel, size = whole_wheel(scene), len(scene.mass)
    seen = [in_space(scene.sector, size, j) for j in range(sectors)]
    # With one node on the axis, the wheel's last coordinates are: along, across, across.
    order = np.r_[: seen[0].shape[1] - 3, seen[0].shape[1] + np.array([-1, -3, -2])]
    seen = [view[:, order] for view in seen]
    stiffness = sum(view.T @ scene.stiffness @ view for view in seen)
    assert wheel.stiffness == pytest.approx(stiffness, abs=1e-12)
    rows = [
        scene.directions @ view + scene.sector.next_directions @ after
        for view, after in zip(seen, seen[1:] + seen[:1], strict=True)
    ]
    assert wheel.directions == pytest.approx(np.vstack(rows), abs=1e-12)
    assert wheel.static == pytest.approx(sum(scene.static @ view for view in seen), abs=1e-12)
    assert wheel.monitors == pytest.approx(scene.monitors @ seen[0], abs=1e-12)


def points_of(scene, frequencies=FREQUENCIES):
    """Points and motion of all coordinates at the frequencies."""
    options = Options(harmonics=3, samples=120, tolerance=1e-13)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequencies[0])
        return [(point, solver.coordinates()) for point in solver.solve_at(frequencies, LEVEL, 0)]


def damped(scene, kind):
    """The same with damping that leaves its modes uncoupled, or not, or with Coriolis forces."""
    if kind == "mass":
        return scene
    if kind == "coriolis":
        skew = 0.1 * np.random.default_rng(9).uniform(-1.0, 1.0, scene.mass.shape)
        return replace(scene, gyroscopic=np.ascontiguousarray(skew - skew.T))
    viscous = 0.05 * scene.mass + 0.02 * scene.stiffness + 0.02 * np.diag(np.arange(len(scene.mass)) % 3)
    return replace(scene, damping_kind="viscous", damping=np.ascontiguousarray(viscous))


@pytest.mark.parametrize("kind", ["mass", "viscous", "coriolis"])
@pytest.mark.parametrize(
    ("sectors", "order"), [(2, 1), *[(sectors, order) for sectors in (3, 5, 6) for order in (0, 1, 2, sectors - 1)]]
)
def test_one_sector_moves_as_in_the_whole_wheel(sectors, order, kind):
    scene = damped(random_sector(20 + sectors, sectors, order, axis_nodes=2), kind)
    compared, turned = 0, 0.0
    for (one, motion), (whole, expected) in zip(points_of(scene), points_of(whole_wheel(scene)), strict=True):
        assert one.is_solved
        # Sliders of contacts that stick all along start at other instants of each sector's own time.
        if not (one.unique and whole.is_solved and whole.unique):
            continue
        compared += one.states[2] > 0
        turned = max(turned, np.abs(motion[scene.sector.across]).max())
        scale = np.abs(whole.harmonics).max()
        assert one.harmonics == pytest.approx(whole.harmonics, abs=CLOSE * scale)
        scale = np.abs(expected).max()
        assert wave_in_wheel(motion, scene.sector) == pytest.approx(expected, abs=CLOSE * scale)
    assert compared >= 2, "contacts do not slip: the test is void"
    # Harmonics of nodal diameter 1 alone move the axis across.
    excited = any((h * order) % sectors in (1, sectors - 1) for h in (1, 2, 3))
    assert (turned > 1e-3) == excited and (turned > 0.0) == excited


def every_mode(scene, state, count=10_000):
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=1)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.15)
        return families_of(solver, state, count)


@pytest.mark.parametrize("sectors", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("boundary", [True, False])
def test_modes_of_all_nodal_diameters_are_those_of_the_wheel(sectors, boundary):
    """Sectors that meet at the axis alone, too; stuck, by the dense wheel."""
    for seed in range(3):
        scene = random_sector(seed, sectors, 2, axis_nodes=2, boundary=boundary)
        families = every_mode(scene, "stuck")
        whole = whole_wheel(scene)
        springs = np.concatenate([[k] * t + [n] for t, k, n in zip(*laws_of(whole), strict=True)])
        stiffness = whole.stiffness + whole.directions.T @ (springs[:, None] * whole.directions)
        expected = np.sqrt(eigh(stiffness, whole.mass, eigvals_only=True)) / (2.0 * np.pi)
        times = [1 if (2 * family.diameter) % sectors == 0 else 2 for family in families]
        found = [np.repeat(family.modes.natural_hz, n) for family, n in zip(families, times, strict=True)]
        # Rounding of 1e-16 times the ratio of the largest to the least eigenvalue, below 1e3.
        assert np.sort(np.concatenate(found)) == pytest.approx(expected, rel=1e-9)
        for family in families:
            check_shapes(scene, family, stiffness, whole.mass)


def laws_of(scene):
    return (scene.laws[name] for name in ("tangents", "tangential_stiffness", "normal_stiffness"))


def check_shapes(scene, family, stiffness, mass):
    """Spread over the wheel, sector j later by n j / N, shapes are its modes; those of one sector have x^H M x = 1."""
    modes, sector = family.modes, scene.sector
    turned = replace(sector, engine_order=family.diameter)
    for shape, frequency in zip(modes.shapes, modes.natural_hz, strict=True):
        series = np.stack([np.zeros(len(shape)), shape.real, -shape.imag], axis=1)
        wave = wave_in_wheel(series, turned)
        wheel = wave[:, 1] - 1j * wave[:, 2]
        force = stiffness @ wheel - (2.0 * np.pi * frequency) ** 2 * (mass @ wheel)
        # Eigenvectors satisfy their equation to rounding of the largest eigenvalue, some 50.
        assert np.abs(force).max() < 1e-11
    gram = modes.shapes.conj() @ scene.mass @ modes.shapes.T
    assert gram == pytest.approx(np.eye(len(gram)), abs=1e-11)


class Disc:
    """A job on one sector of an elastic disc, in a folder."""

    def __init__(self, folder, sectors, seed=3, **cyclic):
        self.model = ring(sectors, 2, seed=seed, bored=False)
        self.folder, self.sectors = folder, sectors
        self.job = sector_job(self.model, sectors, **cyclic)

    def scene(self):
        write_model(self.folder / "model.h5", self.model, [])
        checked = read_job(self.job, self.folder)
        return build_scene(checked), checked

    def reduced(self):
        scene, checked = self.scene()
        return reduced_scene(checked, scene)

    def fault(self):
        with pytest.raises(InputError) as caught:
            self.scene()
        return str(caught.value)


@pytest.mark.parametrize("sectors", [3, 4, 6])
@pytest.mark.parametrize("known", ["in both sets", "by its place", "in one set"])
def test_frequencies_of_all_nodal_diameters_are_those_of_the_whole_disc(tmp_path, sectors, known):
    """Whichever sets nodes on the axis are in; without contacts."""
    disc = Disc(tmp_path, sectors)
    sets = disc.model.node_sets
    both = np.intersect1d(sets["low"], sets["high"])
    assert len(both) == 2
    if known != "in both sets":
        sets["low"] = np.setdiff1d(sets["low"], both)
    if known == "by its place":
        sets["high"] = np.setdiff1d(sets["high"], both)
    scene = disc.reduced()
    assert len(scene.sector.along) == len(scene.sector.across) == 2
    whole = ring(sectors, 2, span=sectors, bored=False)
    expected = np.sqrt(eigh(whole.stiffness.toarray(), whole.mass.toarray(), eigvals_only=True))
    found = []
    for number in range(sectors):
        shape = scene.sector.expansion(len(scene.mass), number).toarray()
        stiffness, mass = (shape.conj().T @ matrix @ shape for matrix in (scene.stiffness, scene.mass))
        found.append(np.sqrt(eigh(stiffness, mass, eigvals_only=True)))
    found = np.sort(np.concatenate(found))
    # Rounding of 1e-16 times the ratio of the largest to the least eigenvalue, some 1e3, and sizes of some 1e2.
    assert len(found) == len(expected) and found == pytest.approx(expected, rel=1e-9)


def test_a_job_with_a_hub_runs_is_examined_and_its_wheel_integrated(tmp_path, capfd):
    """The wave is stable, so the wheel, which has the hub once, keeps it in time; both engines say so."""
    job = sector_on_axis(5, 1) | {"balance": {"harmonics": 30}, "sweep": {"frequencies_hz": [36.0]}}
    job["stability"] = {"method": "both"}
    done = run(tmp_path, job)
    assert "1 along the axis and 2 across it in all sectors at once" in done.stdout + done.stderr
    with Result(tmp_path / "result.h5") as result:
        assert list(result.outcome) == ["converged"]
        amplitude = result.monitor("blade", "amplitude")[0]
        assert (result.array("contacts/slip") > 0.0).any(), "no contact slips: the test is void"
    floquet = [row for row in table(tmp_path, "--multipliers") if row["kind"] == "floquet"]
    found = {
        method: [complex(float(row["real"]), float(row["imag"])) for row in floquet if row["method"] == method]
        for method in ("monodromy", "hill")
    }
    # Three coordinates a sector without its upper boundary, and the hub's once
    assert len(found["monodromy"]) == 2 * (3 * 5 + 3)
    large = np.array([value for value in found["monodromy"] if abs(value) > 0.02])
    for value in large:
        assert np.abs(np.array(found["hill"]) - value).min() < 1e-5
    write_job(tmp_path, job | {"integrate": {"frequency_hz": 36.0, "start": "point:0"}})
    done = attrito_here(tmp_path, capfd, "integrate", "job.toml")
    assert done.returncode == 0, done.stderr
    with Result(tmp_path / "result.h5") as result:
        assert result.array("integration/monitors/blade/amplitude") == pytest.approx(amplitude, rel=1e-6)


def test_only_coordinates_that_move_are_listed_as_modes(tmp_path, capfd):
    """The hub moves along the axis at nodal diameter 0, in one way across it at 1, and not at 2."""
    write_job(tmp_path, sector_on_axis(5, 2))
    done = attrito_here(tmp_path, capfd, "linear-modes", "job.toml", "--state", "stuck", "--count", "100")
    assert done.returncode == 0, done.stderr
    listed = [row["nodal_diameter"] for row in table(tmp_path, result="result.stuck.modes.h5")]
    assert [listed.count(number) for number in "012"] == [4, 4, 3]


def test_a_disc_that_is_reduced_to_interface_modes_keeps_what_is_on_its_axis(tmp_path):
    """As many shapes as the boundary has dofs leave nothing out."""
    disc = Disc(tmp_path, 4)
    disc.job["reduction"] = {"modes": 3}
    frequencies = []
    for interface in ("all", 40):
        disc.job["cyclic"]["interface_modes"] = interface
        disc.job["reduction"]["file"] = f"rom_{interface}.h5"
        scene, job = disc.scene()
        rom, _ = make_rom(MPI.COMM_SELF, job, scene, say=lambda _: None)
        with Solver(MPI.COMM_SELF, reduced_scene(job, scene, rom), Options(harmonics=1)) as solver:
            frequencies.append(np.array([solver.diameter_modes("stuck", n, 12).natural_hz for n in range(3)]))
    assert rom.interface.shape == (len(scene.sector.lower),) * 2
    assert frequencies[1] == pytest.approx(frequencies[0], rel=1e-8)


@pytest.mark.parametrize("engine_order", [0, 1, 2, -1])
def test_a_wave_drawn_on_all_sectors_of_a_disc_meets_itself(tmp_path, capfd, engine_order):
    """Sectors are drawn one by one: wherever nodes of several lie, on the axis all six, they move alike."""
    disc = Disc(tmp_path, 6, engine_order=engine_order)
    disc.job["damping"] = {"ratio": 0.02}
    disc.job["sweep"] = {"frequencies_hz": [2500.0]}
    write_model(tmp_path / "model.h5", disc.model, [])
    run(tmp_path, disc.job)
    assert main(["export", str(tmp_path / "result.h5"), "--wheel"]) == 0, capfd.readouterr().err
    (picture,) = tmp_path.glob("*.vtu")
    mesh = meshio.read(picture)
    shapes = np.hstack([mesh.point_data[name] for name in ("cosine_1", "sine_1", "mean")])
    home = np.vstack([disc_points(disc.model, 6, j) for j in range(6)])
    groups = cKDTree(home).query_ball_point(home, 1e-9)
    assert len(mesh.points) == len(home) and max(map(len, groups)) == 6
    scale = np.abs(shapes).max()
    for members in groups:
        # Solutions of condition some 1e4, and files in double precision.
        assert np.ptp(shapes[members], axis=0).max() < 1e-9 * scale
    axis = np.flatnonzero(np.hypot(*home[:, :2].T) < 1e-9)
    moves = np.abs(mesh.point_data["cosine_1"][axis]).max(axis=0) > 1e-6 * scale
    assert moves.tolist() == {0: [False, False, True], 2: [False] * 3}.get(engine_order, [True, True, False])

    arguments = ["--young", "2e11", "--poisson", "0.3", "--wheel", "--vtu", str(tmp_path / "stress.vtu")]
    assert main(["stress", str(tmp_path / "result.h5"), *arguments]) == 0, capfd.readouterr().err
    drawn = meshio.read(tmp_path / "stress.vtu").point_data["alternating_von_mises"]
    # The disc whose nodes that meet are one
    one = np.array([min(members) for members in groups])
    order = np.argsort(disc.model.node_ids)
    ((kind, (ids, connectivity)),) = disc.model.elements.items()
    rows = order[np.searchsorted(disc.model.node_ids, connectivity, sorter=order)]
    bricks = one[np.concatenate([rows + j * len(order) for j in range(6)])]
    constants = {kind: np.tile([2e11, 0.3], (len(bricks), 1))}
    elements = {kind: (np.arange(len(bricks)), bricks)}
    whole = Model(None, None, node_ids=np.arange(len(home)), coordinates=home, elements=elements, elastic=constants)
    wave = np.stack([mesh.point_data[name] for name in ("mean", "cosine_1", "sine_1")])
    stresses = nodal_stress(whole, wave, one == np.arange(len(home)))
    expected = cycle_of(stresses.harmonics).alternating_von_mises
    # By differences of displacements over a brick, a tenth of the disc
    assert drawn[stresses.node] == pytest.approx(expected, abs=1e-7 * expected.max())
    assert drawn == pytest.approx(drawn[one], abs=1e-7 * expected.max())


def disc_points(model, sectors, number):
    angle = 2.0 * np.pi * number / sectors
    x, y, z = model.coordinates.T
    return np.column_stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])


def test_a_node_on_the_axis_that_is_held_half_across_it_is_refused(tmp_path):
    disc = Disc(tmp_path, 6)
    model = disc.model
    node = int(np.intersect1d(model.node_sets["low"], model.node_sets["high"])[0])
    keep = np.flatnonzero((model.dof_node != node) | (model.dof_direction != 2))
    model.stiffness, model.mass = (matrix[keep][:, keep] for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction, model.size = model.dof_node[keep], model.dof_direction[keep], len(keep)
    expected = "expected nodes on the axis that are free or held along it, and free or held in all directions across"
    assert f"[cyclic] axis_direction = 'node {node} on the axis, held in part': {expected}" in disc.fault()


@pytest.mark.parametrize("held", [(1, 2), (3,), (1, 2, 3)])
def test_a_node_on_the_axis_may_be_held_along_it_or_across_it(tmp_path, held):
    sectors = 4
    frequencies = []
    for disc in (ring(sectors, 2, seed=3, bored=False), ring(sectors, 2, span=sectors, bored=False)):
        on_axis = disc.node_ids[np.hypot(*disc.coordinates[:, :2].T) < 1e-9]
        keep = np.flatnonzero(~(np.isin(disc.dof_node, on_axis) & np.isin(disc.dof_direction, held)))
        disc.stiffness, disc.mass = (matrix[keep][:, keep] for matrix in (disc.stiffness, disc.mass))
        disc.dof_node, disc.dof_direction, disc.size = disc.dof_node[keep], disc.dof_direction[keep], len(keep)
        frequencies.append(disc)
    sector, whole = frequencies
    one = Disc(tmp_path, sectors)
    one.model = sector
    scene = one.reduced()
    found = []
    for number in range(sectors):
        shape = scene.sector.expansion(len(scene.mass), number).toarray()
        parts = (shape.conj().T @ matrix @ shape for matrix in (scene.stiffness, scene.mass))
        found.append(np.sqrt(eigh(*parts, eigvals_only=True)))
    expected = np.sqrt(eigh(whole.stiffness.toarray(), whole.mass.toarray(), eigvals_only=True))
    assert np.sort(np.concatenate(found)) == pytest.approx(expected, rel=1e-9)
