"""The bladed disc of meshes/bladed_disc.py: its sector against CalculiX's own model of the wheel."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from calculix_printed import calculix_frequencies
from jobs import attrito, table, write_job
from mpi4py import MPI
from scipy.sparse import csc_matrix, csr_matrix, diags, identity
from scipy.sparse.linalg import eigsh
from wheels import AXIS

from attrito.job.reading import read_job
from attrito.library.session import Options, Solver
from attrito.results.result import Result
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.wheel import whole_wheel

REPOSITORY = Path(__file__).resolve().parents[2]


def wheel_frequencies(scene, number, count, stuck=False):
    """The lowest frequencies in Hz of a nodal diameter, of the sparse sector, without contacts or with all stuck."""
    sector, model = scene.sector, scene.model
    tie = identity(model.size, dtype=complex, format="lil")
    for lower, upper in zip(sector.lower, sector.upper, strict=True):
        tie[upper, lower] = np.exp(-2j * np.pi * number / sector.sectors)
    kept = np.setdiff1d(np.arange(model.size), sector.upper)
    shape = csr_matrix(sector.axes @ tie.tocsr()[:, kept])
    stiffness, mass = (csc_matrix(shape.conj().T @ matrix @ shape) for matrix in (model.stiffness, model.mass))
    if stuck:
        turn = np.exp(-2j * np.pi * number / sector.sectors)
        laws, contacts = scene.contacts.laws, scene.contacts
        rows = csr_matrix(contacts.rows @ sector.axes + turn * contacts.next_rows @ sector.axes) @ tie.tocsr()[:, kept]
        springs = [
            [laws["tangential_stiffness"][i]] * tangents + [laws["normal_stiffness"][i]]
            for i, tangents in enumerate(laws["tangents"])
        ]
        stiffness = csc_matrix(stiffness + rows.conj().T @ diags(np.concatenate(springs)) @ rows)
    values = eigsh(stiffness, count, mass, sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(values.real)) / (2.0 * np.pi)


def prepare(folder, sectors, *options):
    """Mesh and model of a sector in a folder, and a job on it."""
    script = REPOSITORY / "meshes" / "bladed_disc.py"
    chosen = ["--size", "coarse", "--sectors", str(sectors), "--out", str(folder), *options]
    subprocess.run([sys.executable, script, *chosen], check=True)
    done = attrito(folder, "import", "model.h5", "--calculix", "bladed_disc", "--mesh", "bladed_disc.inp")
    assert done.returncode == 0, done.stderr
    law = {"tangential_stiffness": 160.0, "normal_stiffness": 200.0, "friction_coefficient": 0.3, "gap": -0.25}
    sets = {"a": "shroud_a", "b": "shroud_b", "across": True, "tolerance": 1e-3, "tangents": 1}
    force = [[["node", "tip", "y"], 1.0], [["node", "tip", "z"], 0.5]]
    return {
        "model": {"file": "model.h5"},
        "damping": {"rayleigh": [30.0, 0.0]},
        "cyclic": {"sectors": sectors, "engine_order": 1, "lower": "low", "upper": "high", **AXIS},
        "contact_set": [sets | law],
        "load": [{"kind": "harmonic", "cosine": force}],
        "sweep": {"frequencies_hz": [100.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "tip", "dofs": force[:1]}]},
    }


@pytest.fixture(scope="module", params=[3, 6, 24])
def wheel(request, tmp_path_factory):
    """Sectors, the scene of one, and CalculiX's frequencies."""
    folder, sectors = tmp_path_factory.mktemp("bladed_disc"), request.param
    job = prepare(folder, sectors, "--diameters", "4")
    scene = build_scene(read_job(folder / write_job(folder, job)))
    return sectors, scene, calculix_frequencies(folder / "bladed_disc_frequencies.dat")


