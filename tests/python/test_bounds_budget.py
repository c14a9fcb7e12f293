"""What bounds of points that are not unique may cost, and which points they are spent on."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import chain, everything, write_job
from restarts import differences, run_in_pieces, run_to_the_end

from attrito.runs.bounds_of_levels import SHARE, Candidate, Schedule


def two_levels(tangents: int = 2):
    """A chain of which some contacts slip while others hold, at two levels; the higher level slips more."""
    job = chain(contacts=3, tangents=tangents)
    job["load"][1]["cosine"] = [[0, 30.0]]
    job["sweep"] = {"start_hz": 81.0, "stop_hz": 78.0, "levels": [0.8, 1.0]}
    return job


def examined(schedule: Schedule, cost: float) -> list[int]:
    """Numbers of the points that are examined, each at the same cost."""
    numbers = []
    while (one := schedule.next()) is not None:
        numbers.append(one.number)
        schedule.finish(one.number, cost)
    return numbers


def test_bounds_are_spent_from_the_highest_point_down_until_a_tenth_of_the_work_of_points_is_spent():
    schedule = Schedule(limited=True)
    heights = [1.0, 3.0, 4.0, 2.0]
    for number in range(40):
        schedule.add(0, 100.0, Candidate(number, heights[number], 0.0) if number < 4 else None)
    # A tenth of 4000; a point takes 100, the mean point, to return to, and 50 for visits: a third would end at 450.
    assert examined(schedule, 50.0) == [2, 1]
    assert schedule.omitted == [0, 3]
    assert schedule.spent == 300.0 <= SHARE * schedule.earned


def test_what_a_level_has_not_spent_is_left_to_the_next_and_its_points_are_not():
    schedule = Schedule(limited=True)
    for number in range(40):
        schedule.add(0, 100.0, Candidate(number, 1.0, 0.0) if number == 3 else None)
    assert examined(schedule, 50.0) == [3]
    for number in range(40, 50):
        schedule.add(1, 100.0, Candidate(number, float(number), 0.0))
    # 500 - 150 are left for two more.
    assert examined(schedule, 50.0) == [49, 48]
    assert schedule.omitted == list(range(40, 48))


def test_the_highest_point_of_each_level_is_examined_whatever_is_left():
    schedule = Schedule(limited=True)
    for level in range(3):
        for number in (2 * level, 2 * level + 1):
            schedule.add(level, 1.0, Candidate(number, 1.0, 0.0))
        # Of equal heights the first.
        assert examined(schedule, 1e6) == [2 * level]


def test_without_a_limit_every_point_is_examined():
    schedule = Schedule(limited=False)
    for number in range(5):
        schedule.add(0, 0.0, Candidate(number, float(number), 0.0))
    assert examined(schedule, 1e9) == [4, 3, 2, 1, 0]
    assert schedule.omitted == []


@pytest.mark.parametrize("tangents", [1, 2])
def test_the_highest_point_of_each_level_has_another_member_and_what_is_not_examined_says_so(tmp_path, tangents):
    data = everything(tmp_path, two_levels(tangents))
    several = (data["points/unique"] == 0) & (data["contacts/state"] >= 2).any(axis=1)
    height, change = data["monitors/end/amplitude"], data["points/amplitude_change"]
    for level in np.unique(data["points/level"]):
        among = np.flatnonzero(several & (data["points/level"] == level))
        assert len(among) > 1
        assert np.isfinite(change[among[np.argmax(height[among])]])
    names = ("none", "exact", "sampled", "not_examined")
    left_out = several & np.isnan(change)
    assert left_out.any() and np.all(data["points/bounds"][left_out] == names.index("not_examined"))
    assert np.isnan(data["monitors/end/low"][left_out]).all() and np.isnan(data["contacts/n_low"][left_out]).all()


def test_a_run_resumed_between_points_and_between_their_bounds_gives_the_same_file_bit_for_bit(tmp_path):
    path = tmp_path / write_job(tmp_path, two_levels())
    result = tmp_path / "result.h5"
    assert run_to_the_end(path) == ""
    whole = result.rename(tmp_path / "whole.h5")
    runs, complaint = run_in_pieces(path)
    assert runs > 10 and complaint == ""
    assert differences(result, whole) == []
