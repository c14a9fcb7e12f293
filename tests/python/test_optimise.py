"""Least peaks: the optimum of the paper's wedge, several parameters and levels, and what is refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import attrito_here, table, write_job
from mpi4py import MPI
from wedge_optimum import PRELOAD, wedge_peak, write_optimum

from attrito.job.reading import read_job
from attrito.optima.design import read_optimum
from attrito.optima.run import _Peaks, run_optimum
from attrito.optima.search import least
from attrito.runs.progress import Progress
from attrito.support.errors import InputError


def test_the_optimum_of_the_paper_is_found_in_at_most_fifteen_samples(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_job(tmp_path, wedge_peak())
    write_optimum(tmp_path)
    done = attrito_here(tmp_path, capfd, "optimise", "optimum.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "optimum.h5") as file:
        # The value is flat about the optimum: 1e-3 of the range of ln, 3.0, in the parameter is far less in the value.
        assert file["value"][()] == pytest.approx(7.044e-6, abs=1e-9)
        assert file["parameters/preload"][()] * PRELOAD == pytest.approx(20.2, abs=0.1)
        assert len(file["tried/value"]) <= 15
        count, best = len(file["tried/value"]), file["parameters/preload"][()]
    rows = table(tmp_path, result="optimum.h5")
    assert list(rows[0]) == ["sample", "preload", "value", "least"] and len(rows) == count
    assert [float(row["preload"]) for row in rows if row["least"] == "true"] == pytest.approx([best], rel=1e-11)


def test_derivatives_of_peaks_are_those_by_differences(tmp_path: Path) -> None:
    write_job(tmp_path, wedge_peak())
    parameters = [
        {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.03, "high": 0.1},
        {"name": "stiffness", "keys": ["contact[0].tangential_stiffness"], "low": 2e5, "high": 6e5},
    ]
    asked = read_optimum(write_optimum(tmp_path, parameter=parameters))
    peaks = _Peaks(MPI.COMM_SELF, asked, read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_SELF))
    x = np.array([0.4, 0.6])
    value, gradient = peaks.at(x)
    for i in range(2):
        step = 1e-3 * np.eye(2)[i]
        slope = (peaks.at(x + step)[0] - peaks.at(x - step)[0]) / 2e-3
        # Central differences: an error near the square of the step, and peaks located to 1e-6 or so of their height.
        assert gradient[0, i] == pytest.approx(slope[0], abs=1e-3 * value[0])
    peaks.close()


def test_several_parameters_and_levels(tmp_path: Path) -> None:
    write_job(tmp_path, wedge_peak())
    parameters = [
        {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.02, "high": 0.12},
        {"name": "friction", "keys": ["contact[0].friction_coefficient"], "low": 0.2, "high": 0.8},
    ]
    path = write_optimum(tmp_path, parameter=parameters, levels=[0.8, 1.2], objective="amplitude_per_level")
    run_optimum(MPI.COMM_SELF, path)
    with h5py.File(tmp_path / "optimum.h5") as file:
        found = float(file["value"][()])
    asked = read_optimum(path)
    peaks = _Peaks(MPI.COMM_SELF, asked, read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_SELF))
    grid = [peaks.at(np.array([a, b]))[0].max() for a in np.linspace(0, 1, 6) for b in np.linspace(0, 1, 6)]
    peaks.close()
    assert found <= min(grid) * (1.0 + 1e-6)


def test_the_search_for_the_least_of_the_largest() -> None:
    def cones(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        places = np.array([[0.2, 0.3], [0.9, 0.3], [0.5, 0.9]])
        away = x - places
        return np.sum(away**2, axis=1), 2.0 * away

    found = least(cones, 2, 100, 1e-6, seed=1)
    assert found.converged
    # The centre of the circle through the three places.
    assert found.x == pytest.approx([0.55, 0.3 + (0.36 + 0.05**2 - 0.35**2) / 1.2], abs=1e-5)

    by_differences = least(lambda x: (cones(x)[0], np.full((3, 2), np.nan)), 2, 100, 1e-6, seed=1)
    assert by_differences.converged
    # Differences over 1e-4 turn the steps a little; where they lead three values are equal, whatever the gradients.
    assert by_differences.x == pytest.approx(found.x, abs=1e-4)
    short = least(cones, 2, 6, 1e-6, seed=1)
    assert not short.converged
    assert len(short.tried) == 6


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"levels": [0.0]}, "levels"),
        ({"objective": "mass"}, "amplitude_per_level"),
        ({"speed": 1}, "a known key"),
        ({"parameter": [{"name": "p", "keys": ["static.path"], "low": 0.1, "high": 1.0}]}, "a key of the job"),
        ({"file": "job.toml"}, "job.toml"),
    ],
)
def test_faults(tmp_path: Path, keys: dict, expected: str) -> None:
    write_job(tmp_path, wedge_peak())
    with pytest.raises(InputError, match=expected):
        run_optimum(MPI.COMM_SELF, write_optimum(tmp_path, **keys))
