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


# Contacts under constant normal forces: stiffness, friction coefficient, normal force
KT, MU, N = 100.0, 0.5, 8.0


def ended(frames: np.ndarray, states: list[str], friction: list, amplitude: float, tangents: int = 2) -> str:
    """Reason of an end at which contacts move by an amplitude along their first tangent."""
    count = len(frames)
    laws = {"tangents": tangents, "tangential_stiffness": KT, "normal_stiffness": 1e3, "friction_coefficient": MU}
    places = {"set": np.array(["rail - block"] * count), "frame": frames}
    moved = np.zeros((count, 3, 3))
    moved[:, 0, 1] = amplitude
    last = {"/contacts/state": np.array([[STATES.index(name) for name in states]]), "/contacts/displacement": moved}
    last |= dict(zip(("/contacts/t1_mean", "/contacts/t2_mean"), np.array(friction, dtype=float).T, strict=False))
    constant = {name: np.full(count, value) for name, value in (laws | {"preload": N, "gap": 0.0}).items()}
    return reason(last, SimpleNamespace(laws=constant, places=places))


def groove() -> np.ndarray:
    """Frames of a wedge in a groove along y, of both faces at 30 degrees: tangents and normal."""
    normals = [np.array([sign * 0.5, 0.0, np.sqrt(0.75)]) for sign in (-1, 1)]
    return np.array([[[0.0, 1.0, 0.0], np.cross(normal, [0.0, 1.0, 0.0]), normal] for normal in normals])


@pytest.mark.parametrize("tangents", [1, 2])
def test_a_wedge_slides_along_its_groove_whatever_friction_does_across(tangents):
    # One contact slips; the other, pushed, comes to its limit where it moves farthest: mu N - kt A in the mean.
    amplitude = 0.01
    most = MU * N - KT * amplitude
    friction = [[1.0, 2.0], [most - 0.02, 3.0]]
    said = ended(groove(), ["slipping", "stuck"], friction, amplitude, tangents)
    assert said == (
        f"contact sets rail/block slide along y: load {1.0 + most - 0.02:.4g}, "
        f"friction at this alternating motion carries at most {1.0 + most:.4g}"
    )


def test_contacts_that_can_carry_more_are_no_slide():
    # What is left is above a hundredth of mu N of both.
    friction = [[1.0, 2.0], [MU * N - KT * 0.01 - 0.1, 0.0]]
    lost = "no step along it converges; 1 of 2 contacts that close come to their limit"
    assert ended(groove(), ["slipping", "stuck"], friction, 0.01) == lost
    # At its limit, but across the groove.
    lost = "no step along it converges; 2 of 2 contacts that close come to their limit"
    assert ended(groove(), ["slipping", "shaken_down"], [[0.0, 2.0], [0.0, MU * N]], 0.0) == lost


def test_contacts_that_all_slip_let_a_body_slide_and_say_what_friction_carries():
    said = ended(groove(), ["slipping", "slipping"], [[0.25, 2.0], [0.5, 3.0]], 0.1)
    assert said.endswith("slide along y: load -0.75, friction at this alternating motion carries at most -0.75") or (
        said.endswith("slide along y: load 0.75, friction at this alternating motion carries at most 0.75")
    )


def test_a_block_on_a_plane_slides_the_way_friction_has_nothing_left():
    frames = np.array([np.eye(3)] * 2)
    # Both are at their limit along x alone, one pushed back and one pushing on.
    said = ended(frames, ["shaken_down", "slipping"], [[MU * N, 0.0], [-MU * N, 0.0]], 0.0)
    assert said.endswith("slide along x: load 0, friction at this alternating motion carries at most 0")


def test_a_body_between_faces_across_all_directions_does_not_slide():
    frames = np.array([np.roll(np.eye(3), turns, axis=1) for turns in range(3)])
    said = ended(frames, ["slipping"] * 3, [[1.0, 1.0]] * 3, 0.1)
    assert said == "no step along it converges; 3 of 3 contacts that close come to their limit"


def test_contacts_without_places_say_how_many_hold():
    frames = np.full((4, 3, 3), np.nan)
    states = ["stuck", "shaken_down", "slipping", "open"]
    lost = "no step along it converges; 2 of 3 contacts that close come to their limit"
    assert ended(frames, states, [[0.0, 0.0]] * 4, 0.0) == lost
