"""The jobs of other scenes than the demo blade, coarse: from geometry to response, checked by what must balance."""

from __future__ import annotations

import csv
import io
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from figures import marks
from jobs import attrito, attrito_here
from matplotlib.collections import PolyCollection
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags, save_npz
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh

from attrito.job.reading import read_job
from attrito.model.model_file import read_model
from attrito.model.rotation import softening, spin_of
from attrito.scene.build import build_scene

REPOSITORY = Path(__file__).resolve().parents[2]


def prepare(folder, name, mesh_options, import_options, changes):
    """Mesh and model of a job in a folder, and the job there, with some lines changed."""
    mesh = "damper" if name == "damper" else "blade"
    script = REPOSITORY / "meshes" / f"{mesh}.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", folder, *mesh_options], check=True)
    done = attrito(folder, "import", "model.h5", "--calculix", mesh, "--mesh", f"{mesh}.inp", *import_options)
    assert done.returncode == 0, done.stderr
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / f"{name}.toml").read_text())
    for key, value in changes.items():
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1, key
    (folder / "job.toml").write_text(text)


@pytest.fixture(scope="module")
def damper(tmp_path_factory):
    """A folder with the damper's result; of three harmonics, which show what happens, if not how high peaks are."""
    folder = tmp_path_factory.mktemp("damper")
    changes = {"harmonics": "3", "levels": "[0.1, 1.0, 3.0]", "stop_hz": "388.0"}
    prepare(folder, "damper", [], [], changes)
    done = attrito(folder, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def prestressed(tmp_path_factory):
    """A folder with the result of the blade at speed: a few points are enough."""
    folder = tmp_path_factory.mktemp("prestressed")
    changes = {"harmonics": "1", "start_hz": "430.0", "stop_hz": "436.0", "levels": "[1.0]"}
    holds = ["--holds", "stress_stiffening", "--spin-hz", "100"]
    prepare(folder, "prestressed_blade", ["--spin-hz", "100"], holds, changes)
    done = attrito(folder, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    return folder


def result_file(folder):
    return h5py.File(folder / read_job(folder / "job.toml")["output"]["file"])


def body(model, node_set):
    """Dofs of the connected piece that holds a node set."""
    label = connected_components(model.stiffness)[1]
    inside = np.isin(model.dof_node, model.node_sets[node_set])
    return label == label[inside][0]


def check_balance(folder, node_set, directions, sign):
    """On a body, at the first point: mean contact forces, pull and what displacement adds to it sum to zero."""
    scene = build_scene(read_job(folder / "job.toml"))
    model = scene.model
    own = body(model, node_set)
    with result_file(folder) as file, h5py.File(folder / "rom.h5") as rom:
        force, frame = file["contacts/force"][0, :, :, 0], file["contacts/parameters/frame"][:]
        mean = rom["recovery/basis"][:].T @ file["points/coordinates"][0, :, 0]
    on_body = -sign * np.einsum("ci,cij->j", force, frame)
    pull = scene.static["spin"]
    # Stiffness without softening resists no translation, so what is left of K q is the softening's.
    spin = spin_of(read_job(folder / "job.toml")["load"][0])
    added = softening(model, spin) @ mean
    scale = np.abs(pull[own]).sum()
    for direction in directions:
        along = own & (model.dof_direction == direction)
        total = on_body[direction - 1] + pull[along].sum() + added[along].sum()
        assert total == pytest.approx(0.0, abs=1e-7 * scale)
    return on_body, pull


def test_the_damper_s_contacts_carry_its_centrifugal_force(damper):
    on_damper, pull = check_balance(damper, "damper", (1, 3), sign=1)
    model = read_model(damper / "model.h5")
    along = (model.dof_direction == 3) & np.isin(model.dof_node, model.node_sets["damper"])
    # A pull of m Omega^2 r, r = 240.5 mm of a damper of 5.2 g.
    mass = along @ model.mass @ along
    radius = pull[along].sum() / (mass * (2 * np.pi * 60.0) ** 2)
    assert 239.0 < radius < 243.0
    assert on_damper[2] == pytest.approx(-pull[along].sum(), rel=1e-3)


def test_the_pull_of_the_blade_at_speed_is_carried_by_its_flanks(prestressed):
    check_balance(prestressed, "tip", (1, 2, 3), sign=1)


def test_the_damper_has_a_best_excitation_and_lowers_the_frequency_as_it_slips(damper):
    done = attrito(damper, "table", "result.h5")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert {row["outcome"] for row in rows} == {"converged"}
    peaks = {}
    for row in rows:
        level, amplitude = float(row["level"]), float(row["apart_amplitude"])
        here = (amplitude / level, float(row["frequency_hz"]))
        peaks[level] = max(peaks.get(level, (0.0, 0.0)), here)
    (low, low_hz), (middle, middle_hz), (high, high_hz) = (peaks[level] for level in sorted(peaks))
    with result_file(damper) as file:
        stuck, frictionless = (file[f"linear/{name}/apart"][:].max() for name in ("stuck", "frictionless"))
    assert middle < 0.5 * low and middle < 0.9 * high
    assert max(low, high) < 0.5 * min(stuck, frictionless)
    assert low_hz > middle_hz > high_hz


def test_a_branch_goes_on_whose_means_move_far_while_the_curve_shows_its_steps(damper):
    # From 467 to 452 Hz every contact comes to its limit, and six steps in a row are mean positions for the most part.
    changes = ("sweep.levels=[0.1]", "sweep.stop_hz=440.0", 'output.file="exact.h5"')
    done = attrito(damper, "run", "job.toml", *(word for change in changes for word in ("--set", change)))
    assert done.returncode == 0, done.stderr
    assert "ends at" not in done.stderr
    rows = list(csv.DictReader(io.StringIO(attrito(damper, "table", "exact.h5").stdout)))
    assert {row["outcome"] for row in rows} == {"converged"}
    frequencies = [float(row["frequency_hz"]) for row in rows]
    assert all(after < before for before, after in pairwise(frequencies))
    assert frequencies[-1] == pytest.approx(440.0)


def test_the_free_damper_s_reduced_model_has_the_stuck_frequencies_of_the_full_one(damper):
    scene = build_scene(read_job(damper / "job.toml"))
    rows, laws = scene.contacts.rows, scene.contacts.laws
    springs = np.ravel(np.column_stack([laws["tangential_stiffness"]] * 2 + [laws["normal_stiffness"]]))
    full = scene.model.stiffness + rows.T @ diags(springs) @ rows
    expected = np.sort(eigsh(full.tocsc(), 4, scene.model.mass.tocsc(), sigma=0.0, return_eigenvectors=False))
    with result_file(damper) as file:
        natural = file["linear/stuck/natural_hz"][:4]
    assert natural == pytest.approx(np.sqrt(expected) / (2 * np.pi), rel=1e-4)
    # Without its contacts the damper floats in the plane, and rocks about the line of nodes that are held axially.
    plain = read_model(damper / "model.h5")
    own = np.flatnonzero(body(plain, "damper"))
    order = np.argsort(plain.node_ids)
    x, _, z = plain.coordinates[order[np.searchsorted(plain.node_ids[order], plain.dof_node[own])]].T
    direction, stiffness = plain.dof_direction[own], plain.stiffness[own][:, own].toarray()
    along_x, along_z = (direction == 1).astype(float), (direction == 3).astype(float)
    for motion in (along_x, along_z, along_x * (z - z.mean()) - along_z * (x - x.mean())):
        assert np.abs(stiffness @ motion).max() < 1e-9 * np.abs(stiffness).max() * np.abs(motion).max()
    values = np.linalg.eigvalsh(stiffness)
    assert np.abs(values[:4]).max() < 1e-12 * values[-1] and values[4] > 1e-6 * values[-1]


@pytest.mark.parametrize("name", ["damper", "prestressed"])
def test_every_point_solves_the_equations_that_were_never_condensed(name, request):
    """(K - (h omega)^2 M + i h omega C) q_h + B^T lambda_h = f_h in the reduced coordinates, C from the stuck modes."""
    folder = request.getfixturevalue(name)
    job = read_job(folder / "job.toml")
    scene = build_scene(job)
    with h5py.File(folder / "rom.h5") as rom:
        mass, stiffness, boundary = rom["mass"][:], rom["stiffness"][:], rom["boundary/dof"][:]
        vectors = rom["vectors/reduced"][:]
    rows = np.zeros((scene.contacts.rows.shape[0], len(mass)))
    rows[:, : len(boundary)] = scene.contacts.rows[:, boundary].toarray()
    laws = scene.contacts.laws
    springs = np.ravel(np.column_stack([laws["tangential_stiffness"]] * 2 + [laws["normal_stiffness"]]))
    values, modes = eigh(stiffness + rows.T @ (springs[:, None] * rows), mass)
    damping = mass @ modes @ np.diag(2 * job["damping"]["ratio"] * np.sqrt(values)) @ modes.T @ mass
    static, excitation = vectors[0], vectors[2]
    with result_file(folder) as file:
        for point in range(0, len(file["points/frequency_hz"]), 7):
            omega, level = 2 * np.pi * file["points/frequency_hz"][point], file["points/level"][point]
            q = file["points/coordinates"][point]
            force = file["contacts/force"][point].reshape(-1, q.shape[1])
            cosine, sine = q[:, 1], q[:, 2]
            dynamic = stiffness - omega**2 * mass
            residuals = (
                (stiffness @ q[:, 0] + rows.T @ force[:, 0] - static, static),
                (
                    dynamic @ cosine + omega * damping @ sine + rows.T @ force[:, 1] - level * excitation,
                    stiffness @ cosine,
                ),
                (dynamic @ sine - omega * damping @ cosine + rows.T @ force[:, 2], stiffness @ cosine),
            )
            for residual, scale in residuals:
                assert np.abs(residual).max() < 1e-7 * np.abs(scale).max()


def test_the_clamped_frequencies_at_speed_are_those_of_calculix(prestressed):
    """CalculiX's own, with the flanks held, stiffened and softened by itself; ours are softened here. Seven digits."""
    text = (prestressed / "blade_frequencies.dat").read_text()
    own = [float(words[3]) for words in map(str.split, text.splitlines()) if len(words) == 5 and words[0].isdigit()]
    with h5py.File(prestressed / "rom.h5") as rom:
        ours = rom["modes/frequency_hz"][: len(own)]
    assert len(own) == 16
    assert ours == pytest.approx(own[: len(ours)], rel=5e-6)


def test_pictures_show_the_levels_loops_and_contacts_of_the_result(damper, capfd, written):
    for options in ((), ("--loops",), ("--map",)):
        done = attrito_here(damper, capfd, "plot", "result.h5", *options)
        assert done.returncode == 0, done.stderr
    assert {"frf.png", "loops.png", "contacts.png"} <= {path.name for path in damper.iterdir()}
    response, loops, contacts = written
    with h5py.File(damper / "result.h5") as file:
        frequency, level = file["points/frequency_hz"][:], file["points/level"][:]
        count = file["contacts/force"].shape[1]
    drawn = marks(response.axes[0])
    assert sorted({place for place in drawn[:, 0] if np.isfinite(place)} & set(frequency)) == sorted(set(frequency))
    assert [label for label in response.axes[0].get_legend_handles_labels()[1] if label.startswith("level")] == [
        f"level {value:g}" for value in sorted(set(level))
    ]
    # Loops are closed; on the maps every contact has its faces, a part of each face about its node.
    for axes in loops.axes:
        for one in axes.get_lines():
            assert np.array_equal(one.get_xydata()[0], one.get_xydata()[-1])
    assert sum(map(len, (axes.get_lines() for axes in loops.axes))) > 2
    faces = [one.get_paths() for axes in contacts.axes for one in axes.collections if isinstance(one, PolyCollection)]
    assert sum(map(len, faces)) >= count


def test_an_animated_shape_has_a_file_a_phase_with_its_own_motion(damper):
    done = attrito(damper, "export", "result.h5", "--phases", "3")
    assert done.returncode == 0, done.stderr
    phases = [f"shape_phase_{number:03d}.vtu" for number in range(3)]
    assert re.findall(r'file="(.*?)"', (damper / "shape.pvd").read_text()) == phases
    grids = [meshio.read(damper / name) for name in phases]
    nodes = len(read_model(damper / "model.h5", matrices=False).coordinates)
    moved = [grid.point_data["displacement"] for grid in grids]
    assert all(one.shape == (nodes, 3) and np.isfinite(one).all() for one in moved)
    assert all(np.abs(one - other).max() > 0.1 * np.abs(one).max() for one, other in pairwise(moved))


def test_a_block_that_only_contacts_hold_stands_on_them_with_all_that_presses_it(tmp_path):
    subprocess.run([sys.executable, REPOSITORY / "meshes" / "block.py", "--out", tmp_path], check=True)
    done = attrito(tmp_path, "import", "model.h5", "--calculix", "block", "--mesh", "block.inp")
    assert done.returncode == 0, done.stderr
    model = read_model(tmp_path / "model.h5")
    # 100 x 75 x 50 mm of steel; six free motions, whose eigenvalues are rounding beside the elastic ones.
    assert model.mass.sum() / 3.0 == pytest.approx(7.85e-9 * 375000.0, rel=1e-9)
    frequency = (
        np.sqrt(np.abs(eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)[:7])) / 2 / np.pi
    )
    assert frequency[5] < 1.0 < 1e4 < frequency[6]
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / "block.toml").read_text())
    text = re.sub(r"start_hz = .*\nstop_hz = .*\nlevels = .*", "frequencies_hz = [7500.0]\nlevels = [100.0]", text)
    (tmp_path / "job.toml").write_text(text)
    done = attrito(tmp_path, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    with result_file(tmp_path) as file:
        # Balance of the means, to the residual's tolerance: 10 kN presses, nothing pulls aside.
        for name, force in (("n_mean", 1.0e4), ("t1_mean", 0.0), ("t2_mean", 0.0)):
            assert file[f"contacts/{name}"][0].sum() == pytest.approx(force, abs=1e-3), name
        slipping = list(file["contacts/state"].attrs["names"]).index(b"slipping")
        assert 0 < (file["contacts/state"][0] == slipping).sum() < 20


def stepped_cantilever(pieces, elements=20):
    """First bending frequency of a clamped-free beam, Hz; pieces: (length, bending stiffness, mass per length)."""
    count = elements * len(pieces)
    stiffness, mass = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for k in range(count):
        length, bending, density = pieces[k // elements]
        a = length / elements
        own = slice(2 * k, 2 * k + 4)
        stiffness[own, own] += bending / a**3 * np.array(
            [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a],
             [-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
        )  # fmt: skip
        mass[own, own] += density * a / 420 * np.array(
            [[156, 22 * a, 54, -13 * a], [22 * a, 4 * a * a, 13 * a, -3 * a * a],
             [54, 13 * a, 156, -22 * a], [-13 * a, -3 * a * a, -22 * a, 4 * a * a]]
        )  # fmt: skip
    return np.sqrt(eigh(stiffness[2:, 2:], mass[2:, 2:], eigvals_only=True)[0]) / (2 * np.pi)


def test_a_bolt_closes_a_lap_joint_about_its_hole_and_opens_the_overlap_s_ends(tmp_path):
    script = REPOSITORY / "meshes" / "lap_joint.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", tmp_path], check=True)
    done = attrito(tmp_path, "import", "model.h5", "--calculix", "lap_joint", "--mesh", "lap_joint.inp")
    assert done.returncode == 0, done.stderr
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / "lap_joint.toml").read_text())
    text, count = re.subn(r"start_hz = .*\nstop_hz = .*\n", "frequencies_hz = [50.0, 138.0]\n", text)
    assert count == 1
    (tmp_path / "job.toml").write_text(text)
    done = attrito(tmp_path, "run", "job.toml")
    assert done.returncode == 0, done.stderr

    model = read_model(tmp_path / "model.h5")
    # The bolt pulls neither plate away: 1 kN up on the lower one, 1 kN down on the upper one.
    force = build_scene(read_job(tmp_path / "job.toml")).static["bolt"]
    along = model.dof_direction == 3
    label = connected_components(model.stiffness)[1]
    assert [force[along & (label == k)].sum() for k in range(2)] == pytest.approx([1000.0, -1000.0], rel=1e-9)

    with result_file(tmp_path) as file:
        position = file["contacts/parameters/position"][:]
        names = [name.decode().strip() for name in file["contacts/state"].attrs["names"]]
        state = [np.array(names)[row] for row in file["contacts/state"][:]]
        mean = file["contacts/n_mean"][0]
        stuck = file["linear/stuck/natural_hz"][0]
    radius = np.hypot(*position[:, :2].T)
    assert np.all(position[:, 2] == 0.0)
    # The pressed ring touches all over, the overlap's ends gape, and the contacts carry the bolt's 4 kN.
    assert np.all(state[0][radius <= 9.0 + 1e-6] == "stuck")
    assert (state[0] == "open").sum() > 0.4 * len(radius)
    assert mean[radius > 15.0].sum() < 1e-3 * mean.sum()
    assert mean.sum() == pytest.approx(4000.0, abs=1e-2)
    # Towards the resonance pairs at the edge of the contact zone slip.
    assert np.all(radius[state[1] == "slipping"] > 5.0)
    assert (state[1] == "slipping").sum() > 0
    # Plates of 115 x 30 x 5 mm, glued over 60 mm: a beam of stepped height. Springs for the glue take 1 % off;
    # elements 30 mm long are 5 % too stiff (the default mesh: 1 %).
    bending, density = 210000.0 * 30.0 * 5.0**3 / 12.0, 7.85e-9 * 30.0 * 5.0
    plate = (55.0, bending, density)
    beam = stepped_cantilever([plate, (60.0, 8.0 * bending, 2.0 * density), plate])
    assert beam < stuck < 1.07 * beam


