"""Sweeps of a body that friction alone holds: a branch ends where it slides along, on either side of a resonance."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from jobs import Job, run, table
from mpi4py import MPI
from rocking_block import rocking_block

from attrito.job.reading import read_job
from attrito.library.names import STATES
from attrito.library.session import Solver
from attrito.runs.branch_ends import reason, rigid_motions
from attrito.runs.carrying_capacity import Closed, least_reserve, over_period
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.solver_options import solver_options

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


def ended(
    frames: np.ndarray, states: list[str], friction: list, amplitude: float, tangents: int = 2, rigid: str = "xyz"
) -> str:
    """Reason of an end at which contacts move by an amplitude along their first tangent, on a body free along axes."""
    count = len(frames)
    laws = {"tangents": tangents, "tangential_stiffness": KT, "normal_stiffness": 1e3, "friction_coefficient": MU}
    places = {"set": np.array(["rail - block"] * count), "frame": frames}
    moved = np.zeros((count, 3, 3))
    moved[:, 0, 1] = amplitude
    last = {"/contacts/state": np.array([[STATES.index(name) for name in states]]), "/contacts/displacement": moved}
    last |= dict(zip(("/contacts/t1_mean", "/contacts/t2_mean"), np.array(friction, dtype=float).T, strict=False))
    constant = {name: np.full(count, value) for name, value in (laws | {"preload": N, "gap": 0.0}).items()}
    free = np.eye(3)[["xyz".index(axis) for axis in rigid]]
    rows = np.concatenate([frame[[*range(tangents), 2]] for frame in frames])
    return reason(last, SimpleNamespace(laws=constant, places=places), rows @ free.T)


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


def test_directions_without_friction_are_no_slide():
    """Along y no friction acts: nothing is asked of it there, and it has nothing to give."""
    frames = np.array([np.eye(3)] * 2)
    lost = "no step along it converges; 1 of 2 contacts that close come to their limit"
    assert ended(frames, ["slipping", "stuck"], [[1.0, 0.0], [1.0, 0.0]], 0.0, tangents=1) == lost
    said = ended(frames, ["slipping", "shaken_down"], [[1.0, 0.0], [MU * N, 0.0]], 0.0, tangents=1)
    assert said.endswith(f"slide along x: load {1 + MU * N:.4g}, friction at this alternating motion carries at most 5")


@pytest.mark.parametrize(("rigid", "slides"), [("", False), ("y", False), ("x", True), ("xy", True)])
def test_a_body_slides_only_as_far_as_the_structure_lets_it(rigid, slides):
    frames = np.array([np.eye(3)] * 2)
    said = ended(frames, ["slipping", "shaken_down"], [[1.0, 0.0], [MU * N, 0.0]], 0.0, rigid=rigid)
    assert (" slide along x: load 5," in said) == slides
    assert said.startswith("contact sets rail/block slide" if slides else "no step along it converges")
    bare = ended(np.full((2, 3, 3), np.nan), ["slipping"] * 2, [[1.0, 0.0]] * 2, 0.1, rigid=rigid)
    assert bare.startswith("contact sets rail/block slide" if rigid else "no step along it converges")


def rigid_motions_of(job: Job) -> np.ndarray:
    """Those that a run of a job finds."""
    checked = read_job(job)
    reduced = reduced_scene(checked, build_scene(checked))
    with Solver(MPI.COMM_SELF, reduced, solver_options(checked, None)) as solver:
        return rigid_motions(solver, reduced)


@pytest.mark.parametrize("held", [[], [0], [1], [0, 1]])
def test_rigid_motions_are_those_that_springs_leave_without_friction(held):
    job = swept_block(15.0, 2.0)
    stiffness = np.array(job["model"]["stiffness"])
    stiffness[held, held] = 1e5
    job["model"]["stiffness"] = stiffness.tolist()
    found = rigid_motions_of(job)
    expected = np.delete(np.tile([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]], (2, 1)), held, axis=1)
    assert found.shape == expected.shape
    assert found @ found.T == pytest.approx(expected @ expected.T, abs=1e-6)


@pytest.mark.parametrize("hub", [0.0, 1e5])
@pytest.mark.parametrize("engine_order", [0, 2])
def test_a_wheel_that_nothing_holds_turns_whatever_drives_it(hub, engine_order):
    """Masses tied by chords turn as one: against the ground, and not against each other."""
    own, stretch = (
        np.diag([1.0, 1.0, 0.0, 0.0]),
        np.array([np.sin(0.2 * np.pi), -np.cos(0.2 * np.pi)] * 2) * [1, 1, 1, -1],
    )
    law = {"tangential_stiffness": KT, "normal_stiffness": KT, "friction_coefficient": MU, "preload": N}
    job = {
        "model": {"mass": own.tolist(), "stiffness": (hub * own + 1e5 * np.outer(stretch, stretch)).tolist()},
        "cyclic": {"sectors": 5, "engine_order": engine_order, "lower": [0, 1], "upper": [2, 3]},
        "contact": [
            {"normal": [[0, 1.0]], "tangents": [tangent], **law} for tangent in ([[1, 1.0]], [[1, 1.0], [3, -1.0]])
        ],
        "load": [{"kind": "harmonic", "cosine": [[0, 1.0]]}],
        "sweep": {"frequencies_hz": [24.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "out", "dofs": [[0, 1.0]]}]},
    }
    found = rigid_motions_of(job)
    assert found.shape == (4, 0 if hub else 1)
    if not hub:
        assert abs(found[0, 0]) > 0.1
        assert found[1:, 0] == pytest.approx(0.0, abs=1e-6)


def test_where_all_contacts_slip_a_body_goes_where_the_load_points():
    frames = np.array([np.eye(3)] * 2)
    said = ended(frames, ["slipping"] * 2, [[0.3, -1.5]] * 2, 0.1)
    load = 2.0 * np.hypot(0.3, 1.5)
    carries = f"friction at this alternating motion carries at most {load:.4g}"
    assert said.endswith(f"slide along (0.20, -0.98, 0.00): load {load:.4g}, {carries}")


def test_waves_that_are_shorter_than_any_fixed_sampling_do_not_alias():
    series = np.zeros((1, 2, 601))
    series[0, 0, 2 * 256 - 1] = 1.0
    assert np.ptp(over_period(series)[0, 0]) > 1.9


def test_what_friction_carries_does_not_depend_on_the_axes_of_the_directions():
    """Frames that are turned turn the direction that is found, and leave load and capacity."""
    moved = np.zeros((3, 2, 7))
    moved[:, 0, 1], moved[:, 1, 2], moved[:, 0, 5] = 0.03, [0.01, 0.02, 0.04], 0.01
    limit, mean = np.full((3, 64), MU * N), np.array([[1.0, 2.0], [0.5, 3.0], [-0.3, 1.0]])
    stiffness, holds = np.full(3, KT), np.array([True, True, False])
    found = []
    for angle in (0.0, 0.7):
        turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        frames = np.array([turn] * 3)
        found.append(least_reserve(Closed(frames, stiffness, moved, limit, mean, holds, frames[:, :2])))
    # Directions are as close as the search leaves them, 0.9 degrees to either side.
    assert found[1].capacity - found[1].load == pytest.approx(found[0].capacity - found[0].load, rel=1e-2)
    assert found[1].direction @ turn.T @ found[0].direction > np.cos(0.05)


def test_contacts_without_places_say_how_many_hold():
    frames = np.full((4, 3, 3), np.nan)
    states = ["stuck", "shaken_down", "slipping", "open"]
    lost = "no step along it converges; 2 of 3 contacts that close come to their limit"
    assert ended(frames, states, [[0.0, 0.0]] * 4, 0.0) == lost
