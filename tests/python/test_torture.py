"""Scenes at the edge of what methods can do: stiff contacts, much friction, contacts pulled apart."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import run, table, wedge


@pytest.mark.parametrize("frequency_hz", [65.641, 71.2821, 88.2051])
def test_a_very_stiff_contact_without_friction_leaves_a_body_the_response_it_has_without_contact(
    tmp_path, frequency_hz
):
    # Level wall: u = -x, v = y. Motion along it exceeds the stuck response 17 000 times at 65.641 Hz.
    job = wedge(stiffness=1.0e4 * (200.0 * np.pi) ** 2)
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]], "friction_coefficient": 0.0}
    job["load"][0]["dofs"] = [[1, 10.0]]
    job["load"][1]["cosine"] = [[0, 10.0]]
    job["sweep"] = {"frequencies_hz": [frequency_hz]}
    run(tmp_path, job)
    (point,) = table(tmp_path)
    omega = 2.0 * np.pi * frequency_hz
    free = 10.0 / abs((200.0 * np.pi) ** 2 - omega**2 + 20j * np.pi * omega)
    assert point["outcome"] == "converged"
    # The residual, 1e-10 of the stuck response or rounding of the motion, grows by the ratio of stiffnesses at most.
    assert float(point["x_amplitude"]) == pytest.approx(free, rel=1e-8)
