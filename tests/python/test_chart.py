"""A chart tells error against cost of all ways to solve a job's scene."""

from __future__ import annotations

import csv
import io

import h5py
import mode_jobs
import numpy as np
import pytest
from figures import line
from jobs import attrito_here, wedge, write_job

from attrito.charts import modes
from attrito.charts import run as chart
from attrito.charts.file import SERIES, Chart, Way, stored_table, table, write
from attrito.charts.flank import up_the_flank
from attrito.charts.plot import LEAST_ERROR
from attrito.charts.turns import in_turn
from attrito.support.errors import NumericsError


@pytest.fixture
def few_ways(monkeypatch):
    """Short ladders; what they hold is the same."""
    ladders = {
        "HARMONICS": (1, 5, 20),
        "TOLERANCES": (1e-2,),
        "STEPS": (32, 128),
        "SCHEMES": ("newmark", "event"),
    }
    for name, values in ladders.items():
        monkeypatch.setattr(chart, name, values)


def rubbing_wedge(**balance) -> dict:
    return wedge(force=14.0) | {"balance": balance, "sweep": {"start_hz": 140.0, "stop_hz": 110.0}}


def test_a_chart_is_a_table_a_picture_and_data_that_describe_themselves(tmp_path, capfd, few_ways, written):
    write_job(tmp_path, rubbing_wedge(tolerance=1e-3))
    done = attrito_here(tmp_path, capfd, "chart", "job.toml", "-o", "wedge.h5")
    assert done.returncode == 0
    assert "reference: " in done.stderr
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert attrito_here(tmp_path, capfd, "table", "wedge.h5").stdout == done.stdout
    error = {(row["series"], row["setting"]): float(row["error"]) for row in rows if row["error"]}
    # More harmonics or steps are nearer; the mean that is frozen keeps its error.
    assert error["event", "H = 1"] > error["event", "H = 5"] > error["event", "H = 20"]
    assert error["integration", "newmark, 32 steps"] > error["integration", "newmark, 128 steps"]
    assert error["uncoupled", "H = 20"] > 100.0 * error["event", "H = 20"]
    # Event-exact integration is another method, and comes to the same motion.
    assert error["events in time", "exact"] < 1e-6
    for row in rows:
        if row["series"] == "tolerance":
            assert float(row["error"]) < float(row["tolerance"])
    chosen = [row for row in rows if row["chosen"] == "true"]
    assert [float(row["tolerance"]) for row in chosen] == [1e-3]
    # Each way that has an error is a mark in either panel, those by events above and right of none below the reference.
    (figure,) = written
    *panels, drawn = figure.axes
    for axes, cost in zip(panels, ("seconds", "work"), strict=True):
        ways = [(float(row[cost]), float(row["error"])) for row in rows if row["series"] == "event" and row["error"]]
        x, y = line(axes, SERIES["event"]).get_data()
        assert y == pytest.approx([max(error, LEAST_ERROR) for _, error in ways], rel=1e-5)
        assert x == pytest.approx([seconds for seconds, _ in ways], rel=1e-3)
    # More points draw a curve that is nearer, and are in a panel of their own; they are no way to find the peak.
    curves = [row for row in rows if row["series"] == "curve"]
    assert [float(row["setting"]) for row in curves] == sorted((float(row["setting"]) for row in curves), reverse=True)
    number, distance = ([float(row[name]) for row in curves] for name in ("points", "error"))
    assert number == sorted(number) and distance[0] > distance[-1]
    assert all(d <= float(row["tolerance"]) for d, row in zip(distance, curves, strict=True))
    assert line(drawn, SERIES["curve"]).get_data()[0] == pytest.approx(number)
    assert not any(row["efficient"] == "true" for row in curves)
    assert attrito_here(tmp_path, capfd, "plot", "wedge.h5", "-o", "again.png").returncode == 0
    again = line(written[1].axes[1], SERIES["event"])
    assert again.get_data()[0] == pytest.approx(x, rel=1e-12)
    with h5py.File(tmp_path / "wedge.h5") as file:
        assert file.attrs["format"] == "attrito chart"
        assert len(file["error"]) == len(rows)
        assert all({"description", "unit"} <= set(file[name].attrs) for name in file)
        assert file["error"][:] == pytest.approx([float(row["error"] or "nan") for row in rows], rel=1e-5, nan_ok=True)


