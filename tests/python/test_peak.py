"""Peaks followed without sweeps: closed form, swept peaks, the paper's optimisation curve, similarity, the command."""

from __future__ import annotations

import csv
import io
from types import SimpleNamespace

import campaign_estimates
import campaign_scenes
import h5py
import jobs
import numpy as np
import peaks
import peaks_scenes
import pytest
from bench_library import evaluations
from edited import edited
from figures import marks
from mpi4py import MPI
from rubbing_mass import DAMPING, element, jenkins
from scipy.optimize import brentq, minimize_scalar

from attrito.library.integrator import Integrator, Run
from attrito.library.names import OUTCOMES
from attrito.library.peak_tracker import PeakTracker
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks import run as peaking
from attrito.peaks.curve import Found, ending_of, jumps
from attrito.peaks.file import read_peaks
from attrito.peaks.first import find
from attrito.peaks.plot import peak_curve
from attrito.peaks.run import follow
from attrito.support.errors import NumericsError
from attrito_verification.paper.wedge import BAND, FORCES, PARAMETER_SETS, PRELOAD, Wedge


def closed_form(force: float) -> tuple[float, float]:
    """Peak amplitude and omega of the mass with one harmonic, by the describing function of the Jenkins element."""

    def omega_of(amplitude: float) -> float:
        # The largest force-to-amplitude ratio's minimum over omega: d/domega of (K - omega^2)^2 + (c omega + L)^2.
        stiffness, loss = element(amplitude)
        square = 1.0 + stiffness
        return brentq(
            lambda w: -4.0 * w * (square - w * w) + 2.0 * DAMPING * (DAMPING * w + loss), 0.5 * square**0.5, square**0.5
        )

    def excess(amplitude: float) -> float:
        stiffness, loss = element(amplitude)
        w = omega_of(amplitude)
        return amplitude * np.hypot(1.0 + stiffness - w * w, DAMPING * w + loss) - force

    amplitude = brentq(excess, 1e-3, 1e3, xtol=1e-14, rtol=1e-14)
    return amplitude, omega_of(amplitude)


def test_peaks_of_a_mass_that_rubs_are_those_of_the_describing_function():
    with Solver(MPI.COMM_SELF, jenkins(), Options(harmonics=1, tolerance=1e-12)) as solver:
        solver.follow_static_path(np.array([[1.0]]), 1, 0.2)
        tracker = PeakTracker(solver, 0, "first_harmonic", (0.13, 0.25), np.ones(1))
        peak = tracker.begin(0.01, tracker.linear_peak_hz())
        # At 1.4 the peak is hardly above what friction alone holds, 4/pi; it stays a peak.
        for force in (0.01, 0.2, 0.7, 1.2, 1.5, 3.0):
            peak = tracker.at(force)
            amplitude, omega = closed_form(force)
            assert peak.outcome == "converged" and peak.curvature < 0.0
            # Newton's method ends at 1e-12 of the response and 1e-7 of the band: of second order in the amplitude.
            assert peak.amplitude == pytest.approx(amplitude, rel=1e-10)
            assert 2.0 * np.pi * peak.frequency_hz == pytest.approx(omega, rel=1e-7)


def evaluations_of_swept_peaks(wedge: Wedge) -> int:
    """Of the eight frequency responses of the paper's forces and the location of their peaks, static path left out."""
    count = 0
    for force in FORCES:
        with wedge._solver() as solver:
            before = evaluations(solver)
            grid = np.linspace(*BAND)
            response = [point.amplitude[0] for point in solver.solve_at(grid.tolist(), force, 0)]
            largest = int(np.argmax(response))
            minimize_scalar(
                lambda f, solver=solver, force=force: -next(solver.solve_at([f], force, 0)).amplitude[0],
                bounds=(grid[largest + 1], grid[largest - 1]),
                method="bounded",
                options={"xatol": 1e-6},
            )
            count += evaluations(solver) - before
    return count


