"""The benchmarks run at their smallest size and say what they should; times are never asserted."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import ablation
import evidence
import joints
import kills
import numpy as np
import pairing
import pytest
import record
import scenes
import unlike_plates
from jobs import TIMEOUT

from attrito.job.reading import read_job
from attrito.library.names import NO_SOLUTION
from attrito.library.session import Options
from attrito_verification.scene_grid.scenes import Family, frequencies

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def run(script: str, *arguments: str) -> Any:
    """What a benchmark prints."""
    command = [sys.executable, str(BENCHMARKS / script), *arguments]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=TIMEOUT).stdout)


def test_an_element_carries_its_mass_and_no_stress_in_rigid_motion():
    for edges in ([0.1, 0.2], [0.1, 0.2, 0.3]):
        stiffness, mass = scenes.element(np.array(edges))
        moved = np.tile(np.eye(len(edges)), 2 ** len(edges))
        assert moved @ mass @ moved.T == pytest.approx(scenes.DENSITY * np.prod(edges) * np.eye(len(edges)), rel=1e-12)
        assert np.abs(stiffness @ moved.T).max() < 1e-12 * np.abs(stiffness).max()


def test_a_hexahedral_block_has_the_contacts_asked_for_and_a_unit_mass():
    scene = scenes.hexahedral_block(11, 30)
    assert len(scene.laws["tangents"]) == 11
    assert scene.directions.shape == (33, 30)
    assert scene.mass == pytest.approx(np.eye(30), abs=1e-9)


def test_below_the_least_threshold_every_contact_sticks_and_far_above_none_does():
    found = run("kernels.py", "--plane", "3", "--hexahedral", "9", "--modes", "20", "--harmonics", "1")
    for row in found["scenes"]:
        tangents = (2 if row["scene"] == "hexahedral" else 1) * row["contacts"] * (2 * row["harmonics"] + 1)
        assert row["active_rows"] == 0 if row["share"] == 0.0 else row["active_rows"] >= row["share"] * tangents
    assert {row["kernel"] for row in found["contacts"]} == {"event_line", "event_disc"}


def test_a_strategy_that_is_left_out_is_missed_where_it_alone_solves_a_point():
    # One family of the grid at two frequencies; the lap joint and the blocks are for the whole study.
    options = ("--groups", "corner", "--families", "1", "--frequencies", "2", "--without", "newton")
    rows = run("ablation.py", *options, "newton+stuck_response")["groups"]["corner"]
    assert list(rows) == ["none", "newton", "newton+stuck_response"]
    assert {row["points"] for row in rows.values()} == {2}
    # Contacts that are soft at first, and motion in time, find what no other strategy does (test_torture.py): here with
    # them and without.
    family, at = Family(1, 1.0e4, 0.8, "none", 80.0), frequencies()[32]
    options = Options(harmonics=10, samples=128)
    case = ablation.Case(family.name, family.scene(), options, np.array([[0.0], [1.0]]), 1.0, np.array([at]))
    everything, _ = ablation.solve(case, [])
    without, _ = ablation.solve(case, ["stiffness_homotopy", "time_integration"])
    assert [everything[0].is_solved, without[0].is_solved] == [True, False]
    (changed,) = ablation.differences(case, everything, without)
    assert changed["all"] == "converged"
    assert changed["frequency_hz"] == pytest.approx(at, rel=1e-12)
    assert changed["without"] in NO_SOLUTION


def test_the_sweep_of_a_block_solves_points():
    rows = run("block.py", "--contacts", "3", "--modes", "3", "--harmonics", "1", "--load", "1.0")
    assert len(rows) == 1
    assert rows[0]["points"] > 20 and rows[0]["not_converged"] == 0


def test_ordinary_points_are_solved_and_come_back_to_where_they_began():
    (row,) = run("points.py", "--cases", "9:1:sliding", "--modes", "20", "--points", "4")
    solved = [row["first"], *row["points"]]
    assert [point["outcome"] for point in solved] == 5 * ["converged"]
    assert all(point["states"]["slipping"] == 9 for point in solved)
    # Where every contact slips the motion does not depend on the way; the residual is 1e-10 of the response, and its
    # condition some 1e2.
    assert solved[-1]["amplitude"] == pytest.approx(solved[0]["amplitude"], rel=1e-7)


def test_scaling_fits_an_exponent_to_each_quantity():
    small = (
        "--harmonics",
        "1",
        "3",
        "--modes",
        "20",
        "30",
        "--slipping",
        "1",
        "2",
        "--base",
        "9",
        "--wanted",
        "1",
        "--usual-modes",
        "20",
    )
    found = run("scaling.py", "--contacts", "9", "12", "--samples", "32", *small)
    assert set(found) == {"contacts", "slipping", "harmonics", "modes"}
    assert all(row["points"] == 24 for series in found.values() for row in series["rows"])


def test_integration_finds_the_orbit_of_a_block_that_sticks_and_none_of_one_that_is_shaken_loose():
    scene = scenes.bouncing_block(3, 3)
    assert evidence.march(scene, 900.0, 1.0e3, cycles=600)["integration"] == "period_one"
    found = evidence.march(scene, 300.0, 1.0e7, cycles=25)
    assert found["integration"] not in evidence.FOUND
    assert found["cycles"] == 25
    assert found["open_most"] > 0.5


def test_what_has_no_orbit_is_not_held_against_the_solver():
    rows = [{"integration": name} for name in ("period_one", "settling", "period_3", "none")]
    found = evidence.count(6, rows)
    assert found["unsolved_with_an_orbit"] == 2
    assert found["unsolved_without"] == 2
    assert found["share_solved_of_those_with_an_orbit"] == 6 / 8
    assert evidence.count(6, [{}]) == {"unsolved": 1}


def test_robustness_integrates_what_is_not_solved_unless_told_not_to():
    size = ("--contacts", "4", "--modes", "12", "--harmonics", "1", "--samples", "16", "--levels", "2")
    size = (*size, "--frequencies", "2", "--stiffnesses", "2e9")
    found = run("robustness.py", *size, "--seconds", "0.5")
    assert len(found["not_solved"]) > 0
    assert all("integration" in row for row in found["not_solved"])
    summary = found["summary"]
    assert summary["points"] == 4 == len(found["points"])
    assert summary["unsolved"] == summary["unsolved_with_an_orbit"] + summary["unsolved_without"]
    bare = run("robustness.py", *size, "--no-integration")
    assert len(bare["not_solved"]) == len(found["not_solved"])
    assert not any("integration" in row for row in bare["not_solved"])


def test_a_sweep_tells_what_integration_finds_where_it_was_given_up():
    size = ("--contacts", "3", "--parts", "0.1", "--max-points", "2")
    (row,) = run("sliding.py", *size, "--seconds", "1")
    assert not row["up"]["reached_stop"]
    assert {found["integration"] for found in row["up"]["evidence"]} <= set(evidence.FOUND)
    (row,) = run("sliding.py", *size, "--no-integration")
    assert "evidence" not in row["up"]


def test_a_block_that_walks_is_not_held_by_rounding_of_its_stiffness_a_hundred_metres_away():
    size = ("--contacts", "100", "--parts", "5", "--max-points", "1")
    (row,) = run("sliding.py", *size, "--no-integration")
    (walk,) = row["up"]["without_at"]
    assert (walk["slipping"], row["up"]["solved"]) == (100, 0)
    # At the other end of the range some contacts hold it throughout.
    assert row["down"]["solved"] == 1


def test_a_block_shaken_upright_sticks_until_contacts_open_and_the_sweep_goes_on_beyond_the_fold():
    size = ("--harmonics", "3", "--step", "0", "--max-points", "60", "--range", "1400", "1500")
    found = run("branches.py", *size)
    assert found["slips_hz"] < found["opens_hz"] < found["folds_hz"] < 1.02 * found["slips_hz"]
    assert found["up"][0]["stuck"] == 10
    assert found["down"][0]["slipping"] > 0
    assert found["orbits"] == {"up": [], "down": []}
    # The first branch runs back over the start; what lies beyond its fold is the other one, on which all but the
    # outermost contacts lift off. From above that one passes below the fold: both are there.
    beyond = found["beyond_fold"]
    assert found["from_below_lost_hz"] == pytest.approx(1400.0, rel=1e-12)
    assert beyond["frequency_hz"] > found["folds_hz"]
    assert beyond["slipping"] >= 8
    assert 0.25 < beyond["open_median"] < beyond["open_most"] < 0.55
    assert found["from_above_lost_hz"] < found["opens_hz"]
    assert found["reached_stop"] == [True, True]


def test_random_decks_are_equal_to_calculix_or_refused():
    found = run("decks.py", "--decks", "4", "--seed", "1")
    assert found["decks"] == {"equal": 3, "refused": 1} and found["silent"] == 0
    assert found["by"]["cyclic job"] == found["by"]["cyclic tie"] == {"equal": 1}


def test_every_format_of_matrix_files_reads_to_the_same_matrix():
    found = run("readers.py", "--dofs", "300", "--band", "10")["formats"]
    assert len(found) == 7
    # Each row has 40 on its diagonal, and no file lacks an entry.
    assert {round(row["trace"], 6) for row in found.values()} == {300 * 40.0}
    assert len({row["matrix_megabytes"] for row in found.values()}) == 1


@pytest.mark.parametrize(("ranks", "times"), [(1, 4), (2, 2)])
def test_runs_that_are_killed_lose_no_point_and_end_as_if_they_had_not_been(tmp_path, ranks, times):
    found = kills.kill_and_go_on(tmp_path, "run", times, ranks, size=10, seed=3)
    assert found["kills"] == times
    assert (found["lost"], found["unreadable"], found["different"], found["touched"]) == (0, 0, 0, 0)


def test_pairing_measures_every_kind_of_contact():
    found = {
        points: pairing.measure((("C3D10", "C3D20"), (4, 5), points)) for points in ("pair", "node", "gauss", "cut")
    }
    assert all(one["nodes"] == [81, 96] and one["nonzeros"] > 0 and one["memory_mb"] >= 0 for one in found.values())
    # Nodes of 4 x 4 pairs of triangles, and three points in each of these.
    assert found["node"]["contacts"] == 81 and found["gauss"]["contacts"] == 96
    assert 4 <= found["pair"]["contacts"] < 81 and found["cut"]["contacts"] > 96


def test_jobs_of_unlike_plates_are_the_lap_joint_s_with_other_contacts(tmp_path):
    for points in ("pair", "node", "gauss", "cut"):
        (tmp_path / "job.toml").write_text(unlike_plates.job_of(points))
        job = read_job(tmp_path / "job.toml")
        pairs, own = job["contact_set"][0], "node" if points == "pair" else "face"
        assert pairs["pairing"] == own and pairs["points"] == (None if points == "pair" else points)
        assert job["static"]["bounds"] == "none" and job["output"]["file"] == f"{points}.h5"
        assert (job["sweep"]["start_hz"], job["sweep"]["stop_hz"]) == unlike_plates.BAND


def test_unlike_plates_are_meshed_swept_and_drawn(tmp_path):
    picture = tmp_path / "plates.png"
    arguments = ("--folder", str(tmp_path), "--cases", "2-1.7-node", "2-1-pair", "--picture", str(picture))
    found = run("unlike_plates.py", *arguments, "--band", "120", "121")
    assert [row["case"] for row in found] == ["2-1.7-node", "2-1-pair"]
    assert [row["mean_size"] for row in found] == [pytest.approx(2 / 1.7**0.5, abs=1e-4), 2.0]
    # Side a's nodes that have a face before them, and all pairs; the lower plate is the finer one.
    assert found[0]["contacts"] > 1.5 * found[1]["contacts"] > 50
    assert all(row["frequency_hz"] == 121.0 and not row["inside"] for row in found)
    assert all(136.0 < row["tangent_hz"] < row["stuck_hz"] < 150.0 for row in found)
    assert found[1]["off"] == 0.0 and found[0]["off"] == pytest.approx(found[0]["peak"] / found[1]["peak"] - 1)
    # Far below it a mode answers with 1 / (its frequency^2 - the frequency^2); the rest moves alike on both meshes.
    flexible = [1.0 / (row["tangent_hz"] ** 2 - 121.0**2) for row in found]
    assert found[0]["peak"] / found[1]["peak"] == pytest.approx(flexible[0] / flexible[1], rel=0.05)
    assert picture.stat().st_size > 0
    peak, frequency = unlike_plates.picture(found).axes
    drawn = {line.get_label(): line.get_xydata().tolist() for line in peak.lines}
    assert drawn["matching, node pairs"] == [[2.0, found[1]["peak"]]]
    assert drawn["1 : 1.7, nodes on faces"] == [[found[0]["mean_size"], found[0]["peak"]]]
    assert [line.get_ydata()[0] for line in frequency.lines] == [121.0, 121.0]
    assert [row["off_matching"] for row in found] == [None, 0.0]
    # What is there is not made again.
    (tmp_path / "2_1" / "model.h5").unlink()
    assert run("unlike_plates.py", *arguments) == found


def test_unlike_plates_are_held_against_matching_ones_of_the_same_edge():
    pairs = [{"points": "pair", "mean_size": size, "peak": peak} for size, peak in ((2.0, 1.4), (1.0, 1.2))]
    found = [{"points": "gauss", "mean_size": 1.5, "peak": 1.313}, *pairs]
    unlike_plates.compare(found)
    assert found[0]["off_matching"] == pytest.approx(0.01) and found[0]["off"] == pytest.approx(1.313 / 1.2 - 1)
    assert [row["off_matching"] for row in found[1:]] == [0.0, 0.0]


def test_a_wave_breaks_in_motion_of_a_wheel_in_which_it_is_unstable():
    small, large = run("cyclic.py", "breaking", "--periods", "20")
    assert (small["verdict"], large["verdict"]) == ("stable", "unstable")
    assert small["largest_multiplier"] < 0.95 and large["largest_multiplier"] > 1.9
    # 31 harmonics leave out 1e-6 of the motion; a kick of 1e-6 that doubles each period is seen after twelve.
    assert small["away"][-1] < 1e-4
    assert large["away"][-1] > 1e-2


def test_derivatives_of_random_scenes_are_those_by_differences():
    summary = run("sensitivities.py", "--scenes", "8", "--parameters", "4")["summary"]
    # Next to a corner differences are known to 1e-4: those of lift-off keep that, and in one of two scenes 1e-6.
    lift_off = summary["smooth"].pop("onset of lift-off")
    assert all(kind["largest"] < 1e-4 for kind in lift_off.values() if isinstance(kind, dict))
    for by in ("smooth", "bent"):
        kinds = [kind for look in summary[by].values() for kind in look.values() if isinstance(kind, dict)]
        assert all(kind["scenes that keep it"] == kind["of scenes with sure ones"] for kind in kinds)
        # Bent are peaks of friction by pressure alone, which none of the eight scenes has.
        assert sum(kind["sure"] for kind in kinds) > 0 or by == "bent"
    (cost,) = run("sensitivities.py", "--contacts", "20", "--harmonics", "1")["cost"]
    assert all(point["finite"] for point in cost["points"])


def test_joints_are_drawn_alike_from_a_seed_with_60_to_400_pairs_of_faces_that_meet():
    for number in range(joints.JOINTS):
        joint, drawn = joints.draw(number, 42)
        scene, again = (joints.scene_of(joints.draw(number, 42)[0]) for _ in range(2))
        assert np.array_equal(scene.coordinates, again.coordinates)
        assert 2000 < 3 * len(scene.coordinates) < 15000
        assert all(len(rows) > 0 for rows in scene.node_sets.values())
        if "points" not in drawn["contact"]:
            assert 60 <= sum(len(scene.node_sets[a]) for a, _ in joint.pairs) <= 400
        for cells in scene.elements.values():
            corners = scene.coordinates[cells[:, [0, 1, 3, 4]]]
            assert np.linalg.det(corners[:, 1:] - corners[:, :1]).min() > 0.0
        for a, b in joint.pairs:
            sides = (scene.coordinates[scene.node_sets[name]] for name in (a, b))
            (low_a, high_a), (low_b, high_b) = ((side.min(axis=0), side.max(axis=0)) for side in sides)
            assert np.all(low_a <= high_b + 0.1)
            assert np.all(low_b <= high_a + 0.1)


def test_contact_forces_of_a_joint_balance_its_bolts_at_rest(tmp_path):
    # An angle bolted to another: the sum of normal forces is the bolts' force, since all faces are level.
    row = joints.build(tmp_path, 7, 42)
    force = joints.draw(7, 42)[0].bolts[1][1]
    assert row["balance"] < 1e-6
    assert row["normal"] == pytest.approx(force, rel=1e-6)


def test_a_replay_says_what_moved():
    kept = {"points/work": np.array([1.0, 2.0]), "points/x": np.array([1.0, np.nan]), "points/branch": np.array([0, 1])}
    assert record.compare(kept, {name: values.copy() for name, values in kept.items()}) == ""
    moved = kept | {"points/x": np.array([1.0 + 1e-9, np.nan]), "points/work": np.array([1.0, 4.0])}
    assert record.compare(kept, moved) == "2 of 3 datasets differ; by up to 1.0e+00 (points/work); work times 2.0000"
    longer = kept | {"points/branch": np.array([0, 1, 1])}
    assert "sizes of 1, as points/branch (2,) -> (3,)" in record.compare(kept, longer)
    assert "inf" in record.compare(kept, kept | {"points/x": np.array([1.0, 2.0])})
