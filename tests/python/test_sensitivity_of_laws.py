"""Derivatives by numbers of other laws than Coulomb's, by what a load path leaves, and of waves in a wheel."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito_here, chain, run, table, wedge, write_job
from mpi4py import MPI
from slopes import SHORT_STEP, STEP, compared, pressed, solved, with_parameter
from wheels import lumped_sector

import attrito


def test_by_the_numbers_of_iwan_s_law(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(force=20.0), law="iwan", chi=-0.4, beta=0.5, sliders=5)
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0]}
    names = [f"contact[0].{key}" for key in ("chi", "beta", "friction_coefficient", "tangential_stiffness")]
    compared(tmp_path, job, STEP, 1e-6, capfd, names)


def test_by_the_numbers_of_iwan_s_law_along_two_tangents(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(chain(2, 2), law="iwan", chi=-0.4, beta=0.5, sliders=5)
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    # So large that every element slips.
    job["sweep"] = {"frequencies_hz": [79.0], "levels": [30.0]}
    names = [f"contact[{i}].{key}" for i in range(2) for key in ("chi", "beta", "friction_coefficient")]
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd, names)


def test_of_a_peak_by_the_numbers_of_iwan_s_law(tmp_path: Path) -> None:
    # So large that every element slips: those that rest would be moved by the way to the peak.
    job = pressed(wedge(force=60.0), law="iwan", chi=-0.4, beta=0.5, sliders=5)
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    job["peak"] = {"start": 1.0, "stop": 1.01}

    def peak(changed: Job) -> dict[str, np.ndarray]:
        with attrito.peak(changed, MPI.COMM_SELF, folder=tmp_path, quiet=True):
            pass
        with h5py.File(tmp_path / "result.peaks.h5") as file:
            return {name: dataset[0] for name, dataset in file["peaks"].items() if isinstance(dataset, h5py.Dataset)}

    names = [f"contact[0].{key}" for key in ("chi", "beta")]
    exact = peak(job | {"sensitivity": {"to": names}})
    assert exact["corner"] == 0 and exact["states"][2] == 1
    for quantity, derivatives in (("amplitude", "sensitivity"), ("frequency_hz", "sensitivity_frequency")):
        found, slopes = [], []
        for number, name in enumerate(names):
            (low, _), (high, change) = (with_parameter(job, name, side * 1e-3) for side in (-1.0, 1.0))
            slopes.append((peak(high)[quantity] - peak(low)[quantity]) / 2e-3)
            found.append(exact[derivatives][number] * change / 1e-3)
        # Central differences over 1e-3 leave 1e-6 times third derivatives.
        assert found == pytest.approx(slopes, abs=1e-4 * np.abs(slopes).max())


def test_by_a_table_of_friction_by_pressure(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(force=30.0), law="pressure", friction_coefficient=[[10.0, 0.6], [60.0, 0.4]], area=1.0)
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0]}
    names = [f"contact[0].friction_coefficient[{row}]" for row in range(2)]
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd, [*names, "contact[0].tangential_stiffness"])


def test_by_a_table_of_friction_by_pressure_along_two_tangents(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Sliders that return after a period follow the table."""
    job = pressed(chain(2, 2), law="pressure", area=1.0)
    for contact in job["contact"]:
        contact["friction_coefficient"] = [[10.0, 0.6], [60.0, 0.4]]
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [79.0], "levels": [8.0]}
    names = [f"contact[{i}].friction_coefficient[{row}]" for i in range(2) for row in range(2)]
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd, names)
    assert {row["state"] for row in solved(tmp_path, job, capfd, "--contacts")} == {"slipping"}


@pytest.mark.parametrize("damping", ["ratio", "loss_factor"])
def test_of_forces_along_both_tangents_by_damping(tmp_path: Path, damping: str) -> None:
    """On one rank against differences, on two as on one."""
    job = pressed(chain(2, 2)) | {"damping": {damping: 0.02}}
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [79.0], "levels": [6.0]}
    names = [f"damping.{damping}", "contact[0].friction_coefficient", "load.press", "level"]
    of = ["contact[0].t1_mean", "contact[0].t2_mean", "contact[1].n_mean", "dissipated_energy"]

    def derivatives(ranks: int | None) -> np.ndarray:
        run(tmp_path, job | {"sensitivity": {"to": names, "of": of}}, ranks)
        rows = [row for row in table(tmp_path, "--sensitivities") if row["quantity"] in of]
        return np.array([float(row["derivative"]) for row in rows]).reshape(len(of), len(names))

    def found(changed: Job) -> np.ndarray:
        with attrito.run(changed, MPI.COMM_SELF, folder=tmp_path, quiet=True) as result:
            contacts = result.contacts
            means = [contacts.t1_mean[0, 0], contacts.t2_mean[0, 0], contacts.n_mean[0, 1]]
            return np.array([*means, np.sum(contacts.dissipated_energy[0])])

    slopes = []
    scales = np.array([abs(with_parameter(job, name, 1.0)[1]) for name in names])
    for name, scale in zip(names, scales, strict=True):
        sides = [found(with_parameter(job, name, side * SHORT_STEP)[0]) for side in (-1.0, 1.0)]
        slopes.append((sides[1] - sides[0]) / (2.0 * SHORT_STEP * scale))
    expected = np.array(slopes).T
    largest = np.max(np.abs(expected * scales), axis=1, keepdims=True)
    assert np.all(largest > 0.0)
    alone, shared = derivatives(None), derivatives(2)
    # As by samples elsewhere; systems on both are solved to 1e-9.
    assert np.all(np.abs(alone - expected) * scales < 1e-4 * largest)
    assert np.all(np.abs(alone - shared) * scales < 1e-7 * largest)


