"""Studies: what is varied, batches, groups of ranks, and one that was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import jobs
import mode_jobs
import numpy as np
import patient
import pytest
from figures import marks
from mpi4py import MPI

from attrito.job.reading import read_job
from attrito.job.varied import is_of_model, places, set_value
from attrito.library.session import Solver
from attrito.modes.mode_point import ModePoint
from attrito.modes.tracker import ModeTracker
from attrito.results.journal import kept_record
from attrito.runs.stability import ENGINES, ORBITS, examine_point, fetch_multipliers
from attrito.studies.design import batches, read_study
from attrito_verification.paper.wedge import PARAMETER_SETS, Wedge

STUDY = {
    "job": "job.toml",
    "file": "study.h5",
    "samples": 24,
    "batch": 2,
    "vary": [
        {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.3, "high": 0.6},
        {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.8, "high": 1.2},
    ],
}


def write(folder: Path, **changes) -> str:
    """The wedge and a study of it; returns the study's name."""
    made = jobs.wedge(force=1.0)
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["static"] = {"load_path": [0.0, 1.0]}
    made["peak"] = {"start": 10.0}
    jobs.write_job(folder, made)
    study = {key: value for key, value in (STUDY | changes).items() if value is not None}
    study["vary"] = [{key: value for key, value in row.items() if value is not None} for row in study["vary"]]
    return jobs.write_job(folder, study, "study.toml")


def results(folder: Path) -> dict[str, np.ndarray]:
    """Every dataset of the study."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(folder / "study.h5") as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
        assert all(file[name].attrs["description"] and file[name].attrs["unit"] for name in found)
    return found


def test_a_study_that_was_killed_goes_on_and_ends_like_one_that_was_not(tmp_path, capfd, written):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    for folder in (whole, broken):
        folder.mkdir()
        write(folder)
    done = jobs.attrito(whole, "study", "study.toml")
    assert done.returncode == 0, done.stderr
    command = [sys.executable, patient.PROGRAM, "study", "study.toml"]
    running = subprocess.Popen(command, cwd=broken, env=os.environ | jobs.ENVIRONMENT, stdout=subprocess.DEVNULL)

    def whole_batches() -> int:
        return sum(kept_record(str(path)) is not None for path in broken.glob("study.h5.parts/*/batch_*"))

    jobs.wait_for(lambda: whole_batches() >= 3, running)
    running.send_signal(signal.SIGKILL)
    running.wait()
    kept = whole_batches()
    assert 3 <= kept < 12 and not (broken / "study.h5").exists()
    done = jobs.attrito_here(broken, capfd, "study", "study.toml")
    assert done.returncode == 0 and f"{kept} of them there already" in done.stdout
    first, second = results(whole), results(broken)
    assert first.keys() == second.keys()
    assert all(np.array_equal(first[name], second[name], equal_nan=True) for name in first)
    assert not (broken / "study.h5.parts").exists()
    # A panel a quantity, a dot a sample.
    (figure,) = written
    assert [axes.get_xlabel() for axes in figure.axes] == ["mu", "preload"]
    for axes in figure.axes:
        places = np.column_stack([first[f"values/{axes.get_xlabel()}"], first["peaks/amplitude"][:, 0]])
        assert np.array_equal(marks(axes, "."), places)


def test_groups_of_ranks_find_what_one_process_finds(tmp_path):
    found = []
    for ranks in (None, 2):
        write(tmp_path, samples=8)
        done = jobs.attrito(tmp_path, "study", "study.toml", ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        found.append(results(tmp_path))
    assert np.array_equal(found[0]["peaks/amplitude"], found[1]["peaks/amplitude"])


def test_a_sample_is_the_job_with_its_values(tmp_path):
    write(tmp_path, design="grid", samples=None, vary=[STUDY["vary"][0] | {"low": None, "high": None, "values": [0.4]}])
    done = jobs.attrito(tmp_path, "study", "study.toml")
    assert done.returncode == 0, done.stdout + done.stderr
    made = jobs.wedge(force=1.0)
    made["contact"][0]["friction_coefficient"] = 0.4
    made["sweep"] = {"frequencies_hz": np.linspace(128.0, 120.0, 161).tolist(), "levels": [10.0]}
    jobs.run(tmp_path, made)
    highest = max(float(row["x_amplitude"]) for row in jobs.table(tmp_path))
    peak = results(tmp_path)["peaks/amplitude"][0, 0]
    # Listed frequencies miss the peak by a fortieth of a hertz at most.
    assert highest <= peak <= highest * (1.0 + 1e-4)


def test_a_sample_does_not_depend_on_the_one_before(tmp_path):
    """Alone, each is followed from its linear peak; in one batch, looked for near the other's."""
    found = []
    for batch in (1, 24):
        write(tmp_path, batch=batch, samples=6)
        done = jobs.attrito(tmp_path, "study", "study.toml")
        assert done.returncode == 0, done.stdout + done.stderr
        found.append(results(tmp_path))
    assert found[0]["peaks/method"].tolist() == [[1]] * 6 and sorted(found[1]["peaks/method"].ravel()) == [0] * 5 + [1]
    # Newton's method ends at 1e-10 of the response, the peak at 1e-7 of the band: of second order in the amplitude.
    assert np.allclose(found[0]["peaks/amplitude"], found[1]["peaks/amplitude"], rtol=1e-9, atol=0.0)


