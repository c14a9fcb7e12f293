"""Fits: intervals of a linear model, parameters from solutions of attrito's own, restart, and what is refused."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, attrito_here, table, write_job
from mpi4py import MPI
from rubbing_fit import FRICTION, KEYS, STIFFNESS, measured, rubbing, write_fit
from scipy.stats import t
from wheels import lumped_sector

import attrito.fits.run as fits_run
from attrito.fits.design import read_fit
from attrito.fits.estimate import estimate, profile
from attrito.fits.solution import Solution
from attrito.job.reading import read_job
from attrito.runs.progress import Progress
from attrito.support.errors import InputError


def test_intervals_of_a_linear_model_are_those_of_the_book() -> None:
    random = np.random.default_rng(2)
    matrix, truth = random.standard_normal((12, 3)), np.array([1.0, -2.0, 0.5])
    data = matrix @ truth + 0.1 * random.standard_normal(12)
    bounds = np.array([[-10.0, 10.0]] * 3)

    def residuals(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return matrix @ x - data, matrix

    best = estimate(residuals, np.zeros(3), bounds, known_deviations=False)
    exact, (least,), *_ = np.linalg.lstsq(matrix, data, rcond=None)
    assert best.converged
    assert best.x == pytest.approx(exact, rel=1e-7)
    deviations = np.sqrt(least / 9.0 * np.diag(np.linalg.inv(matrix.T @ matrix)))
    reach = t.ppf(0.975, 9) * deviations
    assert best.intervals[:, 1] - best.x == pytest.approx(reach, rel=1e-6)
    # Of a linear model the profile is a parabola.
    for i in range(3):
        found = profile(residuals, best, bounds, i)
        assert found.interval == pytest.approx((best.x[i] - reach[i], best.x[i] + reach[i]), rel=1e-4)
        assert found.cost - least == pytest.approx(((found.x - best.x[i]) / deviations[i]) ** 2 * least / 9.0, abs=1e-8)


def test_a_search_that_creeps_ends_where_the_rest_is_nothing_beside_the_noise() -> None:
    """With a Jacobian that is off by a half each step leaves a third of the way."""
    random = np.random.default_rng(2)
    matrix = random.standard_normal((12, 3))
    data = matrix @ [1.0, -2.0, 0.5] + 0.1 * random.standard_normal(12)
    bounds = np.array([[-10.0, 10.0]] * 3)
    best = estimate(lambda x: (matrix @ x - data, 1.5 * matrix), np.zeros(3), bounds, known_deviations=False)
    assert best.converged
    assert best.evaluations < 16
    exact, (least,), *_ = np.linalg.lstsq(matrix, data, rcond=None)
    deviations = np.sqrt(least / 9.0 * np.diag(np.linalg.inv(matrix.T @ matrix)))
    assert np.all(np.abs(best.x - exact) < 2e-3 * deviations)


def test_parameters_of_a_response_are_found(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    measured(tmp_path, rubbing())
    write_fit(tmp_path)
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "fit.h5") as file:
        # The search ends when steps are below 1e-8 of the scaled parameters.
        assert file["parameters/value"][:] == pytest.approx([STIFFNESS, FRICTION], rel=1e-5)
        assert list(file["parameters/identified"][:]) == [1, 1]
        assert file["data/response/solved/amplitude"][:] == pytest.approx(
            file["data/response/measured/amplitude"][:], rel=1e-6
        )
    assert (tmp_path / "fit.png").exists()
    friction = table(tmp_path, result="fit.h5")[1]
    assert friction["parameter"] == "friction coefficient"
    assert float(friction["low"]) <= FRICTION <= float(friction["high"])
    assert not (tmp_path / "fit.h5.partial").exists()


def test_ranks_take_the_same_steps(tmp_path: Path) -> None:
    measured(tmp_path, rubbing(), noise=0.02)
    write_fit(tmp_path, profile=False)
    found = []
    for ranks in (1, 2):
        done = attrito(tmp_path, "fit", "fit.toml", ranks=ranks)
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / "fit.h5") as file:
            found.append(file["parameters/value"][:])
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def waves(_: Job) -> Job:
    """A sector of a wheel whose contacts slip."""
    job = lumped_sector()
    job["contact"] = [contact | {"preload": 1.0} for contact in job["contact"]]
    return job | {"balance": {"harmonics": 3}, "sweep": {"frequencies_hz": [28.0, 29.0, 31.0]}}


def turning(job: Job) -> Job:
    """With Coriolis forces, at 120 Hz as large as half the stiffness along x."""
    return job | {"model": job["model"] | {"gyroscopic": [[0.0, 300.0], [-300.0, 0.0]]}}


@pytest.mark.parametrize(("changed", "exact"), [(Job, True), (waves, True), (turning, False)])
def test_derivatives_are_those_by_differences(
    tmp_path: Path, changed: Callable[[Job], Job], exact: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exact ones, also of sectors; those by differences in their place with Coriolis forces, which says so."""
    job = changed(rubbing())
    monitor = job["output"]["monitors"][0]["name"]
    measured(tmp_path, job | {"balance": job["balance"] | {"residual_tolerance": 1e-12}}, monitor=monitor)
    data = {"name": "response", "file": "measured.csv", "monitor": monitor}
    fit = read_fit(write_fit(tmp_path, data=[data]))
    solution = Solution(
        MPI.COMM_WORLD, fit, fit.data[0], read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_WORLD)
    )
    values = np.array([0.8 * STIFFNESS, 1.1 * FRICTION])
    found, rates = solution.at(values)
    assert np.all(np.isfinite(rates["amplitude"]))
    assert ("are differences, a further solution each" in capsys.readouterr().out) is not exact
    for i, value in enumerate(values):
        sides = []
        for side in (-1.0, 1.0):
            beside = values.copy()
            beside[i] += side * 1e-4 * value
            sides.append(solution.at(beside)[0]["amplitude"])
        slope = (sides[1] - sides[0]) / (2e-4 * value)
        # A central difference over 1e-4 has an error near 1e-8 of the third derivative's size; a difference to one side
        # near 1e-4 of the second's.
        part = 1e-5 if exact else 1e-3
        assert rates["amplitude"][:, i] * value == pytest.approx(slope * value, abs=part * found["amplitude"].max())


