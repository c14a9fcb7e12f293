"""Branches that coexist are found, once each; sweeps begin at points of older results."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
from edited import edited
from jobs import run, stiff_wedge, swept, table

from attrito.job.reading import read_job
from attrito.library.integrator import Integrator, Run
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene

REPOSITORY = Path(__file__).resolve().parents[2]


def test_both_stable_branches_of_the_stiff_wedge_are_found_and_each_once(tmp_path):
    # Between its folds at 88.1 and 91.0 Hz the branch passes three times; in this window the three do not meet.
    run(tmp_path, swept(stiff_wedge([], 5), 90.8, 89.2, branches=2))
    rows = table(tmp_path)
    ends = {}
    for branch in ("0", "1"):
        own = [row for row in rows if row["branch"] == branch]
        frequencies = [float(row["frequency_hz"]) for row in own]
        assert {round(min(frequencies), 6), round(max(frequencies), 6)} == {89.2, 90.8}
        ends[branch] = [float(row["x_amplitude"]) for row in own if row["frequency_hz"] == "90.8"]
    assert {row["branch"] for row in rows} == {"0", "1"}
    # Known at 90 Hz: 0.1613 and 0.1269 mm.
    apart = abs(ends["0"][0] - ends["1"][0])
    assert apart > 0.25e-4


def test_no_branch_is_found_twice(tmp_path):
    # All of it is one branch here, which starts from both ends, from motion in time and by homotopy lead to again.
    done = run(tmp_path, swept(stiff_wedge([], 5), 93.0, 87.5, branches=3))
    assert {row["branch"] for row in table(tmp_path)} == {"0"}
    assert "another branch" not in done.stdout


def test_an_isola_is_found_followed_round_and_motion_stays_on_its_stable_side(tmp_path):
    job = tomllib.loads((REPOSITORY / "input/wedge_isola.toml").read_text())
    job["output"]["file"] = "result.h5"
    run(tmp_path, job)
    rows = table(tmp_path)
    (main, isola) = ([row for row in rows if row["branch"] == branch] for branch in ("0", "1"))
    frequencies, amplitudes = (
        np.array([float(row[name]) for row in isola]) for name in ("frequency_hz", "x_amplitude")
    )
    # Closed: it ends where it began, as nearly as a branch comes home, after two folds; apart from the other.
    assert frequencies.min() > 122.0
    assert frequencies.max() < 130.0
    assert frequencies[-1] == pytest.approx(frequencies[0], rel=1e-6)
    assert amplitudes[-1] == pytest.approx(amplitudes[0], rel=1e-6)
    assert [row["kind"] for row in table(tmp_path, "--bifurcations") if row["branch"] == "1"].count("fold") == 2
    assert amplitudes.min() > 1.5 * max(float(row["x_amplitude"]) for row in main)
    # The side of large motions is stable, the other is not; by located events the motion is there 400 periods later.
    best = isola[int(np.argmax(amplitudes))]
    assert best["stable"] == "true"
    assert {row["stable"] for row in isola} >= {"true", "false"}
    with h5py.File(tmp_path / "result.h5") as file:
        motion = file["points/coordinates"][int(best["point"])]
        sliders = file["contacts/slider"][int(best["point"])]
    read = read_job(tmp_path / "job.toml")
    omega = 2.0 * np.pi * float(best["frequency_hz"])
    orders = np.arange(1, motion.shape[1] // 2 + 1)
    with Integrator(reduced_scene(read, build_scene(read))) as session:
        session.start(motion[:, 0] + motion[:, 1::2].sum(axis=1), omega * motion[:, 2::2] @ orders, sliders, np.ones(1))
        orbit = session.run(Run(float(best["frequency_hz"]), level=0.85, cycles=400, fewest_cycles=400))
    # The five harmonics leave out some 1e-3 of the motion, by their estimate.
    assert orbit.amplitude[0] == pytest.approx(amplitudes.max(), rel=10.0 * float(best["estimate"]))


def test_a_sweep_begins_at_a_point_of_an_older_result(tmp_path):
    job = swept(stiff_wedge([], 5), 100.0, 98.0)
    run(tmp_path, job)
    older = table(tmp_path)
    job["continuation"] = {"start": "point:7", "start_file": "result.h5"}
    job["output"]["file"] = "again.h5"
    run(tmp_path, job)
    rows = table(tmp_path, result="again.h5")
    # Converged to 1e-10 of the response both times.
    for column in ("frequency_hz", "x_amplitude", "y_amplitude"):
        assert float(rows[0][column]) == pytest.approx(float(older[7][column]), rel=1e-8)
        assert float(rows[-1][column]) == pytest.approx(float(older[-1][column]), rel=1e-8)


def test_a_point_of_another_scene_is_a_fault_and_one_under_other_loads_is_not(tmp_path):
    job = swept(stiff_wedge([], 5), 100.0, 99.0)
    run(tmp_path, job)
    job["continuation"] = {"start": "point:1", "start_file": "result.h5"}
    job["output"]["file"] = "again.h5"
    job["contact"][0]["friction_coefficient"] *= 1.01
    run(tmp_path, job)
    # As many coordinates and contacts, which stand for something else.
    for change in ("heavier", "turned"):
        other = copy.deepcopy(job)
        if change == "heavier":
            other["model"]["mass"][0][0] *= 1.01
        else:
            other["contact"][0]["normal"][0][1] *= 0.5
        done = run(tmp_path, other, code=2)
        assert "[continuation] start = 'point:1': expected a result of this scene in result.h5" in done.stderr
        assert "another model, reduction or contacts" in done.stderr
    with edited(tmp_path / "result.h5") as file:
        file["contacts/slider"][1] = np.nan
    assert "expected a point that has converged" in run(tmp_path, job, code=2).stderr
    with edited(tmp_path / "result.h5") as file:
        del file["contacts/slider"]
    assert "expected a result of `attrito run` in result.h5" in run(tmp_path, job, code=2).stderr


def test_a_point_that_is_not_there_is_a_fault(tmp_path):
    job = swept(stiff_wedge([], 5), 100.0, 99.0, start="point:12")
    done = run(tmp_path, job, code=2)
    assert "[continuation] start" in done.stderr
    job["continuation"] = {"start": "static"}
    done = run(tmp_path, job, code=2)
    assert '"point:<number>"' in done.stderr
