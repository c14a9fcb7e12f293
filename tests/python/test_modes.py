"""Nonlinear modes by the extended periodic motion concept, `attrito mode`."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import attrito, chain, table, write_job
from mode_jobs import KT, MASS, K, cut_short, described, follow, rubbing, weakly_damped_wedge


def test_one_harmonic_of_a_coulomb_element_has_the_frequency_and_damping_of_its_describing_function(tmp_path):
    rows = follow(tmp_path, rubbing())
    slipping = 0
    for row in rows:
        omega, work, slips = described(row["amplitude"])
        slipping += slips
        assert row["frequency_hz"] == pytest.approx(omega / (2 * np.pi), rel=1e-8)
        assert row["dissipated_energy"] == pytest.approx(work, rel=1e-8, abs=1e-12)
        assert row["damping_ratio"] == pytest.approx(work / (2 * np.pi * (omega * row["amplitude"]) ** 2), abs=1e-10)
        # C = 2 M: alpha / (2 omega)
        assert row["damping_ratio_structure"] == pytest.approx(2.0 / (2.0 * omega), rel=1e-8)
    assert 0 < slipping < len(rows), "the test is void unless it sticks at first and slips later"


def test_a_mode_begins_as_the_tangent_one_and_its_damping_is_what_the_excitation_makes_up_for(tmp_path):
    rows = follow(tmp_path, rubbing(harmonics=7))
    assert [rows[0]["amplitude"], rows[-1]["amplitude"]] == pytest.approx([1.0e-4, 2.0e-2], rel=1e-12)
    assert rows[0]["frequency_hz"] == pytest.approx(np.sqrt((K + KT) / MASS) / (2 * np.pi), rel=1e-8)
    with h5py.File(tmp_path / "result.mode.h5") as file:
        excitation = file["points/excitation"][:]
        first = file["points/coordinates"][:, 0, 1:3]
    assert np.hypot(*first.T) * np.sqrt(MASS) == pytest.approx([row["amplitude"] for row in rows], rel=1e-8)
    for row, xi in zip(rows, excitation, strict=True):
        both = row["damping_ratio"] + row["damping_ratio_structure"]
        assert both == pytest.approx(xi / (4 * np.pi * row["frequency_hz"]), rel=1e-7)


def marched_work(motion: np.ndarray, kt: float, kn: float, mu: float, steps: int = 40_000) -> float:
    """Work a period of one Coulomb element under a displacement `[3, nk]`, its slider marched until periodic."""
    angle = 2 * np.pi * np.arange(steps + 1) / steps
    harmonics = np.arange(1, (motion.shape[1] + 1) // 2)
    u, v = (row[0] + row[1::2] @ np.cos(np.outer(harmonics, angle)) + row[2::2] @ np.sin(np.outer(harmonics, angle))
            for row in (motion[0], motion[2]))  # fmt: skip
    reach = mu * np.maximum(kn * v, 0.0) / kt
    slider = u[0]
    for _ in range(2):
        forces = np.empty_like(u)
        for i in range(steps + 1):
            slider = min(max(slider, u[i] - reach[i]), u[i] + reach[i])
            forces[i] = kt * (u[i] - slider)
    return float(np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(u)))


def test_dissipation_is_that_of_a_loop_marched_in_time(tmp_path):
    job = weakly_damped_wedge()
    rows = follow(tmp_path, job)
    with h5py.File(tmp_path / "result.mode.h5") as file:
        motion = file["contacts/displacement"][:, 0]
    law = job["contact"][0]
    numbers = (law[name] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient"))
    work = marched_work(motion[-1], *numbers)
    assert work > 0.0
    # The march's own error falls like the square of 1/40 000; the balance goes by events.
    assert rows[-1]["dissipated_energy"] == pytest.approx(work, rel=1e-4)


def test_dissipation_is_that_of_forced_motion_integrated_in_time(tmp_path):
    # Loads xi M q' of the last point's own motion, all harmonics, keep it up: event by event, without a balance.
    job = weakly_damped_wedge()
    job["balance"] = {"harmonics": 25}
    job["mode"] |= {"start": 3.0e-4, "points": 4}
    rows = follow(tmp_path, job)
    with h5py.File(tmp_path / "result.mode.h5") as file:
        motion, xi = file["points/coordinates"][-1], file["points/excitation"][-1]
    frequency = rows[-1]["frequency_hz"]
    # The mass is the unit matrix.
    assert job["model"]["mass"] == [[1.0, 0.0], [0.0, 1.0]]
    job["load"] = [load for load in job["load"] if load["kind"] == "static"]
    for h in range(1, 26):
        rate = xi * h * 2 * np.pi * frequency
        cosine, sine = rate * motion[:, 2 * h], -rate * motion[:, 2 * h - 1]
        load = {"cosine": [[i, float(cosine[i])] for i in (0, 1)], "sine": [[i, float(sine[i])] for i in (0, 1)]}
        job["load"].append({"kind": "harmonic", "harmonic": h} | load)
    job["integrate"] = {"frequency_hz": frequency, "cycles": 4000}
    done = attrito(tmp_path, "integrate", write_job(tmp_path, job))
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(tmp_path / job["output"]["file"]) as file:
        work = file["integration/contacts/dissipated_energy"][:].sum()
        slips = (file["integration/contacts/history/regime"][:] == 1).any()
    assert slips, "the test is void unless the contact slips"
    # 25 harmonics leave out some (7/25)^3 of the 3e-4 that 7 do.
    assert rows[-1]["dissipated_energy"] == pytest.approx(work, rel=1e-4)


@pytest.mark.parametrize("points", [12, 18, 25])
def test_a_mode_that_folds_goes_on_beyond_however_far_apart_its_amplitudes_are(tmp_path, points):
    job = weakly_damped_wedge()
    job["contact"][0]["normal_stiffness"] = 2.0 * job["contact"][0]["tangential_stiffness"]
    job["mode"]["points"] = points
    rows = follow(tmp_path, job)
    frequency = np.array([row["frequency_hz"] for row in rows])
    # At a = 0.1605, Q = 1.76e-4, the part of 145 to 133 Hz ends.
    before = np.array([row["amplitude"] for row in rows]) < 1.7e-4
    assert frequency[before].min() > 133.0 and frequency[~before].max() < 130.5
    # The part beyond is the one that a mode begun there is on, to the tolerances of Q and of the balance.
    job["mode"] |= {"start": 2.9e-3, "points": 2}
    assert frequency[-1] == pytest.approx(follow(tmp_path, job)[-1]["frequency_hz"], rel=1e-7)


def test_the_mode_predicts_forced_resonances_of_a_lightly_damped_wedge(tmp_path):
    job = weakly_damped_wedge()
    # So that slip damps by less than 1 %, too.
    job["contact"][0]["friction_coefficient"] = 0.1
    follow(tmp_path, job)
    force = np.zeros(2)
    for dof, value in job["load"][1]["cosine"]:
        force[dof] += value
    with h5py.File(tmp_path / "result.mode.h5") as file:
        omega = 2 * np.pi * file["points/frequency_hz"][:]
        ratio = file["points/damping_ratio"][:] + file["points/damping_ratio_structure"][:]
        first = file["points/coordinates"][:, :, 1] - 1j * file["points/coordinates"][:, :, 2]
        series = file["points/coordinates"][:]
        mean = series[:, :, 0]
        height = file["monitors/x/amplitude"][:]
    mass = np.eye(2)
    harmonic = (np.arange(series.shape[2]) + 1) // 2
    kinetic = np.einsum("pik,ij,pjk,k->p", series, mass, series, harmonic**2)
    level = 2 * ratio * omega**2 * kinetic / abs(first @ force)
    # Where the contacts damp by less than 1 % and the mean has hardly moved.
    swing = np.linalg.norm(series[:, :, 1], axis=1)
    chosen = np.flatnonzero((ratio < 0.01) & (np.linalg.norm(mean - mean[0], axis=1) < 0.1 * swing))
    slips = [i for i in chosen if ratio[i] > 1.5 * ratio[0]]
    assert slips, "the test is void unless the contact slips at some of these"
    for i in (slips[0], slips[-1]):
        at = omega[i] / (2 * np.pi)
        around = at * np.linspace(1.03, 0.97, 61)
        job["sweep"] = {"frequencies_hz": around.tolist(), "levels": [float(level[i])]}
        done = attrito(tmp_path, "run", write_job(tmp_path, job))
        assert done.returncode == 0, done.stderr
        rows = table(tmp_path)
        heights = [float(row["x_amplitude"]) for row in rows]
        peak = int(np.argmax(heights))
        assert heights[peak] == pytest.approx(height[i], rel=0.02)
        assert float(rows[peak]["frequency_hz"]) == pytest.approx(at, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stop": 1.0e-4}, "[mode] stop = 0.0001: expected an amplitude other than start"),
        ({"number": 5}, "[mode] number = 5: expected the number of an elastic mode, 1 to 2"),
        ({"number": 1, "near_hz": 40.0}, "[mode] near_hz = 40.0: expected no such key beside number"),
        ({"method": "epcm"}, "[mode] method = 'epcm': expected"),
    ],
)
def test_faults_of_the_mode_name_their_key(tmp_path, changes, said):
    job = rubbing()
    job["mode"] |= changes
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 2 and said in done.stderr, done.stderr


def test_a_mode_is_plotted_and_its_contacts_are_listed(tmp_path):
    follow(tmp_path, rubbing())
    assert (tmp_path / "result.mode.png").is_file()
    done = attrito(tmp_path, "plot", "result.mode.h5", "-o", "curve.svg")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "curve.svg").read_text()
    assert text.count("<path") > 10
    contacts = table(tmp_path, "--contacts", result="result.mode.h5")
    assert [row["state"] for row in contacts][:1] == ["stuck"] and contacts[-1]["state"] == "slipping"


def test_a_mode_that_closes_a_gap_has_the_period_of_its_two_oscillators(tmp_path):
    law = {"tangential_stiffness": 3.0e4, "normal_stiffness": 5.0e4, "friction_coefficient": 0.4}
    gap = 1.0e-3
    job = rubbing() | {
        "model": {"mass": (MASS * np.eye(2)).tolist(), "stiffness": np.diag([3.0 * K, K]).tolist()},
        "damping": {"ratio": 1.0e-4},
        "contact": [{"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]], "gap": gap, **law}],
        "balance": {"harmonics": 15},
        "mode": {"near_hz": 36.0, "start": 5.0e-4, "stop": 6.0e-3, "points": 8},
    }
    job["load"] = [{"name": "none", "kind": "static", "dofs": [[0, 1.0]]}]
    rows = follow(tmp_path, job)
    natural, closed = np.sqrt(K / MASS), np.sqrt((K + law["normal_stiffness"]) / MASS)
    # Open at rest: the tangent mode, not the stuck one at 43.6 Hz.
    assert rows[0]["frequency_hz"] == pytest.approx(natural / (2 * np.pi), rel=1e-8)
    with h5py.File(tmp_path / "result.mode.h5") as file:
        series = file["points/coordinates"][-1, 1]
    angle = np.linspace(0, 2 * np.pi, 20_001)
    harmonics = np.arange(1, (len(series) + 1) // 2)
    motion = series[0] + series[1::2] @ np.cos(np.outer(harmonics, angle))
    motion += series[2::2] @ np.sin(np.outer(harmonics, angle))
    farthest = -motion.min()
    centre = law["normal_stiffness"] * gap / (K + law["normal_stiffness"])
    speed = natural * np.sqrt(farthest**2 - gap**2)
    reach = np.hypot(gap - centre, speed / closed)
    period = 2 * ((np.pi - np.arccos(gap / farthest)) / natural + np.arccos((gap - centre) / reach) / closed)
    assert period * natural / (2 * np.pi) < 0.95, "the test is void unless it touches for long"
    # Harmonics beyond 15 of a force with kinks are of some 1/15^2 of the first, their stiffness 15^2 times as much.
    assert rows[-1]["frequency_hz"] == pytest.approx(1.0 / period, rel=1e-4)


@pytest.mark.parametrize("method", ["epmc", "quasi_static"])
@pytest.mark.parametrize("known", [0, 3])
def test_a_mode_that_is_cut_short_goes_on_as_if_it_had_not_been(tmp_path, monkeypatch, method, known):
    job = chain(contacts=3, tangents=2)
    del job["sweep"]
    job["load"].pop()
    job["mode"] = {"start": 1.0e-4, "stop": 2.0e-3, "points": 5, "method": method, "steps": 16}
    whole = follow(tmp_path, job)
    iterations = [row["iterations"] for row in table(tmp_path, result="result.mode.h5")]
    (tmp_path / "result.mode.h5").unlink()
    cut_short(tmp_path, monkeypatch, known)
    assert (tmp_path / "result.mode.h5.partial").is_file() and not (tmp_path / "result.mode.h5").exists()
    # What there is of it has the table of a mode.
    begun = table(tmp_path, result="result.mode.h5.partial") if known else []
    assert len(begun) == known and all("damping_ratio" in row for row in begun)
    done = attrito(tmp_path, "mode", "job.toml", "--resume")
    assert done.returncode == 0, done.stderr
    assert f"going on after {known} points" in done.stdout + done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    for row, other in zip(rows, whole, strict=True):
        # Q is met to 1e-9; two processes may differ by rounding.
        assert {name: float(row[name]) for name in other} == pytest.approx(other, rel=1e-7, abs=1e-12)
    # A mode that had forgotten where it was would take others.
    assert [row["iterations"] for row in rows] == iterations
    assert not list(tmp_path.glob("*.partial*"))


def test_a_mode_goes_on_only_as_it_began(tmp_path, monkeypatch):
    job = rubbing()
    write_job(tmp_path, job)
    cut_short(tmp_path, monkeypatch, 0)
    job["mode"]["stop"] = 3.0e-2
    done = attrito(tmp_path, "mode", write_job(tmp_path, job), "--resume")
    assert done.returncode == 2 and "mode.stop = 0.03" in done.stderr, done.stderr


def test_a_mode_with_two_tangents_does_not_depend_on_the_number_of_ranks(tmp_path):
    job = chain(contacts=3, tangents=2)
    del job["sweep"]
    job["load"].pop()
    job["mode"] = {"start": 1.0e-5, "stop": 3.0e-3, "points": 5}
    alone = follow(tmp_path, job)
    done = attrito(tmp_path, "mode", "job.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    for row, other in zip(table(tmp_path, result="result.mode.h5"), alone, strict=True):
        # Q is met to 1e-9; sums over ranks differ by rounding.
        assert {name: float(row[name]) for name in other} == pytest.approx(other, rel=1e-6, abs=1e-12)
    assert alone[0]["damping_ratio"] == pytest.approx(0.0, abs=1e-12) and alone[-1]["damping_ratio"] > 0.01