def curve_job(**keys) -> dict:
    """What `follow` asks of a job."""
    peak = {"parameter": "level", "start": FORCES[0], "stop": FORCES[-1], "values": list(FORCES[1:-1]), "level": 1.0}
    peak |= {"monitor": None, "amplitude": "half_range", "near_hz": None, "optimum": True, "max_points": 200}
    sweep = {"frequencies_hz": None, "start_hz": BAND[0], "stop_hz": BAND[1]}
    return dict(peak=peak | keys, sweep=sweep, static={"steps": 20})


@pytest.mark.parametrize("degrees", [0.0, 45.0])
def test_the_optimisation_curve_is_that_of_swept_peaks_at_a_twentieth_of_the_evaluations(degrees):
    wedge = Wedge(PARAMETER_SETS["unrounded"], degrees, "C", 5)
    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, BAND[1])
        on_the_static_path = evaluations(solver)
        found = list(follow(solver, curve_job(optimum=False), wedge.scene, np.array([[0.0], [1.0]])))
        count = evaluations(solver) - 2 * on_the_static_path
    at = {round(one.peak.parameter, 9): one.peak for one in found if one.kind == "value"}
    for force in FORCES:
        swept = wedge.peak(force)
        assert at[force].curvature < 0.0
        # Swept peaks are located to 1e-6 Hz, the maximum being flat; both balances end at 1e-12 of the stuck response.
        assert at[force].response == pytest.approx(swept.response, rel=1e-9)
        assert at[force].frequency_hz == pytest.approx(swept.frequency_hz, abs=1e-4)
    assert 20 * count <= evaluations_of_swept_peaks(wedge)


def test_the_least_peak_on_the_level_wall_is_that_of_the_paper():
    wedge = Wedge(PARAMETER_SETS["unrounded"], 0.0, "C", 5)
    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        found = list(follow(solver, curve_job(values=[]), wedge.scene, np.array([[0.0], [1.0]])))
    best = [one.peak for one in found if one.kind == "optimum"]
    assert len(best) == 1
    assert best[0].response == pytest.approx(7.044e-6, abs=2e-9)
    assert PRELOAD / best[0].level == pytest.approx(20.2, abs=0.2)
    parameters = [one.peak.parameter for one in found]
    assert parameters == sorted(parameters)


def test_followed_in_the_preload_the_peak_is_that_in_the_level_by_similarity():
    wedge = Wedge(PARAMETER_SETS["unrounded"], 0.0, "C", 5)
    path = np.array([[0.0], [1.0]])
    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        job = curve_job(parameter="preload", start=2.0, stop=0.5, values=[1.0], level=24.0)
        by_preload = [one for one in follow(solver, job, wedge.scene, path) if one.kind == "value"]
    with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
        tracker = find(solver, curve_job(), wedge.scene, path, 12.0).tracker
        for one in by_preload:
            # Twice all loads is twice the motion.
            level = 24.0 / one.peak.parameter
            assert one.peak.amplitude == pytest.approx(one.peak.parameter * tracker.at(level).amplitude, rel=1e-9)


def test_a_peak_of_a_contact_with_two_tangents_is_the_swept_one():
    scene = jenkins()
    laws = scene.laws | {"tangents": np.full(1, 2, dtype=np.int32), "tangential_stiffness": np.full(1, 0.02)}
    harmonic = np.zeros((3, 3))
    harmonic[1, 0], harmonic[2, 1] = 1.0, 0.4
    scene = ReducedScene(
        np.eye(3),
        np.diag([1.0, 1.1, 1.0]),
        "viscous",
        0.0,
        0.1 * np.eye(3),
        laws,
        np.eye(3),
        np.array([[0.0, 0.0, 1.0]]),
        harmonic,
        np.array([[1.0, 0.0, 0.0]]),
        ["x"],
    )
    options = Options(harmonics=3, samples=128, tolerance=1e-12)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.array([[1.0]]), 1, 0.2)
        tracker = PeakTracker(solver, 0, "half_range", (0.13, 0.25), np.ones(1))
        tracker.begin(0.01, tracker.linear_peak_hz())
        peak = tracker.at(10.0)
        assert peak.outcome == "converged" and peak.curvature < 0.0 and peak.point.states[2] == 1
        swept = minimize_scalar(
            lambda f: -next(solver.solve_at([f], 10.0, 0)).amplitude[0],
            bounds=(peak.frequency_hz - 0.003, peak.frequency_hz + 0.003),
            method="bounded",
            options={"xatol": 1e-8},
        )
    # Located to 1e-7 of the frequency here and 1e-8 Hz there; the amplitude is flat.
    assert peak.amplitude == pytest.approx(-swept.fun, rel=1e-8)


