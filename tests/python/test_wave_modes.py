"""Nonlinear modes of a nodal diameter: waves that run round the wheel without excitation."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
from jobs import attrito_here, write_job
from mpi4py import MPI
from wheels import lumped_sector

from attrito.job.reading import read_job
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import Sector, all_alike
from attrito.library.session import Options, Solver
from attrito.modes.tracker import ModeTracker
from attrito.report.wheel import displacements
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.wheel import delayed, wave_in_wheel, whole_wheel

SECTORS, HARMONICS = 5, 7
# Preload alone: there are no static loads.
PATH = np.empty((2, 0))


def mode_of(folder, capfd, engine_order, **keys):
    """The file of a mode of the lumped sector."""
    job = lumped_sector(SECTORS, engine_order) | {"balance": {"harmonics": HARMONICS, "residual_tolerance": 1e-12}}
    job["mode"] = {"start": 1e-4, "stop": 1e-3, "points": 6} | keys
    done = attrito_here(folder, capfd, "mode", write_job(folder, job))
    assert done.returncode == 0, done.stderr
    return folder / "result.mode.h5"


def scene_of(folder):
    job = read_job(folder / "job.toml")
    return reduced_scene(job, build_scene(job))


# Forward, backward, and the second of two modes that are 3 % apart
@pytest.mark.parametrize("engine_order, number", [(1, 1), (4, 1), (2, 2), (-2, 3)])
def test_forces_in_place_of_the_negative_damping_keep_the_whole_wheel_in_the_wave(
    tmp_path, capfd, engine_order, number
):
    """M q'' + C q' + K q + contacts = xi M q': the right-hand side as loads on a wheel that is solved by itself."""
    file = mode_of(tmp_path, capfd, engine_order, number=number)
    scene = scene_of(tmp_path)
    with h5py.File(file) as result:
        motions, frequencies = result["points/coordinates"][:], result["points/frequency_hz"][:]
        excitations, slipping = result["points/excitation"][:], result["contacts/state"][:].max(axis=1)
    assert slipping[-1] >= 2, "no contact slips: the test is void"
    for motion, frequency, excitation in zip(motions, frequencies, excitations, strict=True):
        rate = 2.0 * np.pi * frequency * excitation * np.arange(1, HARMONICS + 1)[:, None]
        inertia = (scene.mass @ motion).T
        loads = np.zeros((2 * HARMONICS + 1, len(scene.mass)))
        loads[1::2], loads[2::2] = rate * inertia[2::2], -rate * inertia[1::2]
        wheel = whole_wheel(replace(scene, harmonic=loads))
        wave = wave_in_wheel(motion, scene.sector)
        with Solver(MPI.COMM_SELF, wheel, Options(harmonics=HARMONICS, tolerance=1e-12)) as solver:
            solver.follow_static_path(PATH, 10, frequency)
            solver.set_excitation(0.9 * frequency, 1.1 * frequency, 1.0)
            assert solver.start_from(StoredPoint(frequency, wave, np.zeros((2 * SECTORS, 2))), 1.0)
            # Residuals are 1e-12, and the amplitude is met to 1e-9.
            assert solver.coordinates() == pytest.approx(wave, abs=1e-8 * np.abs(wave).max())


def test_the_mode_of_nodal_diameter_0_is_that_of_a_sector_tied_to_itself(tmp_path, capfd):
    file = mode_of(tmp_path, capfd, 0)
    alone = all_alike(scene_of(tmp_path))
    with (
        h5py.File(file) as result,
        Solver(MPI.COMM_SELF, alone, Options(harmonics=HARMONICS, tolerance=1e-12)) as solver,
    ):
        solver.follow_static_path(PATH, 10, 20.0)
        modes = solver.linear_modes("tangent", 1)
        tracker = ModeTracker(solver, alone, modes.shapes[:1], modes.natural_hz[0])
        for i, amplitude in enumerate(result["points/amplitude"]):
            point = tracker.at(float(amplitude))
            assert point.point.frequency_hz == pytest.approx(result["points/frequency_hz"][i], rel=1e-9)
            assert point.drive["excitation"] == pytest.approx(result["points/excitation"][i], rel=1e-7)
            assert point.structural_ratio == pytest.approx(result["points/damping_ratio_structure"][i], rel=1e-7)


@pytest.mark.parametrize("damping", [{"rayleigh": [8.0, 1e-5]}, {"ratio": 0.02}, {"loss_factor": 0.03}])
def test_small_motion_has_the_frequency_and_the_damping_of_the_tangent_mode(tmp_path, capfd, damping):
    job = lumped_sector(SECTORS, 3) | {"mode": {"start": 1e-6, "stop": 2e-6, "points": 2}, "damping": damping}
    done = attrito_here(tmp_path, capfd, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    scene = scene_of(tmp_path)
    with h5py.File(tmp_path / "result.mode.h5") as result, Solver(MPI.COMM_SELF, scene, Options(harmonics=3)) as solver:
        solver.follow_static_path(PATH, 10, 20.0)
        modes = solver.diameter_modes("tangent", 3, 1)
        # Damping that couples modes moves the frequency by its square, some 1e-4; the mode is the undamped one.
        assert result["points/frequency_hz"][0] == pytest.approx(modes.natural_hz[0], rel=1e-3)
        assert result["points/damping_ratio_structure"][0] == pytest.approx(modes.damping_ratio[0], rel=1e-2)


def test_loading_in_cycles_is_refused(tmp_path, capfd):
    job = lumped_sector() | {"mode": {"start": 1e-6, "stop": 1e-3, "method": "quasi_static"}}
    done = attrito_here(tmp_path, capfd, "mode", write_job(tmp_path, job))
    assert done.returncode == 2
    expected = 'expected "epmc" with [cyclic]: loading in cycles is no travelling wave'
    assert f"job.toml: [mode] method = 'quasi_static': {expected}" in done.stderr


def test_the_report_has_every_sector_of_the_wheel(tmp_path, capfd):
    file = mode_of(tmp_path, capfd, 1)
    done = attrito_here(tmp_path, capfd, "report", file.name)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / f"{file.stem}.report.html").read_text()
    assert "One of 5 sectors, engine order 1: nodal diameter 1, running forward." in page


def test_monitors_round_the_wheel_are_those_of_the_delayed_sectors():
    sector = Sector(SECTORS, -2, np.array([2]), np.array([3]), np.zeros((4, 4)))
    coefficients = np.random.default_rng(1).uniform(-1.0, 1.0, (2 * HARMONICS + 1, 1))
    instant = 0.7
    found = displacements(coefficients[:, 0], SECTORS, -2, instant)
    for j in range(SECTORS):
        later = delayed(coefficients, sector, j)[1:, 0]
        angles = instant * np.arange(1, HARMONICS + 1)
        assert found[j] == pytest.approx(later[::2] @ np.cos(angles) + later[1::2] @ np.sin(angles), abs=1e-13)
