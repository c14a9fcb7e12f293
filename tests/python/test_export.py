"""The motion of the whole structure in a VTU file."""

from __future__ import annotations

import h5py
import meshio
import numpy as np
import pytest
import synthetic

from attrito.export.export import CELLS, export_point, full_field, mesh_cells, node_motion
from attrito.results.result import Result
from attrito.support.errors import InputError

KINDS = tuple(CELLS)
# Mid-side nodes of VTK's quadratic cells, by the corners they lie between: VTK file formats, "Quadratic cells".
VTK_EDGES = {
    "tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron20": (
        (0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7),
    ),
}  # fmt: skip


def one_point(tmp_path, model, field, **options):
    """A result whose only point has the full field [n, nk] as its coordinates."""
    return synthetic.write_result(tmp_path / "result.h5", [100.0], {}, coordinates=field[None], **options)


def one_node(coefficients):
    """Motion of a single node from Fourier coefficients [3, nk]."""
    model = synthetic.assemble([synthetic.block("C3D8", (1, 1, 1))], {}, held=lambda p: p.sum(axis=1) > 0)
    motion = node_motion(np.asarray(coefficients, dtype=float), model)
    place = int(np.flatnonzero(model.node_ids == model.dof_node[0])[0])
    return motion, place


@pytest.mark.parametrize("kind", KINDS)
def test_cells_keep_their_volume_and_their_mid_side_nodes_lie_midway(tmp_path, kind):
    model = synthetic.joint(kind, (2, 1, 1), seed=4)
    path = one_point(tmp_path, model, np.zeros((model.size, 3)))
    with Result(path) as result:
        assert export_point(result, 0, model, tmp_path / "shape.vtu") == (str(tmp_path / "shape.vtu"), [])
    mesh = meshio.read(tmp_path / "shape.vtu")
    (cells,) = mesh.cells
    assert cells.type == CELLS[kind]
    x = mesh.points[cells.data]
    for middle, (a, b) in enumerate(VTK_EDGES.get(cells.type, ()), start=8 if "hexa" in cells.type else 4):
        assert x[:, middle] == pytest.approx((x[:, a] + x[:, b]) / 2, abs=1e-12)
    along, across, up = (1, 3, 4) if "hexa" in cells.type else (1, 2, 3)
    triple = np.linalg.det(x[:, [along, across, up]] - x[:, [0]])
    assert (triple > 0).all()
    assert triple.sum() / (1 if up == 4 else 6) == pytest.approx(2.0)


def test_fields_reach_their_nodes_and_held_nodes_stand_still(tmp_path):
    model = synthetic.joint("C3D8", held=lambda points: points[:, 2] < 1e-9, seed=1)
    field = np.random.default_rng(0).normal(size=(model.size, 5))
    with Result(one_point(tmp_path, model, field)) as result:
        export_point(result, 0, model, tmp_path / "shape.vtu")
    data = meshio.read(tmp_path / "shape.vtu").point_data
    for column, name in enumerate(("mean", "cosine_1", "sine_1", "cosine_2", "sine_2")):
        for dof in range(0, model.size, 7):
            row = int(np.flatnonzero(model.node_ids == model.dof_node[dof])[0])
            assert data[name][row, model.dof_direction[dof] - 1] == field[dof, column]
    still = model.coordinates[:, 2] < 1e-9
    for name in ("mean", "cosine_1", "amplitude", "shape_at_peak"):
        assert not data[name][still].any() and data[name][~still].any()
    assert not {"contact_state", "normal_force"} & set(data)


def test_the_amplitude_of_an_ellipse_is_its_major_semi_axis():
    cosine, sine = np.array([1.0, 2.0, -0.5]), np.array([0.3, -1.0, 2.0])
    motion, node = one_node(np.column_stack([[9.0, 9.0, 9.0], cosine, sine]))
    semi_axis = np.linalg.svd(np.column_stack([cosine, sine]), compute_uv=False)[0]
    assert motion.amplitude[node] == pytest.approx(semi_axis, rel=1e-14)
    assert np.linalg.norm(motion.shape_at(motion.phase)[node] - 9) == pytest.approx(semi_axis, rel=1e-14)