def test_work_is_counted_without_the_static_path_and_grows_with_harmonics(tmp_path, few_ways):
    path = tmp_path / write_job(tmp_path, rubbing_wedge())
    found = {way.label: way.work for way in chart.chart_job(str(path), 5.0).ways if way.series == "event"}
    # A contact by events counts 168 k^2, an elimination at most (2/3) (2 k)^3, k = 2 H + 1, for each iteration.
    assert found["H = 20"] > 168.0 * 41**2
    assert 9.0 < found["H = 20"] / found["H = 5"] < (41 / 11) ** 3 * 3.0


def test_an_uncoupled_job_is_charted_against_the_coupled_balance(tmp_path, few_ways, monkeypatch):
    for ladder in ("TOLERANCES", "SCHEMES"):
        monkeypatch.setattr(chart, ladder, ())
    monkeypatch.setattr(chart, "HARMONICS", (20,))
    path = tmp_path / write_job(tmp_path, rubbing_wedge(approach="uncoupled"))
    error = {way.series: way.error for way in chart.chart_job(str(path), 5.0).ways}
    # A wall at 45 degrees: the mean that is frozen costs percents, the series at hand less than its tolerance.
    assert error["uncoupled"] > 0.01 > error["tolerance"] > error["event"]


def test_steps_get_no_shorter_after_a_run_that_takes_too_long_but_do_after_one_that_fails(
    tmp_path, few_ways, monkeypatch
):
    monkeypatch.setattr(chart, "TOLERANCES", ())
    monkeypatch.setattr(chart, "HARMONICS", (5,))
    path = tmp_path / write_job(tmp_path, rubbing_wedge())

    def steps_tried(seconds):
        return [way.steps for way in chart.chart_job(str(path), seconds).ways if way.series == "integration"]

    def fail(self, run):
        raise NumericsError("these steps take it nowhere")

    # The time of the whole chart is spent from the start: each series has its first way all the same.
    assert steps_tried(1e-9) == [32]
    monkeypatch.setattr(chart.Integrator, "run", fail)
    assert steps_tried(5.0) == [32, 128]


def test_a_chart_that_is_stopped_keeps_what_there_is(tmp_path, few_ways):
    path = str(tmp_path / write_job(tmp_path, rubbing_wedge()))
    kept = []

    def keep(found):
        kept.append(table(found))
        write(found, str(tmp_path / "part.h5"), path)
        if len(kept) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        chart.chart_job(path, 5.0, keep=keep)
    assert stored_table(str(tmp_path / "part.h5")) == kept[-1]
    # A line of names, the ways by tolerance, and three more.
    assert kept[-1].count("\n") == kept[0].count("\n") + 2


def test_the_fixed_harmonics_of_a_job_are_its_own_way(tmp_path, few_ways):
    path = str(tmp_path / write_job(tmp_path, rubbing_wedge(harmonics=5)))
    ways = chart.chart_job(path, 5.0).ways
    assert [(way.series, way.label) for way in ways if way.own] == [("event", "H = 5")]


def test_series_take_turns_until_the_time_is_spent():
    gone = []

    def ways(name, count):
        for i in range(count):
            gone.append(name)
            yield Way(name, str(i))

    series = [ways("a", 3), ways("b", 1)]
    assert [way.series + way.label for way in in_turn(series, lambda: len(gone) > 2)] == ["a0", "b0", "a1"]
    # Each has its first way however late it is.
    series = [iter([Way(name, "0"), Way(name, "1")]) for name in "ab"]
    assert [way.series for way in in_turn(series, lambda: True)] == ["a", "b"]


def test_frequencies_lead_up_the_flank_to_the_peak_and_one_way():
    # A branch that folds: the parts above a half are beyond the turning point at 13.
    frequency = np.array([10.0, 11.0, 12.0, 13.0, 12.5, 12.2, 12.0])
    amplitude = np.array([0.01, 0.1, 0.3, 0.6, 0.95, 1.0, 0.2])
    assert up_the_flank(9.0, frequency, amplitude) == [9.0, 11.0, 12.0, 12.2]
    assert up_the_flank(10.0, frequency, amplitude[::-1] * 0 + [1.0, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0]) == [10.0]