def test_the_command_writes_file_table_and_picture(tmp_path, capfd, written):
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, jobs.peak_of_wedge()))
    assert done.returncode == 0, done.stderr
    last = "Result: result.peaks.h5; picture: result.peaks.png. Table: attrito table result.peaks.h5"
    assert done.stdout.splitlines()[-1] == last
    rows = list(csv.DictReader(io.StringIO(jobs.attrito_here(tmp_path, capfd, "table", "result.peaks.h5").stdout)))
    rows = [row for row in rows if row["outcome"] == "converged"]
    assert {"6", "12", "20"} <= {row["level"] for row in rows}
    data, attributes = read_peaks(str(tmp_path / "result.peaks.h5"))
    assert attributes["parameter"] == "level" and len(data["level"]) == len(rows)
    (figure,) = written
    for axes, name in zip(figure.axes, ("response", "frequency_hz"), strict=True):
        asked = marks(axes, "o")
        assert {6.0, 12.0, 20.0} <= set(asked[:, 0])
        heights = dict(zip(data["level"], data[name], strict=True))
        assert asked[:, 1].tolist() == [heights[level] for level in asked[:, 0]]
    with h5py.File(tmp_path / "result.peaks.h5") as file:
        named: list[str] = []
        file.visititems(lambda name, item: named.append(name) if isinstance(item, h5py.Dataset) else None)
        assert all(file[name].attrs["description"] and file[name].attrs["unit"] for name in named)


def test_peaks_before_a_failure_are_written(tmp_path, capfd, monkeypatch):
    follow = peaking.follow

    def follow_and_fail(*arguments):
        for count, one in enumerate(follow(*arguments)):
            if count == 2:
                raise NumericsError("PETSc failed")
            yield one

    monkeypatch.setattr(peaking, "follow", follow_and_fail)
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, jobs.peak_of_wedge()))
    assert done.returncode == 1 and "PETSc failed" in done.stderr
    data, _ = read_peaks(str(tmp_path / "result.peaks.h5"))
    assert len(data["level"]) == 2 and (tmp_path / "result.peaks.png").exists()
    with edited(tmp_path / "result.peaks.h5") as file:
        file["peaks/outcome"][...] = OUTCOMES.index("not_converged")
    drawn = peak_curve(str(tmp_path / "result.peaks.h5"))
    assert "no peak was found" in [text.get_text() for text in drawn.axes[0].texts] and not drawn.axes[0].get_legend()


def test_ranks_find_the_same_peaks(tmp_path):
    made = jobs.peak_of_wedge()
    made["contact"] = made["contact"] * 2
    for contact in made["contact"]:
        contact["tangential_stiffness"] = contact["normal_stiffness"] = 1.5e5
    found = []
    for ranks in (None, 2):
        done = jobs.attrito(tmp_path, "peak", jobs.write_job(tmp_path, made), ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        found.append(read_peaks(str(tmp_path / "result.peaks.h5"))[0])
    # Sums over ranks differ in rounding; the balance ends at 1e-10 of the response.
    assert np.allclose(found[0]["amplitude"], found[1]["amplitude"], rtol=1e-8, atol=0.0)


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"stop": 1.0}, "[peak] stop = 1.0: expected a value other than start"),
        ({"start": None}, "[peak] start is missing"),
        ({"monitor": "z"}, "[peak] monitor = 'z': expected one of x"),
        ({"level": 2.0}, "[peak] level = 2.0: expected no such key"),
    ],
)
def test_a_fault_of_the_peaks_keys_is_told(tmp_path, capfd, keys, key):
    made = jobs.peak_of_wedge(**keys)
    made["peak"] = {name: value for name, value in made["peak"].items() if value is not None}
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, made))
    assert done.returncode == 2 and key in done.stderr


