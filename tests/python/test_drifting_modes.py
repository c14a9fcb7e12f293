"""Nonlinear modes by periodic motion of joints that only friction holds: the last contact gives way, and they drift."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, table, write_job


def rocking_block() -> Job:
    """A block on two feet that rocks about y: only friction holds x and y, and a 400th of its load pushes along y."""
    arm, height = 1.0, 0.5
    feet = [
        {
            "normal": [[2, 1.0], [3, side * arm]],
            "tangents": [[[0, 1.0], [3, height]], [[1, 1.0]]],
            "tangential_stiffness": 4.0e4,
            "normal_stiffness": 6.0e4,
            "friction_coefficient": 0.3,
        }
        for side in (-1.0, 1.0)
    ]
    return {
        "model": {
            "mass": np.diag([1.0, 1.0, 1.0, 0.3]).tolist(),
            "stiffness": np.diag([0.0, 0.0, 0.0, 2.0e5]).tolist(),
        },
        "damping": {"ratio": 1.0e-3},
        "contact": feet,
        "load": [{"name": "press", "kind": "static", "dofs": [[2, 200.0], [1, 0.5]]}],
        "balance": {"harmonics": 3, "samples": 64},
        "mode": {"number": 4, "start": 4.0e-4, "stop": 8.4e-4, "points": 3},
        "output": {"file": "result.h5", "monitors": [{"name": "turn", "dofs": [[3, 1.0]]}]},
    }


def test_a_mode_goes_on_where_no_contact_holds_the_joint_and_says_that_it_drifts(tmp_path):
    done = attrito(tmp_path, "mode", write_job(tmp_path, rocking_block()))
    assert done.returncode == 0, done.stdout + done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    assert [row["outcome"] for row in (rows[0], rows[-1])] == ["converged", "indeterminate"]
    assert len(rows) == 3
    with h5py.File(tmp_path / "result.mode.h5") as file:
        states, xi = file["contacts/state"][-1], file["points/excitation"][-1]
        omega = 2.0 * np.pi * file["points/frequency_hz"][-1]
    assert not np.isin(states, (0, 1)).any(), "the test is void unless no contact sticks throughout"
    assert omega < 2.0 * np.pi * float(rows[0]["frequency_hz"])
    both = float(rows[-1]["damping_ratio"]) + float(rows[-1]["damping_ratio_structure"])
    # What contacts and structure lose a period is what the excitation puts in: to the tolerance of the balance, 1e-10.
    assert both == pytest.approx(xi / (2.0 * omega), rel=1e-8)