def test_frequencies_of_nodal_diameters_are_calculix_s_own(wheel):
    """Seven digits are printed: the last one is worth up to 1e-6 of the number."""
    sectors, scene, expected = wheel
    assert sorted(expected) == list(range(min(4, sectors // 2) + 1))
    for number, frequencies in expected.items():
        # CalculiX lists every frequency of the doubled real problem twice.
        once = np.array(frequencies[::2])
        assert wheel_frequencies(scene, number, len(once)) == pytest.approx(once, rel=1e-6)


def test_linear_modes_of_each_nodal_diameter_are_those_of_the_sparse_sector(tmp_path):
    """What the reduction leaves out raises a frequency, and with 40 modes inside by 3e-5 at most."""
    job = prepare(tmp_path, 6)
    job["reduction"] = {"modes": 40}
    del job["sweep"], job["load"]
    name = write_job(tmp_path, job)
    scene = build_scene(read_job(tmp_path / name, excited=False))
    done = attrito(tmp_path, "linear-modes", name, "--state", "stuck", "--count", "4")
    assert done.returncode == 0, done.stderr
    assert "nodal diameter 3: " in done.stdout
    rows = table(tmp_path, result="result.stuck.modes.h5")
    for number in range(4):
        found = [float(row["frequency_hz"]) for row in rows if row["nodal_diameter"] == str(number)]
        expected = wheel_frequencies(scene, number, 4, stuck=True)
        error = np.array(found) / expected - 1.0
        # eigsh solves to machine precision times the condition of the stiffness, some 1e6.
        assert len(error) == 4 and np.all(error > -1e-9) and np.all(error < 1e-4)


def test_every_node_of_a_shroud_meets_one_of_the_next_without_a_gap(wheel):
    _, scene, _ = wheel
    contacts = scene.contacts
    assert contacts.count == len(scene.model.node_sets["shroud_a"]) == len(scene.model.node_sets["shroud_b"])
    assert np.abs(contacts.places["clearance"]).max() < 1e-9
    # The wheel's own translation along its axis moves neither side against the other.
    along = (scene.model.dof_direction == 3).astype(float)
    assert np.abs((contacts.rows + contacts.next_rows) @ along).max() < 1e-12


def test_shrouds_that_rub_move_in_one_sector_as_in_the_wheel_of_its_reduction(tmp_path):
    job = prepare(tmp_path, 3) | {"reduction": {"modes": 10}}
    job = read_job(tmp_path / write_job(tmp_path, job))
    scene = build_scene(job)
    rom, _ = make_rom(MPI.COMM_SELF, job, scene, say=lambda _: None)
    sector = reduced_scene(job, scene, rom)
    one, all_of_them = (points_at(each, [56.27, 52.33]) for each in (sector, whole_wheel(sector)))
    for point, whole in zip(one, all_of_them, strict=True):
        assert point.outcome == whole.outcome == "converged" and point.unique and whole.unique
        assert [3 * count for count in point.states] == list(whole.states)
        assert point.states[2] >= 5 and point.states[3] >= 5, "contacts neither slip nor open: the test is void"
        # Residuals of 1e-13, and contacts and bore some 1e4 times stiffer than the blade.
        assert point.harmonics == pytest.approx(whole.harmonics, abs=1e-8 * np.abs(whole.harmonics).max())


@pytest.mark.slow
def test_a_sector_moves_as_the_wheel_that_is_meshed_and_reduced_by_itself(tmp_path):
    """Loads f_j(t) = f_0(t - j EO T / N), turned with their sectors; two tangents by samples, 40 a sector's delay."""
    sectors, frequencies = 3, [56.0, 53.0]
    place = {name: tmp_path / name for name in ("sector", "wheel")}
    for folder in place.values():
        folder.mkdir()
    job = prepare(place["sector"], sectors)
    job["contact_set"][0]["tangents"] = 2
    job["load"][0]["cosine"] = [[dof, 20.0 * force] for dof, force in job["load"][0]["cosine"]]
    job |= {"reduction": {"modes": 30}, "balance": {"harmonics": 3}}
    job["sweep"] = {"frequencies_hz": frequencies}
    whole = prepare(place["wheel"], sectors, "--whole") | {key: job[key] for key in ("reduction", "balance", "sweep")}
    del whole["cyclic"]
    (pair,) = job["contact_set"]
    follower = {j: (j + 1) % sectors for j in range(sectors)}
    whole["contact_set"] = [
        pair | {"a": f"shroud_a_{j}", "b": f"shroud_b_{after}", "across": False} for j, after in follower.items()
    ]
    cosine, sine = [], []
    for j in range(sectors):
        angle = 2.0 * np.pi * j / sectors
        force = 20.0 * np.array([-np.sin(angle), np.cos(angle), 0.5])
        for name, value in zip("xyz", force, strict=True):
            cosine.append([["node", f"tip_{j}", name], float(value * np.cos(angle))])
            sine.append([["node", f"tip_{j}", name], float(value * np.sin(angle))])
    whole["load"] = [{"kind": "harmonic", "cosine": cosine, "sine": sine}]
    whole["output"]["monitors"] = [{"name": "tip", "dofs": [[["node", "tip_0", "y"], 1.0]]}]
    found = {}
    for name, own in (("sector", job), ("wheel", whole)):
        done = attrito(place[name], "run", write_job(place[name], own))
        assert done.returncode == 0, done.stderr
        with Result(place[name] / "result.h5") as result:
            found[name] = [result.monitor("tip", key) for key in ("amplitude", "mean")]
            found[f"{name} error"] = result.array("/points/error_modes").max()
    error = found["sector error"] + found["wheel error"]
    assert 0.0 < error < 0.01
    for one, other in zip(found["sector"], found["wheel"], strict=True):
        assert one == pytest.approx(other, rel=error)


def points_at(scene, frequencies):
    options = Options(harmonics=3, tolerance=1e-13)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.zeros((1, 0)), 1, frequencies[0])
        return list(solver.solve_at(frequencies, 40.0, 0))


def test_the_job_of_the_bladed_disc_damps_its_peak_by_friction(tmp_path):
    """At the stuck frequency a hundredth of a newton leaves the shrouds stuck, five make them slip."""
    prepare(tmp_path, 24)
    text = re.sub(r"\.\./out/\w+/", "", (REPOSITORY / "input" / "bladed_disc.toml").read_text())
    text = re.sub(r"start_hz = .*\nstop_hz = .*\n", "frequencies_hz = [866.0]\n", text)
    text = re.sub(r"harmonics = .*\n", "harmonics = 1\n", text)
    (tmp_path / "job.toml").write_text(re.sub(r"levels = .*\n", "levels = [0.01, 5.0]\n", text))
    done = attrito(tmp_path, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    assert "one of 24 sectors, engine order 3: nodal diameter 3, running forward" in done.stderr + done.stdout
    with Result(tmp_path / "result.h5") as result:
        stuck, damped = result.monitor("tip", "amplitude") / result.array("/points/level")
        assert result.attribute("nodal_diameter") == "3"
    assert damped < 0.6 * stuck
    done = attrito(tmp_path, "report", "result.h5")
    assert done.returncode == 0, done.stderr
    assert (
        "one of 24 sectors, engine order 3: nodal diameter 3, running forward" in (tmp_path / "report.html").read_text()
    )
    # The same on two ranks: what they add up differs in rounding, of residuals of 1e-10.
    done = attrito(tmp_path, "run", "job.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    with Result(tmp_path / "result.h5") as result:
        again = result.monitor("tip", "amplitude") / result.array("/points/level")
    assert again == pytest.approx([stuck, damped], rel=1e-7)