def test_an_uncoupled_balance_cannot_follow_the_preload(tmp_path, capfd):
    made = jobs.peak_of_wedge(parameter="preload")
    made["balance"] = made.get("balance", {}) | {"approach": "uncoupled"}
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, made))
    assert done.returncode == 2 and "[peak] parameter = 'preload'" in done.stderr


def test_a_peak_that_jumps_has_no_optimum_between(monkeypatch):
    # Back from beyond the jump the tracker stays on the other curve, whose slope has one sign at both ends.
    def smooth(value: float) -> SimpleNamespace:
        return SimpleNamespace(parameter=value, outcome="converged", at_corner=False)

    tracker = SimpleNamespace(parameter="level", at=smooth)
    monkeypatch.setattr(peaking, "elasticity", lambda peak, parameter: peak.parameter)
    assert peaking.locate_optimum(tracker, tracker.at(1.0), tracker.at(2.0)) is None
    monkeypatch.setattr(peaking, "elasticity", lambda peak, parameter: peak.parameter - 1.5)
    assert peaking.locate_optimum(tracker, tracker.at(1.0), tracker.at(2.0)).parameter == pytest.approx(1.5, rel=1e-6)


def rubbing_chain(contacts: int) -> ReducedScene:
    """Six masses in a row, free along it and across, on which contacts of different stiffness and friction press."""
    draw = np.random.default_rng(0)
    masses = 6
    row = 20.0 * (2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    row[0, 0], row[-1, -1] = 21.0, 20.0
    stiffness = np.kron(np.eye(2), row)
    directions = np.zeros((2 * contacts, 2 * masses))
    for contact, mass in enumerate(draw.integers(0, masses, contacts)):
        directions[2 * contact, mass] = directions[2 * contact + 1, masses + mass] = 1.0
    laws = {"tangents": np.ones(contacts, dtype=np.int32), "gap": np.zeros(contacts), "preload": np.zeros(contacts)}
    laws |= {"tangential_stiffness": draw.uniform(0.6, 3.0, contacts) / contacts}
    laws |= {"normal_stiffness": draw.uniform(1.5, 6.0, contacts) / contacts}
    laws |= {"friction_coefficient": draw.uniform(0.2, 0.6, contacts)}
    press = np.zeros((1, 2 * masses))
    press[0, masses:] = draw.uniform(0.2, 2.0, masses) / masses
    harmonic = np.zeros((3, 2 * masses))
    harmonic[1, masses - 1], harmonic[1, 2 * masses - 1] = 1.0, 0.15
    monitor = np.eye(2 * masses)[masses - 1 : masses]
    damping = 0.01 * np.eye(2 * masses)
    return ReducedScene(
        np.eye(2 * masses), stiffness, "viscous", 0.0, damping, laws, directions, press, harmonic, monitor, ["x"]
    )


@pytest.mark.parametrize(
    "keys",
    [
        {"start": 0.05, "stop": 5.0, "values": [0.2, 1.0]},
        {"start": 5.0, "stop": 0.05, "values": [0.2, 1.0]},
        {"parameter": "preload", "start": 0.1, "stop": 10.0, "values": [1.0], "level": 0.5},
        {"parameter": "preload", "start": 10.0, "stop": 0.1, "values": [1.0], "level": 0.5},
    ],
)
def test_a_peak_arrives_where_contacts_begin_to_slip_one_after_another(keys):
    scene, path = rubbing_chain(12), np.array([[0.0], [1.0]])
    job = curve_job(**keys) | {"sweep": {"frequencies_hz": None, "start_hz": 0.05, "stop_hz": 0.5}}
    options = Options(harmonics=3)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        found = list(follow(solver, job, scene, path))
    assert all(one.converged and one.peak.curvature < 0.0 for one in found)
    parameters = [one.peak.parameter for one in found]
    assert parameters == sorted(parameters, reverse=keys["stop"] < keys["start"])
    assert (parameters[0], parameters[-1]) == (keys["start"], keys["stop"])
    (one,) = [one.peak for one in found if one.peak.parameter == 1.0]
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(path, 10, 0.05)
        nearby = one.frequency_hz * np.linspace(0.98, 1.02, 81)
        swept = max(point.amplitude[0] for point in solver.solve_at(nearby.tolist(), one.level, 0))
    # The nearest of these frequencies is 2.5e-4 off at most: 3 % of half the bandwidth, half of whose square is 5e-4.
    assert swept == pytest.approx(one.amplitude, rel=5e-4) and swept <= one.amplitude * (1.0 + 1e-6)


@pytest.mark.parametrize("way", ["level_up", "preload_down"])
def test_a_peak_of_a_strip_that_is_partly_open_at_rest_arrives_within_its_band(way):
    # Three of twelve contacts are open at rest, so that the stuck resonance is none of this strip: from there Newton's
    # method came to a peak at 5338 Hz, beyond the band. Downwards in preload the first peak is at a corner.
    scene = peaks_scenes.make(1, 6)
    job = peaks.keys_of(scene, way)
    with Solver(MPI.COMM_SELF, scene.reduced, Options(harmonics=5)) as solver:
        solver.follow_static_path(peaks.PATH, 10, scene.band_hz[0])
        assert solver.closed_contacts().sum() == 9, "the test is void unless contacts are open at rest"
        found = list(follow(solver, job, scene.reduced, peaks.PATH))
    assert all(one.converged for one in found)
    assert [found[0].peak.parameter, found[-1].peak.parameter] == [job["peak"]["start"], job["peak"]["stop"]]
    low, high = scene.band_hz
    assert all(low <= one.peak.frequency_hz <= high for one in found)


@pytest.mark.parametrize("number", [245, 246])
def test_a_broad_peak_that_is_swept_for_has_the_frequency_of_its_maximum(number):
    # When sweep and climb end next to nothing of the amplitude is left to be gained, but the top is so flat that the
    # maximum was up to 8e-5 of the frequency away. Newton's method from there on has it to 1e-7 of half the width.
    scene = campaign_scenes.make(20261128, number)
    with campaign_estimates.Series(scene, 5, 128) as series:
        tracker = series.tracker
        peak = tracker.begin(1.0, tracker.linear_peak_hz())
        near = [peak.frequency_hz * (1.0 + part) for part in (-1e-4, 0.0, 1e-4)]
    with campaign_estimates.Series(scene, 5, 128) as series:
        low, top, high = (point.amplitude[0] for point in series.solver.solve_at(near, 1.0, 0))
    assert not peak.at_corner
    vertex = 0.5 * (high - low) / (2.0 * top - low - high)
    assert vertex == pytest.approx(0.0, abs=0.1), "of the parabola through three points, in steps of 1e-4"


def test_a_peak_at_a_corner_is_said_to_be_one_and_falls_on_either_side():
    scene = peaks_scenes.make(1, 6)
    job = peaks.keys_of(scene, "preload_down")
    with Solver(MPI.COMM_SELF, scene.reduced, Options(harmonics=5)) as solver:
        peak = next(follow(solver, job, scene.reduced, peaks.PATH)).peak
        state = solver.save_state()
        falls = []
        for step in (1e-5, 1e-4, -1e-5, -1e-4):
            solver.load_state(state)
            (point,) = solver.solve_at([peak.frequency_hz * (1.0 + step)], peak.level, 0)
            falls.append(1.0 - point.amplitude[0] / peak.amplitude)
    assert peak.at_corner and np.isnan(peak.slope) and np.isnan(peak.curvature)
    # Of a smooth peak ten times the way makes a hundred times the fall. What the peak lacks is 1e-9.
    assert min(falls) > 1e-8
    assert 5.0 < falls[1] / falls[0] < 20.0 and 5.0 < falls[3] / falls[2] < 20.0


@pytest.mark.parametrize("way", ["preload_down", "level_up"])
def test_a_peak_along_two_tangents_has_one_maximum(way):
    # A wedge whose forces by samples have corners where these begin to slip, and several maxima within 1 %.
    scene = peaks_scenes.make(1, 15)
    job = peaks.keys_of(scene, way)
    options = Options(harmonics=5)
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        curve = follow(solver, job, scene.reduced, peaks.PATH)
        peak = next(one for one in curve if one.peak.parameter == job["peak"]["values"][0]).peak
        state = solver.save_state()
    # Listed frequencies about it, sliders going on from the peak's, 1 % to either side.
    offsets = np.linspace(0.0, 0.01, 41)
    heights = []
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        preload = peak.parameter if way.startswith("preload") else 1.0
        solver.follow_static_path(peaks.PATH * preload, peaks.STATIC_STEPS, scene.band_hz[0])
        for side in (1.0, -1.0):
            solver.load_state(state)
            points = solver.solve_at((peak.frequency_hz * (1.0 + side * offsets)).tolist(), peak.level, 0)
            heights.append([point.amplitude[0] for point in points])
    assert heights[0][0] == pytest.approx(peak.amplitude, rel=1e-9)
    # The frequency of the maximum is wrong by 1e-9, where the response is flat.
    assert all(np.diff(height).max() < 0.0 for height in heights)


def test_a_curve_along_two_tangents_that_opens_more_and_more_stays_on_the_only_maximum():
    # By samples another maximum of this wedge had been 3 % higher at the last level.
    done = peaks.run(peaks.Task(1, 13, "level_up", check=True, limit=jobs.TIMEOUT, options=Options(harmonics=5)))
    assert done.arrived and not any(value.moved for value in done.values)
    assert [value.kind for value in done.values] == ["equal"] * 3
    assert max(abs(value.dense_error) for value in done.values) <= peaks.EQUAL


def test_the_peak_of_a_joint_that_friction_alone_holds_ends_where_it_drifts():
    scene = peaks_scenes.make(1, 36)
    job = peaks.keys_of(scene, "level_up")
    options = Options(harmonics=5)
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        # Three motions of the upper plate take no energy but in contacts.
        natural = solver.linear_response("frictionless", np.array([scene.band_hz[0]]), 3)[1]
        found = list(follow(solver, job, scene.reduced, peaks.PATH))
    assert natural[0] < 1.0 < natural[1]
    assert all(one.converged and not one.peak.at_corner for one in found[:-1])
    assert found[-1].peak.ending == "no_periodic_motion"
    last = found[-2].peak
    # Some contact still holds at the last peak, and at a level farther on motion in time drifts.
    assert sum(last.point.states[:2]) > 0
    with Integrator(scene.reduced) as integrator:
        integrator.start_static(peaks.PATH)
        ends = []
        for cycles in (400, 40, 40):
            choices = Run(last.frequency_hz, 1.05 * last.parameter, "exponential", 256, cycles=cycles)
            integrator.run(choices)
            ends.append((scene.reduced.directions @ integrator.state()[0])[::2])
    steps = np.diff(ends, axis=0)
    assert np.abs(steps[1]).min() > 1e-3 * last.amplitude
    np.testing.assert_allclose(steps[1], steps[0], rtol=0.05)


def test_a_peak_that_leaves_the_band_ends_there_and_the_file_says_so(tmp_path, capfd):
    made = jobs.peak_of_wedge()
    made["peak"]["values"] = []
    made["sweep"]["stop_hz"] = 125.0
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, made))
    # That is no failure: there is no peak to be found.
    assert done.returncode == 0, done.stderr
    data, attributes = read_peaks(str(tmp_path / "result.peaks.h5"))
    assert attributes["ending"] == "leaves_band"
    last = data["level"][data["amplitude"] > 0.0][-1]
    # Without the band's limit the peak is at 125.75 Hz at level 10.8 and at 123.8 Hz at 12.7.
    assert 10.7 < last < 12.7
    words = (
        f"the curve ends: there is no peak beyond level {last:g}, since the response is largest at an end of the band"
    )
    assert attributes["ending_in_words"].startswith(words)
    assert words in done.stdout + done.stderr


