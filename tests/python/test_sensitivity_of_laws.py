"""Derivatives by numbers of other laws than Coulomb's, by what a load path leaves, and of waves in a wheel."""

from __future__ import annotations

from pathlib import Path

import pytest
from jobs import attrito_here, wedge, write_job
from slopes import SHORT_STEP, STEP, compared, pressed, solved
from wheels import lumped_sector


def test_by_the_numbers_of_iwan_s_law(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(force=20.0), law="iwan", chi=-0.4, beta=0.5, sliders=5)
    job["balance"] = {"harmonics": 5, "quadrature": "event", "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0]}
    names = [f"contact[0].{key}" for key in ("chi", "beta", "friction_coefficient", "tangential_stiffness")]
    compared(tmp_path, job, STEP, 1e-6, capfd, names)


def test_by_a_table_of_friction_by_pressure(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(force=30.0), law="pressure", friction_coefficient=[[10.0, 0.6], [60.0, 0.4]], area=1.0)
    job["balance"] = {"harmonics": 3, "samples": 256, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0]}
    names = [f"contact[0].friction_coefficient[{row}]" for row in range(2)]
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd, [*names, "contact[0].tangential_stiffness"])


@pytest.mark.parametrize(("push", "state"), [(-20.0, "stuck"), (-60.0, "shaken_down")])
def test_points_that_begin_at_the_load_path_s_sliders_change_with_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], push: float, state: str
) -> None:
    """A push makes the contact slip and is taken away; it holds its slider, or vibration takes that along."""
    job = wedge(force=1.0)
    job["load"].append({"name": "push", "kind": "static", "dofs": [[0, push], [1, -push]]})
    pushed = {"preload": 1.0, "push": 1.0}
    job["static"] = {"load_path": [{"preload": 1.0}, pushed, {"preload": 1.0}], "slider": "reset"}
    job["balance"] = {"harmonics": 3, "quadrature": "event", "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [120.0]}
    names = [f"contact[0].{key}" for key in ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap")]
    compared(tmp_path, job, STEP, 1e-6, capfd, [*names, "load.preload", "load.push", "level"])
    (contact,) = solved(tmp_path, job, capfd, "--contacts")
    assert contact["state"] == state


def test_of_waves_in_a_wheel(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = lumped_sector()
    job["balance"] = {"harmonics": 3, "quadrature": "event", "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [29.0]}
    names = [
        f"contact[{i}].{key}" for i in range(2) for key in ("tangential_stiffness", "friction_coefficient", "preload")
    ]
    names += ["load.wake", "damping.rayleigh[0]"]
    compared(tmp_path, job, STEP, 1e-6, capfd, names)


def test_of_modes_of_a_wheel_there_are_none(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = lumped_sector() | {"sensitivity": {"to": ["contact[0].tangential_stiffness"]}}
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job))
    assert done.returncode == 2
    assert "derivatives of modes are of whole models" in done.stderr


def test_beta_is_above_zero(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(), law="iwan", chi=-0.4, beta=0.0) | {"sensitivity": {"to": ["contact[0].beta"]}}
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
    assert done.returncode == 2
    assert "beta above 0" in done.stderr
