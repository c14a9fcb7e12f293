"""The motion of the whole structure over a period, written by one rank and by several, read back by meshio."""

from __future__ import annotations

import contextlib
import xml.etree.ElementTree as ElementTree

import h5py
import meshio
import numpy as np
import pytest
import synthetic
from jobs import attrito
from scipy.sparse import identity

from attrito.model_file import write_model

PHASES, FREQUENCY, COORDINATES = 5, 40.0, 21


def two_kinds():
    """A brick and a tetrahedral body, ids shuffled, the lowest nodes held."""
    bodies = [
        synthetic.block("C3D8", (3, 2, 1)),
        synthetic.block("C3D10", (1, 1, 2), shape=lambda points: points + [0.0, 0.0, 1.5]),
    ]
    return synthetic.assemble(bodies, {}, held=lambda points: points[:, 2] < 1e-9, seed=6)


@pytest.fixture(scope="module", params=["one kind", "two kinds"])
def case(request, tmp_path_factory):
    """A folder with a result of two points, the rom.h5 and the model it belongs to."""
    folder = tmp_path_factory.mktemp("series")
    model = two_kinds() if request.param == "two kinds" else synthetic.joint("C3D20", (2, 1, 1), seed=4)
    model.stiffness = model.mass = identity(model.size, format="csr")
    write_model(folder / "model.h5", model, [])
    random = np.random.default_rng(3)
    basis, reduced = random.normal(size=(COORDINATES, model.size)), random.normal(size=(2, COORDINATES, 5))
    with h5py.File(folder / "rom.h5", "w") as rom:
        rom.create_dataset("recovery/basis", data=basis, chunks=(1, min(model.size, 50)))
    synthetic.write_result(
        folder / "result.h5", [FREQUENCY, 50.0], {"one": [1.0, 2.0], "other": [4.0, 3.0]}, coordinates=reduced
    )
    with h5py.File(folder / "result.h5", "r+") as result:
        result.attrs["model_file"], result.attrs["rom_file"] = str(folder / "model.h5"), str(folder / "rom.h5")
        result.attrs["rom_fingerprint"] = ""
    return folder, model, basis, reduced


def displacement(model, basis, reduced, phase):
    """basis^T q(t) at the nodes, one dof after another, from the definition of the coefficients."""
    angle = 2 * np.pi * phase / PHASES
    q = reduced @ np.array([1.0, np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)])
    full = basis.T @ q
    moved = np.zeros((len(model.node_ids), 3))
    row = {node: index for index, node in enumerate(model.node_ids)}
    for dof, (node, direction) in enumerate(zip(model.dof_node, model.dof_direction, strict=True)):
        moved[row[node], direction - 1] = full[dof]
    return moved


def by_place(points, values, where):
    """Values at the nodes where they are asked for; every piece that holds a node agrees on it."""
    order = np.lexsort(np.round(points, 9).T)
    distance = np.linalg.norm(points[:, None] - where[None, :], axis=2)
    assert len(order) and distance.min(axis=0).max() < 1e-9
    return values[np.argmin(distance, axis=0)]


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_vtu_series_holds_the_motion_at_its_phases(case, ranks):
    folder, model, basis, reduced = case
    done = attrito(folder, "export", "result.h5", "--points", "1,0", "--phases", str(PHASES), ranks=ranks)
    assert done.returncode == 0, done.stderr
    assert [line.rsplit("/", 1)[-1] for line in done.stdout.split()] == ["shape_1.pvd", "shape_0.pvd"]
    # Both bodies of the joint have nodes at one place, which move apart: tell them by the cells.
    for point, hertz in ((0, FREQUENCY), (1, 50.0)):
        entries = ElementTree.parse(folder / f"shape_{point}.pvd").getroot().findall(".//DataSet")
        assert [float(entry.get("timestep")) for entry in entries] == pytest.approx(np.arange(PHASES) / PHASES / hertz)
        for phase, entry in enumerate(entries):
            expected = displacement(model, basis, reduced[point], phase)
            cells = 0
            for piece in pieces(folder, entry.get("file"), ranks):
                mesh = meshio.read(piece)
                cells += sum(len(block.data) for block in mesh.cells)
                found = mesh.point_data["displacement"]
                node = nodes_of(model, mesh.points, found, expected)
                assert found == pytest.approx(expected[node], abs=1e-12)
            assert cells == sum(len(ids) for ids, _ in model.elements.values())


