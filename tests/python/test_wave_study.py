"""Studies over the engine order: every sample is a wave of its own nodal diameter."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import attrito_here, toml, write_job
from wheels import lumped_sector

ORDERS = [0, 1, 4]


def studied(folder, capfd, of, **job):
    """The exit code, what was said, and the file of a study over engine orders."""
    write_job(folder, lumped_sector() | {"balance": {"harmonics": 5}} | job)
    vary = {"name": "engine order", "keys": ["cyclic.engine_order"], "values": ORDERS}
    (folder / "study.toml").write_text(toml({"job": "job.toml", "of": of, "design": "grid", "vary": [vary]}))
    done = attrito_here(folder, capfd, "study", "study.toml")
    return done, folder / "study.h5"


def test_peaks_of_engine_orders_are_those_of_jobs_of_their_own(tmp_path, capfd):
    band = {"peak": {"start": 1.0}, "sweep": {"start_hz": 45.0, "stop_hz": 15.0}}
    done, file = studied(tmp_path, capfd, "peaks", **band)
    assert done.returncode == 0, done.stderr
    with h5py.File(file) as study:
        found = study["peaks/frequency_hz"][:, 0]
    # What forward and backward waves lose by friction differs a little.
    assert len(np.unique(found)) == len(ORDERS)
    for order, frequency in zip(ORDERS, found, strict=True):
        job = lumped_sector(engine_order=order) | {"balance": {"harmonics": 5}} | band
        job["peak"] = {"start": 1.0, "stop": 1.01, "file": "peak.h5"}
        assert attrito_here(tmp_path, capfd, "peak", write_job(tmp_path, job)).returncode == 0
        with h5py.File(tmp_path / "peak.h5") as peak:
            # Where a peak is located is known to the root of what its height is.
            assert frequency == pytest.approx(peak["peaks/frequency_hz"][0], rel=1e-5)


def test_modes_of_engine_orders_are_of_their_nodal_diameters(tmp_path, capfd):
    done, file = studied(tmp_path, capfd, "modes", mode={"start": 1e-4, "stop": 1e-3, "points": 3})
    assert done.returncode == 0, done.stderr
    with h5py.File(file) as study:
        small, large = study["modes/frequency_hz"][:, [0, -1]].T
    # Forward and backward waves have one frequency while everything sticks.
    assert small[1] == pytest.approx(small[2], rel=1e-9) and abs(small[0] - small[1]) > 1.0
    assert abs(large[1] - large[2]) > 1e-4 * large[1]


def test_a_study_without_any_peak_is_written_and_says_so(tmp_path, capfd):
    done, file = studied(tmp_path, capfd, "peaks", peak={"start": 1.0}, sweep={"start_hz": 300.0, "stop_hz": 200.0})
    assert done.returncode == 1
    assert "3 of 3 samples have no peak" in done.stderr and "Warning" not in done.stderr
    with h5py.File(file) as study:
        assert np.isnan(study["peaks/frequency_hz"][:]).all()
    assert (tmp_path / "study.png").is_file()
