"""The curve drawn through a sweep's points: its error, its table, and how many points it takes."""

from __future__ import annotations

import itertools
from pathlib import Path

import h5py
import numpy as np
import pytest
import verdicts
from jobs import Job, attrito, run, swept, table, wedge, write_job
from mpi4py import MPI

from attrito.library.session import Solver
from attrito.results.curve import Curve, curve_of, points_along, stretches
from attrito.results.result import Result

MONITORS = ("x_amplitude", "y_amplitude")


def sweep(folder: Path, **continuation: object) -> list[dict[str, str]]:
    """The wedge over its resonance; the points."""
    run(folder, swept(wedge(), 145.0, 100.0, **continuation))
    return table(folder)


def listed(job: Job, frequencies: np.ndarray) -> Job:
    """The job at frequencies, one by one."""
    job["sweep"] = {"frequencies_hz": frequencies.tolist()}
    return job


def test_the_drawn_curve_meets_listed_frequencies_within_its_tolerance(tmp_path):
    points = sweep(tmp_path)
    drawn = table(tmp_path, "--curve", "2000")
    frequency = np.array([float(row["frequency_hz"]) for row in drawn])
    assert np.all(np.diff(frequency) < 0), "the branch turns: the test is void"
    # From high frequencies to low ones, as the sweep: which of several solutions is found depends on the way.
    asked = np.linspace(144.0, 101.0, 120)
    folder = tmp_path / "listed"
    folder.mkdir()
    run(folder, listed(wedge(), asked))
    truth = table(folder)
    assert len(points) < len(truth) / 2
    for name in MONITORS:
        true = np.array([float(row[name]) for row in truth])
        curve = np.array([float(row[name]) for row in drawn])
        off = np.abs(np.interp(asked, frequency[::-1], curve[::-1]) - true)
        # Between rows the line is straight: 2000 of them leave a thousandth of the tolerance.
        assert off.max() <= 0.01 * true.max()


def test_a_point_lies_at_the_peak(tmp_path):
    points = sweep(tmp_path)
    drawn = table(tmp_path, "--curve", "5000")
    for name in MONITORS:
        largest = max(float(row[name]) for row in drawn)
        # A tenth of the tolerance, 0.01, and what the drawn curve itself may be off by there, a point being near.
        assert max(float(row[name]) for row in points) >= (1 - 0.002) * largest


def test_the_table_of_the_curve_has_as_many_rows_as_are_asked_for(tmp_path):
    points = sweep(tmp_path)
    done = attrito(tmp_path, "table", "result.h5", "--curve", "77")
    header, *rows = done.stdout.splitlines()
    assert header == "level,branch,frequency_hz,x_amplitude,y_amplitude"
    assert len(rows) == 77
    first, last = (rows[0].split(","), rows[-1].split(","))
    assert [first[0], first[1], first[2]] == ["1", "0", "145"]
    assert last[2] == "100"
    assert [first[3], last[3]] == [points[0]["x_amplitude"], points[-1]["x_amplitude"]]


def test_fewer_rows_than_ends_are_refused(tmp_path):
    sweep(tmp_path)
    done = attrito(tmp_path, "table", "result.h5", "--curve", "1")
    assert done.returncode == 2
    assert "--curve" in done.stderr
    assert "at least 2" in done.stderr


def test_a_tolerance_beyond_its_range_is_refused(tmp_path):
    done = attrito(tmp_path, "run", write_job(tmp_path, swept(wedge(), 145.0, 100.0, curve_tolerance=0.0)))
    assert done.returncode == 2
    assert "curve_tolerance" in done.stderr


def test_a_finer_curve_takes_more_points(tmp_path):
    coarse, fine = (len(sweep(tmp_path, curve_tolerance=tolerance)) for tolerance in (0.01, 1e-4))
    # The error goes with the fourth power of the step, with less where friction begins.
    assert 1.5 * coarse < fine < 10 * coarse


