"""Jobs with Coriolis forces: a chain of masses with a closed form, and an elastic ring against one assembled whole."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from elastic import CORNERS, DENSITY
from jobs import attrito_here, table, write_job
from mpi4py import MPI
from scipy.linalg import eig
from scipy.sparse import coo_matrix
from wheels import AXIS, ring, sector_job

from attrito.job.reading import read_job
from attrito.library.session import Solver
from attrito.model.coriolis import coriolis_matrix
from attrito.model.model_file import write_model
from attrito.model.rotation import Spin, softening
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.solver_options import solver_options

MASS, HUB, CHORD, SPIN = 2.0, 5.0e4, 3.0e4, 12.0
OMEGA = 2.0 * np.pi * SPIN
# Sectors of the elastic ring, and its speed in Hz
SECTORS, TURNS = 6, 400.0


def masses_on_chords(sectors, *, softened=True, chord=CHORD, engine_order=1):
    """Masses on isotropic springs to a hub that turns, each tied to the next one by a spring along the chord.

    Dofs 0 and 1: a mass outwards and along the circumference; 2 and 3: the next one, in its own axes.
    """
    half = np.pi / sectors
    stretch = np.array([np.sin(half), -np.cos(half), np.sin(half), np.cos(half)])
    own = np.array([1.0, 1.0, 0.0, 0.0])
    stiffness = np.diag((HUB - (MASS * OMEGA**2 if softened else 0.0)) * own) + chord * np.outer(stretch, stretch)
    turn = np.zeros((4, 4))
    # a x e_r = e_theta, a x e_theta = -e_r
    turn[1, 0], turn[0, 1] = 2.0 * MASS * OMEGA, -2.0 * MASS * OMEGA
    law = {"tangential_stiffness": 1e-6, "normal_stiffness": 1e-6, "friction_coefficient": 0.3, "preload": 1.0}
    return {
        "model": {
            "mass": np.diag(MASS * own).tolist(),
            "stiffness": stiffness.tolist(),
            "gyroscopic": turn.tolist(),
            "gyroscopic_hz": SPIN,
        },
        "cyclic": {
            "sectors": sectors,
            "engine_order": engine_order,
            "lower": [0, 1],
            "upper": [2, 3],
            "coriolis": True,
        },
        "contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], **law}],
        "output": {"file": "result.h5", "monitors": [{"name": "out", "dofs": [[0, 1.0]]}]},
    }


def modes_of(folder, capfd, job, *options):
    done = attrito_here(folder, capfd, "linear-modes", write_job(folder, job), "--state", "stuck", *options)
    assert done.returncode == 0, done.stderr
    found = {}
    for row in table(folder, result="result.stuck.modes.h5"):
        found.setdefault(int(row["nodal_diameter"]), []).append(float(row["frequency_hz"]))
    return found


@pytest.mark.parametrize("softened", [True, False])
def test_a_mass_on_isotropic_springs_has_the_frequencies_of_foucaults_pendulum(tmp_path, capfd, softened):
    """Softened, the mass is one that hangs on springs at rest, seen by axes that turn: omega = omega_0 -+ Omega."""
    job = masses_on_chords(4, softened=softened, chord=0.0)
    # Nothing ties them: sectors of two dofs without boundaries.
    del job["cyclic"]["lower"], job["cyclic"]["upper"]
    for name in ("mass", "stiffness", "gyroscopic"):
        job["model"][name] = [row[:2] for row in job["model"][name][:2]]
    found = modes_of(tmp_path, capfd, job)
    assert list(found) == [0, 1, -1, 2]
    rest = np.sqrt(HUB / MASS)
    middle = rest if softened else np.hypot(rest, OMEGA)
    for frequencies in found.values():
        # The contact's springs add 1e-6 to 5e4.
        expected = (middle + np.array([-OMEGA, OMEGA])) / (2.0 * np.pi)
        assert frequencies == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("sectors", [3, 5, 6])
def test_waves_forward_and_backward_on_a_chain_of_masses_have_the_frequencies_of_its_quartic(tmp_path, capfd, sectors):
    """Of diameter n, s and c being sine and cosine of pi / N, z = exp(-2 pi i n / N), r = s (1 + z) and t = c (z - 1)

        (k + g |r|^2 - m omega^2) (k + g |t|^2 - m omega^2) = |g r^* t - 2 i Omega m omega|^2
                                                            = (2 g s c sin(2 pi n / N) + 2 Omega m omega)^2,

    which another sign of n, or of Omega, changes.
    """
    found = modes_of(tmp_path, capfd, masses_on_chords(sectors))
    half, hub = np.pi / sectors, HUB - MASS * OMEGA**2
    s, c = np.sin(half), np.cos(half)
    for n, frequencies in found.items():
        theta = 2.0 * np.pi * n / sectors
        outwards = np.poly1d([-MASS, 0.0, hub + CHORD * s**2 * (2.0 + 2.0 * np.cos(theta))])
        along = np.poly1d([-MASS, 0.0, hub + CHORD * c**2 * (2.0 - 2.0 * np.cos(theta))])
        both = np.poly1d([2.0 * OMEGA * MASS, 2.0 * CHORD * s * c * np.sin(theta)])
        roots = (outwards * along - both * both).roots
        expected = np.sort(roots.real[roots.real > 0.0]) / (2.0 * np.pi)
        assert frequencies == pytest.approx(expected, rel=1e-9)
    assert abs(found[1][0] / found[-1][0] - 1.0) > 0.05


def test_a_campbell_diagram_has_waves_both_ways_at_every_speed(tmp_path, capfd):
    job = masses_on_chords(5, softened=False)
    job["campbell"] = {"speeds_hz": [0.0, 6.0, SPIN], "modes": 2}
    done = attrito_here(tmp_path, capfd, "campbell", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.campbell.h5")
    at = {}
    for row in rows:
        at.setdefault((float(row["speed_hz"]), int(row["nodal_diameter"])), []).append(float(row["frequency_hz"]))
    assert {n for _, n in at} == {0, 1, -1, 2, -2}
    # At rest waves both ways are alike, to rounding; then they part.
    assert at[0.0, 1] == pytest.approx(at[0.0, -1], rel=1e-12)
    assert at[SPIN, 1][0] < 0.9 * at[SPIN, -1][0]
    half = dict(job)
    half["model"] = half["model"] | {"gyroscopic": (0.5 * np.array(job["model"]["gyroscopic"])).tolist()}
    expected = modes_of(tmp_path, capfd, half | {"campbell": job["campbell"]})
    for n, frequencies in expected.items():
        assert at[6.0, n] == pytest.approx(frequencies, rel=1e-9)


def slipping_wave(engine_order, way):
    """Amplitudes outwards and along of a mass that slips on the ground; `way` -1: rotation and load are mirrored."""
    job = masses_on_chords(5, engine_order=engine_order)
    job["model"]["gyroscopic"] = (way * np.array(job["model"]["gyroscopic"])).tolist()
    job["damping"] = {"rayleigh": [5.0, 0.0]}
    law = {"tangential_stiffness": 2e4, "normal_stiffness": 2e4, "friction_coefficient": 0.3, "preload": 20.0}
    job["contact"] = [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], **law}]
    job["load"] = [{"kind": "harmonic", "cosine": [[0, 8.0]], "sine": [[1, 12.0 * way]]}]
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [24.0]}
    job["output"]["monitors"].append({"name": "along", "dofs": [[1, 1.0]]})
    checked = read_job(job)
    scene = build_scene(checked)
    with Solver(MPI.COMM_SELF, reduced_scene(checked, scene), solver_options(checked, None)) as solver:
        solver.follow_static_path(scene.load_path, 10, 24.0)
        (point,) = solver.solve_at([24.0], 1.0, 0)
    assert point.is_solved and point.states[2] == 1, "the mass does not slip: the test is void"
    return point.amplitude


def test_engine_order_and_speed_reversed_together_give_the_mirror_image():
    forward, mirrored, backward = slipping_wave(1, 1), slipping_wave(-1, -1), slipping_wave(-1, 1)
    # Residuals of 1e-13 times the condition of the balance.
    assert mirrored == pytest.approx(forward, rel=1e-10)
    assert np.abs(backward / forward - 1.0).max() > 0.05


def test_a_whole_model_that_turns_answers_as_a_dense_solve_says(tmp_path, capfd):
    """`coriolis` of the centrifugal load, the contact is next to nothing."""
    model = ring(3, seed=4)
    write_model(tmp_path / "model.h5", model, [])
    node = ["node", int(model.node_sets["rim"][1])]
    law = {"tangential_stiffness": 1e-3, "normal_stiffness": 1e-3, "friction_coefficient": 0.3, "preload": 1e3}
    dofs = [int(np.flatnonzero((model.dof_node == node[1]) & (model.dof_direction == i))[0]) for i in (1, 2)]
    job = {
        "model": {"file": "model.h5"},
        "damping": {"rayleigh": [50.0, 0.0]},
        "contact": [{"normal": [[[*node, "z"], 1.0]], "tangents": [[[[*node, "x"], 1.0]]], **law}],
        "load": [
            {"name": "spin", "kind": "centrifugal", "speed_hz": TURNS, "coriolis": True, **AXIS},
            {"kind": "harmonic", "cosine": [[[*node, "x"], 1e3]]},
        ],
        "static": {"load_path": [1.0]},
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [3000.0]},
        "output": {
            "file": "result.h5",
            "monitors": [{"name": name, "dofs": [[[*node, name], 1.0]]} for name in ("x", "y")],
        },
    }
    amplitudes = {}
    for coriolis in (True, False):
        job["load"][0]["coriolis"] = coriolis
        done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
        assert done.returncode == 0, done.stderr
        (row,) = table(tmp_path)
        amplitudes[coriolis] = np.array([float(row["x_amplitude"]), float(row["y_amplitude"])])
    omega, spin = 2.0 * np.pi * 3000.0, 2.0 * np.pi * TURNS
    damping = 50.0 * model.mass + spin * by_quadrature(model, np.array([0.0, 0.0, 1.0]))
    matrix = model.stiffness - omega**2 * model.mass + 1j * omega * damping
    force = np.zeros(model.size)
    force[dofs[0]] = 1e3
    expected = np.abs(np.linalg.solve(matrix.toarray(), force))[dofs]
    # The contact's springs are 1e-12 of the structure's; rounding 1e-16 times the condition, 1e6.
    assert amplitudes[True] == pytest.approx(expected, rel=1e-8)
    assert np.abs(amplitudes[False] / expected - 1.0).max() > 1e-3


def by_quadrature(model, axis):
    """2 integral rho N^T (a x N) over the bricks of a model, two Gauss points a direction as for its mass."""
    order = np.argsort(model.node_ids)
    (_, connectivity) = model.elements["C3D8"]
    places = order[np.searchsorted(model.node_ids, connectivity, sorter=order)]
    rows, columns, values = [], [], []
    for nodes in places:
        block = np.zeros((24, 24))
        for point in CORNERS / np.sqrt(3.0):
            factors = (1.0 + CORNERS * point) / 2.0
            shapes = factors.prod(axis=1)
            slopes = [CORNERS[:, i] / 2.0 * np.delete(factors, i, axis=1).prod(axis=1) for i in range(3)]
            volume = np.linalg.det(np.array(slopes) @ model.coordinates[nodes])
            motions = np.kron(shapes, np.eye(3))
            block += volume * DENSITY * 2.0 * motions.T @ np.cross(axis, motions, axisb=0, axisc=0)
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        rows.append(np.repeat(dofs, 24))
        columns.append(np.tile(dofs, 24))
        values.append(block.ravel())
    size = 3 * len(model.node_ids)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    place = order[np.searchsorted(model.node_ids, model.dof_node, sorter=order)]
    kept = 3 * place + model.dof_direction - 1
    return coo_matrix(entries, shape=(size, size)).tocsr()[kept][:, kept]


def test_the_mass_of_solids_tells_the_coriolis_forces():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    model = ring(5, seed=2)
    found, expected = coriolis_matrix(model, axis), by_quadrature(model, axis)
    assert abs(found - expected).max() < 1e-12 * abs(expected).max()
    assert abs(found + found.T).max() == 0.0


def altered(change):
    """A ring whose mass, and what its dofs are called, is changed in place."""
    model = ring(5, seed=2)
    mass = model.mass.tolil()
    change(model, mass)
    model.mass = mass.tocsr()
    return model


def heavier_along_x(model, mass):
    dof = np.flatnonzero(model.dof_direction == 1)[3]
    mass[dof, dof] *= 1.01


def coupled_across(model, mass):
    x, y = (np.flatnonzero((model.dof_node == model.dof_node[0]) & (model.dof_direction == i))[0] for i in (1, 2))
    mass[x, y] = mass[y, x] = 0.1 * mass[x, x]


def a_rotation(model, mass):
    model.dof_direction[np.flatnonzero(model.dof_direction == 3)[0]] = 4


def held_apart(model, mass):
    """Neighbours on the rim, one moving along x alone, the other along y."""
    rows = np.unique(model.stiffness[np.flatnonzero(model.dof_node == model.dof_node[0])].nonzero()[1])
    other = next(node for node in model.dof_node[rows] if node != model.dof_node[0])
    gone = (model.dof_node == model.dof_node[0]) & (model.dof_direction != 1)
    gone |= (model.dof_node == other) & (model.dof_direction != 2)
    model.stiffness = model.stiffness[~gone][:, ~gone]
    mass[:] = 0.0
    kept = np.flatnonzero(~gone)
    mass.resize((len(kept), len(kept)))
    mass.setdiag(1.0)
    model.dof_node, model.dof_direction, model.size = model.dof_node[~gone], model.dof_direction[~gone], len(kept)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (heavier_along_x, "a mass of"),
        (coupled_across, "instead of 0"),
        (a_rotation, "rx"),
        (held_apart, "held so that they move along no common direction"),
    ],
)
def test_a_mass_that_does_not_tell_the_coriolis_forces_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        coriolis_matrix(altered(change), np.array([0.0, 0.0, 1.0]))


def test_what_a_mass_must_be_for_coriolis_forces_is_told_in_one_message(tmp_path, capfd):
    model, job = turning_ring()
    heavy = model.mass.tolil()
    heavier_along_x(model, heavy)
    model.mass = heavy.tocsr()
    write_model(tmp_path / "model.h5", model, [])
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job))
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "[cyclic] coriolis = 'a mass of" in done.stderr and "which Coriolis forces follow from" in done.stderr


def turning_ring(**reduction):
    """A job on a sector of an elastic ring that turns fast, its contact next to nothing."""
    model = ring(SECTORS, seed=3)
    job = sector_job(model, SECTORS, coriolis=True)
    node = ["node", int(model.node_sets["rim"][1])]
    law = {"tangential_stiffness": 1e-3, "normal_stiffness": 1e-3, "friction_coefficient": 0.3, "preload": 1.0}
    job["contact"] = [{"normal": [[[*node, "z"], 1.0]], "tangents": [[[[*node, "x"], 1.0]]], **law}]
    job["load"].append({"name": "spin", "kind": "centrifugal", "speed_hz": TURNS, "spin_softening": True, **AXIS})
    job["static"] = {"load_path": [1.0]}
    del job["contact_set"]
    if reduction:
        job["reduction"] = reduction
    return model, job


def whole_ring():
    """Frequencies (Hz) and nodal diameters of the ring assembled whole, by eigenvalues that know of no symmetry."""
    whole = ring(SECTORS, span=SECTORS)
    spin = Spin(2.0 * np.pi * TURNS, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    mass, stiffness = whole.mass.toarray(), (whole.stiffness - softening(whole, spin)).toarray()
    turning = spin.omega * by_quadrature(whole, spin.direction).toarray()
    n = len(mass)
    inverse = np.linalg.inv(mass)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ turning]])
    values, vectors = eig(companion)
    chosen = np.argsort(np.where(values.imag > 0.0, values.imag, np.inf))[:40]
    order = np.argsort(whole.node_ids)
    place = order[np.searchsorted(whole.node_ids, whole.dof_node, sorter=order)]
    around = np.round(np.arctan2(whole.coordinates[:, 1], whole.coordinates[:, 0]) / (2.0 * np.pi / SECTORS), 6)[place]
    # A motion along the axis of nodes at the same place of each sector: of n it falls behind by 2 pi n / N a sector.
    along = (whole.dof_direction == 3) & (np.abs(around - np.round(around)) < 1e-6)
    turn = np.exp(2j * np.pi * np.outer(np.arange(SECTORS), np.round(around[along]) % SECTORS) / SECTORS)
    level = np.round(whole.coordinates[place][along][:, 2], 9) + 1e3 * np.round(
        np.hypot(*whole.coordinates[place][along][:, :2].T), 9
    )
    _, group = np.unique(np.round(level, 6), return_inverse=True)
    found = []
    for mode in chosen:
        motion = vectors[:n, mode][along]
        parts = [sum(abs(np.sum((row * motion)[group == g])) for g in np.unique(group)) for row in turn]
        found.append((values[mode].imag / (2.0 * np.pi), int(np.argmax(parts))))
    return found


@pytest.mark.parametrize("reduction", [{}, {"modes": 10}])
def test_modes_of_a_turning_ring_are_those_of_the_ring_assembled_whole(tmp_path, capfd, reduction):
    model, job = turning_ring(**reduction)
    write_model(tmp_path / "model.h5", model, [])
    found = modes_of(tmp_path, capfd, job, "--count", "4")
    if reduction:
        with h5py.File(tmp_path / "rom.h5") as file:
            basis, reduced = file["recovery/basis"][()], file["gyroscopic"][()]
        full = basis @ coriolis_matrix(model, np.array([0.0, 0.0, 1.0])) @ basis.T
        # Rounding; G^T = -G tells a row from a column.
        assert reduced == pytest.approx(full, abs=1e-14 * np.abs(full).max())
    whole = whole_ring()
    assert list(found) == [0, 1, -1, 2, -2, 3]
    for n, frequencies in found.items():
        expected = [hz for hz, diameter in whole if diameter == n % SECTORS][: len(frequencies)]
        # Rounding of 1e-16 times the condition, 1e6; a reduction keeps all modes there are.
        assert frequencies[: len(expected)] == pytest.approx(expected, rel=1e-8)
        assert len(expected) >= 3
    assert abs(found[1][0] / found[-1][0] - 1.0) > 0.005
