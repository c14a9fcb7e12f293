"""One sector of a wheel: from the job to what is solved; against wheels that are assembled whole."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import attrito_here, toml, write_job
from mpi4py import MPI
from scipy.linalg import eigh
from wheels import lumped_sector, ring, sector_job

from attrito.job.cyclic import nodal_diameter, nodal_diameter_in_words
from attrito.job.reading import check_job, read_job
from attrito.library.reduced_scene import all_alike
from attrito.model.model_file import write_model
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.support.errors import InputError


def scene_of(job, folder="."):
    checked = read_job(job, folder)
    scene = build_scene(checked)
    return scene, reduced_scene(checked, scene)


def tie(sector, size, diameter):
    """S `[m, m - k]`: q of all coordinates from those without the upper boundary, of one nodal diameter."""
    whole = np.eye(size, dtype=complex)
    whole[sector.upper, sector.lower] = np.exp(-2j * np.pi * diameter / sector.sectors)
    return np.delete(whole, sector.upper, axis=1)


def wave_frequencies(reduced, diameter):
    """Natural frequencies in Hz of a sector's nodal diameter, without contacts."""
    shape = tie(reduced.sector, len(reduced.mass), diameter)
    stiffness, mass = (shape.conj().T @ matrix @ shape for matrix in (reduced.stiffness, reduced.mass))
    return np.sqrt(np.abs(eigh(stiffness, mass, eigvals_only=True))) / (2.0 * np.pi)


