"""Exact derivatives in `attrito fit`: of first harmonics and their phases, and of modes, against differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jobs import Job, wedge, write_job
from mpi4py import MPI
from rubbing_fit import FRICTION, KEYS, STIFFNESS, rubbing, write_fit

from attrito.fits.design import read_fit
from attrito.fits.solution import Solution
from attrito.job.reading import read_job
from attrito.library.reduced_scene import ReducedScene
from attrito.runs.progress import Progress
from attrito.runs.slider_rates import LoadPath, end_sliders
from attrito.studies import sloped_modes

PRELOAD = {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.5, "high": 2.0}
LAWS = [
    {"name": name, "keys": KEYS[name], "low": 0.1 * value, "high": 10.0 * value}
    for name, value in zip(KEYS, (STIFFNESS, FRICTION), strict=True)
]


def solution_of(folder: Path, job: Job, data: Job, parameters: list[Job]) -> Solution:
    """What is compared with a measurement."""
    write_job(folder, job)
    fit = read_fit(write_fit(folder, data=[data | {"file": "measured.csv"}], parameter=parameters))
    read = read_job(str(folder / "job.toml"), excited=fit.data[0].is_excited)
    return Solution(MPI.COMM_SELF, fit, fit.data[0], read, Progress(MPI.COMM_SELF))


def compare(solution: Solution, values: np.ndarray, part: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Derivatives against central differences, `part` of the largest of a column, by one solution."""
    solved, counted = [], solution._source.solve
    monkeypatch.setattr(solution._source, "solve", lambda *asked, **more: solved.append(1) or counted(*asked, **more))
    found, rates = solution.at(values)
    assert len(solved) == 1
    for name, columns in rates.items():
        assert np.all(np.isfinite(columns))
        slopes = np.empty_like(columns)
        for i, value in enumerate(values):
            sides = []
            for side in (-1.0, 1.0):
                beside = values.copy()
                beside[i] += side * 1e-4 * value
                sides.append(solution.found(beside)[name])
            slopes[:, i] = (sides[1] - sides[0]) / 2e-4
        scaled = columns * values
        # The test is void unless each parameter changes the column.
        assert np.all(np.abs(slopes).max(axis=0) > 100.0 * part * np.abs(slopes).max())
        assert scaled == pytest.approx(slopes, abs=part * np.abs(slopes).max()), name


@pytest.mark.parametrize("quantity", ["displacement", "accelerance"])
def test_derivatives_of_first_harmonics_and_phases_are_those_by_differences(
    tmp_path: Path, quantity: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    job = rubbing()
    job["balance"] |= {"residual_tolerance": 1e-12}
    lines = ["frequency_hz,amplitude,phase_deg", "112.0,1e-4,10.0", "118.0,1e-4,20.0", "125.0,1e-4,30.0"]
    (tmp_path / "measured.csv").write_text("\n".join(lines) + "\n")
    data = {"name": "response", "monitor": "x", "quantity": quantity, "phase": True}
    data |= {"force": 30.0} if quantity == "accelerance" else {}
    solution = solution_of(tmp_path, job, data, LAWS)
    # A central difference over 1e-4: some 1e-8 of the third derivative's size.
    compare(solution, np.array([0.8 * STIFFNESS, 1.1 * FRICTION]), 1e-5, monkeypatch)
    assert "differences" not in capsys.readouterr().out


@pytest.mark.parametrize("frequency", ["frequency_hz", "frequency_ratio"])
def test_derivatives_of_modes_are_those_by_differences(
    tmp_path: Path, frequency: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also by the preload, whose static path leaves other sliders."""
    job = wedge(STIFFNESS)
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-12}
    job["static"] = {"load_path": [0.0, 1.0]}
    job["mode"] = {"start": 1e-5, "stop": 5e-4, "points": 8}
    lines = [f"amplitude,{frequency},damping_ratio", "2e-4,120.0,0.05", "5e-4,110.0,0.1", "1e-3,105.0,0.1"]
    (tmp_path / "measured.csv").write_text("\n".join(lines) + "\n")
    solution = solution_of(tmp_path, job, {"name": "backbone", "of": "mode"}, [*LAWS, PRELOAD])
    compare(solution, np.array([0.8 * STIFFNESS, 1.1 * FRICTION, 1.0]), 1e-5, monkeypatch)
    assert "differences" not in capsys.readouterr().out


def test_the_static_path_is_followed_again_beside_the_value_alone_however_wide_the_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not at all by what moves no slider, as the structure's damping."""
    job = wedge(STIFFNESS)
    job["static"] = {"load_path": [0.0, 1.0]}
    job["contact"][0]["friction_coefficient"] = 0.1 * FRICTION
    job["mode"] = {"start": 1e-5, "stop": 5e-4, "points": 8}
    (tmp_path / "measured.csv").write_text("amplitude,frequency_hz\n2e-4,120.0\n")
    wide = [one | {"low": 1e-3 * one["low"], "high": 1e3 * one["high"]} for one in LAWS]
    damping = {"name": "damping", "keys": ["damping.loss_factor"], "low": 1e-4, "high": 1e-1}
    del job["model"]["damping"]
    job["damping"] = {"loss_factor": 0.01}
    followed = []

    def follow(comm: MPI.Comm, steps: int, scene: ReducedScene, path: LoadPath) -> np.ndarray:
        followed.append(scene.laws)
        return end_sliders(comm, steps, scene, path)

    monkeypatch.setattr(sloped_modes, "end_sliders", follow)
    values = np.array([STIFFNESS, 0.1 * FRICTION, 0.01])
    solution = solution_of(tmp_path, job, {"name": "backbone", "of": "mode"}, [*wide, damping])
    assert np.all(np.isfinite(solution.at(values)[1]["frequency_hz"]))
    assert len(followed) == 4
    for name, value in (("tangential_stiffness", STIFFNESS), ("friction_coefficient", 0.1 * FRICTION)):
        assert all(laws[name] == pytest.approx(value, rel=2e-3) for laws in followed)
