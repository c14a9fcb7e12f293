"""Sweeps of a body that friction alone holds: a branch ends where it slides along, on either side of a resonance."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from jobs import Job, run, table
from rocking_block import rocking_block

from attrito.library.names import STATES
from attrito.runs.branch_ends import reason

START, STOP = 160.0, 240.0


def swept_block(force: float, push: float) -> Job:
    """The rocking block, its load aside as given, swept over the resonance at which it rocks."""
    job = rocking_block()
    del job["mode"]
    job["load"][0]["dofs"] = [[2, 200.0], [1, push]]
    job["load"].append({"kind": "harmonic", "cosine": [[3, force]]})
    return job | {"sweep": {"start_hz": START, "stop_hz": STOP, "levels": [1.0]}}


def branches_of(folder: Path) -> list[list[tuple[float, float]]]:
    """Frequencies and amplitudes, branch by branch."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in table(folder):
        assert row["outcome"] == "converged"
        found.setdefault(row["branch"], []).append((float(row["frequency_hz"]), float(row["turn_amplitude"])))
    return list(found.values())


@pytest.mark.parametrize(("force", "push", "ranks"), [(5.0, 0.5, 1), (15.0, 2.0, 2), (40.0, 0.5, 1)])
def test_a_branch_ends_where_the_body_slides_along(tmp_path, force, push, ranks):
    done = run(tmp_path, swept_block(force, push), ranks=ranks, code=1)
    assert done.stdout.count("branch 0 ends at ") == 1
    assert "contacts 0, 1 slide, each at its limit of friction" in done.stdout
    before, behind = branches_of(tmp_path)
    # What friction carries depends on how far the block rocks, hardly on the frequency: both ends are at one amplitude.
    assert before[-1][1] == pytest.approx(behind[0][1], rel=0.02)
    assert before[-1][0] < behind[0][0]
    assert (before[0][0], behind[-1][0]) == (START, STOP)
    # The way back from the place where the second branch was found goes on to its end.
    assert max(amplitude for _, amplitude in behind) == pytest.approx(behind[0][1], rel=1e-3)


def test_no_periodic_motion_is_left_between_both_ends(tmp_path):
    job = swept_block(15.0, 2.0)
    run(tmp_path, job, code=1)
    before, behind = branches_of(tmp_path)
    between = [0.9 * before[-1][0] + 0.1 * behind[0][0], 0.1 * before[-1][0] + 0.9 * behind[0][0]]
    folder = tmp_path / "between"
    folder.mkdir()
    run(folder, job | {"sweep": {"frequencies_hz": between, "levels": [1.0]}}, code=1)
    assert {row["outcome"] for row in table(folder)} == {"no_period_one_orbit"}


def test_an_end_with_contacts_that_hold_says_how_many_do_not():
    states = [STATES.index(name) for name in ("stuck", "shaken_down", "slipping", "slipping", "open")]
    said = reason({"/contacts/state": np.array([states])}, SimpleNamespace())
    assert said == "no step along it converges; 3 of 4 contacts that close come to their limit"