def test_a_sector_of_dofs_reaches_what_is_solved_as_it_is_given():
    scene, reduced = scene_of(lumped_sector(5, 7))
    sector = reduced.sector
    assert (sector.sectors, sector.engine_order) == (5, 7)
    assert sector.lower.tolist() == [2] and sector.upper.tolist() == [3]
    # Rows of each contact: tangent, normal.
    assert reduced.directions.tolist() == [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]]
    assert sector.next_directions.tolist() == [[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert scene.sector.axes is None and np.array_equal(reduced.stiffness, scene.model.stiffness.toarray())
    assert any("engine order 7: nodal diameter 2, running forward" in note for note in scene.contacts.notes)


def test_a_reduction_keeps_both_boundaries_and_what_contacts_touch_of_the_next_sector():
    job = lumped_sector()
    job["contact"] = [job["contact"][0] | {"normal": [[2, 1.0]], "tangents": [[[3, 1.0]]]}]
    job["contact"][0] |= {"normal_next": [[0, -1.0]], "tangents_next": [[]]}
    assert build_scene(read_job(job)).boundary.tolist() == [0, 2, 3]


def test_sectors_that_meet_in_contacts_alone_have_no_boundary():
    job = lumped_sector()
    del job["cyclic"]["lower"], job["cyclic"]["upper"]
    job["model"]["mass"][3][3] = 1.0
    _, reduced = scene_of(job)
    assert len(reduced.sector.lower) == len(reduced.sector.upper) == 0


def test_a_whole_model_has_no_sector():
    job = lumped_sector()
    del job["cyclic"], job["contact"][0]
    job["model"]["mass"][3][3] = 1.0
    assert scene_of(job)[1].sector is None


@pytest.mark.parametrize(
    "sectors, engine_order, number, words",
    [
        (12, 5, 5, "nodal diameter 5, running forward"),
        (12, 7, 7, "nodal diameter 5, running backward"),
        (12, -5, 7, "nodal diameter 5, running backward"),
        (12, 6, 6, "nodal diameter 6: a standing wave"),
        (12, 24, 0, "nodal diameter 0: all sectors move alike"),
        (5, 2, 2, "nodal diameter 2, running forward"),
        (5, 3, 3, "nodal diameter 2, running backward"),
        (1, 4, 0, "nodal diameter 0: all sectors move alike"),
    ],
)
def test_the_nodal_diameter_is_that_of_the_engine_order_modulo_the_sectors(sectors, engine_order, number, words):
    assert nodal_diameter(sectors, engine_order) == number
    assert nodal_diameter_in_words(sectors, engine_order).startswith(words)


def test_frequencies_of_all_nodal_diameters_are_those_of_the_lumped_wheel():
    """Its frequencies are the union over the diameters; mass and stiffness of neighbours add up on the boundary."""
    count = 5
    job = lumped_sector(count)
    job["model"]["mass"][3][3] = 0.3
    _, reduced = scene_of(job)
    size = len(reduced.mass) - 1
    wheel = [np.zeros((count * size, count * size)) for _ in range(2)]
    for j in range(count):
        place = [size * j, size * j + 1, size * j + 2, size * ((j + 1) % count) + 2]
        for whole, own in zip(wheel, (reduced.stiffness, reduced.mass), strict=True):
            whole[np.ix_(place, place)] += own
    expected = np.sqrt(eigh(*wheel, eigvals_only=True)) / (2.0 * np.pi)
    found = np.sort(np.concatenate([wave_frequencies(reduced, n) for n in range(count)]))
    # Backward stable eigensolvers: rounding of some 1e-16 times the ratio of the largest to the least eigenvalue.
    assert found == pytest.approx(expected, rel=1e-11)


def test_at_rest_a_sector_is_tied_to_itself():
    _, reduced = scene_of(lumped_sector())
    alike = all_alike(reduced)
    shape = tie(reduced.sector, len(reduced.mass), 0).real
    assert alike.sector is None
    assert np.array_equal(alike.stiffness, shape.T @ reduced.stiffness @ shape)
    # A contact across to an equal neighbour that moves alike does not feel it.
    assert not alike.directions[:2].any() and alike.directions[2:].any()
    assert all_alike(alike) is alike


def test_a_chart_of_methods_of_modes_refuses_a_sector_by_name(tmp_path, capfd):
    job = lumped_sector() | {"mode": {"start": 1e-6, "stop": 1e-3}}
    done = attrito_here(tmp_path, capfd, "chart", "--mode", write_job(tmp_path, job))
    assert done.returncode == 2
    expected = "job.toml: [cyclic] = 'given': expected no such table: attrito chart --mode does not take one sector"
    assert expected in done.stderr


def test_a_job_of_a_sector_is_written_as_it_was_read():
    from attrito.job.reference import as_job

    job = lumped_sector()
    checked = check_job(job, "job.toml")
    import tomllib

    again = check_job(tomllib.loads(as_job(checked.tables)), "job.toml")
    assert again.tables == checked.tables


class Ring:
    """A job on one sector of an elastic ring, in a folder."""

    def __init__(self, folder, model, sectors, **cyclic):
        write_model(folder / "model.h5", model, [])
        self.folder = folder
        self.job = sector_job(model, sectors, **cyclic)

    def read(self):
        return scene_of(self.job, self.folder)


@pytest.mark.parametrize("sectors", [3, 4, 6])
def test_frequencies_of_all_nodal_diameters_are_those_of_the_whole_elastic_ring(tmp_path, sectors):
    """Shuffled node ids, a sector whose ends lie at no special angle: pairing and turning are what is tried."""
    scene, reduced = Ring(tmp_path, ring(sectors, seed=3), sectors).read()
    whole = ring(sectors, span=sectors)
    expected = np.sqrt(eigh(whole.stiffness.toarray(), whole.mass.toarray(), eigvals_only=True)) / (2.0 * np.pi)
    found = np.sort(np.concatenate([wave_frequencies(reduced, n) for n in range(sectors)]))
    assert len(scene.sector.lower) == 3 * len(scene.model.node_sets["low"])
    # Rounding of 1e-16 times the ratio of the largest to the least eigenvalue, some 1e3, and sizes of some 1e2.
    assert len(found) == len(expected) and found == pytest.approx(expected, rel=1e-9)


def test_one_reduction_serves_all_nodal_diameters(tmp_path):
    """With every mode of the inside kept nothing is left out: the frequencies are those of the whole matrices."""
    sectors = 5
    model = ring(sectors, 3, seed=3)
    write_model(tmp_path / "model.h5", model, [])
    job = sector_job(model, sectors)
    exact = scene_of(job, tmp_path)[1]
    kept = build_scene(read_job(job, tmp_path)).boundary
    job["reduction"] = {"modes": model.size - len(kept)}
    checked = read_job(job, tmp_path)
    scene = build_scene(checked)
    rom, _ = make_rom(MPI.COMM_SELF, checked, scene, say=lambda _: None)
    reduced = reduced_scene(checked, scene, rom)
    assert len(rom.boundary) < model.size and len(reduced.mass) >= model.size
    for number in range(sectors):
        expected = wave_frequencies(exact, number)
        # Static corrections span nothing more where all modes are kept; modes are solved to residuals of 1e-12.
        assert wave_frequencies(reduced, number)[: len(expected)] == pytest.approx(expected, rel=1e-8)


def fault_of(ring_job):
    with pytest.raises(InputError) as caught:
        ring_job.read()
    return str(caught.value)


def test_a_wrong_number_of_sectors_is_told_with_the_one_that_fits(tmp_path):
    text = fault_of(Ring(tmp_path, ring(6), 5))
    assert "[cyclic] upper = 'high': expected nodes of low, turned by 2 pi / 5 about the axis; sectors = 6 fits" in text


def test_boundaries_are_looked_at_before_contacts_across_them(tmp_path):
    """Where the number of sectors is wrong no contact is found across either: one message says why."""
    ring_job = Ring(tmp_path, ring(6), 5)
    law = {"tangential_stiffness": 1e9, "normal_stiffness": 1e9, "friction_coefficient": 0.3}
    ring_job.job["contact_set"].append({"a": "high", "b": "low", "across": True, "tolerance": 1e-6, **law})
    text = fault_of(ring_job)
    assert "sectors = 6 fits" in text and "contact_set" not in text


def test_exchanged_boundaries_are_told(tmp_path):
    text = fault_of(Ring(tmp_path, ring(6), 6, lower="high", upper="low"))
    assert "exchange lower and upper" in text
    reversed_axis = Ring(tmp_path, ring(6), 6, axis_direction=[0.0, 0.0, -1.0])
    assert "or reverse axis_direction" in fault_of(reversed_axis)


def test_a_sector_that_closes_no_wheel_is_told_with_its_angle(tmp_path):
    model = ring(6)
    angle = np.arctan2(model.coordinates[:, 1], model.coordinates[:, 0]) * 1.1
    radius = np.hypot(model.coordinates[:, 0], model.coordinates[:, 1])
    model.coordinates[:, 0], model.coordinates[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    assert "no number of sectors fits: the sector spans 66 degrees" in fault_of(Ring(tmp_path, model, 6))


def test_nodes_without_a_partner_are_told_by_number(tmp_path):
    model = ring(6)
    alone, model.node_sets["low"] = model.node_sets["low"][0], model.node_sets["low"][1:]
    text = fault_of(Ring(tmp_path, model, 6))
    partner = 101 + np.argmin(np.linalg.norm(turned(model, alone) - model.coordinates, axis=1))
    assert f"1 of 4 nodes of high are alone (nodes {partner})" in text


def turned(model, node, sectors=6):
    """Where a node's image on the upper boundary is."""
    angle = 2.0 * np.pi / sectors
    x, y, z = model.coordinates[node - 101]
    return np.array([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])


def test_a_mesh_that_is_not_quite_periodic_is_paired_within_a_tolerance(tmp_path):
    model = ring(6)
    rows = np.isin(model.node_ids, model.node_sets["high"])
    model.coordinates[rows, 2] += 1e-3
    assert "4 of 4 nodes of high are alone" in fault_of(Ring(tmp_path, model, 6))
    assert "at most 0.0009 from them" in fault_of(Ring(tmp_path, model, 6, tolerance=9e-4))
    scene, _ = Ring(tmp_path, model, 6, tolerance=2e-3).read()
    assert len(scene.sector.lower) == 12
    assert (
        "12 dofs of its boundaries paired, nodes at most 0.001 from their partners' images" in scene.contacts.notes[0]
    )


def test_nodes_of_both_boundaries_are_refused_by_number(tmp_path):
    model = ring(6)
    node = int(model.node_sets["low"][0])
    model.node_sets["high"] = np.append(model.node_sets["high"], node)
    text = fault_of(Ring(tmp_path, model, 6))
    assert f"[cyclic] upper = 'high (nodes {node})': expected a node set without nodes of low, but for nodes on" in text


def test_partners_that_are_held_otherwise_are_refused(tmp_path):
    model = ring(6)
    node = model.node_sets["high"][0]
    keep = np.flatnonzero((model.dof_node != node) | (model.dof_direction != 3))
    model.stiffness, model.mass = (matrix[keep][:, keep] for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction, model.size = model.dof_node[keep], model.dof_direction[keep], len(keep)
    assert "expected partners with the same dofs free, each in its own axes" in fault_of(Ring(tmp_path, model, 6))


def test_the_same_scene_is_written_as_toml(tmp_path):
    assert "[cyclic]" in toml(lumped_sector())
