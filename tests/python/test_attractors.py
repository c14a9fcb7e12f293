"""Motions that stated starts come to: coexisting ones, longer periods, families."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import attrito_here, run, toml, wedge


def stiff_wedge(frequency_hz):
    """Stiff contacts, 20 N of preload, 60 N along x."""
    job = wedge(stiffness=3.0e6)
    job["load"][0]["dofs"] = [[1, 20.0]]
    job["load"][1]["cosine"] = [[0, 60.0]]
    job["integrate"] = {"frequency_hz": frequency_hz, "attractors": True, "max_period_multiple": 32, "cycles": 2000}
    job["integrate"]["periodicity_tolerance"] = 1e-9
    return job


def met(folder, capfd, job):
    (folder / "job.toml").write_text(toml(job))
    done = attrito_here(folder, capfd, "integrate", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / job["output"]["file"]) as file:
        group = file["integration/attractors"]
        starts = [text.decode() for text in group["starts"]]
        return group["period"][()], group["x/amplitude"][()], group["family"][()], starts


def test_two_stable_orbits_of_period_one_are_met_at_90_hz(tmp_path, capfd):
    period, amplitude, _, starts = met(tmp_path, capfd, stiff_wedge(90.0))
    ones = np.sort(amplitude[period == 1])
    # Of the balance with 20 harmonics: 0.1269 and 0.1613 mm.
    assert ones == pytest.approx([1.269e-4, 1.613e-4], rel=2e-3)
    assert sum(len(text.split(", ")) for text in starts) == 7


@pytest.mark.parametrize(
    ("frequency_hz", "longer"),
    [(85.0, {2}), (102.5, {2}), (112.5, {2}), (117.5, {2}), (120.0, {5}), (122.5, {3}), (125.0, {3, 4}), (127.5, {5})],
)
def test_longer_periods_are_told_where_the_orbit_of_period_one_is_unstable(tmp_path, capfd, frequency_hz, longer):
    period, _, _, _ = met(tmp_path, capfd, stiff_wedge(frequency_hz))
    assert longer & set(period.tolist())
    assert 1 not in period


def test_at_117_hz_the_motion_of_period_two_shows_only_after_a_thousand_cycles(tmp_path, capfd):
    job = stiff_wedge(117.5)
    job["integrate"]["cycles"] = 1000
    period, _, _, _ = met(tmp_path, capfd, job)
    assert period.tolist() == [0]


def test_the_stable_orbit_at_130_hz_lies_beside_longer_motions(tmp_path, capfd):
    job = stiff_wedge(130.0)
    job["balance"]["harmonics"] = 20
    job["sweep"] = {"frequencies_hz": [130.0]}
    job["integrate"]["start"] = "point:0"
    run(tmp_path, job)
    period, _, _, starts = met(tmp_path, capfd, job)
    assert starts[period.tolist().index(1)].split(", ")[0] == "point"
    assert np.any(period != 1)


def test_members_of_a_family_are_one_motion(tmp_path, capfd):
    job = wedge(force=1.0)
    job["integrate"] = {"frequency_hz": 132.0, "attractors": True}
    period, _, family, starts = met(tmp_path, capfd, job)
    assert period.tolist() == [1]
    assert family.tolist() == [1]
    assert len(starts[0].split(", ")) == 7


def test_a_point_of_the_result_is_the_eighth_start(tmp_path, capfd):
    job = wedge()
    job["integrate"] = {"frequency_hz": 132.0, "attractors": True, "start": "point:0"}
    run(tmp_path, job)
    _, _, _, starts = met(tmp_path, capfd, job)
    assert starts == ["static, rest, point, twice, opposite, backwards, mirrored, far"]