def test_a_session_takes_other_friction_as_a_new_one_would_and_refuses_other_stiffness():
    wedge = Wedge(PARAMETER_SETS["unrounded"], 45.0, "C", 5)
    changed = replace(wedge.scene, laws=wedge.scene.laws | {"friction_coefficient": np.full(1, 0.4)})
    stiffer = replace(wedge.scene, laws=wedge.scene.laws | {"normal_stiffness": np.full(1, 1e6)})

    def solve(solver: Solver) -> list[float]:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, 100.0)
        return [point.amplitude[0] for point in solver.solve_at([130.0, 125.0, 120.0], 10.0, 0)]

    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        solve(solver)
        assert not solver.take(stiffer) and solver.take(changed)
        again = solve(solver)
    with Solver(MPI.COMM_SELF, changed, wedge._options) as solver:
        assert solve(solver) == again


def test_stability_is_that_of_the_friction_a_session_has_taken():
    """Orbits integrated in time have the laws of the scene, not those of the one before."""
    wedge = Wedge(PARAMETER_SETS["unrounded"], 45.0, "C", 5)
    changed = replace(wedge.scene, laws=wedge.scene.laws | {"friction_coefficient": np.full(1, 0.4)})

    def examine(solver: Solver) -> tuple[float, ...]:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, 100.0)
        (point,) = solver.solve_at([125.0], 10.0, 0)
        report, reason = examine_point(solver, ENGINES["monodromy"], ORBITS["exact"])
        assert point.outcome == "converged" and point.states[2] == 1 and not reason
        return report.distance, *fetch_multipliers(solver, ENGINES["monodromy"], report.monodromy)[0]

    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        before = examine(solver)
        assert solver.take(changed)
        again = examine(solver)
    with Solver(MPI.COMM_SELF, changed, wedge._options) as solver:
        assert examine(solver) == again != before


def write_modes(folder: Path, **changes) -> None:
    """A study of the modes of a mass on a Coulomb element."""
    jobs.write_job(folder, mode_jobs.rubbing(stop=5.0e-3))
    mu = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.3, "high": 0.6}
    study = {"job": "job.toml", "of": "modes", "file": "study.h5", "samples": 5, "batch": 2, "vary": [mu]}
    jobs.write_job(folder, study | changes, "study.toml")


@pytest.mark.parametrize("method", ["epmc", "quasi_static"])
def test_a_sample_s_mode_is_that_of_the_job_with_its_values(tmp_path, capfd, written, method):
    write_modes(tmp_path)
    job = mode_jobs.rubbing(stop=5.0e-3)
    job["mode"]["method"] = method
    jobs.write_job(tmp_path, job)
    done = jobs.attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 0, done.stderr
    found = results(tmp_path)
    job["contact"][0]["friction_coefficient"] = float(found["values/mu"][3])
    jobs.write_job(tmp_path, job)
    assert jobs.attrito_here(tmp_path, capfd, "mode", "job.toml").returncode == 0
    with h5py.File(tmp_path / "result.mode.h5") as file:
        assert np.allclose(found["parameter"], file["points/amplitude"], rtol=1e-9)
        for name in ("frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy"):
            assert np.array_equal(found[f"modes/{name}"][3], file[f"points/{name}"][:]), name
        assert found["modes/tangent_hz"][3] == file.attrs["tangent_hz"]
    median = found["quantiles/probability"].tolist().index(0.5)
    assert np.allclose(
        found["quantiles/frequency_hz"][median], np.median(found["modes/frequency_hz"], axis=0), rtol=1e-15
    )
    assert [axes.get_ylabel() for axes in written[0].axes] == ["Frequency (Hz)", "Damping ratio of the contacts"]