def test_the_amplitude_of_a_circle_is_its_radius():
    motion, node = one_node([[0, 2.0, 0], [0, 0, 2.0], [0, 0, 0]])
    assert motion.amplitude[node] == pytest.approx(2.0, rel=1e-14)


def test_the_amplitude_of_many_harmonics_is_that_of_the_continuous_motion():
    random = np.random.default_rng(7)
    phase = np.linspace(0, 2 * np.pi, 200_001)
    for _ in range(20):
        field = random.normal(size=(3, 11))
        motion, node = one_node(field)
        basis = [trigonometric(h * phase) for h in range(1, 6) for trigonometric in (np.cos, np.sin)]
        dense = np.sqrt(((field[:, 1:] @ np.array(basis)) ** 2).sum(axis=0)).max()
        assert dense <= motion.amplitude[node] * (1 + 1e-14)
        assert motion.amplitude[node] == pytest.approx(dense, rel=1e-7)


def test_the_peak_shape_belongs_to_the_node_that_moves_most():
    model = synthetic.joint("C3D8")
    field = np.zeros((model.size, 3))
    field[3, 1], field[30, 2], field[:, 0] = 1.0, 5.0, 0.5
    motion = node_motion(field, model)
    assert motion.phase % np.pi == pytest.approx(np.pi / 2)
    shape = motion.shape_at(motion.phase)
    # The mean of 0.5 and the sine of 5 at the phase's quarter of a period, the first or the third.
    assert abs(shape).max() == pytest.approx(abs(0.5 + 5.0 * np.sin(motion.phase)))
    assert motion.amplitude.max() == 5.0


def test_the_rom_basis_recovers_the_full_field(tmp_path):
    model = synthetic.joint("C3D8")
    random = np.random.default_rng(2)
    basis, reduced = random.normal(size=(37, model.size)), random.normal(size=(37, 5))
    with h5py.File(tmp_path / "rom.h5", "w") as rom:
        rom["recovery/basis"] = basis
    with Result(one_point(tmp_path, model, reduced)) as result:
        assert full_field(result, 0, model.size, tmp_path / "rom.h5") == pytest.approx(basis.T @ reduced)


def rom_of_some(tmp_path, model, kept, basis) -> str:
    """A reduced model that gives back the motion of some dofs; its boundary are the first three."""
    with h5py.File(tmp_path / "rom.h5", "w") as rom:
        rom["recovery/basis"], rom["recovery/dof"] = basis, np.array(kept, dtype=np.int64)
        rom["boundary/dof"] = np.arange(3)
    return str(tmp_path / "rom.h5")


def test_motion_that_is_not_recovered_is_open_and_that_of_the_boundary_is_known(tmp_path):
    model = synthetic.joint("C3D8")
    random = np.random.default_rng(2)
    kept = [5, 9, 30]
    basis, reduced = random.normal(size=(37, len(kept))), random.normal(size=(37, 5))
    rom = rom_of_some(tmp_path, model, kept, basis)
    with Result(one_point(tmp_path, model, reduced)) as result:
        field = full_field(result, 0, model.size, rom)
        assert field[kept] == pytest.approx(basis.T @ reduced, rel=1e-14)
        assert np.array_equal(field[:3], reduced[:3])
        assert np.isnan(np.delete(field, [0, 1, 2, *kept], axis=0)).all()
        # Ranks have a part of the dofs each.
        parts = [full_field(result, 0, model.size, rom, part) for part in (slice(0, 8), slice(8, model.size))]
        assert np.concatenate(parts) == pytest.approx(field, rel=1e-13, nan_ok=True)