def pieces(folder, name, ranks):
    if ranks is None:
        return [folder / name]
    root = ElementTree.parse(folder / name).getroot()
    arrays = {array.get("Name") for array in root.findall(".//PPointData/PDataArray")}
    named = [folder / piece.get("Source") for piece in root.findall(".//Piece")]
    assert arrays == set(meshio.read(named[0]).point_data) and len(named) == ranks
    return named


def nodes_of(model, points, found, expected):
    """Which node each point of a file is: that at its place and, of two bodies' nodes there, the one that moves so."""
    near = np.linalg.norm(points[:, None] - model.coordinates[None, :], axis=2) < 1e-9
    apart = np.linalg.norm(found[:, None] - expected[None, :], axis=2)
    assert near.any(axis=1).all()
    return np.argmin(np.where(near, apart, np.inf), axis=1)


@pytest.mark.parametrize("ranks", [None, 2])
def test_an_xdmf_series_holds_the_motion_at_its_phases(case, ranks):
    folder, model, basis, reduced = case
    name = f"series{ranks or 1}.xdmf"
    arguments = ("export", "result.h5", "--point", "0", "--phases", str(PHASES), "--format", "xdmf", "-o", name)
    done = attrito(folder, *arguments, ranks=ranks)
    assert done.returncode == 0, done.stderr
    # The reader of meshio looks for the HDF5 file from where it runs.
    with contextlib.chdir(folder), meshio.xdmf.TimeSeriesReader(name) as reader:
        points, cells = reader.read_points_cells()
        assert np.array_equal(points, model.coordinates)
        assert sum(len(block.data) for block in cells) == sum(len(ids) for ids, _ in model.elements.values())
        # First corners of all cells are those of the model.
        row = {node: index for index, node in enumerate(model.node_ids)}
        first = [row[nodes[0]] for _, connectivity in model.elements.values() for nodes in connectivity]
        assert sorted(int(nodes[0]) for block in cells for nodes in block.data) == sorted(first)
        assert reader.num_steps == PHASES
        for phase in range(PHASES):
            time, data, _ = reader.read_data(phase)
            assert time == pytest.approx(phase / PHASES / FREQUENCY)
            assert data["displacement"] == pytest.approx(displacement(model, basis, reduced[0], phase), abs=1e-12)


def test_the_geometry_is_displaced_by_the_scale(case):
    folder, model, basis, reduced = case
    arguments = ("--point", "1", "--phases", str(PHASES), "--scale", "0.25", "-o", "moved.vtu")
    done = attrito(folder, "export", "result.h5", *arguments)
    assert done.returncode == 0, done.stderr
    mesh = meshio.read(folder / "moved_phase_003.vtu")
    expected = displacement(model, basis, reduced[1], 3)
    assert mesh.points == pytest.approx(model.coordinates + 0.25 * expected, abs=1e-12)


def test_the_point_is_that_of_the_monitor_s_largest_amplitude(case):
    folder, model, basis, reduced = case
    for monitor, point in (("one", 1), ("other", 0)):
        done = attrito(folder, "export", "result.h5", "--monitor", monitor, "-o", f"{monitor}.vtu")
        assert done.returncode == 0, done.stderr
        mesh = meshio.read(folder / f"{monitor}.vtu")
        place = np.flatnonzero(model.dof_direction == 2)
        row = {node: index for index, node in enumerate(model.node_ids)}
        nodes = [row[node] for node in model.dof_node[place]]
        assert mesh.point_data["cosine_1"][nodes, 1] == pytest.approx(basis.T[place] @ reduced[point][:, 1])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--points", "0,9"], "point = 9: expected a number from 0 to 1"),
        (["--points", "a"], "expected numbers with commas between"),
        (["--phases", "0"], "expected a number of at least 1"),
        (["--monitor", "none"], "--monitor = 'none': expected one of one, other"),
        (["-o", "nowhere/shape.vtu"], "expected a place where a file can be written"),
        (["-o", "nowhere/shape.xdmf", "--format", "xdmf"], "expected a place where a file can be written"),
    ],
)
@pytest.mark.parametrize("ranks", [None, 2])
def test_what_cannot_be_exported_is_told_once_on_any_number_of_ranks(case, options, said, ranks):
    folder = case[0]
    done = attrito(folder, "export", "result.h5", *options, ranks=ranks)
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr, done.stderr
    if "expected numbers" not in said and "at least 1" not in said:
        assert done.stderr.count(said) == 1