def test_a_chart_without_a_reference_says_so(tmp_path, few_ways, monkeypatch):
    solve = chart.Bench._solve

    def lost(self, scene, options):
        seconds, points = solve(self, scene, options)
        return seconds, [point._replace(outcome="not_converged") for point in points]

    monkeypatch.setattr(chart.Bench, "_solve", lost)
    path = tmp_path / write_job(tmp_path, rubbing_wedge())
    with pytest.raises(NumericsError, match="the reference, .* harmonics, has no solution"):
        chart.chart_job(str(path), 5.0)


def test_the_efficient_front_holds_what_nothing_beats():
    costs = [(1.0, 1e-1), (2.0, 1e-2), (3.0, 5e-2), (4.0, 1e-3), (np.nan, 1e-9), (5.0, np.nan)]
    ways = [Way("event", "", error=error, seconds=seconds) for seconds, error in costs]
    found = Chart(ways, {}, "", "", ways[0]).efficient()
    assert found.tolist() == [True, True, False, True, False, False]


def test_a_scene_without_some_coordinates_is_that_of_the_others():
    from attrito_verification.paper.wedge import PARAMETER_SETS, wedge_scene

    whole = wedge_scene(next(iter(PARAMETER_SETS.values())), 45.0)
    part = chart.restricted(whole, np.array([0]))
    assert part.stiffness == pytest.approx(whole.stiffness[:1, :1], rel=0.0)
    assert part.directions == pytest.approx(whole.directions[:, :1], rel=0.0)


def test_a_chart_of_no_job_is_a_fault_of_the_input(tmp_path, capfd):
    done = attrito_here(tmp_path, capfd, "chart", "missing.toml")
    assert done.returncode == 2
    assert "missing.toml: file = " in done.stderr


@pytest.mark.parametrize("method, own", [("epmc", "H = 3"), ("quasi_static", "24 steps")])
def test_a_mode_is_charted_by_both_methods(tmp_path, capfd, monkeypatch, written, method, own):
    monkeypatch.setattr(modes, "HARMONICS", (1, 5, 20))
    monkeypatch.setattr(modes, "STEPS", (16, 64))
    job = mode_jobs.rubbing(harmonics=3)
    job["mode"] |= {"method": method, "steps": 24, "points": 6}
    write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "chart", "job.toml", "--mode", "-o", "mode.h5")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    error = {row["setting"]: float(row["error"]) for row in rows}
    assert error["H = 1"] > error["H = 5"] > error["H = 20"] > 0.0
    # One mass on one element: a loop has the same corners with any number of steps, and one harmonic is all it lacks.
    assert error["64 steps"] == pytest.approx(error["16 steps"], rel=1e-6)
    assert 0.1 > error["64 steps"] > error["H = 1"]
    assert [row["setting"] for row in rows if row["chosen"] == "true"] == [own]
    (figure,) = written
    assert figure.axes[0].get_ylabel() == "Relative error of frequency and damping"
    with h5py.File(tmp_path / "mode.h5") as file:
        assert file.attrs["amplitude"] == job["mode"]["stop"] and file.attrs["reference_harmonics"] == modes.FINEST


def test_a_mode_that_a_way_loses_is_noted_and_one_without_a_reference_ends_the_chart(tmp_path, monkeypatch):
    monkeypatch.setattr(modes, "HARMONICS", (1, 5))
    monkeypatch.setattr(modes, "STEPS", ())
    path = str(tmp_path / write_job(tmp_path, mode_jobs.rubbing()))
    follow, lost = modes.ModeBench._follow, []

    def lose(self, method, options, steps=0):
        seconds, work, found = follow(self, method, options, steps)
        if options.harmonics in lost:
            found[:, -2:] = np.nan
        return seconds, work, found

    monkeypatch.setattr(modes.ModeBench, "_follow", lose)
    lost[:] = [1]
    noted = {way.label: way.note for way in modes.chart_mode(path, 5.0).ways}
    assert noted["H = 1"].startswith("lost at amplitude 0.012") and not noted["H = 5"]
    lost[:] = [modes.FINEST]
    with pytest.raises(NumericsError, match="the reference, .* harmonics, loses the mode"):
        modes.chart_mode(path, 5.0)
