"""A travelling wave of one sector, and motion in time of the whole wheel, which nothing keeps a wave."""

from __future__ import annotations

import csv
import io

import h5py
import numpy as np
import pytest
from jobs import attrito_here, run, write_job
from wheels import lumped_sector

from attrito.charts import run as chart

# At the first the wave is stable, contacts across slip; at the second it is not. Some 30 harmonics leave 1e-7.
STABLE, UNSTABLE = 35.0, 40.0
SECTORS = 5


def solved(folder):
    """A job whose two points are solved, and their amplitudes."""
    job = lumped_sector(SECTORS, 2) | {"sweep": {"frequencies_hz": [UNSTABLE, STABLE]}}
    job |= {"balance": {"harmonics": 30}, "stability": {"method": "monodromy"}}
    run(folder, job)
    with h5py.File(folder / "result.h5") as file:
        assert file["points/stable"][:].tolist() == [0, 1]
        amplitude = file["monitors/blade/amplitude"][:]
    return job, amplitude


def in_time(folder, capfd, job, **keys):
    """The outcome, and the amplitude of the monitor."""
    write_job(folder, job | {"integrate": {"frequency_hz": STABLE} | keys})
    done = attrito_here(folder, capfd, "integrate", "job.toml")
    with h5py.File(folder / "result.h5") as file:
        group = file["integration"]
        assert len(group["contacts/n_mean"]) == 2 * SECTORS
        return (
            done,
            str(group.attrs["outcome"]),
            float(group["monitors/blade/amplitude"][()]),
            group["contacts/slip"][:],
        )


@pytest.mark.parametrize("start", ["point:1", "static", "rest"])
def test_the_wheel_comes_to_a_stable_wave_from_anywhere(tmp_path, capfd, start):
    job, amplitude = solved(tmp_path)
    done, outcome, found, slip = in_time(tmp_path, capfd, job, start=start)
    assert done.returncode == 0, done.stderr
    assert outcome == "converged"
    assert found == pytest.approx(amplitude[1], rel=1e-6)
    # All sectors do the same, one after the other: contacts across slip, those inside stick.
    assert slip[::2] == pytest.approx(slip[0], abs=1e-6) and slip[0] > 0.0 and not slip[1::2].any()


def test_the_wheel_leaves_an_unstable_wave(tmp_path, capfd):
    job, amplitude = solved(tmp_path)
    _, outcome, found, slip = in_time(tmp_path, capfd, job, start="point:0", frequency_hz=UNSTABLE, cycles=2000)
    assert outcome != "converged" or abs(found - amplitude[0]) > 1e-3 * amplitude[0]
    assert np.ptp(slip[::2]) > 1e-3, "all sectors still move alike"


def test_a_sector_is_charted_beside_its_wheel(tmp_path, capfd, monkeypatch):
    ladders = {"HARMONICS": (1, 5, 20), "TOLERANCES": (1e-2,)}
    for name, values in (ladders | {"STEPS": (64, 256), "SCHEMES": ("newmark", "event")}).items():
        monkeypatch.setattr(chart, name, values)
    write_job(tmp_path, lumped_sector(SECTORS, 2) | {"sweep": {"start_hz": STABLE, "stop_hz": 25.0}})
    done = attrito_here(tmp_path, capfd, "chart", "job.toml", "-o", "wheel.h5")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    error = {(row["series"], row["setting"]): float(row["error"] or "nan") for row in rows}
    for harmonics in (1, 5, 20):
        # Both are solved to 1e-10; errors are of the monitor's amplitude.
        assert error["wheel", f"H = {harmonics}"] == pytest.approx(error["event", f"H = {harmonics}"], abs=1e-8)
    assert error["wheel", "H = 1"] > error["wheel", "H = 5"] > error["wheel", "H = 20"]
    assert error["integration", "newmark, 64 steps"] > error["integration", "newmark, 256 steps"]
    assert error["events in time", "exact"] < 1e-6