def test_derivatives_by_a_law_of_its_own_and_by_damping(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of Iwan's model, with a damping ratio of the stuck modes; by that and stiffness together they are differences."""
    job = rubbing()
    del job["model"]["damping"]
    job["contact"] = [contact | {"law": "iwan", "chi": -0.5, "beta": 0.8} for contact in job["contact"]]
    job |= {"damping": {"ratio": 0.05}, "balance": {"harmonics": 3, "residual_tolerance": 1e-12}}
    write_job(tmp_path, job)
    (tmp_path / "measured.csv").write_text("frequency_hz,x_amplitude\n115.0,1e-4\n125.0,1e-4\n")
    ranges = {"contact[0].chi": (-0.9, -0.1), "contact[0].beta": (0.1, 2.0), "damping.ratio": (0.01, 0.1)}
    values = np.array([-0.5, 0.8, 0.05])
    parameters = [{"name": key, "keys": [key], "low": low, "high": high} for key, (low, high) in ranges.items()]
    fit = read_fit(write_fit(tmp_path, parameter=parameters))
    solution = Solution(MPI.COMM_SELF, fit, fit.data[0], read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_SELF))
    found, rates = solution.at(values)
    assert "differences" not in capsys.readouterr().out
    for i, value in enumerate(values):
        sides = []
        for side in (-1.0, 1.0):
            beside = values.copy()
            beside[i] += side * 1e-4 * value
            sides.append(solution.at(beside)[0]["amplitude"])
        slope = (sides[1] - sides[0]) / 2e-4
        # By samples differences jump where one changes its regime: each in 256 of 20 sliders by its part of the force.
        assert rates["amplitude"][:, i] * value == pytest.approx(slope, abs=1e-4 * found["amplitude"].max())


