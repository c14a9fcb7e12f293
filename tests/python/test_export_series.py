"""The motion of the whole structure over a period, written by one rank and by several, read back by meshio."""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ElementTree

import h5py
import meshio
import numpy as np
import pytest
import synthetic
from edited import edited
from full_disk import OLD, one_message, with_room_for
from jobs import attrito, attrito_here
from scipy.sparse import identity

from attrito.model.model_file import write_model

PHASES, FREQUENCY, COORDINATES = 5, 40.0, 21


def two_kinds(brick, tetrahedron):
    """A brick and a tetrahedral body, ids shuffled, the lowest nodes held."""
    bodies = [
        synthetic.block(brick, (3, 2, 1)),
        synthetic.block(tetrahedron, (1, 1, 2), shape=lambda points: points + [0.0, 0.0, 1.5]),
    ]
    return synthetic.assemble(bodies, {}, held=lambda points: points[:, 2] < 1e-9, seed=6)


def make_case(folder, model):
    """A folder with a result of two points, the rom.h5 and the model it belongs to."""
    model.stiffness = model.mass = identity(model.size, format="csr")
    write_model(folder / "model.h5", model, [])
    random = np.random.default_rng(3)
    basis, reduced = random.normal(size=(COORDINATES, model.size)), random.normal(size=(2, COORDINATES, 5))
    with h5py.File(folder / "rom.h5", "w") as rom:
        rom.create_dataset("recovery/basis", data=basis, chunks=(1, min(model.size, 50)))
    synthetic.write_result(
        folder / "result.h5", [FREQUENCY, 50.0], {"one": [1.0, 2.0], "other": [4.0, 3.0]}, coordinates=reduced
    )
    with edited(folder / "result.h5") as result:
        result.attrs["model_file"], result.attrs["rom_file"] = str(folder / "model.h5"), str(folder / "rom.h5")
        result.attrs["rom_fingerprint"] = ""
    return folder, model, basis, reduced


@pytest.fixture(scope="module", params=["one kind", "two kinds", "two kinds of second order"])
def case(request, tmp_path_factory):
    """Folder, model, basis and reduced motion, of elements of one kind and of two."""
    kinds = {"two kinds": ("C3D8", "C3D4"), "two kinds of second order": ("C3D20", "C3D10")}.get(request.param)
    model = two_kinds(*kinds) if kinds else synthetic.joint("C3D20", (2, 1, 1), seed=4)
    return make_case(tmp_path_factory.mktemp("series"), model)


@pytest.fixture(scope="module")
def simple(tmp_path_factory):
    """The same of one kind only."""
    return make_case(tmp_path_factory.mktemp("simple"), synthetic.joint("C3D8", (1, 1, 1), seed=4))


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


def export(folder, capfd, *options, ranks=None):
    """Run the command, here or on a number of ranks; returns what it said."""
    if ranks is None:
        done = attrito_here(folder, capfd, "export", "result.h5", *options)
    else:
        done = attrito(folder, "export", "result.h5", *options, ranks=ranks)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_vtu_series_holds_the_motion_at_its_phases(case, capfd, ranks):
    folder, model, basis, reduced = case
    said = export(folder, capfd, "--points", "1,0", "--phases", str(PHASES), ranks=ranks)
    assert [line.rsplit("/", 1)[-1] for line in said.split()] == ["shape_1.pvd", "shape_0.pvd"]
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


def mixed_cells(data):
    """Cells of several kinds, each its number and its nodes; meshio itself reads those of first order only."""
    sizes = {6: ("tetra", 4), 9: ("hexahedron", 8), 0x26: ("tetra10", 10), 0x30: ("hexahedron20", 20)}
    cells, place = {}, 0
    while place < len(data):
        name, size = sizes[int(data[place])]
        cells.setdefault(name, []).append(data[place + 1 : place + 1 + size])
        place += 1 + size
    return [meshio.CellBlock(name, np.array(rows)) for name, rows in cells.items()]


@pytest.mark.parametrize("ranks", [None, 2])
def test_an_xdmf_series_holds_the_motion_at_its_phases(case, capfd, ranks, monkeypatch):
    monkeypatch.setattr(meshio.xdmf.time_series, "translate_mixed_cells", mixed_cells)
    folder, model, basis, reduced = case
    name = f"series{ranks or 1}.xdmf"
    export(folder, capfd, "--point", "0", "--phases", str(PHASES), "-o", name, ranks=ranks)
    with meshio.xdmf.TimeSeriesReader(folder / name) as reader:
        points, cells = reader.read_points_cells()
        assert np.array_equal(points, model.coordinates)
        row = {node: index for index, node in enumerate(model.node_ids)}
        expected = [[row[node] for node in nodes] for _, kind in model.elements.values() for nodes in kind.tolist()]
        assert sorted(nodes.tolist() for block in cells for nodes in block.data) == sorted(expected)
        assert reader.num_steps == PHASES
        for phase in range(PHASES):
            time, data, _ = reader.read_data(phase)
            assert time == pytest.approx(phase / PHASES / FREQUENCY)
            assert data["displacement"] == pytest.approx(displacement(model, basis, reduced[0], phase), abs=1e-12)


