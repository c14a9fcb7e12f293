"""Derivatives of modes by parameters: natural frequencies in closed form and against differences."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito_here, chain, write_job

from attrito.results.result import Result

SPRINGS = {"tangential_stiffness": 3.0e4, "normal_stiffness": 5.0e4, "friction_coefficient": 0.4}


def slopes(folder: Path, job: Job, capfd: pytest.CaptureFixture[str], state: str) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies `[modes]`, and their derivatives `[modes, parameters]`."""
    done = attrito_here(folder, capfd, "linear-modes", write_job(folder, job), "--state", state)
    assert done.returncode == 0, done.stderr
    with Result(folder / "result.modes.h5") as result:
        return result.array("/points/frequency_hz"), result.array("/sensitivity/frequency_hz")


@pytest.mark.parametrize("state", ["stuck", "frictionless", "tangent"])
def test_natural_frequencies_of_masses_on_springs_change_as_these_do(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], state: str
) -> None:
    """Two masses of 2 on springs k + k_c: d f/d k_c = f/(2 (k + k_c)), of one mass alone."""
    job: Job = {
        "model": {"mass": (2.0 * np.eye(4)).tolist(), "stiffness": (1.0e5 * np.eye(4)).tolist()},
        "contact": [
            {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]], **SPRINGS},
            {"normal": [[3, 1.0]], "tangents": [[[2, 1.0]]], "gap": 1.0e-3, **SPRINGS},
        ],
        "load": [{"name": "press", "kind": "static", "dofs": [[1, 50.0]]}],
        "balance": {"harmonics": 1},
        "output": {"file": "result.h5"},
        "sensitivity": {"to": ["contact[0].tangential_stiffness", "contact[*].normal_stiffness", "load.press"]},
    }
    frequency, found = slopes(tmp_path, job, capfd, state)
    along, normal = frequency / (2.0 * 1.3e5), frequency / (2.0 * 1.5e5)
    # Of two equal frequencies one stays, the other one rises with its spring.
    expected = {
        "stuck": ([0, along[1], 0, 0], [0, 0, normal[2], normal[3]]),
        "frictionless": ([0, 0, 0, 0], [0, 0, normal[2], normal[3]]),
        "tangent": ([0, 0, along[2], 0], [0, 0, 0, normal[3]]),
    }[state]
    assert found[:, 0] == pytest.approx(expected[0], rel=1e-10, abs=1e-16)
    assert found[:, 1] == pytest.approx(expected[1], rel=1e-10, abs=1e-16)
    assert not np.any(found[:, 2])


def test_natural_frequencies_change_as_differences_say(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = chain(3)
    del job["damping"]
    names = [f"contact[{i}].{key}" for i in range(3) for key in ("tangential_stiffness", "normal_stiffness")]
    job["sensitivity"] = {"to": names}
    _, found = slopes(tmp_path, job, capfd, "stuck")
    for place, name in enumerate(names):
        values = []
        # The parameter's relative step: central differences over h and 2 h, extrapolated, leave h^4.
        for step in (-2e-3, -1e-3, 1e-3, 2e-3):
            other = copy.deepcopy(job)
            other["contact"][int(name[8])][name[11:]] *= 1.0 + step
            values.append(slopes(tmp_path, other, capfd, "stuck")[0])
        far, near = (values[3] - values[0]) / 4e-3, (values[2] - values[1]) / 2e-3
        expected = (4.0 * near - far) / 3.0
        stiffness = job["contact"][int(name[8])][name[11:]]
        assert found[:, place] * stiffness == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


def test_a_free_body_has_no_derivative(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job: Job = {
        "model": {"mass": np.eye(2).tolist(), "stiffness": [[1.0e5, 0.0], [0.0, 0.0]]},
        "contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], "preload": 10.0, **SPRINGS}],
        "balance": {"harmonics": 1},
        "output": {"file": "result.h5"},
        "sensitivity": {"to": ["contact[0].normal_stiffness"]},
    }
    _, found = slopes(tmp_path, job, capfd, "frictionless")
    assert np.isnan(found[0, 0])
    assert found[1, 0] > 0.0
