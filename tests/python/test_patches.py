"""Pairs merged into patches: exact where the field is uniform, within the estimate elsewhere, results of all pairs."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from elastic import elastic_block
from jobs import blocks, run, swept, write_blocks, write_job
from mpi4py import MPI
from restarts import differences, run_in_pieces, run_to_the_end

from attrito.charts import patches as chart
from attrito.job.fewer_contacts import take_all_contacts
from attrito.job.reading import read_job
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.modes.patched import PatchedModeTracker
from attrito.modes.tracker import ModeTracker
from attrito.patches.partition import first_partition, halves, kinds_of, numbered, refined
from attrito.patches.solver import PatchedSolver, Places
from attrito.support.errors import InputError

OPTIONS = Options(harmonics=3, samples=256)
FULL = np.array([[0.0], [1.0]])


def laws_of(stiffness, tangents=2, friction=0.4):
    count = len(stiffness)
    return {
        "tangents": np.full(count, tangents, dtype=np.int32),
        "tangential_stiffness": 0.8 * stiffness,
        "normal_stiffness": stiffness,
        "friction_coefficient": np.full(count, friction),
        "gap": np.zeros(count),
        "preload": np.zeros(count),
    }


def punch():
    """A rigid body on springs, pressed on the ground over 12 pairs of unequal areas, shaken along it."""
    stiffness = 1.0e4 * np.linspace(1.0, 3.0, 12)
    rows = np.tile([[1.0, 0.0], [0.0, -1.0]], (12, 1))
    scene = ReducedScene(
        np.eye(2),
        np.diag([2.0e4, 1.0e3]),
        "mass",
        3.0,
        None,
        laws_of(stiffness, tangents=1),
        rows,
        np.array([[0.0, -100.0]]),
        np.array([[0.0, 0.0], [60.0, 6.0], [0.0, 0.0]]),
        np.array([[1.0, 0.0]]),
        ["x"],
    )
    places = np.column_stack([np.arange(12.0), np.zeros(12), np.zeros(12)])
    return scene, Places(np.zeros(12, dtype=int), places, np.tile([0.0, 0.0, -1.0], (12, 1)))


def block():
    """An elastic block on the ground, its foot pressed unevenly, so that it slips from one side; two tangents."""
    model, points = elastic_block((6, 3, 2), (0.12, 0.06, 0.04))
    foot = np.flatnonzero(points[:, 2] < 1e-9)
    size = len(points) * 3
    rows = np.zeros((3 * len(foot), size))
    for i, node in enumerate(foot):
        for row, (direction, sign) in enumerate(((0, 1.0), (1, -1.0), (2, -1.0))):
            rows[3 * i + row, 3 * node + direction] = sign
    top = np.flatnonzero(points[:, 2] > 0.04 - 1e-9)
    press, shake, watch = np.zeros((3, size))
    press[3 * top + 2] = -400.0 * (0.3 + points[top, 0] / 0.12)
    shake[3 * top] = 60.0
    watch[3 * top[-1]] = 1.0
    scene = ReducedScene(
        model.mass.toarray(),
        model.stiffness.toarray(),
        "ratio",
        0.005,
        None,
        laws_of(np.full(len(foot), 2.0e7)),
        rows,
        press[None],
        np.array([np.zeros(size), shake, np.zeros(size)]),
        watch[None],
        ["corner"],
    )
    return scene, Places(np.zeros(len(foot), dtype=int), points[foot], np.tile([0.0, 0.0, -1.0], (len(foot), 1)))


def solve(solver, frequencies, level=1.0):
    """The static means, points, and what is reported of each."""
    means = solver.follow_static_path(FULL, 1, frequencies[0])
    points, reports = [], []
    for point in solver.solve_at(list(frequencies), level, 0):
        points.append(point)
        reports.append(reported(solver))
    return means, points, reports


def of_all(scene, frequencies, level=1.0):
    with Solver(MPI.COMM_SELF, scene, OPTIONS) as solver:
        return solve(solver, frequencies, level)


def of_patches(scene, places, frequencies, level=1.0, partition=None, tolerance=0.01):
    band = min(frequencies), max(frequencies)
    with PatchedSolver(MPI.COMM_SELF, scene, OPTIONS, places, tolerance, band, partition) as solver:
        return solve(solver, frequencies, level)


def amplitudes(points):
    return np.array([point.amplitude[0] for point in points])


@pytest.mark.parametrize(("scene", "frequencies"), [(punch, [22.0, 24.0]), (block, [900.0, 1000.0])])
def test_patches_of_single_pairs_are_all_pairs(scene, frequencies):
    scene, places = scene()
    count = len(places.tables)
    means, points, reports = of_all(scene, frequencies)
    merged_means, merged, merged_reports = of_patches(scene, places, frequencies, partition=np.arange(count))
    assert means == pytest.approx(merged_means, rel=1e-12)
    assert any(point.states[2] > 0 for point in points), "the test is void unless contacts slip"
    # Both are converged to residuals of 1e-10; sliders of two tangents rest but for a defect of 1e-6 of the motion.
    assert amplitudes(merged) == pytest.approx(amplitudes(points), rel=1e-8)
    for report, other in zip(reports, merged_reports, strict=True):
        assert other["/points/patches"] == count and other["/points/error_contacts"] < 1e-5
        assert np.array_equal(report["/contacts/state"], other["/contacts/state"])
        for name in ("force", "displacement", "n_min", "dissipated_energy"):
            own, theirs = report[f"/contacts/{name}"], other[f"/contacts/{name}"]
            assert theirs == pytest.approx(own, rel=1e-6, abs=2e-5 * np.nanmax(abs(own)), nan_ok=True)


def test_one_patch_is_exact_under_a_rigid_punch_of_uniform_pressure():
    scene, places = punch()
    _, points, reports = of_all(scene, [20.0, 23.0, 26.0])
    _, merged, merged_reports = of_patches(scene, places, [20.0, 23.0, 26.0], partition=np.zeros(12, dtype=int))
    assert all(point.states[2] == 12 for point in points), "the test is void unless all pairs slip"
    assert amplitudes(merged) == pytest.approx(amplitudes(points), rel=1e-8)
    for report, other in zip(reports, merged_reports, strict=True):
        assert other["/points/patches"] == 1 and other["/points/error_contacts"] < 1e-7
        work = report["/contacts/dissipated_energy"]
        assert other["/contacts/dissipated_energy"] == pytest.approx(work, rel=1e-6)
        # Tractions are uniform: pairs bear by their stiffness.
        assert work / work.sum() == pytest.approx(scene.laws["normal_stiffness"] / 2.4e5, rel=1e-6)


def test_statics_and_tangent_response_are_those_of_all_pairs_whatever_the_patches():
    scene, places = block()
    # So little load that nothing slips.
    means, points, reports = of_all(scene, [900.0, 1500.0], level=1e-4)
    one = np.zeros(len(places.tables), dtype=int)
    merged_means, merged, merged_reports = of_patches(scene, places, [900.0, 1500.0], level=1e-4, partition=one)
    assert all(sum(point.states[2:]) == 0 for point in points)
    assert merged_means == pytest.approx(means, rel=1e-12)
    assert amplitudes(merged) == pytest.approx(amplitudes(points), rel=1e-6)
    for report, other in zip(reports, merged_reports, strict=True):
        largest = abs(report["/contacts/n_mean"]).max()
        assert other["/contacts/n_mean"] == pytest.approx(report["/contacts/n_mean"], abs=1e-7 * largest)


def test_patches_are_refined_until_the_error_is_within_the_tolerance_and_the_estimate_is_of_the_error():
    scene, places = block()
    frequencies = [700.0, 900.0, 1100.0, 1250.0]
    _, points, _ = of_all(scene, frequencies)
    count = len(places.tables)
    assert max(point.states[2] for point in points) > count // 3, "the test is void unless many pairs slip"
    found = {}
    for tolerance in (0.1, 0.001):
        _, merged, reports = of_patches(scene, places, frequencies, tolerance=tolerance)
        errors = abs(amplitudes(merged) / amplitudes(points) - 1.0)
        estimates = np.array([report["/points/error_contacts"] for report in reports])
        # Half of the tolerance is the patches' part; the estimate is at least a third of the error.
        assert np.all(estimates <= 0.5 * tolerance)
        assert np.all(estimates >= errors / 3.0 - 1e-6)
        found[tolerance] = reports[-1]["/points/patches"]
    assert found[0.1] < found[0.001] < count


def test_a_chart_has_the_error_of_ever_more_patches_against_all_pairs(monkeypatch):
    scene, places = block()
    frequencies = [900.0, 1000.0]
    reference = amplitudes(of_all(scene, frequencies)[1])[-1]
    monkeypatch.setattr(chart, "TOLERANCES", (3e-1, 3e-2, 3e-3))
    *patched, whole = chart.patched_ways(
        MPI.COMM_SELF,
        scene,
        OPTIONS,
        places,
        frequencies,
        lambda solver: solver.follow_static_path(FULL, 1, frequencies[0]),
        1.0,
        lambda amplitude: abs(float(amplitude[0]) / reference - 1.0),
    )
    counts = [way.contacts for way in patched]
    assert counts == sorted(counts) and counts[0] < counts[-1] <= whole.contacts == len(places.tables)
    assert patched[0].error > patched[-1].error
    # Patches are refined until the estimate, which is at least a third of the error, is within half of the tolerance.
    assert all(way.error < 1.5 * way.tolerance for way in patched)
    # The same points, solved to residuals of 1e-10.
    assert whole.error < 1e-8


def test_pairs_without_a_place_are_no_patches():
    scene, places = block()
    assert chart.can_merge(scene, places)
    assert not chart.can_merge(scene, replace(places, positions=np.full_like(places.positions, np.nan)))


def test_a_mode_followed_with_patches_is_that_of_all_pairs():
    scene, places = block()
    band = 1587.0, 1587.0
    with (
        Solver(MPI.COMM_SELF, scene, OPTIONS) as solver,
        PatchedSolver(MPI.COMM_SELF, scene, OPTIONS, places, 0.01, band) as merged,
    ):
        for one in (solver, merged):
            one.follow_static_path(FULL, 1, 700.0)
        modes = solver.linear_modes("tangent", 2)
        frequency_hz = float(modes.natural_hz[0])
        trackers = ModeTracker(solver, scene, modes.shapes[:1], frequency_hz), PatchedModeTracker(merged, frequency_hz)
        slips, patches, damping = [], [], []
        for amplitude in (1e-5, 1.15e-5, 1.3e-5, 1.4e-5, 1.5e-5):
            whole, coarse = (tracker.at(amplitude) for tracker in trackers)
            assert whole.converged and coarse.converged
            error = abs(coarse.point.frequency_hz / whole.point.frequency_hz - 1.0)
            assert error <= min(3.0 * coarse.error_contacts + 1e-6, 0.01)
            reports = [reported(one) for one in (solver, merged)]
            work = [np.nansum(report["/contacts/dissipated_energy"]) for report in reports]
            ratios = [one.damping_ratio(own) for one, own in zip((whole, coarse), work, strict=True)]
            missing = abs(ratios[1] - ratios[0]) / max(ratios[0], 1e-12)
            assert missing <= 3.0 * reports[1]["/points/error_dissipation"] + 1e-6
            assert reports[1]["/points/error_dissipation"] <= 0.025
            assert ratios[1] == pytest.approx(ratios[0], rel=0.05, abs=1e-12)
            slips.append(whole.point.states[2])
            patches.append(int(reports[1]["/points/patches"]))
            damping.append(ratios[0])
    assert max(slips) >= 8 and max(damping) > 0.005, "the test is void unless contacts slip and damp"
    assert patches[0] < max(patches) < len(places.tables)


def test_what_a_force_changes_of_a_mode_is_what_a_stiffness_does_that_gives_this_force():
    scene, _ = block()
    scene = replace(scene, damping_kind="viscous", damping=10.0 * scene.mass)
    part = 1.0e-5
    stiffer = replace(scene, stiffness=(1.0 + part) * scene.stiffness)
    with Solver(MPI.COMM_SELF, scene, OPTIONS) as first, Solver(MPI.COMM_SELF, stiffer, OPTIONS) as second:
        points = []
        for solver in (first, second):
            solver.follow_static_path(FULL, 1, 700.0)
            modes = solver.linear_modes("tangent", 1)
            # The amplitude is that of the first one's shape in both.
            shapes = modes.shapes[:1] if not points else points[0][1]
            tracker = ModeTracker(solver, scene, shapes, float(modes.natural_hz[0]))
            point = tracker.at(1.4e-5)
            assert point.converged and point.point.states[2] >= 8, "the test is void unless contacts slip"
            points.append((point, shapes, tracker))
        motion = first.coordinates()
        change = points[0][2].change_by_force(-part * scene.stiffness @ motion)
    omega = [2.0 * np.pi * point.point.frequency_hz for point, _, _ in points]
    xi = [point.drive["excitation"] for point, _, _ in points]
    assert change[0] == pytest.approx(omega[1] - omega[0], rel=1e-3)
    assert change[1] == pytest.approx(xi[1] - xi[0], rel=1e-3)


def reported(solver):
    report = {}
    solver.report_point(lambda path, _, values: report.update({path: values}))
    return report


def test_only_pairs_alike_are_merged():
    laws = laws_of(np.full(6, 1.0e4))
    places = np.zeros((6, 3))
    closed = np.array([True, True, False, True, True, True])
    laws["friction_coefficient"][3] = 0.1
    places[4] = np.nan
    kinds = kinds_of(laws, np.array([0, 0, 0, 0, 0, 1]), closed, places)
    assert kinds.tolist() == [0, 0, 1, 2, 3, 4]


def test_first_patches_are_small_compact_and_nearly_plane():
    angle = np.linspace(0.0, np.pi, 400)
    normals = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    partition = first_partition(np.zeros(400, dtype=int), 5.0 * normals, normals)
    for patch in range(partition.max() + 1):
        pairs = np.flatnonzero(partition == patch)
        assert len(pairs) <= 64 and np.array_equal(pairs, np.arange(pairs[0], pairs[0] + len(pairs)))
        assert (normals[pairs] @ normals[pairs].T).min() >= 0.95


def test_a_patch_is_split_between_states_or_across_its_longest_side():
    places = np.column_stack([np.arange(8.0), np.zeros(8), np.zeros(8)])
    one = np.zeros(8, dtype=int)
    states = np.array([0, 0, 2, 0, 0, 2, 2, 0])
    assert refined(one, np.ones(8), states, places).tolist() == [0, 0, 1, 0, 0, 1, 1, 0]
    assert refined(one, np.ones(8), 0 * states, places).tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    # A patch of one pair, and one that lacks nothing, stay.
    parts = np.array([0, 1, 1, 1, 1, 2, 2, 2])
    assert np.array_equal(refined(parts, np.array([9.0, *np.zeros(7)]), states, places), parts)
    assert [len(part) for part in halves(np.arange(5), places[:5])] == [2, 3]
    assert numbered(np.array([7, 3, 7, 1])).tolist() == [0, 1, 0, 2]


def merging(job, **balance):
    job["balance"] |= {"contacts": "auto"} | balance
    return job


def test_a_run_reports_every_pair_the_estimate_and_how_many_patches(tmp_path):
    write_blocks(tmp_path / "model.h5")
    job = blocks() | {"sweep": {"frequencies_hz": [58.0, 60.0, 62.0]}}
    run(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        amplitude, count = file["monitors/tip/amplitude"][:], len(file["contacts/parameters/area"])
    run(tmp_path, merging(job))
    with h5py.File(tmp_path / "result.h5") as file:
        assert json.loads(file.attrs["job"])["balance"]["contacts"] == "auto"
        assert json.loads(file.attrs["job"])["balance"]["tolerance"] == 0.01
        assert file["contacts/n_mean"].shape == (3, count)
        assert np.all(file["points/patches"][:] <= count)
        errors, estimate = file["points/error_contacts"][:], file["points/estimate"][:]
        others = sum(file[f"points/error_{name}"][:] for name in ("harmonics", "samples", "modes"))
        assert estimate == pytest.approx(errors + others, rel=1e-12)
        assert file["monitors/tip/amplitude"][:] == pytest.approx(amplitude, rel=0.01)


def test_a_sweep_that_refines_on_its_way_goes_on_from_every_point_bit_for_bit(tmp_path):
    write_blocks(tmp_path / "model.h5")
    job = merging(swept(blocks(), 57.0, 64.0, max_points=8), tolerance=1e-3)
    job["load"][1]["cosine"] = [[["node", "tip", "x"], 70.0]]
    path = tmp_path / write_job(tmp_path, job)
    assert "before its stop" in run_to_the_end(path)
    result = tmp_path / "result.h5"
    with h5py.File(result) as file:
        patches, along, frequency = (file[f"points/{name}"][:] for name in ("patches", "path", "frequency_hz"))
    assert len(patches) == 8
    assert len(np.unique(patches)) > 2, "the test is void unless patches are refined"
    assert np.all(np.diff(along) > 0.0) and np.all(np.diff(frequency) > 0.0)
    result.rename(tmp_path / "whole.h5")
    runs, _ = run_in_pieces(path)
    assert runs == 8
    assert differences(tmp_path / "whole.h5", result) == []


def test_a_sweep_that_refines_at_its_first_point_goes_on_from_there(tmp_path):
    write_blocks(tmp_path / "model.h5")
    job = merging(swept(blocks(), 56.0, 64.0, max_points=4), tolerance=1e-3)
    # All nine contacts slip at the start: one patch is not enough.
    job["load"][1]["cosine"] = [[["node", "tip", "x"], 100.0]]
    run_to_the_end(tmp_path / write_job(tmp_path, job))
    with h5py.File(tmp_path / "result.h5") as file:
        frequency, patches = file["points/frequency_hz"][:], file["points/patches"][:]
    assert patches[0] > 1, "the test is void unless patches are refined at the first point"
    assert frequency[0] == 56.0 and len(frequency) == 4 and np.all(np.diff(frequency) > 0.0)


@pytest.mark.parametrize(
    ("table", "key", "value", "expected"),
    [
        ("balance", "approach", "uncoupled", '"coupled" with'),
        ("static", "bounds", "sampled", '"auto" or "none" with'),
        ("continuation", "branches", 2, "1 with"),
        ("stability", "method", "hill", '"none" with'),
        ("damping", "loss_factor", 0.01, "another kind of damping with"),
    ],
)
def test_what_patches_do_not_give_is_refused_by_name(tmp_path, table, key, value, expected):
    write_blocks(tmp_path / "model.h5")
    job = merging(swept(blocks(), 50.0, 60.0))
    job[table] = ({} if table == "damping" else job.get(table, {})) | {key: value}
    answer = run(tmp_path, job, code=2)
    assert f"[{table}] {key}" in answer.stderr
    assert f'{expected} [balance] contacts = "auto"' in answer.stderr


@pytest.mark.parametrize("command", ["peak", "study"])
def test_commands_that_do_not_merge_say_so(tmp_path, command):
    write_blocks(tmp_path / "model.h5")
    job = read_job(tmp_path / write_job(tmp_path, merging(blocks())))
    with pytest.raises(InputError, match=f'"all": attrito {command} does not merge contacts'):
        take_all_contacts(job, command)