@pytest.mark.parametrize(("push", "state"), [(-20.0, "stuck"), (-60.0, "shaken_down")])
def test_points_that_begin_at_the_load_path_s_sliders_change_with_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], push: float, state: str
) -> None:
    """A push makes the contact slip and is taken away; it holds its slider, or vibration takes that along."""
    job = wedge(force=1.0)
    job["load"].append({"name": "push", "kind": "static", "dofs": [[0, push], [1, -push]]})
    pushed = {"preload": 1.0, "push": 1.0}
    job["static"] = {"load_path": [{"preload": 1.0}, pushed, {"preload": 1.0}], "slider": "reset"}
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [120.0]}
    names = [f"contact[0].{key}" for key in ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap")]
    compared(tmp_path, job, STEP, 1e-6, capfd, [*names, "load.preload", "load.push", "level"])
    (contact,) = solved(tmp_path, job, capfd, "--contacts")
    assert contact["state"] == state


@pytest.mark.parametrize(("level", "states"), [(3.0, ["slipping", "stuck"]), (4.0, ["slipping", "slipping"])])
def test_a_loop_that_forgets_the_load_path_s_sliders_follows_along_two_tangents(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], level: float, states: list[str]
) -> None:
    """Sliders that slip return after a period, wherever points begin; where one rests bounds are looked for before.

    After two periods they would be off by some 1e-3 at these levels.
    """
    job = pressed(chain(2, 2))
    job["static"]["slider"] = "reset"
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [79.0], "levels": [level]}
    names = [f"contact[{i}].{key}" for i in range(2) for key in ("friction_coefficient", "preload")]
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd, [*names, "load.press", "level"])
    assert [row["state"] for row in solved(tmp_path, job, capfd, "--contacts")] == states


def test_of_waves_in_a_wheel(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = lumped_sector()
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [29.0]}
    names = [
        f"contact[{i}].{key}" for i in range(2) for key in ("tangential_stiffness", "friction_coefficient", "preload")
    ]
    names += ["load.wake", "damping.rayleigh[0]"]
    compared(tmp_path, job, STEP, 1e-6, capfd, names)


def test_of_the_peak_of_a_wave(tmp_path: Path) -> None:
    job = lumped_sector()
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"start_hz": 38.0, "stop_hz": 56.0}
    job["peak"] = {"start": 1.0, "stop": 1.01}

    def peaks(changed: Job) -> dict[str, np.ndarray]:
        with attrito.peak(changed, MPI.COMM_SELF, folder=tmp_path, quiet=True):
            pass
        with h5py.File(tmp_path / "result.peaks.h5") as file:
            return {name: dataset[0] for name, dataset in file["peaks"].items() if isinstance(dataset, h5py.Dataset)}

    names = ["contact[0].friction_coefficient", "contact[1].tangential_stiffness", "damping.rayleigh[0]"]
    exact = peaks(job | {"sensitivity": {"to": names}})
    assert exact["corner"] == 0 and exact["states"][2] == 2
    for quantity, derivatives in (("amplitude", "sensitivity"), ("frequency_hz", "sensitivity_frequency")):
        found, slopes = [], []
        for number, name in enumerate(names):
            (low, _), (high, _) = (with_parameter(job, name, side * 1e-2) for side in (-1.0, 1.0))
            slopes.append((peaks(high)[quantity] - peaks(low)[quantity]) / 2e-2)
            found.append(exact[derivatives][number] * abs(with_parameter(job, name, 1.0)[1]))
        # Central differences over 1e-2 leave 1e-4 times third derivatives; a peak that is climbed to is found to 1e-9
        # of its height, the root of which is the part of its width (1 Hz) that its frequency is found to.
        assert found == pytest.approx(slopes, abs=4e-3 * np.abs(slopes).max())


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