def beam(elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness of a cantilever by beam elements, deflection and rotation at each node in turn, and its lumped mass."""
    length, bending, mass = 1.0 / elements, 1.0e4, 8.0 / elements
    one = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float)
    scale = np.array([1.0, length, 1.0, length])
    stiffness, lumped = np.zeros((2 * elements + 2,) * 2), np.zeros(2 * elements + 2)
    for first in range(0, 2 * elements, 2):
        part = slice(first, first + 4)
        stiffness[part, part] += bending / length**3 * one * np.outer(scale, scale)
        lumped[part] += 0.5 * mass * np.array([1.0, 0.0, 1.0, 0.0])
    return stiffness[2:, 2:], np.diag(lumped[2:])


BEAM = """
[model]
{model}
[damping]
ratio = 0.005
[[contact]]
normal = [[{tip}, -1.0]]
tangents = [[[{middle}, 1.0]]]
normal_stiffness = 1.0e6
tangential_stiffness = 1.0e5
friction_coefficient = 0.4
[[load]]
name = "press"
kind = "static"
dofs = [[{tip}, 50.0]]
[[load]]
kind = "harmonic"
cosine = [[{middle}, 20.0]]
[balance]
harmonics = 5
[sweep]
frequencies_hz = [60.0, 75.0, 90.0, 105.0]
[output]
file = "{name}.h5"
monitors = [{{ name = "middle", dofs = [[{middle}, 1.0]] }}]
"""


def test_dofs_without_mass_follow_the_others_as_if_they_were_condensed_before(tmp_path):
    # Rotations of a beam with lumped mass. Twenty elements, so twenty modes less the two boundary dofs' are all.
    stiffness, mass = beam(20)
    heavy, light = np.arange(0, 40, 2), np.arange(1, 40, 2)
    follows = -np.linalg.solve(stiffness[np.ix_(light, light)], stiffness[np.ix_(light, heavy)])
    condensed = stiffness[np.ix_(heavy, heavy)] + stiffness[np.ix_(heavy, light)] @ follows
    for name, matrix in (("K", stiffness), ("M", mass), ("Kc", 0.5 * (condensed + condensed.T))):
        save_npz(tmp_path / f"{name}.npz", csr_matrix(matrix))
    save_npz(tmp_path / "Mc.npz", csr_matrix(mass[np.ix_(heavy, heavy)]))
    done = attrito(tmp_path, "import", "model.h5", "--stiffness", "K.npz", "--mass", "M.npz")
    assert done.returncode == 0, done.stderr
    assert "dofs without mass: 20, 0 of them rotations; a job needs [reduction]" in done.stdout
    models = {
        "whole": ('file = "model.h5"\n[reduction]\nmodes = 18', 38, 20),
        "condensed": ('stiffness = "Kc.npz"\nmass = "Mc.npz"', 19, 10),
    }
    amplitudes = {}
    for name, (model, tip, middle) in models.items():
        (tmp_path / f"{name}.toml").write_text(BEAM.format(model=model, tip=tip, middle=middle, name=name))
        done = attrito(tmp_path, "run", f"{name}.toml")
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / f"{name}.h5") as file:
            amplitudes[name] = file["monitors/middle/amplitude"][:]
    assert np.ptp(amplitudes["whole"]) > 0.1 * amplitudes["whole"].max()
    # Both are solved to 1e-10 of the motion.
    assert amplitudes["whole"] == pytest.approx(amplitudes["condensed"], rel=1e-8)
    (tmp_path / "direct.toml").write_text(
        BEAM.format(model='stiffness = "K.npz"\nmass = "M.npz"', tip=38, middle=20, name="direct")
    )
    done = attrito(tmp_path, "run", "direct.toml")
    assert done.returncode == 2
    assert "no mass at dof 1 and 19 more': expected mass at every dof, or [reduction], in which" in done.stderr