NAMES = ("frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy")
STIFFNESS = {"name": "stiffness", "keys": ["contact[*].tangential_stiffness"], "factor": True}


def of_modes(folder: Path, capfd, start: float, **changes) -> tuple[dict[str, np.ndarray], str]:
    """A study of the mode at amplitudes from `start` on, by friction and stiffness, and what it said."""
    mu = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.45, "high": 0.5}
    keys = {"samples": 40, "vary": [mu, STIFFNESS | {"low": 0.9, "high": 1.1}]} | changes
    jobs.write_job(folder, {"job": "job.toml", "of": "modes", "file": "study.h5"} | keys, "study.toml")
    job = mode_jobs.rubbing(stop=5.0e-3)
    job["mode"] |= {"start": start, "points": 3}
    jobs.write_job(folder, job)
    done = jobs.attrito_here(folder, capfd, "study", "study.toml")
    assert done.returncode == 0, done.stderr
    return results(folder), done.stdout + done.stderr


def test_a_study_of_modes_of_first_order_has_the_slopes_of_solved_ones(tmp_path, capfd):
    """At Q = 1e-3, 0.7 mm, it slips in every sample: from mu N / kt, 0.4 mm, on."""
    planes, words = of_modes(tmp_path, capfd, 1.0e-3, design="first_order")
    assert "5 of 40 samples" in words
    middle, step = np.array([0.475, 1.0]), 1e-3
    terms = np.column_stack([np.ones(40), planes["values/mu"] - middle[0], planes["values/stiffness"] - middle[1]])
    slopes = {name: np.linalg.lstsq(terms, planes[f"modes/{name}"], rcond=None)[0][1:] for name in NAMES}
    for i in range(2):
        solved = []
        for side in (-step, step):
            mu, factor = middle + side * (np.arange(2) == i)
            job = mode_jobs.rubbing(stop=5.0e-3)
            job["mode"] |= {"start": 1.0e-3, "points": 3}
            job["contact"][0] |= {"friction_coefficient": mu, "tangential_stiffness": factor * mode_jobs.KT}
            jobs.write_job(tmp_path, job)
            assert jobs.attrito_here(tmp_path, capfd, "mode", "job.toml").returncode == 0
            with h5py.File(tmp_path / "result.mode.h5") as file:
                solved.append({name: file[f"points/{name}"][:] for name in NAMES})
        for name in NAMES:
            differences = (solved[1][name] - solved[0][name]) / (2.0 * step)
            scale = np.abs(slopes[name] * middle[:, np.newaxis]).max()
            # Third derivatives over a step of 2e-3 of the values at most leave 1e-6; modes are found to 1e-9 of them.
            assert np.abs(slopes[name][i] - differences).max() * middle[i] <= 1e-4 * scale, name


def test_bands_of_modes_by_gradients_are_near_sampled_ones_where_all_slip(tmp_path, capfd):
    modelled, words = of_modes(tmp_path, capfd, 1.0e-3, design="second_order")
    assert "7 of 40 samples" in words and "does not hold" not in words
    sampled, _ = of_modes(tmp_path, capfd, 1.0e-3, design="latin_hypercube")
    for name in NAMES:
        exact = sampled[f"modes/{name}"]
        # Third derivatives over a tenth of the values
        assert np.abs(modelled[f"modes/{name}"] - exact).max() <= 1e-2 * np.abs(exact).max(), name


