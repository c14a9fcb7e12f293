"""The last lines of a run: what they say of sweeps, listed frequencies, no motion and bands without a maximum."""

from __future__ import annotations

import pytest
from jobs import swept, wedge

import attrito
from attrito.runs.answer import answer

LINEAR = "The nearest linear peaks are at 116.3 Hz (frictionless) and 132.7 Hz (stuck). Sweep from 99 to 150 Hz."


def lines_of(job, folder):
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    with attrito.run(job, folder=folder, quiet=True) as made, attrito.Result(made) as result:
        return answer(result)


def test_a_peak_inside_the_band_is_beside_that_of_stuck_contacts(tmp_path):
    heading, row, words = lines_of(swept(wedge(), 140.0, 100.0), tmp_path)
    assert heading.split() == ["peak", "below", "stuck", "error"]
    assert row.startswith("x   5.84e-05 at 13") and " 14 % " in row
    assert words.startswith('"below stuck": than the linear peak')


def test_a_sweep_that_begins_at_its_peak_and_goes_both_ways_has_it_inside(tmp_path):
    job = swept(wedge(), 131.0, 100.0)
    assert lines_of(job, tmp_path)[0].split() == ["largest", "error"]
    listed = wedge()
    listed["sweep"] = {"frequencies_hz": [133.0, 140.0, 120.0]}
    heading, row, _ = lines_of(listed, tmp_path)
    assert heading.split()[0] == "peak" and "133 Hz" in row


def test_the_lowest_of_listed_frequencies_is_an_end_and_one_alone_is_none(tmp_path):
    listed = wedge()
    listed["sweep"] = {"frequencies_hz": [135.0, 140.0, 134.0, 150.0]}
    assert "134 Hz, the end" in lines_of(listed, tmp_path)[1]
    listed["sweep"] = {"frequencies_hz": [133.0]}
    heading, row = lines_of(listed, tmp_path)
    assert row.startswith("x   5.84e-05 at 133 Hz ") and "the end" not in row


def test_a_band_without_a_maximum_is_answered_with_one_that_has_it(tmp_path):
    assert lines_of(swept(wedge(), 60.0, 90.0), tmp_path)[-1] == LINEAR


@pytest.mark.parametrize("points", [2, 5])
def test_a_sweep_that_stops_early_gets_no_band_that_it_asked_for(tmp_path, points):
    lines = lines_of(swept(wedge(), 140.0, 100.0, max_points=points), tmp_path)
    assert not any("Sweep from" in line for line in lines)


def test_what_does_not_move_says_so(tmp_path):
    job = swept(wedge(), 60.0, 90.0)
    job["output"]["monitors"] = [{"name": "x", "dofs": [[0, 0.0]]}]
    assert lines_of(job, tmp_path)[1] == "x   does not move"
