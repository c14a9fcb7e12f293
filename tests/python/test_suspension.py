"""A structure that floats, hung in soft springs by `[model] suspension_hz`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito, run, table, write_job
from scipy.linalg import eigh

MASS = np.diag([1.0, 0.7, 1.2])
SPRING, KT, ALPHA, BETA = 4.0e5, 2.0e5, 3.0, 1.0e-5
STIFFNESS = SPRING * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
ACROSS = np.array([0.0, 1.0, -1.0])
STUCK = STIFFNESS + KT * np.outer(ACROSS, ACROSS)


def joint(suspension_hz: float | None = 0.5, preload: float = 100.0) -> Job:
    """Two bodies that float, one of them elastic, held together by a Jenkins element and by nothing else."""
    model: dict = {"mass": MASS.tolist(), "stiffness": STIFFNESS.tolist()}
    if suspension_hz is not None:
        model["suspension_hz"] = suspension_hz
    law = {"tangential_stiffness": KT, "friction_coefficient": 0.5, "preload": preload}
    return {
        "model": model,
        "damping": {"rayleigh": [ALPHA, BETA]},
        "contact": [{"tangents": [[[1, 1.0], [2, -1.0]]], **law}],
        "load": [{"name": "shake", "kind": "harmonic", "cosine": [[0, 1.0]]}],
        "balance": {"harmonics": 5},
        "sweep": {"frequencies_hz": [70.0, 85.0, 140.0], "levels": [1.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "end", "dofs": [[0, 1.0]]}]},
    }


def amplitudes(folder: Path, suspension_hz: float, preload: float) -> np.ndarray:
    """Of the monitor at the job's frequencies, all of them solved."""
    run(folder, joint(suspension_hz, preload))
    rows = table(folder)
    assert all(row["outcome"] == "converged" for row in rows)
    return np.array([float(row["end_amplitude"]) for row in rows])


def test_without_a_suspension_the_message_says_what_holds_it(tmp_path):
    done = attrito(tmp_path, "run", write_job(tmp_path, joint(None)))
    assert done.returncode == 2
    assert "leaves 1 motion(s) free" in done.stderr and "[model] suspension_hz" in done.stderr


def test_the_squares_of_all_natural_frequencies_are_raised_alike_and_rigid_body_modes_are_named(tmp_path):
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, joint()), "--state", "stuck")
    assert done.returncode == 0, done.stderr
    assert "(and 1 rigid-body mode)" in done.stdout
    found = [float(row["frequency_hz"]) for row in table(tmp_path, result="result.stuck.modes.h5")]
    free = np.maximum(eigh(STUCK, MASS, eigvals_only=True), 0.0)
    assert found == pytest.approx(np.sqrt(free / (2.0 * np.pi) ** 2 + 0.5**2), rel=1e-9)


def test_a_linear_response_is_that_of_the_hung_structure_whose_suspension_does_not_damp(tmp_path):
    # 1 N moves the joint by far less than its limit of 50 N.
    run(tmp_path, joint())
    for row in table(tmp_path):
        omega = 2.0 * np.pi * float(row["frequency_hz"])
        hung = STUCK + (2.0 * np.pi * 0.5) ** 2 * MASS
        dynamic = hung - omega**2 * MASS + 1j * omega * (ALPHA * MASS + BETA * STIFFNESS)
        expected = abs(np.linalg.solve(dynamic, [1.0, 0.0, 0.0])[0])
        assert float(row["end_amplitude"]) == pytest.approx(expected, rel=1e-9)


def test_a_sliding_joint_does_not_feel_how_softly_it_hangs(tmp_path):
    stuck, soft, softer = (amplitudes(tmp_path, *how) for how in ((0.5, 100.0), (0.5, 0.5), (0.05, 0.5)))
    assert np.all(abs(soft / stuck - 1.0) > 0.1), "the test is void unless the joint slips"
    # 1 - (0.5/70)^2, times what a resonance makes of a change of frequency: at most a hundred.
    assert soft == pytest.approx(softer, rel=100 * (0.5 / 70.0) ** 2)


def test_the_mode_followed_is_the_first_elastic_one(tmp_path):
    job = joint()
    del job["sweep"], job["load"]
    job["mode"] = {"start": 1.0e-6, "stop": 1.0e-4, "points": 3}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    first = float(table(tmp_path, result="result.mode.h5")[0]["frequency_hz"])
    assert first == pytest.approx(np.sqrt(eigh(STUCK, MASS, eigvals_only=True)[1]) / (2.0 * np.pi), rel=1e-4)


@pytest.mark.parametrize("state", ["stuck", "frictionless"])
def test_rigid_body_modes_have_no_damping_ratio(tmp_path, state):
    """What floats without friction is damped as in the stuck joint, far more than a hundredth at 0.5 Hz."""
    damping = {"ratio": 0.01}
    done = attrito(tmp_path, "linear-modes", write_job(tmp_path, joint() | {"damping": damping}), "--state", state)
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result=f"result.{state}.modes.h5")
    kinds = ["rigid"] * (1 if state == "stuck" else 2)
    assert [row["kind"] for row in rows] == kinds + ["elastic"] * (3 - len(kinds))
    assert [float(row["damping_ratio"]) == 0.0 for row in rows] == [row["kind"] == "rigid" for row in rows]


def test_a_suspension_is_refused_with_a_wheel(tmp_path):
    job = joint()
    job["cyclic"] = {"sectors": 5, "engine_order": 1, "lower": [[0]], "upper": [[1]]}
    done = attrito(tmp_path, "run", write_job(tmp_path, job))
    assert done.returncode == 2 and "[model] suspension_hz = 0.5: expected no such key" in done.stderr
