"""Backbones whose amplitudes are those of a sensor, half the range or of the first harmonic's acceleration."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import attrito_here, write_job
from mpi4py import MPI
from rubbing_fit import FRICTION, STIFFNESS, rubbing, write_fit

from attrito.fits import run as fits_run
from attrito.support.errors import InputError


@pytest.mark.parametrize("quantity", ["range", "acceleration"])
def test_amplitudes_of_a_sensor_give_stiffness_and_friction(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], quantity: str
) -> None:
    job = rubbing()
    # The tangent mode moves along y, too, and turns as the contact slips.
    job["contact"][0] |= {"normal_stiffness": 2.0 * STIFFNESS, "friction_coefficient": FRICTION, "preload": 200.0}
    # With one harmonic half the range is the first harmonic.
    job["balance"] |= {"harmonics": 1 if quantity == "acceleration" else 5}
    job["static"] = {"load_path": [0.0, 1.0]}
    job["mode"] = {"start": 2e-4, "stop": 5.5e-4, "points": 6}
    write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "mode", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "result.mode.h5") as file:
        points, amplitude = file["points"], file["monitors/x/amplitude"][:]
        frequency = points["frequency_hz"][:]
        damping = points["damping_ratio"][:] + points["damping_ratio_structure"][:]
        ratio = amplitude / points["amplitude"][:]
    # Five times what parameters are asked to be within.
    assert np.ptp(ratio) > 5e-4 * ratio[0], "the sensor moves as the tangent mode does: the test is void"
    if quantity == "acceleration":
        amplitude = amplitude * (2.0 * np.pi * frequency) ** 2
    rows = zip(amplitude.tolist(), frequency.tolist(), damping.tolist(), strict=True)
    lines = ["x_amplitude,frequency_hz,damping_ratio", *(",".join(f"{value:.15g}" for value in row) for row in rows)]
    (tmp_path / "measured.csv").write_text("\n".join(lines) + "\n")
    data = {"name": "backbone", "of": "mode", "file": "measured.csv", "monitor": "x", "quantity": quantity}
    values = {"tangential_stiffness": STIFFNESS, "friction_coefficient": FRICTION}
    parameters = [
        {"name": name, "keys": [f"contact[*].{name}"], "low": 0.1 * value, "high": 10.0 * value, "start": 0.8 * value}
        for name, value in values.items()
    ]
    write_fit(tmp_path, parameter=parameters, data=[data], profile=False)
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "fit.h5") as file:
        assert file["parameters/value"][:] == pytest.approx([STIFFNESS, FRICTION], rel=1e-4)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"monitor": "z"}, "monitor = 'z': expected one of x, y"),
        ({"quantity": "velocity"}, "one of range, displacement, velocity, acceleration, of a monitor"),
        ({"monitor": "x", "quantity": "mobility"}, "one of range, displacement, velocity, acceleration, of a monitor"),
    ],
)
def test_a_sensor_that_is_none_is_refused(tmp_path: Path, keys: dict, expected: str) -> None:
    write_job(tmp_path, rubbing() | {"mode": {"start": 1e-5, "stop": 1e-4}})
    (tmp_path / "backbone.csv").write_text("amplitude,frequency_hz\n1e-5,110.0\n")
    path = write_fit(tmp_path, data=[{"name": "a", "of": "mode", "file": "backbone.csv", **keys}])
    with pytest.raises(InputError, match=expected):
        fits_run.run_fit(MPI.COMM_SELF, path)
