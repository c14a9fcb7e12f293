"""A contact that stays open has no force at all, however far it is from its partner and however little moves."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, run, wedge

HZ = (110.0, 120.0)


def open_job(gap: float, press: float, force: float, tangents: int = 1) -> Job:
    """The wedge beside a wall that is normal to y and never touched."""
    job = wedge()
    stiffness = {"normal_stiffness": 3.0e5, "tangential_stiffness": 3.0e5, "friction_coefficient": 0.5}
    job["contact"] = [{"normal": [[1, 1.0]], "tangents": [[[0, 1.0]], [[0, 0.5]]][:tangents], "gap": gap, **stiffness}]
    job["load"][0]["dofs"] = [[1, press]]
    job["load"][1]["cosine"] = [[0, force]]
    job["balance"] = {"tolerance": 0.01}
    job["sweep"] = {"frequencies_hz": list(HZ)}
    return job


def linear(force: float) -> np.ndarray:
    """Amplitudes of x without the contact."""
    omega = 2 * np.pi * np.array(HZ)
    model = wedge()["model"]
    return force / abs(model["stiffness"][0][0] - omega**2 + 1j * omega * model["damping"][0][0])


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize(("press", "force"), [(420.0, 14.0), (0.0, 14.0), (0.0, 1e-8), (1e-6, 1e-8)])
@pytest.mark.parametrize("gap", [1.0, 1e4, 1e6, 1e9, 1e20, 1e100, 1e300])
def test_far_from_its_partner_the_response_is_that_without_the_contact(tmp_path: Path, gap, press, force, tangents):
    run(tmp_path, open_job(gap, press, force, tangents))
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["monitors/x/amplitude"][:] == pytest.approx(linear(force), rel=1e-9)
        assert file["monitors/y/mean"][:] == pytest.approx(press / wedge()["model"]["stiffness"][1][1], rel=1e-9)
        assert np.all(file["contacts/n_mean"][:] == 0.0)
        assert np.all(file["points/iterations"][:] <= 4)


@pytest.mark.parametrize("press", [1e-9, 1e-11, 1e-13, 1e-15])
def test_a_contact_that_is_barely_pressed_holds_nothing(tmp_path: Path, press):
    job = open_job(0.0, press, 14.0, 2)
    job["contact"][0] |= {"normal": [[1, 1.0], [0, 0.1 * press]], "preload": press}
    run(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["monitors/x/amplitude"][:] == pytest.approx(linear(14.0), rel=1e-6)