def test_the_geometry_is_displaced_by_the_scale(simple, capfd):
    folder, model, basis, reduced = simple
    export(folder, capfd, "--point", "1", "--phases", str(PHASES), "--scale", "0.25", "-o", "moved.vtu")
    mesh = meshio.read(folder / "moved_phase_003.vtu")
    expected = displacement(model, basis, reduced[1], 3)
    assert mesh.points == pytest.approx(model.coordinates + 0.25 * expected, abs=1e-12)


def test_the_point_is_that_of_the_monitor_s_largest_amplitude(simple, capfd):
    folder, model, basis, reduced = simple
    row = {node: index for index, node in enumerate(model.node_ids)}
    place = np.flatnonzero(model.dof_direction == 2)
    nodes = [row[node] for node in model.dof_node[place]]
    for monitor, point in (("one", 1), ("other", 0)):
        export(folder, capfd, "--monitor", monitor, "-o", f"{monitor}.vtu")
        mesh = meshio.read(folder / f"{monitor}.vtu")
        assert mesh.point_data["cosine_1"][nodes, 1] == pytest.approx(basis.T[place] @ reduced[point][:, 1])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--points", "0,9"], "point = 9: expected a number from 0 to 1"),
        (["--monitor", "none"], "--monitor = 'none': expected one of one, other"),
        (["-o", "nowhere/shape.vtu"], "expected a place where a file can be written"),
        (["-o", "nowhere/shape.xdmf", "--format", "xdmf"], "expected a place where a file can be written"),
    ],
)
def test_what_cannot_be_exported_is_told(simple, capfd, options, said):
    done = attrito_here(simple[0], capfd, "export", "result.h5", *options)
    assert done.returncode == 2 and done.stderr.count(said) == 1, done.stderr


@pytest.mark.parametrize("name", ["a & b", "a < b", "a > b", "it's", 'a "b"'])
def test_an_xdmf_series_may_have_any_name(simple, capfd, name):
    done = attrito_here(simple[0], capfd, "export", "result.h5", "--phases", "2", "-o", f"{name}.xdmf")
    assert done.returncode == 0, done.stderr
    items = ElementTree.parse(simple[0] / f"{name}.xdmf").iter("DataItem")
    assert {item.text.split(":")[0] for item in items} == {f"{name}.h5"}


def test_a_colon_in_the_name_of_an_xdmf_series_is_refused(simple, capfd):
    done = attrito_here(simple[0], capfd, "export", "result.h5", "--phases", "2", "-o", "a:b.xdmf")
    assert done.returncode == 2 and "a name without a colon" in done.stderr
    assert not list(simple[0].glob("a:b*"))


@pytest.mark.parametrize("place", ["nowhere/shape.vtu", "nowhere/shape.xdmf"])
def test_a_place_that_no_rank_can_write_to_is_told_once(simple, place):
    kind = place.rsplit(".", 1)[1]
    done = attrito(simple[0], "export", "result.h5", "-o", place, "--format", kind, ranks=2)
    assert done.returncode == 2 and done.stderr.count("expected a place where a file can be written") == 1, done.stderr


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("ending", ["xdmf", "vtu"])
def test_a_disk_that_fills_up_leaves_the_old_files(simple, tmp_path, ending, ranks):
    shutil.copytree(simple[0], tmp_path, dirs_exist_ok=True)
    data = {"xdmf": "shape.h5", "vtu": "shape.vtu" if ranks == 1 else "shape_rank0.vtu"}[ending]
    (tmp_path / data).write_bytes(OLD)
    done = with_room_for(1000, tmp_path, "export", "result.h5", "--format", ending, ranks=ranks)
    assert done.returncode == 2 and data in one_message(done) and "room on the disk" in done.stderr
    assert (tmp_path / data).read_bytes() == OLD
    assert [path.name for path in tmp_path.iterdir() if path.name.endswith(".new")] == []


@pytest.mark.parametrize("options", [["--points", "a"], ["--phases", "0"]])
def test_numbers_that_are_none_end_with_the_usage(simple, capfd, options):
    with pytest.raises(SystemExit) as ended:
        attrito_here(simple[0], capfd, "export", "result.h5", *options)
    assert ended.value.code == 2
    assert f"argument {options[0]}" in capfd.readouterr().err
