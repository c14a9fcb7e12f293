"""Nonlinear modes by cycles of quasi-static loading, `attrito mode` with `method = "quasi_static"`."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from dense_loading import Loading
from jobs import Job, attrito, chain, table, wedge, write_job
from mode_jobs import KT, LIMIT, MASS, K, follow, rubbing


def quasi_static(job: Job, **mode: float) -> Job:
    job["mode"] = job.get("mode", {}) | {"method": "quasi_static"} | mode
    return job


def sliding(contacts: int = 3, tangents: int = 1, **mode: float) -> Job:
    """The chain, free of its excitation."""
    job = chain(contacts, tangents)
    del job["sweep"]
    job["load"].pop()
    return quasi_static(job, **mode)


def test_a_coulomb_element_has_the_secant_stiffness_and_the_loop_of_its_closed_form(tmp_path):
    # Whatever the number of steps: no force changes while it slips.
    job = quasi_static(rubbing(), steps=16)
    job["output"]["monitors"] = [{"name": "mass", "dofs": [[0, 1.0]]}]
    rows = follow(tmp_path, job, "mass_amplitude")
    assert [rows[0]["amplitude"], rows[-1]["amplitude"]] == pytest.approx([1.0e-4, 2.0e-2], rel=1e-8)
    slipping = 0
    for row in rows:
        amplitude = row["amplitude"] / np.sqrt(MASS)
        # Of the loop itself: its one harmonic misses what the corners hold.
        assert row["mass_amplitude"] == pytest.approx(amplitude, rel=1e-8)
        slips = KT * amplitude > LIMIT
        slipping += slips
        omega = np.sqrt((K + min(KT, LIMIT / amplitude)) / MASS)
        work = 4.0 * LIMIT * (amplitude - LIMIT / KT) if slips else 0.0
        assert row["frequency_hz"] == pytest.approx(omega / (2 * np.pi), rel=1e-8)
        assert row["dissipated_energy"] == pytest.approx(work, rel=1e-7, abs=1e-12)
        assert row["damping_ratio"] == pytest.approx(work / (2 * np.pi * (omega * row["amplitude"]) ** 2), abs=1e-9)
        # C = 2 M: alpha / (2 omega)
        assert row["damping_ratio_structure"] == pytest.approx(2.0 / (2.0 * omega), rel=1e-8)
    assert 0 < slipping < len(rows), "the test is void unless it sticks at first and slips later"


def test_masing_s_rule_holds_where_the_normal_force_is_constant(tmp_path):
    rows = follow(tmp_path, quasi_static(rubbing(), steps=256))
    with h5py.File(tmp_path / "result.mode.h5") as file:
        frequency, ratio = file["points/masing_hz"][:], file["points/masing_damping_ratio"][:]
    assert frequency == pytest.approx([row["frequency_hz"] for row in rows], rel=1e-8)
    # The onset of slip is within one of 256 steps of the first loading, pi / 512 long: trapezoids miss a triangle of at
    # most an eighth of its square there, eight times that of the loop, 2 pi times smaller in the ratio.
    missed = (np.pi / 512) ** 2 / (2 * np.pi)
    assert ratio == pytest.approx([row["damping_ratio"] for row in rows], rel=1e-7, abs=missed)
    assert ratio.max() > 1e3 * missed


def marched(job: Job, shape: np.ndarray, load: float, steps: int) -> tuple[float, float]:
    """Q and the loop's area of a job with one contact of one tangent, by small steps of all its loads."""
    law = job["contact"][0]
    kt, kn, mu = (law[name] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient"))
    size = len(shape)
    tangent, normal, force = np.zeros(size), np.zeros(size), np.zeros(size)
    for row, entries in ((tangent, law["tangents"][0]), (normal, law["normal"]), (force, job["load"][0]["dofs"])):
        for dof, value in entries:
            row[dof] += value
    mass, stiffness = np.array(job["model"]["mass"]), np.array(job["model"]["stiffness"])
    closed = stiffness + kn * np.outer(normal, normal)
    stuck = closed + kt * np.outer(tangent, tangent)
    path = [(s, 0.0) for s in np.linspace(0.0, 1.0, steps + 1)[1:]]
    angle = 2.0 * np.pi * np.arange(2 * steps + 1) / steps
    path += [(1.0, load * s) for s in np.sin(np.linspace(0.0, 0.5 * np.pi, steps))] + [
        (1.0, a) for a in load * np.cos(angle)
    ]
    slider, coordinates = 0.0, []
    for static, alpha in path:
        right = static * force + alpha * mass @ shape
        x = np.linalg.solve(stuck, right + kt * slider * tangent)
        pull, press = kt * (tangent @ x - slider), kn * (normal @ x)
        if press > 0.0 and abs(pull) > mu * press:
            side = np.sign(pull)
            x = np.linalg.solve(closed + side * mu * kn * np.outer(tangent, normal), right)
            press = kn * (normal @ x)
            slider = tangent @ x - side * mu * press / kt
        if press <= 0.0:
            x = np.linalg.solve(stiffness, right)
            slider = tangent @ x
        coordinates.append(shape @ mass @ x)
    cycle, alpha = np.array(coordinates[-steps - 1 :]), load * np.cos(angle[-steps - 1 :])
    area = np.sum(0.5 * (alpha[1:] + alpha[:-1]) * np.diff(cycle))
    return float(np.ptp(cycle)) / 2.0, float(abs(area))


def test_a_wedge_that_slips_and_lifts_off_has_the_loop_of_small_steps(tmp_path):
    job = wedge()
    del job["sweep"]
    quasi_static(job, start=2.0e-5, stop=5.0e-3, points=4, steps=256)
    rows = follow(tmp_path, job)
    open_part = [float(row["open"]) for row in table(tmp_path, "--contacts", result="result.mode.h5")]
    assert open_part[0] == 0.0 < open_part[-1], "the test is void unless it stays closed at first and lifts off later"
    done = attrito(tmp_path, "linear-modes", "job.toml", "--state", "tangent")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.modes.h5") as file:
        shape = file["points/coordinates"][0, :, 1]
    with h5py.File(tmp_path / "result.mode.h5") as file:
        loads = file["points/load"][:]
    assert sum(row["dissipated_energy"] > 0.0 for row in rows) > 1, "the test is void unless the contact slips"
    for row, load in zip(rows, loads, strict=True):
        amplitude, area = marched(job, shape, load, 4000)
        # Steps miss a landing by up to one of them, 2 pi / 256 of the amplitude, in a part of the loop.
        assert row["amplitude"] == pytest.approx(amplitude, rel=2e-3)
        assert row["dissipated_energy"] == pytest.approx(area, rel=2e-2, abs=1e-9)
        assert row["frequency_hz"] == pytest.approx(np.sqrt(load / row["amplitude"]) / (2 * np.pi), rel=1e-9)


def test_contacts_that_slip_open_and_land_take_the_steps_of_a_dense_solution(tmp_path):
    # The same steps, 16 a cycle, from the same static solution: no error but what is left of the cycles' settling.
    job = sliding(contacts=4, tangents=2, start=5.0e-4, stop=4.0e-3, points=3, steps=16)
    # Two that press hardly at all, and one that is open at rest.
    job["load"][0]["dofs"][0][1], job["load"][0]["dofs"][1][1] = 6.0, 12.0
    job["contact"][2]["gap"] = 4.0e-4
    rows = follow(tmp_path, job)
    done = attrito(tmp_path, "linear-modes", "job.toml", "--state", "tangent")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.modes.h5") as file:
        shape = file["points/coordinates"][0, :, 1]
    with h5py.File(tmp_path / "result.mode.h5") as file:
        loads, areas = file["points/load"][:], file["points/loop_area"][:]
    opened = []
    for row, load, area in zip(rows, loads, areas, strict=True):
        amplitude, own, count = Loading(job, shape).cycles(load, 16, 12)
        opened.append(count)
        assert row["amplitude"] == pytest.approx(amplitude, rel=1e-6)
        assert area == pytest.approx(own, rel=1e-5)
    assert max(opened) > 1, "the test is void unless contacts open"


def test_what_contacts_dissipate_adds_up_to_the_loop_s_area(tmp_path):
    rows = follow(tmp_path, sliding(tangents=2, start=3.0e-4, stop=1.0e-3, points=3, steps=256))
    contacts = table(tmp_path, "--contacts", result="result.mode.h5")
    with h5py.File(tmp_path / "result.mode.h5") as file:
        areas = file["points/loop_area"][:]
    for i, (row, area) in enumerate(zip(rows, areas, strict=True)):
        own = [float(one["dissipated_energy"]) for one in contacts if one["point"] == str(i)]
        assert sum(own) == pytest.approx(row["dissipated_energy"], rel=1e-12)
        # The area is a sum of trapezoids, whose error falls like the square of the steps.
        assert sum(own) == pytest.approx(area, rel=5e-3)
    assert areas[-1] > 0.0


def test_where_slip_changes_a_mode_little_both_methods_find_its_frequency_and_damping(tmp_path):
    job = sliding(contacts=6, start=2.0e-4, stop=6.0e-4, points=4)
    for contact in job["contact"]:
        # Friction has a hundredth of the stiffness, so that the shape is the tangent mode's and zeta some 1e-3.
        contact |= {"tangential_stiffness": 1.5e3, "friction_coefficient": 0.004}
    job["balance"]["harmonics"] = 7
    loaded = follow(tmp_path, job)
    job["mode"]["method"] = "epmc"
    motion = follow(tmp_path, job)
    slips = 0
    for one, other in zip(loaded, motion, strict=True):
        # The loop's secant and its first harmonic differ by less than what friction adds to the stiffness, 0.3 %.
        assert one["frequency_hz"] == pytest.approx(other["frequency_hz"], rel=1e-3)
        assert one["damping_ratio"] == pytest.approx(other["damping_ratio"], rel=2e-3, abs=1e-6)
        slips += other["damping_ratio"] > 1e-4
    assert slips > 1, "the test is void unless contacts slip"


def test_a_point_does_not_depend_on_those_before_it(tmp_path):
    rows = follow(tmp_path, sliding(start=2.0e-4, stop=2.0e-3, points=3))
    alone = follow(tmp_path, sliding(start=2.0e-3, stop=1.0e-3, points=2))
    assert alone[0] == pytest.approx(rows[-1], rel=1e-7)


def test_a_quasi_static_mode_with_two_tangents_does_not_depend_on_the_number_of_ranks(tmp_path):
    alone = follow(tmp_path, sliding(tangents=2, start=1.0e-5, stop=3.0e-3, points=4))
    done = attrito(tmp_path, "mode", "job.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    for row, other in zip(table(tmp_path, result="result.mode.h5"), alone, strict=True):
        assert {name: float(row[name]) for name in other} == pytest.approx(other, rel=1e-6, abs=1e-12)
    assert alone[0]["damping_ratio"] == pytest.approx(0.0, abs=1e-12) and alone[-1]["damping_ratio"] > 0.01


@pytest.mark.parametrize("method", ["epmc", "quasi_static"])
def test_a_report_of_a_mode_has_its_points_and_says_what_is_estimated(tmp_path, method):
    job = rubbing()
    job["mode"] |= {"method": method, "points": 4}
    rows = follow(tmp_path, job)
    done = attrito(tmp_path, "report", "result.mode.h5", "-o", "mode.html")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "mode.html").read_text()
    assert "Nonlinear mode" in page and "Frequency response" not in page
    assert all(f"{row['frequency_hz']:.6g}" in page for row in rows)
    words = {
        "epmc": "Estimated error of frequency, negative damping or monitors",
        "quasi_static": "Estimated error of the contacts",
    }
    assert {name for name in words if words[name] in page} == {method} and "not known" not in page


def test_steps_are_a_multiple_of_eight(tmp_path):
    done = attrito(tmp_path, "mode", write_job(tmp_path, quasi_static(rubbing(), steps=12)))
    assert done.returncode == 2 and "[mode] steps = 12: expected a multiple of 8" in done.stderr, done.stderr
