"""Nonlinear modes by periodic motion of joints that only friction holds: the last contact gives way, and they drift."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, table, write_job
from mode_jobs import cut_short
from rocking_block import FEET, FRICTION, KN, KT, MASS, RATIO, STIFFNESS, rocking_block
from scipy.linalg import eigh

from attrito.modes.mode_slopes import DRIFTS


def followed(folder: Path, job: Job) -> list[dict[str, str]]:
    """The table of a job's mode, which sticks at first and drifts at last."""
    done = attrito(folder, "mode", write_job(folder, job))
    assert done.returncode == 0, done.stdout + done.stderr
    rows = table(folder, result="result.mode.h5")
    assert [row["outcome"] for row in rows] == ["converged", "converged", "indeterminate"]
    with h5py.File(folder / "result.mode.h5") as file:
        drift, states = file["points/drift"][:], file["contacts/state"][:]
    assert drift[:2].tolist() == [0.0, 0.0] < drift[2:].tolist()
    assert not np.isin(states[-1], (0, 1)).any(), "the test is void unless no contact sticks throughout"
    return rows


def marched(series: np.ndarray, slider: np.ndarray, xi: float, omega: float, periods: int) -> tuple[float, np.ndarray]:
    """Amplitude of the turn, and by how much sliders move, in the last of some periods of forced motion.

    It begins at a mode's point. Velocity Verlet, 400 steps a period; the load is xi M q' of the series.
    """
    steps = 400
    h = 2.0 * np.pi / omega / steps
    stuck = STIFFNESS + sum(rows.T @ np.diag([KT, KT, KN]) @ rows for rows in FEET)
    squares, shapes = eigh(stuck, MASS)
    damping = MASS @ shapes @ np.diag(2.0 * RATIO * np.sqrt(squares)) @ shapes.T @ MASS
    order, angle = np.arange(1, series.shape[1] // 2 + 1)[:, None], 2.0 * np.pi * np.arange(steps) / steps
    cosine, sine = np.cos(order * angle), np.sin(order * angle)
    rate = omega * (series[:, 2::2] @ (order * cosine) - series[:, 1::2] @ (order * sine))
    load = np.array([0.0, 0.5, 200.0, 0.0])[:, None] + xi * MASS @ rate
    x, v = series[:, 0] + series[:, 1::2] @ cosine[:, 0] + series[:, 2::2] @ sine[:, 0], rate[:, 0]
    inverse, slider = 1.0 / np.diag(MASS), slider.copy()

    def accelerated(x: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
        force = force - STIFFNESS @ x - damping @ v
        for rows, w in zip(FEET, slider, strict=True):
            u = rows @ x
            normal = max(KN * u[2], 0.0)
            pull = KT * (u[:2] - w)
            if (size := np.hypot(*pull)) > FRICTION * normal:
                pull *= FRICTION * normal / size
                w[:] = u[:2] - pull / KT
            force = force - rows.T @ np.array([*pull, normal])
        return inverse * force

    a = accelerated(x, v, load[:, 0])
    for _ in range(periods):
        before, turn = slider.copy(), 0.0j
        for step in range(1, steps + 1):
            v = v + 0.5 * h * a
            x = x + h * v
            a = accelerated(x, v, load[:, step % steps])
            v = v + 0.5 * h * a
            turn += x[3] * np.exp(-2.0j * np.pi * step / steps)
    return abs(turn) * 2.0 / steps, slider - before


def test_a_mode_goes_on_where_no_contact_holds_the_joint_and_says_that_it_drifts(tmp_path):
    rows = followed(tmp_path, rocking_block())
    with h5py.File(tmp_path / "result.mode.h5") as file:
        xi, omega = file["points/excitation"][-1], 2.0 * np.pi * file["points/frequency_hz"][-1]
    assert omega < 2.0 * np.pi * float(rows[0]["frequency_hz"])
    both = float(rows[-1]["damping_ratio"]) + float(rows[-1]["damping_ratio_structure"])
    # What contacts and structure lose a period is what the excitation puts in: to the tolerance of the balance, 1e-10.
    assert both == pytest.approx(xi / (2.0 * omega), rel=1e-8)


def test_points_that_drift_have_no_derivatives_and_say_so(tmp_path):
    job = rocking_block()
    job["sensitivity"] = {"to": ["contact[0].friction_coefficient", "load.press"]}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(DRIFTS) == 1 and "Q 0.00084: " + DRIFTS in done.stdout
    with h5py.File(tmp_path / "result.mode.h5") as file:
        for name in ("frequency_hz", "damping_ratio", "amplitude"):
            found = file[f"sensitivity/{name}"][:]
            assert np.isfinite(found[:2]).all() and np.isnan(found[2]).all()


def test_loads_in_place_of_the_excitation_keep_up_that_motion_and_drift_in_time(tmp_path):
    job = rocking_block()
    job["balance"] = {"harmonics": 7}
    followed(tmp_path, job)
    with h5py.File(tmp_path / "result.mode.h5") as file:
        series, slider = file["points/coordinates"][-1], file["contacts/slider"][-1]
        xi, omega = file["points/excitation"][-1], 2.0 * np.pi * file["points/frequency_hz"][-1]
        drift = file["points/drift"][-1]
    amplitude, moved = marched(series, slider, xi, omega, 60)
    # At resonance the amplitude feels an error of the frequency, (2 pi / 400)^2 / 24 = 1e-5 of the march, by the square
    # of what it is of the damping ratio of 3.5e-3: 4e-6. xi is settled to 3e-6 a period, with some periods to go.
    assert amplitude == pytest.approx(np.hypot(*series[3, 1:3]), rel=1e-4)
    # Slip, which takes a tenth of the period at least, begins and ends within steps of 1/400.
    assert np.linalg.norm(moved, axis=1) == pytest.approx([drift, drift], rel=0.03)
    # Along the push, by either foot alike.
    assert moved[:, 1] == pytest.approx([drift, drift], rel=0.03)


def test_a_mode_that_drifts_does_not_depend_on_the_number_of_ranks(tmp_path):
    whole = followed(tmp_path, rocking_block())
    done = attrito(tmp_path, "mode", "job.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    for one, two in zip(whole, table(tmp_path, result="result.mode.h5"), strict=True):
        for name in ("frequency_hz", "damping_ratio"):
            # Q is met to 1e-6 where sliders creep; damping changes a hundred times as fast there.
            assert float(two[name]) == pytest.approx(float(one[name]), rel=1e-4)
        assert two["outcome"] == one["outcome"]


def test_a_mode_cut_short_where_it_drifts_goes_on_as_if_it_had_not_been(tmp_path, monkeypatch):
    job = rocking_block()
    job["mode"] |= {"stop": 8.6e-4, "points": 4}
    job["mode"]["start"] = 8.0e-4
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    whole = table(tmp_path, result="result.mode.h5")
    assert whole[1]["outcome"] == "indeterminate", "the test is void unless it goes on from a point that drifts"
    (tmp_path / "result.mode.h5").unlink()
    cut_short(tmp_path, monkeypatch, 2)
    assert attrito(tmp_path, "mode", "--resume", "job.toml").returncode == 0
    assert table(tmp_path, result="result.mode.h5") == whole