def test_a_study_of_modes_says_where_the_model_of_damping_does_not_hold(tmp_path, capfd):
    """At Q = 5e-4 samples slip whose friction is below 0.42, and others do not: a kink."""
    mu = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.2, "high": 0.8}
    _, words = of_modes(tmp_path, capfd, 5.0e-4, design="second_order", vary=[mu])
    assert "it does not hold" in words and "beyond 5 % at amplitudes" in words


def test_a_mode_that_is_lost_leaves_the_rest_of_its_sample_open_and_the_others_whole(tmp_path, capfd, monkeypatch):
    write_modes(tmp_path, samples=3)
    find, calls = ModeTracker.at, []

    def lose(tracker: ModeTracker, amplitude: float) -> ModePoint:
        one = find(tracker, amplitude)
        calls.append(amplitude)
        return replace(one, point=one.point._replace(outcome="not_converged")) if len(calls) == 5 else one

    monkeypatch.setattr(ModeTracker, "at", lose)
    done = jobs.attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 1 and "1 of 3 samples have no mode at some amplitude" in done.stderr
    frequency = results(tmp_path)["modes/frequency_hz"]
    lost = np.isnan(frequency).any(axis=1)
    assert lost.sum() == 1 and np.isfinite(frequency[lost][0, :4]).all() and np.isnan(frequency[lost][0, 4:]).all()


def test_a_study_of_modes_names_what_the_job_lacks(tmp_path, capfd):
    write_modes(tmp_path)
    job = mode_jobs.rubbing()
    del job["mode"]
    jobs.write_job(tmp_path, job)
    done = jobs.attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 2 and "[mode]" in done.stderr


def test_keys_are_found_and_changed_by_their_paths(tmp_path):
    write(tmp_path)
    tables = read_job(tmp_path / "job.toml").tables
    assert [index for _, index in places(tables, "contact[*].friction_coefficient")] == ["friction_coefficient"]
    set_value(tables, "static.load_path[1]", 0.5, factor=True)
    assert tables["static"]["load_path"] == [0.0, 0.5]
    for key in ("contact[3].gap", "static.slider", "static", "no such"):
        with pytest.raises(ValueError):
            places(tables, key)


def test_batches_hold_every_sample_once_and_are_short(tmp_path):
    study = read_study(str(tmp_path / write(tmp_path)))
    values = study.sample()
    order = batches(study, values)
    assert sorted(np.concatenate(order).tolist()) == list(range(24)) and max(map(len, order)) <= 2
    assert np.array_equal(values, study.sample())
    assert values[:, 0].min() >= 0.3 and values[:, 1].max() <= 1.2


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"desing": "grid"}, "desing"),
        ({"samples": None}, "samples"),
        ({"vary": [{"name": "a", "keys": ["contact[7].gap"], "low": 0.0, "high": 1.0}]}, "vary[0] keys"),
        ({"vary": [{"name": "a", "keys": ["static.slider"], "low": 0.0, "high": 1.0}]}, "vary[0] keys"),
        ({"vary": [{"name": "a", "keys": ["contact[0].gap"]}]}, "vary[0] values"),
        (
            {"vary": [STUDY["vary"][0] | {"low": -0.1}]},
            "study.toml: vary (mu = -0.1): contact[0] friction_coefficient = -0.1",
        ),
        ({"vary": [{"name": "f", "keys": ["sweep.stop_hz"], "values": [85, 150]}]}, "vary (f = 150): [sweep] stop_hz"),
    ],
)
def test_a_fault_of_a_study_is_told(tmp_path, capfd, changes, key):
    done = jobs.attrito_here(tmp_path, capfd, "study", write(tmp_path, **changes))
    assert done.returncode == 2 and key in done.stderr


@pytest.mark.parametrize(
    "key",
    [
        "contact_set[0].friction_coefficient",
        "contact[*].chi",
        "contact_set[*].beta",
        "contact[0].friction_coefficient[1][1]",
        "static.load_path[1]",
        "cyclic.engine_order",
    ],
)
def test_no_number_of_a_contacts_law_is_of_the_model(key: str) -> None:
    """A reduced model holds none of them, so studies and fits may vary them."""
    assert not is_of_model(key)


@pytest.mark.parametrize("key", ["contact[0].normal[0][1]", "contact_set[0].tolerance", "reduction.modes"])
def test_places_and_modes_are_of_the_model(key: str) -> None:
    assert is_of_model(key)