def held_by_friction(stiffness: float, push: float) -> ReducedScene:
    """A mass that rubs along x; a force beside the one that shakes it varies what presses it."""
    laws = {"tangents": np.ones(1, dtype=np.int32), "gap": np.zeros(1), "preload": np.zeros(1)}
    laws |= {
        "tangential_stiffness": np.ones(1),
        "normal_stiffness": np.ones(1),
        "friction_coefficient": np.full(1, 0.5),
    }
    harmonic = np.array([[0.0, 0.0], [1.0, push], [0.0, 0.0]])
    mass, damping = np.eye(2), 0.05 * np.eye(2)
    press, monitor = np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])
    springs = np.diag([stiffness, 1.0])
    return ReducedScene(mass, springs, "viscous", 0.0, damping, laws, np.eye(2), press, harmonic, monitor, ["x"])


@pytest.mark.parametrize(
    ("stiffness", "push", "low", "ending"), [(0.0, 0.3, 0.05, "no_periodic_motion"), (1.0, 0.0, 0.19, "leaves_band")]
)
def test_a_curve_ends_where_a_body_drifts_or_the_peak_leaves_the_band(stiffness, push, low, ending):
    scene = held_by_friction(stiffness, push)
    job = curve_job(start=0.01, stop=3.0, values=[])
    job |= {"sweep": {"frequencies_hz": None, "start_hz": low, "stop_hz": 0.3}}
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=5)) as solver:
        found = list(follow(solver, job, scene, np.array([[0.0], [1.0]])))
    assert all(one.peak.ending == "none" for one in found[:-1])
    assert (found[-1].converged, found[-1].peak.ending) == (False, ending)
    if stiffness > 0.0:
        # Slipping, the peak goes from sqrt(2)/(2 pi) = 0.225 Hz towards 1/(2 pi) = 0.159 Hz, below the band.
        assert low <= found[-2].peak.frequency_hz < 1.005 * low
    else:
        # Sticking, the friction force is 20 times the level at resonance, mu N = 0.25 when it is largest: from 0.0125
        # on it slips, and as the normal force varies more on one way than on the other it is carried along.
        assert 0.0120 < found[-2].peak.parameter <= 0.0125