def test_elements_are_drawn_whose_nodes_all_are_recovered(tmp_path):
    model = synthetic.joint("C3D8")
    (_, connectivity), *_ = model.elements.values()
    kept = np.flatnonzero(np.isin(model.dof_node, connectivity[:2]))
    rom = rom_of_some(tmp_path, model, kept, np.random.default_rng(2).normal(size=(7, len(kept))))
    whole = [np.isin(nodes, connectivity[:2]).all() for nodes in connectivity]
    with Result(one_point(tmp_path, model, np.ones((7, 3)))) as result:
        path, notes = export_point(result, 0, model, tmp_path / "shape.vtu", rom)
        (cells,) = meshio.read(path).cells
        assert len(cells.data) == sum(whole) < len(whole)
        assert any("[reduction] recovery" in note for note in notes)
        none = rom_of_some(tmp_path, model, kept[:4], np.zeros((7, 4)))
        with pytest.raises(InputError, match="recovery/dof"):
            export_point(result, 0, model, tmp_path / "shape.vtu", none)


def test_a_reduced_result_without_its_basis_or_with_another_one_is_a_fault(tmp_path):
    model = synthetic.joint("C3D8")
    with h5py.File(tmp_path / "rom.h5", "w") as rom:
        rom["recovery/basis"] = np.zeros((3, 5))
    with Result(one_point(tmp_path, model, np.zeros((4, 3)))) as result:
        for rom_file, said in (
            (None, "the rom.h5 that made them"),
            ("rom.h5", "3 x 5"),
            ("none.h5", "'absent'"),
        ):
            with pytest.raises(InputError, match=said):
                full_field(result, 0, model.size, rom_file and str(tmp_path / rom_file))


def test_contact_quantities_stand_on_the_nodes_of_both_sides_only(tmp_path):
    model = synthetic.joint("C3D8", seed=8)
    top, bottom = model.node_sets["top"], model.node_sets["bottom"]
    # Three contacts; the first two share their node on side a, the last is on the ground.
    parameters = {"node_a": np.array([top[0], top[0], top[1]]), "node_b": np.array([bottom[0], bottom[1], -1])}
    contacts = synthetic.contact_data(1, 3)
    contacts["state"] = np.array([[0, 2, 3]], dtype=np.int32)
    contacts["slip"] = np.array([[0.0, 0.5, 0.0]])
    path = one_point(tmp_path, model, np.zeros((model.size, 3)), contacts=contacts, parameters=parameters)
    with Result(path) as result:
        export_point(result, 0, model, tmp_path / "shape.vtu")
    data = meshio.read(tmp_path / "shape.vtu").point_data
    row = {node: index for index, node in enumerate(model.node_ids)}
    state = data["contact_state"]
    assert state.dtype.kind == "i" and (state >= 0).sum() == 4
    assert [state[row[node]] for node in (top[0], top[1], bottom[0], bottom[1])] == [2, 3, 0, 2]
    force, energy = contacts["n_mean"][0], contacts["dissipated_energy"][0]
    assert data["normal_force"][row[top[0]]] == pytest.approx(force[0] + force[1])
    assert data["dissipated_energy"][row[bottom[1]]] == pytest.approx(energy[1])
    assert data["slip_fraction"][row[top[0]]] == 0.5
    assert not data["normal_force"][state < 0].any()


def test_elements_without_a_counterpart_are_left_out_and_told():
    model = synthetic.joint("C3D8")
    model.elements["S4"] = (np.array([1, 2]), np.array([[101, 102, 103, 104]] * 2))
    cells, notes = mesh_cells(model)
    assert [kind for kind, _ in cells] == ["hexahedron"]
    assert notes == ["2 elements of type S4 are not drawn (drawn are C3D4, C3D8, C3D10, C3D20)"]


def test_a_model_without_a_mesh_a_wrong_point_and_a_bad_path_are_faults(tmp_path):
    model = synthetic.joint("C3D8")
    with Result(one_point(tmp_path, model, np.zeros((model.size, 3)))) as result:
        with pytest.raises(InputError, match="point = 1: expected a number from 0 to 0"):
            export_point(result, 1, model, tmp_path / "shape.vtu")
        with pytest.raises(InputError, match="can be written"):
            export_point(result, 0, model, tmp_path / "none" / "shape.vtu")
        model.dof_node = None
        with pytest.raises(InputError, match="a finite-element model"):
            export_point(result, 0, model, tmp_path / "shape.vtu")
