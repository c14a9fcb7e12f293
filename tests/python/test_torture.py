"""Scenes at the edge of what methods can do: stiff contacts, much friction, contacts pulled apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from jobs import run, table, wedge
from mpi4py import MPI

from attrito.integration.attractors import pushed
from attrito.library.family import Family as Members
from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.names import ENGINES, ORBITS, STRATEGIES
from attrito.library.session import Options, Solver
from attrito.runs.stability import examine_point
from attrito_verification.scene_grid.grid import NEAR
from attrito_verification.scene_grid.methods import SAMPLES, distance, state_of
from attrito_verification.scene_grid.scenes import Family, frequencies


@pytest.mark.parametrize("frequency_hz", [65.641, 71.2821, 88.2051])
def test_a_very_stiff_contact_without_friction_leaves_a_body_the_response_it_has_without_contact(
    tmp_path, frequency_hz
):
    # Level wall: u = -x, v = y. Motion along it exceeds the stuck response 17 000 times at 65.641 Hz.
    job = wedge(stiffness=1.0e4 * (200.0 * np.pi) ** 2)
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]], "friction_coefficient": 0.0}
    job["load"][0]["dofs"] = [[1, 10.0]]
    job["load"][1]["cosine"] = [[0, 10.0]]
    job["sweep"] = {"frequencies_hz": [frequency_hz]}
    run(tmp_path, job)
    (point,) = table(tmp_path)
    omega = 2.0 * np.pi * frequency_hz
    free = 10.0 / abs((200.0 * np.pi) ** 2 - omega**2 + 20j * np.pi * omega)
    assert point["outcome"] == "converged"
    # The residual, 1e-10 of the stuck response or rounding of the motion, grows by the ratio of stiffnesses at most.
    assert float(point["x_amplitude"]) == pytest.approx(free, rel=1e-8)


def without_higher(orbit: Orbit, harmonics: int) -> Orbit:
    """An orbit without what a balance of so many harmonics leaves out."""
    spectrum = np.fft.rfft(orbit.monitors[-SAMPLES:], axis=0)
    spectrum[harmonics + 1 :] = 0.0
    return replace(orbit, monitors=np.fft.irfft(spectrum, SAMPLES, axis=0))


def test_a_verdict_on_coarse_harmonics_is_that_of_the_event_exact_orbit():
    # Ten harmonics of an impact: multipliers of the balance's orbit say it is unstable. Motion in time stays.
    family = Family(1, 100.0, 0.3, "apart", 45.0)
    at = 138.974359
    scene = family.scene()
    with Integrator(scene) as session, Solver(MPI.COMM_SELF, scene, Options(harmonics=10)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, at)
        (point,) = solver.solve_at([at], 1.0, 0)
        balance, _ = examine_point(solver, ENGINES["monodromy"], ORBITS["balance"])
        chosen, _ = examine_point(solver, ENGINES["monodromy"], ORBITS["auto"])
        slider = Members(MPI.COMM_SELF, solver, 1, 2).visit(lambda members: members.describe().slider)
        state = state_of(point.harmonics, at, slider)
        session.start(state.displacement, state.velocity, state.sliders, np.ones(1))
        orbit = session.run(Run(at, samples=SAMPLES, cycles=4000, periodicity_tolerance=1e-8))
    assert balance.verdict == 0
    assert chosen.verdict == 1
    assert (orbit.outcome, orbit.period) == ("converged", 1)
    # The largest coordinate against the norm of two, in numerator and denominator: a factor of their root at most.
    assert 2**-0.5 < distance(point, without_higher(orbit, 10)) / chosen.distance < 2**0.5
    assert 1e-3 < chosen.distance < NEAR


@pytest.mark.parametrize("steps", [1, 4, 20])
def test_a_first_point_is_found_however_many_steps_the_static_path_before_it_took(steps):
    # Open at rest, and the path's rounding leaves harmonics of 1e-20 m or none: motion in time begins alike after both.
    at = 138.8
    scene = Family(1, 100.0, 0.3, "apart", 45.0).scene()
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=10)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), steps, at)
        (point,) = solver.solve_at([at], 1.0, 0)
    assert point.outcome == "converged"


def examined(family, first, number):
    """A point of the grid by way of those from `first` on, its examination, and the motion in time that it comes to."""
    scene, masses, at = family.scene(), family.masses, frequencies()[number]
    with Integrator(scene) as session, Solver(MPI.COMM_SELF, scene, Options(harmonics=10)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, at)
        *_, point = solver.solve_at(list(frequencies()[first : number + 1]), 1.0, 0)
        report, reason = examine_point(solver, ENGINES["monodromy"], ORBITS["auto"])
        slider = Members(MPI.COMM_SELF, solver, masses, 2 * masses).visit(lambda members: members.describe().slider)
        moved = pushed(state_of(point.harmonics, at, slider), point.amplitude.max(), 2.0 * np.pi * at)
        session.start(moved.displacement, moved.velocity, moved.sliders, np.ones(1))
        orbit = session.run(Run(at, samples=SAMPLES, cycles=400, periodicity_tolerance=1e-8))
    return point, report, reason, orbit


def test_an_orbit_that_leaves_the_balances_within_the_period_is_another_and_how_far_it_lies_is_told():
    # A wall 10^4 times as stiff as the spring: impacts that ten harmonics leave out, as the estimate says.
    point, report, reason, orbit = examined(Family(1, 1.0e4, 0.8, "small", 0.0), 0, 16)
    assert point.outcome == "converged"
    assert point.estimate > 0.1
    assert report.verdict == 2
    assert reason == f"the event-exact orbit lies {report.distance:.2f} of the amplitude from that of the balance"
    assert orbit.period == 1
    # On a level wall only one coordinate differs.
    assert distance(point, without_higher(orbit, 10)) == pytest.approx(report.distance, rel=0.2)
    assert report.distance > NEAR


def test_bodies_that_do_the_same_have_a_verdict_though_their_contacts_change_at_one_instant():
    _, report, _, orbit = examined(Family(2, 100.0, 3.0, "none", 45.0), 21, 23)
    assert report.verdict == 1
    assert orbit.period == 1


def test_a_mode_that_alternates_while_it_dies_out_is_no_motion_of_period_two():
    # The orbit has a multiplier near -0.96: states two periods apart agree long before successive ones do.
    family = Family(1, 10.0, 3.0, "none", 80.0)
    with Integrator(family.scene()) as session:
        session.start_static(np.array([[0.0], [1.0]]))
        loose = session.run(Run(60.0, periodicity_tolerance=1e-7, cycles=2000))
        tight = session.run(Run(60.0, periodicity_tolerance=1e-12, cycles=2000))
    assert tight.period == loose.period == 1


def test_an_attempt_is_asked_for_by_its_name_and_leaves_the_session_where_it_stood():
    scene = Family(1, 10.0, 0.3, "small", 45.0).scene()
    frequencies = [80.0, 85.0]
    points = []
    for attempts in ((), STRATEGIES):
        with Solver(MPI.COMM_SELF, scene, Options(harmonics=10)) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 20, frequencies[0])
            solving = solver.solve_at(frequencies, 1.0, 0)
            next(solving)
            found = {name: solver.solve_by_strategy(name, frequencies[1]) for name in attempts}
            points.append(next(solving))
    assert [points[1].outcome, points[1].iterations] == [points[0].outcome, points[0].iterations]
    assert points[1].amplitude[0] == points[0].amplitude[0]
    # Newton's method alone gives up after 30 iterations, and briefly after 8 that gain little, or when it is done.
    assert 0 < found["newton_early_stop"].iterations <= found["newton"].iterations
    assert found["level_homotopy"].iterations > found["newton"].iterations
    with (
        Solver(MPI.COMM_SELF, scene, Options()) as solver,
        pytest.raises(ValueError, match="newton_early_stop, mean_regularisation"),
    ):
        solver.solve_by_strategy("guess", frequencies[0])


def test_contacts_that_are_soft_at_first_lead_to_an_orbit_that_few_attempts_find():
    family, at = Family(1, 1.0e4, 0.8, "none", 80.0), frequencies()[32]
    with (
        Integrator(family.scene()) as session,
        Solver(MPI.COMM_SELF, family.scene(), Options(harmonics=10)) as solver,
    ):
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, at)
        solver.set_excitation(60.0, 280.0, 1.0)
        found = {name: solver.solve_by_strategy(name, at) for name in STRATEGIES}
        (point,) = solver.solve_at([at], 1.0, 0)
        session.start_static(np.array([[0.0], [1.0]]))
        orbit = session.run(Run(at, cycles=2000, periodicity_tolerance=1e-8))
    solved = {name for name, one in found.items() if one.outcome == "converged"}
    assert "stiffness_homotopy" in solved and solved <= {"stiffness_homotopy", "time_integration"}
    assert point.outcome == "converged"
    assert point.amplitude == pytest.approx(found["stiffness_homotopy"].amplitude, rel=1e-6)
    # Motion in time has an orbit of period one there; ten harmonics of its impacts leave out some percents.
    assert orbit.period == 1
    assert point.amplitude[0] == pytest.approx(orbit.amplitude[0], rel=0.1)


def test_an_iterate_that_runs_off_is_no_solution():
    # Pulled off the wall: from motion in time with soft contacts Newton's method ran to 1e202 of the amplitude.
    family, at = Family(1, 1.0e4, 0.0, "apart", 45.0), frequencies()[2]
    with Solver(MPI.COMM_SELF, family.scene(), Options(harmonics=10)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, at)
        solver.set_excitation(60.0, 280.0, 1.0)
        point = solver.solve_by_strategy("stiffness_homotopy", at)
    assert point.outcome == "not_converged"


@pytest.mark.parametrize(
    ("frequency_hz", "method", "outcome", "period"),
    [
        (60.0, "monodromy", "no_period_one_orbit", "2"),
        (60.0, "none", "no_period_one_orbit", ""),
        (71.2820513, "monodromy", "not_converged", "1"),
    ],
)
def test_motion_in_time_tells_its_period_where_the_balance_has_no_orbit(
    tmp_path, frequency_hz, method, outcome, period
):
    # Pulled away from a wall ten thousand times as stiff as its spring. Of period one: there is an orbit after all.
    family = Family(1, 1.0e4, 0.8, "apart", 80.0)
    scene = family.scene()
    job = wedge(stiffness=1.0e4 * (200.0 * np.pi) ** 2)
    tangent, normal = ([[i, float(x)] for i, x in enumerate(row)] for row in scene.directions)
    job["contact"][0] |= {"normal": normal, "tangents": [tangent], "friction_coefficient": 0.8}
    job["load"][0]["dofs"] = [[i, float(x)] for i, x in enumerate(scene.static[0])]
    job["load"][1]["cosine"] = [[0, 10.0]]
    job["balance"] = {"harmonics": 10}
    job["stability"] = {"method": method}
    job["sweep"] = {"frequencies_hz": [frequency_hz]}
    run(tmp_path, job, code=1)
    (point,) = table(tmp_path)
    assert (point["outcome"], point["period"]) == (outcome, period)
    if period:
        with Integrator(scene) as session:
            session.start_static(np.array([[0.0], [1.0]]))
            orbit = session.run(Run(frequency_hz, cycles=400, max_period_multiple=32, periodicity_tolerance=1e-8))
        assert str(orbit.period) == period
