"""Quasi-static cycles whose sliders creep: where their loop is the same from cycle to cycle, and where they ratchet."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, write_job
from mode_jobs import KT, LIMIT, MASS, K, rubbing

# A second, weak contact with two tangents: its limit, and a steady push of it across the motion
WEAK_LIMIT, PUSH = 0.2, 0.004


def pushed(stiffness_across: float) -> Job:
    """A mass that moves along x, where one Coulomb element dissipates; a weak one is pushed along y and creeps.

    What the push turns of the weak element's friction away from x is a part (PUSH / WEAK_LIMIT)^2 / 2 of it.
    """
    job = rubbing()
    stiffness = np.diag([K, stiffness_across, K])
    job["model"] = {"mass": (MASS * np.eye(3)).tolist(), "stiffness": stiffness.tolist()}
    weak = {
        "normal": [[2, 1.0e-9]],
        "tangents": [[[0, 1.0]], [[1, 1.0]]],
        "tangential_stiffness": KT,
        "normal_stiffness": 1.0,
        "friction_coefficient": WEAK_LIMIT,
        "preload": 1.0,
    }
    job["contact"] = [job["contact"][0] | {"normal": [[2, 1.0]]}, weak]
    job["load"] = [{"name": "press", "kind": "static", "dofs": [[2, 46.875], [1, PUSH]]}]
    job["balance"] = {"harmonics": 1}
    job["mode"] = {"method": "quasi_static", "near_hz": 45.0, "start": 1.0e-3, "stop": 1.0e-2, "points": 4, "steps": 64}
    return job


def check_loop(file: h5py.File) -> None:
    """Secant and area of the loop of two Coulomb elements along x, which both slip at its ends."""
    a = file["points/amplitude"][:] / np.sqrt(MASS)
    omega = np.sqrt((K * a + LIMIT + WEAK_LIMIT) / (MASS * a))
    work = sum(4.0 * limit * (a - limit / KT) for limit in (LIMIT, WEAK_LIMIT))
    turned = (PUSH / WEAK_LIMIT) ** 2 / 2.0 * WEAK_LIMIT / LIMIT
    # Loops of neighbouring cycles differ by at most 3e-6 of their area, 3e-7 of Q.
    assert file["points/frequency_hz"][:] == pytest.approx(omega / (2.0 * np.pi), rel=turned + 3.0e-7)
    assert file["points/dissipated_energy"][:] == pytest.approx(work, rel=2.0 * turned + 3.0e-6)


def outcomes(file: h5py.File) -> list[str]:
    """Of each point, by name."""
    series = file["points/outcome"]
    return [series.attrs["names"][i].decode() for i in series[:]]


def test_a_cycle_whose_loop_is_the_same_is_closed_though_sliders_creep(tmp_path):
    stiffness = 5.0
    done = attrito(tmp_path, "mode", write_job(tmp_path, pushed(stiffness)))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.mode.h5") as file:
        assert set(outcomes(file)) == {"converged"}
        across = file["points/coordinates"][:, 1, 0]
        check_loop(file)
    # Where they rest the spring alone carries the push.
    assert min(across) < 0.5 * PUSH / stiffness, "the test is void unless sliders still creep somewhere"


def test_a_cycle_whose_sliders_go_on_by_equal_steps_is_not_closed_though_its_loop_is_the_same(tmp_path):
    # Nothing but friction holds the mass along y: it ratchets.
    done = attrito(tmp_path, "mode", write_job(tmp_path, pushed(0.0)))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.mode.h5") as file:
        assert set(outcomes(file)) == {"indeterminate"}
        check_loop(file)
