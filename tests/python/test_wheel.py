"""Contacts across a sector's boundary, and all sectors drawn: against wheels whose sectors are there one by one."""

from __future__ import annotations

from dataclasses import replace

import meshio
import numpy as np
import pytest
import synthetic
from edited import edited
from scipy.sparse import block_diag, csr_matrix
from scipy.spatial import cKDTree
from wheels import AXIS, ring, sector_job

from attrito.cli import main
from attrito.export.wheel import Wheel
from attrito.job.reading import read_job
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.model.sector import axis_of
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.reduced_sector import attributes_of_sector, axes_of_sector
from attrito.stresses.cycle import cycle_of
from attrito.stresses.neighbours import boundaries_of, with_neighbours
from attrito.stresses.recovery import nodal_stress

SECTORS = 6
FAR = 10_000


def turn(angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def two_sectors(model: Model) -> Model:
    """A sector and the next one, apart: nodes, and sets with `next_` before their names, from `FAR` on."""
    both = replace(
        model,
        stiffness=csr_matrix(block_diag([model.stiffness] * 2)),
        mass=csr_matrix(block_diag([model.mass] * 2)),
        dof_node=np.concatenate([model.dof_node, model.dof_node + FAR]),
        dof_direction=np.tile(model.dof_direction, 2),
        node_ids=np.concatenate([model.node_ids, model.node_ids + FAR]),
        coordinates=np.vstack([model.coordinates, model.coordinates @ turn(2 * np.pi / SECTORS).T]),
        elements={
            kind: (np.arange(2 * len(ids)) + 1, np.vstack([nodes, nodes + FAR]))
            for kind, (ids, nodes) in model.elements.items()
        },
        size=2 * model.size,
    )
    both.node_sets = model.node_sets | {f"next_{name}": nodes + FAR for name, nodes in model.node_sets.items()}
    return both


def contact_set(b, **keys):
    law = {"tangential_stiffness": 1e9, "normal_stiffness": 2e9, "friction_coefficient": 0.3}
    return {"a": "high", "b": b, "tolerance": 1e-6, "tangents": 2, "gap": "geometry"} | law | keys


@pytest.mark.parametrize("pairing", [{}, {"pairing": "face"}, {"pairing": "face", "points": "gauss"}])
def test_contacts_across_are_those_between_a_sector_and_the_next(tmp_path, pairing):
    """The next sector's motion along the model's axes is R times that along its own."""
    model = ring(SECTORS, seed=5)
    write_model(tmp_path / "model.h5", model, [])
    write_model(tmp_path / "both.h5", two_sectors(model), [])
    job = sector_job(model, SECTORS)
    job["cyclic"] = {"sectors": SECTORS, "engine_order": 1, **AXIS}
    job["contact_set"] = [contact_set("low", across=True, **pairing)]
    across = build_scene(read_job(job, tmp_path)).contacts
    del job["cyclic"]
    job["model"]["file"], job["contact_set"] = "both.h5", [contact_set("next_low", **pairing)]
    plain = build_scene(read_job(job, tmp_path)).contacts
    own_axes = own_axes_of_the_next(model)
    here, there = plain.rows[:, : model.size].toarray(), plain.rows[:, model.size :].toarray() @ own_axes
    assert across.rows.toarray() == pytest.approx(here, abs=1e-14)
    assert across.next_rows.toarray() == pytest.approx(there, abs=1e-14)
    assert across.laws["gap"] == pytest.approx(plain.laws["gap"], abs=1e-14)
    assert (plain.places["node_b"] - FAR).tolist() == across.places["node_b"].tolist()


def own_axes_of_the_next(model):
    """R at every node, `[n, n]`."""
    axes, rotation = np.zeros((model.size, model.size)), turn(2 * np.pi / SECTORS)
    same = model.dof_node[:, None] == model.dof_node[None, :]
    rows, columns = np.nonzero(same)
    axes[rows, columns] = rotation[model.dof_direction[rows] - 1, model.dof_direction[columns] - 1]
    return axes


@pytest.mark.parametrize("engine_order", [2, -1, 3, 0])
def test_the_wheel_drawn_from_one_sector_is_the_whole_wheel_s_motion(tmp_path, engine_order, capfd):
    """A linear wave: the whole ring under loads f_j(t) = f_0(t - j EO T / N) that turn with their sectors."""
    frequency, theta = 400.0, 2.0 * np.pi * engine_order / SECTORS
    omega = 2.0 * np.pi * frequency
    model = ring(SECTORS, seed=3)
    write_model(tmp_path / "model.h5", model, [])
    job = sector_job(model, SECTORS)
    job["cyclic"]["engine_order"] = engine_order
    checked = read_job(job, tmp_path)
    reduced = reduced_scene(checked, build_scene(checked))

    def response(stiffness, mass, force):
        return np.linalg.solve((1.0 + 0.02j) * stiffness - omega**2 * mass, force)

    size, sector = len(reduced.mass), reduced.sector
    tie = np.eye(size, dtype=complex)
    tie[sector.upper, sector.lower] = np.exp(-1j * theta)
    tie = np.delete(tie, sector.upper, axis=1)
    load = reduced.harmonic[1] - 1j * reduced.harmonic[2]
    parts = (tie.conj().T @ matrix @ tie for matrix in (reduced.stiffness, reduced.mass))
    motion = tie @ response(*parts, tie.conj().T @ load)
    write_wave(tmp_path, checked, sector, motion, frequency)

    whole = ring(SECTORS, span=SECTORS)
    force = np.zeros((len(whole.node_ids), 3), dtype=complex)
    node = int(model.node_sets["rim"][0])
    place = model.coordinates[np.flatnonzero(model.node_ids == node)[0]]
    for j in range(SECTORS):
        rotation = turn(2.0 * np.pi * j / SECTORS)
        row = cKDTree(whole.coordinates).query(rotation @ place)[1]
        force[row] += np.exp(-1j * j * theta) * rotation @ np.array([1.0 - 2.0j, 0.0, 3.0])
    dofs = whole.on_dofs(force.real) + 1j * whole.on_dofs(force.imag)
    expected = np.zeros((len(whole.node_ids), 3), dtype=complex)
    of_dof = np.searchsorted(whole.node_ids, whole.dof_node)
    answer = response(whole.stiffness.toarray(), whole.mass.toarray(), dofs)
    expected[of_dof, whole.dof_direction - 1] = answer

    assert main(["export", str(tmp_path / "result.h5"), "--wheel", "--phases", "5"]) == 0, capfd.readouterr().err
    scale = np.abs(expected).max()
    for step in range(5):
        mesh = meshio.read(tmp_path / f"shape_phase_{step:03d}.vtu")
        assert len(mesh.points) == SECTORS * len(model.node_ids)
        assert len(mesh.cells[0].data) == len(next(iter(whole.elements.values()))[0])
        row = cKDTree(whole.coordinates).query(mesh.points)[1]
        now = (expected * np.exp(2j * np.pi * step / 5)).real[row]
        # Two solutions of condition some 1e4, and files in double precision.
        assert mesh.point_data["displacement"] == pytest.approx(now, abs=1e-9 * scale)

    arguments = ["--young", "2e11", "--poisson", "0.3", "--wheel", "--vtu", str(tmp_path / "stress.vtu")]
    assert main(["stress", str(tmp_path / "result.h5"), *arguments]) == 0, capfd.readouterr().err
    ((kind, (ids, _)),) = whole.elements.items()
    whole.elastic = {kind: np.tile([2e11, 0.3], (len(ids), 1))}
    waves = np.stack([np.zeros_like(expected.real), expected.real, -expected.imag])
    stresses = cycle_of(nodal_stress(whole, waves, np.ones(len(whole.node_ids), dtype=bool)).harmonics)
    mesh = meshio.read(tmp_path / "stress.vtu")
    row = cKDTree(whole.coordinates).query(mesh.points)[1]
    for name in ("alternating_von_mises", "alternating_principal", "peak_von_mises"):
        stress = getattr(stresses, name)
        # Strains are displacements over a length of the order of an element, a tenth of the wheel: 1e-9 becomes 1e-8.
        assert mesh.point_data[name] == pytest.approx(stress[row], abs=1e-7 * stress.max()), name


@pytest.mark.parametrize("apart", [0.0, 1e-4])
def test_faces_that_touch_across_sectors_have_the_stress_of_their_own_side(apart):
    """Their nodes stand at one place and are not of the boundaries; nodes that are have a stress by both sides."""
    model = ring(SECTORS, seed=2)
    ends = np.union1d(model.node_sets["low"], model.node_sets["high"])
    is_slit = np.isin(model.node_ids, ends) & (np.hypot(*model.coordinates[:, :2].T) > 0.19)
    is_tied = np.isin(model.node_ids, ends) & ~is_slit
    for name in ("low", "high"):
        model.node_sets[name] = np.setdiff1d(model.node_sets[name], model.node_ids[is_slit])
    model.coordinates[np.isin(model.node_ids, model.node_sets["high"]), 2] += apart
    ((kind, (ids, _)),) = model.elements.items()
    model.elastic = {kind: np.tile([2e11, 0.3], (len(ids), 1))}
    harmonics = np.random.default_rng(4).standard_normal((3, len(model.node_ids), 3))
    wheel = Wheel(SECTORS, 1, axis_of(AXIS["axis_point"], AXIS["axis_direction"]))
    keys = {"lower": "low", "upper": "high", "tolerance": 2e-4 if apart else None}
    whole, motion = with_neighbours(model, harmonics, wheel, boundaries_of(keys, model, wheel))
    for wanted, is_alone in ((is_slit, True), (is_tied, False)):
        alone = nodal_stress(model, harmonics, wanted).harmonics
        found = nodal_stress(whole, motion, np.append(wanted, np.zeros(len(whole.node_ids) - len(wanted), dtype=bool)))
        change = np.abs(found.harmonics - alone).max(axis=(0, 2)) / np.abs(alone).max()
        # Sums of the same numbers in another order; of random motion both sides' stresses have nothing in common.
        assert np.all(change < 1e-12 if is_alone else change > 1e-3)


def write_wave(folder, job, sector, motion, frequency):
    """A result of one point whose coordinates, as solved, move so."""
    coordinates = np.stack([np.zeros(len(motion)), motion.real, -motion.imag], axis=1)
    synthetic.write_result(folder / "result.h5", [frequency], {"rim": [1.0]}, coordinates=coordinates[None])
    with edited(folder / "result.h5") as file:
        file.attrs.update(attributes_of_sector(sector) | job.attributes)
        file.attrs["model_file"] = str(folder / "model.h5")
        for name, (values, _) in axes_of_sector(sector).items():
            file[name] = values


def test_a_whole_model_has_no_wheel_to_draw(tmp_path, capfd):
    model = ring(SECTORS)
    write_model(tmp_path / "model.h5", model, [])
    synthetic.write_result(tmp_path / "result.h5", [1.0], {"rim": [1.0]}, coordinates=np.zeros((1, model.size, 3)))
    with edited(tmp_path / "result.h5") as file:
        file.attrs["model_file"] = str(tmp_path / "model.h5")
    assert main(["export", str(tmp_path / "result.h5"), "--wheel"]) == 2
    assert "export: --wheel = 'given': expected a result of a job with [cyclic]" in capfd.readouterr().err
