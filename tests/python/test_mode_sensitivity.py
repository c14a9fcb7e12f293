"""Derivatives of modes by parameters: natural frequencies in closed form and against differences."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito_here, chain, table, write_job
from mode_jobs import weakly_damped_wedge

from attrito.modes import tracker
from attrito.results.result import Result

SPRINGS = {"tangential_stiffness": 3.0e4, "normal_stiffness": 5.0e4, "friction_coefficient": 0.4}


def slopes(folder: Path, job: Job, capfd: pytest.CaptureFixture[str], state: str) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies `[modes]`, and their derivatives `[modes, parameters]`."""
    done = attrito_here(folder, capfd, "linear-modes", write_job(folder, job), "--state", state)
    assert done.returncode == 0, done.stderr
    with Result(folder / f"result.{state}.modes.h5".replace(".tangent", "")) as result:
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


def test_a_nonlinear_mode_changes_at_its_amplitude_as_differences_say(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Differences over 1e-3 show what is left of Q: as little as the balance's own residual.
    monkeypatch.setattr(tracker, "AMPLITUDE_TOLERANCE", 1e-13)
    job = weakly_damped_wedge()
    job["damping"] = {"rayleigh": [0.5, 2e-5]}
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    # It slips at every amplitude, so that its slider does not remember the load path.
    job["mode"] = {"start": 2.0e-3, "stop": 3.0e-3, "points": 2}
    keys = ("tangential_stiffness", "normal_stiffness", "friction_coefficient")
    names = [
        *(f"contact[0].{key}" for key in keys),
        "load.preload",
        "damping.rayleigh[0]",
        "damping.rayleigh[1]",
        "level",
    ]
    quantities = (
        "frequency_hz",
        "damping_ratio",
        "damping_ratio_structure",
        "x_amplitude",
        "x_mean",
        "dissipated_energy",
    )

    def found(changed: Job, *options: str) -> list[dict[str, str]]:
        done = attrito_here(tmp_path, capfd, "mode", write_job(tmp_path, changed))
        assert done.returncode == 0, done.stderr
        return table(tmp_path, *options, result="result.mode.h5")

    def moved(name: str, part: float) -> Job:
        other = copy.deepcopy(job)
        if name.startswith("contact"):
            other["contact"][0][name[11:]] *= 1.0 + part
        elif name == "load.preload":
            other["load"][0]["dofs"] = [[dof, force * (1.0 + part)] for dof, force in other["load"][0]["dofs"]]
        else:
            other["damping"]["rayleigh"][int(name[-2])] *= 1.0 + part
        return other

    rows = found(job | {"sensitivity": {"to": names, "of": ["dissipated_energy"]}}, "--sensitivities")
    exact = {(row["point"], row["quantity"], row["parameter"]): float(row["derivative"]) for row in rows}
    for point in ("0", "1"):
        assert all(exact[point, quantity, "level"] == 0.0 for quantity in quantities)
    scales = [job["contact"][0][key] for key in keys] + [1.0, *job["damping"]["rayleigh"]]
    expected = np.zeros((2, len(quantities), len(scales)))
    for number, name in enumerate(names[:-1]):
        slopes = []
        for step in (1e-3, 2e-3):
            sides = [
                np.array([[float(row[quantity]) for quantity in quantities] for row in found(moved(name, side * step))])
                for side in (-1.0, 1.0)
            ]
            slopes.append((sides[1] - sides[0]) / (2.0 * step))
        expected[:, :, number] = (4.0 * slopes[0] - slopes[1]) / 3.0
    for point in range(2):
        for place, quantity in enumerate(quantities):
            ours = [exact[str(point), quantity, name] * scale for name, scale in zip(names, scales, strict=False)]
            largest = np.abs(expected[point, place]).max()
            assert largest > 0.0
            # Two differences extrapolated leave the fourth power of the step.
            assert ours == pytest.approx(expected[point, place], abs=1e-6 * largest), quantity


def test_a_mode_by_quasi_static_loading_has_no_derivatives(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = weakly_damped_wedge() | {"sensitivity": {"to": ["level"]}}
    job["mode"]["method"] = "quasi_static"
    done = attrito_here(tmp_path, capfd, "mode", write_job(tmp_path, job))
    assert done.returncode == 2
    assert '"epmc" with [sensitivity]' in done.stderr