@pytest.mark.parametrize("rule", ["cycle", "masing"])
def test_a_backbone_gives_stiffness_and_friction(tmp_path: Path, capfd: pytest.CaptureFixture[str], rule: str) -> None:
    """That of the periodic motion, and that of Masing's rule on the first loading, which differ where forces vary."""
    job = rubbing()
    job["static"] = {"load_path": [0.0, 1.0]}
    job["mode"] = {"start": 1e-5, "stop": 5e-4, "points": 8}
    if rule == "masing":
        job["mode"] |= {"method": "quasi_static", "steps": 16}
    write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "mode", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.mode.h5") as file:
        points = file["points"]
        names = ("masing_hz", "masing_damping_ratio") if rule == "masing" else ("frequency_hz", "damping_ratio")
        frequency, damping = (points[name][:] for name in names)
        rows = zip(points["amplitude"][:], frequency, damping + points["damping_ratio_structure"][:], strict=True)
        with open(tmp_path / "measured.csv", "w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(["amplitude", "frequency_hz", "damping_ratio"])
            writer.writerows([f"{value:.15g}" for value in row] for row in rows)
    data = {"name": "backbone", "of": "mode", "file": "measured.csv", "rule": rule}
    write_fit(tmp_path, data=[data], profile=False)
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "fit.h5") as file:
        assert file["parameters/value"][:] == pytest.approx([STIFFNESS, FRICTION], rel=1e-4)


def test_a_fit_goes_on_from_what_it_has_solved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measured(tmp_path, rubbing(), noise=0.02)
    path = write_fit(tmp_path, profile=False)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(fits_run, "write_fit", killed)
        fits_run.run_fit(MPI.COMM_SELF, path)
    assert (tmp_path / "fit.h5.partial").exists()
    with monkeypatch.context() as patch:
        patch.setattr(Solution, "at", killed)
        fits_run.run_fit(MPI.COMM_SELF, path)
    with h5py.File(tmp_path / "fit.h5") as file:
        assert file["parameters/value"][0] == pytest.approx(STIFFNESS, rel=0.1)


def test_what_data_do_not_identify_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    measured(tmp_path, rubbing(force=0.1))
    write_fit(tmp_path)
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml")
    assert done.returncode == 0, done.stderr
    assert "the data do not identify friction coefficient" in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"data": [{"name": "a", "file": "absent.csv"}]}, "a CSV file of measurements that can be read"),
        ({"data": [{"name": "a", "file": "job.toml"}]}, "a column frequency_hz, and of amplitude at least one"),
        ({"data": [{"name": "a", "file": "measured.csv", "monitor": "x", "speed": 1}]}, "a known key: name, of, file"),
        ({"data": [{"name": "a", "file": "measured.csv", "monitor": "z"}]}, "a column frequency_hz, and of amplitude"),
        ({"parameter": [{"name": "mu", "keys": ["contact[*].mu"], "low": 0.1, "high": 1.0}]}, "a key of the job"),
        (
            {"parameter": [{"name": "mu", "keys": ["contact[*].gap"], "low": 1.0, "high": 0.1}]},
            "a number above low = 1",
        ),
        ({"parameter": [{"name": "mu", "keys": KEYS["friction coefficient"], "low": -1, "high": 1}]}, "of at least 0"),
        ({"file": "measured.csv"}, "measured.csv"),
        (
            {"data": [{"name": "a", "of": "mode", "file": "backbone.csv", "rule": "masing"}]},
            '"quasi_static" with rule = "masing"',
        ),
    ],
)
def test_faults(tmp_path: Path, keys: dict, expected: str) -> None:
    write_job(tmp_path, rubbing() | {"mode": {"start": 1e-5, "stop": 1e-4}})
    (tmp_path / "backbone.csv").write_text("amplitude,frequency_hz\n1e-5,110.0\n")
    (tmp_path / "measured.csv").write_text("frequency_hz,x_amplitude\n110.0,1e-4\n120.0,2e-4\n130.0,1e-4\n")
    path = write_fit(tmp_path, **keys)
    with pytest.raises(InputError, match=expected.replace("[", r"\[")):
        fits_run.run_fit(MPI.COMM_SELF, path)
