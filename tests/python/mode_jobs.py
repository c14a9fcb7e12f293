"""Jobs with a table `[mode]`, and what `attrito mode` finds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jobs import Job, attrito, table, wedge, write_job
from mpi4py import MPI

from attrito.modes.nonlinear import mode_job
from attrito.runs.recorder import Recorder

K, KT, LIMIT, MASS = 1.0e5, 6.0e4, 20.0, 2.0


def rubbing(harmonics: int = 1, stop: float = 2.0e-2) -> Job:
    """A mass on a spring and one Coulomb element whose normal force is constant: limit 20, slip from 20/kt on."""
    return {
        "model": {"mass": (MASS * np.eye(2)).tolist(), "stiffness": (K * np.eye(2)).tolist()},
        "damping": {"rayleigh": [2.0, 0.0]},
        "contact": [
            {
                "normal": [[1, 1.0]],
                "tangents": [[[0, 1.0]]],
                "tangential_stiffness": KT,
                "normal_stiffness": 4.0e5,
                "friction_coefficient": 0.4,
                "preload": 62.5,
            }
        ],
        # The spring takes part of the preload: N = 62.5 K / (K + kn) + 37.5 = 50.
        "load": [{"name": "press", "kind": "static", "dofs": [[1, 46.875]]}],
        "balance": {"harmonics": harmonics},
        "mode": {"start": 1.0e-4, "stop": stop, "points": 12},
        "output": {"file": "result.h5"},
    }


def described(amplitude: float) -> tuple[float, float, bool]:
    """By the describing function, at an amplitude Q: angular frequency, work a period, and whether it slips."""
    motion = amplitude / np.sqrt(MASS)
    # Half a loop: sticks from the reversal until the slider has gone 2 limit/kt, then slips.
    ratio = min(LIMIT / (KT * motion), 1.0)
    angle = np.arccos(1.0 - 2.0 * ratio)
    omega = float(np.sqrt((K + KT / np.pi * (angle - np.sin(angle) * np.cos(angle))) / MASS))
    return omega, 4.0 * LIMIT * (motion - LIMIT / KT) if ratio < 1.0 else 0.0, ratio < 1.0


def weakly_damped_wedge() -> Job:
    """The paper's wedge with a tenth of its damping, from where the contact sticks to where it slips."""
    job = wedge()
    job["model"]["damping"] = (2 * np.pi * np.eye(2)).tolist()
    job["balance"] = {"harmonics": 7}
    job["mode"] = {"start": 1.0e-6, "stop": 3.0e-3, "points": 18}
    return job


def cut_short(folder: Path, monkeypatch: pytest.MonkeyPatch, known: int) -> None:
    """Follow the mode of job.toml until so many points are written."""
    write, written = Recorder.write, []

    def write_a_few(recorder: Recorder, *point: Any) -> None:
        if len(written) == known:
            raise KeyboardInterrupt
        written.append(point)
        write(recorder, *point)

    with monkeypatch.context() as patched:
        patched.chdir(folder)
        patched.setattr(Recorder, "write", write_a_few)
        with pytest.raises(KeyboardInterrupt):
            mode_job(MPI.COMM_WORLD, "job.toml")


def follow(folder: Path, job: Job, *monitored: str) -> list[dict[str, float]]:
    """The numbers of `attrito table` of a job's mode, and columns of monitors; all its points are to converge."""
    done = attrito(folder, "mode", write_job(folder, job))
    assert done.returncode == 0, done.stdout + done.stderr
    numbers = ("amplitude", "frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy")
    rows = table(folder, result="result.mode.h5")
    assert all(row["converged"] == "true" and row["outcome"] == "converged" for row in rows)
    return [{name: float(row[name]) for name in (*numbers, *monitored)} for row in rows]