def test_the_curve_is_the_same_on_ranks(tmp_path):
    found = []
    for ranks in (1, 2):
        run(tmp_path, swept(wedge(), 145.0, 100.0), ranks=ranks)
        with h5py.File(tmp_path / "result.h5") as file:
            found.append(
                [file[path][()] for path in ("points/path", "points/tangent_hz", "monitors/x/tangent")]  # fmt: skip
            )
    for one, two in zip(*found, strict=True):
        assert one == pytest.approx(two, rel=1e-6, abs=1e-9 * np.abs(one).max())


def test_listed_frequencies_are_joined_by_straight_lines(tmp_path):
    run(tmp_path, listed(wedge(), np.array([140.0, 120.0, 110.0])))
    rows = [float(row["x_amplitude"]) for row in table(tmp_path, "--curve", "5")]
    points = [float(row["x_amplitude"]) for row in table(tmp_path)]
    halves = [points[0], np.mean(points[:2]), points[1], np.mean(points[1:]), points[2]]
    assert rows == pytest.approx(halves, rel=1e-9)


def test_a_cubic_is_met_exactly_and_a_stretch_without_tangents_is_straight():
    s = np.array([0.0, 2.0, 3.0, 3.0])
    values, rates = np.array([s, 1 + s**3]), np.array([np.ones(4), 3 * s**2])
    curve = Curve(values, rates, s, ["x"])
    assert curve.at(np.array([0.0, 0.25, 1.5, 2.0])) == pytest.approx(
        np.array([[0.0, 0.5, 2.5, 3.0], [1.0, 1.125, 16.625, 28.0]])
    )
    # The last two have the same path: no tangent was found between.
    values[:, 3] = [4.0, 30.0]
    assert curve.at(np.array([2.5]))[:, 0] == pytest.approx([3.5, 29.0])


def test_rows_are_shared_out_over_stretches(tmp_path):
    job = swept(wedge(), 145.0, 130.0)
    job["sweep"]["levels"] = [1.0, 1.5]
    run(tmp_path, job)
    with Result(tmp_path / "result.h5") as result:
        runs = stretches(result)
        assert len(runs) == 2
        places = points_along(result, 100)
        assert len(places) == 100
        assert {run[0] for run in runs} | {run[-1] for run in runs} <= set(places.tolist())
        assert np.isfinite(curve_of(result).at(places)).all()


@pytest.mark.parametrize(("seed", "tangents"), [(240858518, 1), (105, 2)])
def test_a_branch_in_pieces_is_followed_in_a_bounded_number_of_tries(seed, tangents):
    # Short steps lead as far away as long ones: at the end of a branch, and where samples leave it in pieces.
    scene, ends = verdicts.random_scene(np.random.default_rng([seed, tangents]), tangents)
    with Solver(MPI.COMM_SELF, scene, verdicts.options()) as solver:
        solver.follow_static_path(verdicts.PATH, verdicts.STATIC_STEPS, ends["start_hz"])
        points = list(solver.sweep(ends["start_hz"], ends["stop_hz"], 1.0, 0, 60))
    assert all(point.outcome in ("converged", "above_tolerance") for point in points)
    # Some thirty tries of a step, thirty iterations each, are the most that a point takes. One that begins a branch
    # has the iterations of the search, and of the way back to there.
    assert max(b.iterations for a, b in itertools.pairwise(points) if a.branch == b.branch) < 1000


def test_bifurcations_of_a_branch_in_pieces_are_looked_for_at_frequencies_that_exist():
    # The plane across an arc between two pieces meets motions of negative frequency, which have no period to march.
    scene, ends = verdicts.random_scene(np.random.default_rng([85082048, 1]), 1)
    points = verdicts.sweep(scene, **ends, most=150, orbit="auto")
    assert len(points) == 150 and all(one.point.frequency_hz > 0.0 for one in points)