def test_an_ending_is_that_of_the_last_peak():
    def peak(parameter: float, outcome: str = "converged", why: str = "none") -> Found:
        return Found(SimpleNamespace(parameter=parameter, outcome=outcome, ending=why), "step")

    assert ending_of([peak(1.0), peak(2.0)], "level", 2.0).kind == "stop"
    limited = ending_of([peak(1.0)], "level", 2.0)
    assert (limited.kind, limited.words) == ("max_points", "[peak] max_points was reached at level 1")
    lost = ending_of([peak(1.0), peak(1.0, "not_converged", "not_found")], "preload", 2.0)
    assert (lost.kind, lost.is_physical) == ("not_found", False)
    assert lost.words == "the peak is lost beyond preload 1: no point of the curve was found there"
    none = ending_of([peak(0.5, "not_converged", "not_found")], "level", 2.0)
    assert none.words == "the peak is lost from the start: no point of the curve was found there"
    drifts = ending_of([peak(1.0), peak(1.0, "not_converged", "no_periodic_motion")], "level", 2.0)
    assert drifts.is_physical and "beyond level 1" in drifts.words and "a body drifts" in drifts.words


def test_a_curve_that_leaves_one_peak_for_another_says_where():
    parameter = np.array([1.0, 2.0, 4.0, 4.2, 8.0, 8.4, 9.0])
    # y = x^-0.5, then ten times as much; a corner; no peak
    height = np.array([1.0, 2.0**-0.5, 0.5, 10.0 * 4.2**-0.5, 10.0 * 8.0**-0.5, 10.0 * 8.4**-0.5, np.nan])
    power = np.array([-0.5, -0.5, -0.5, -0.5, np.nan, -0.5, np.nan])
    assert np.flatnonzero(jumps(parameter, height, power)).tolist() == [3]
