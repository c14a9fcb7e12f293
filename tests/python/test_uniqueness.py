"""Bounds of points that are one of a family: against an oracle, closed forms and integration in time."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import attrito, chain, everything, run, wedge, write_job
from mpi4py import MPI

from attrito.job.reading import read_job
from attrito.library.family import Family, Member
from attrito.library.integrator import Integrator, Run
from attrito.library.session import Options, Solver
from attrito.results.journal import is_point, read_journal
from attrito.results.result import Result
from attrito.runs.bounds_by_members import VISITS, Search, least_room
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene

FREQUENCY = 132.0
# Printed digits of docs and design.
DIGITS = 0.005


def solved(folder, job, ranks=None):
    """The quantities of interest of them."""
    groups = "contacts/", "monitors/x/", "monitors/end/", "points/bounds"
    data = everything(folder, job, ranks).items()
    return {name: values for name, values in data if name.startswith(groups) and "parameters" not in name}


def bounds(data, name):
    return data[f"contacts/{name}_low"], data[f"contacts/{name}_mean"], data[f"contacts/{name}_high"]


def tilted_chain():
    """Three contacts whose normal and tangent stand at an angle, so that a slider moves the normal forces too."""
    job = chain(contacts=3)
    for contact in job["contact"]:
        contact["normal"] = [[contact["normal"][0][0], 1.0], [contact["normal"][1][0], 0.5]]
    return job


def stuck_chain():
    job = tilted_chain()
    job["load"][1] |= {"cosine": [[0, 1.0]], "sine": [[0, 0.5]]}
    job["sweep"] = {"frequencies_hz": [40.0]}
    return job


def settled_means(folder, path, sliders, frequency, ramp=0):
    """Mean contact forces `[rows]` that integration in time ends in, from the end of a load path and moved sliders.

    The harmonic load rises over `ramp` periods, so that its onset moves fewer sliders.
    """
    job = read_job(folder / "job.toml")
    scene = reduced_scene(job, build_scene(job))
    with Integrator(scene) as integrator:
        integrator.start_static(np.array(path)[:, None] * np.ones(len(scene.static)))
        displacement, velocity, own = integrator.state()
        moved = own + np.column_stack([sliders, np.zeros(len(sliders))])
        integrator.start(displacement, velocity, moved, np.ones(len(scene.static)))
        profile = np.array([[0.0, 0.0], [ramp / frequency, 1.0]]) if ramp else None
        choices = Run(frequency, cycles=4000, periodicity_tolerance=1e-12, fewest_cycles=ramp, harmonic_profile=profile)
        orbit = integrator.run(choices)
    assert orbit.outcome == "converged"
    return orbit.force_mean


@pytest.fixture(scope="module")
def stuck_wedge(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wedge")
    return folder, solved(folder, wedge(force=1.0))


def test_the_wedge_at_1_newton_has_the_bounds_of_the_design(stuck_wedge):
    _, data = stuck_wedge
    low, _, high = bounds(data, "t1")
    assert (low[0, 0], high[0, 0]) == pytest.approx((-9.98, 9.27), abs=DIGITS)
    low, _, high = bounds(data, "n")
    assert (low[0, 0], high[0, 0]) == pytest.approx((22.85, 27.12), abs=DIGITS)


def test_the_member_shown_is_within_its_bounds_and_the_contact_is_not_unique(stuck_wedge):
    _, data = stuck_wedge
    for name in ("t1", "n"):
        low, shown, high = bounds(data, name)
        assert np.all((low <= shown) & (shown <= high))
    assert data["contacts/unique"].tolist() == [[0]]


def test_amplitudes_are_the_same_in_all_members_and_means_are_not(stuck_wedge):
    _, data = stuck_wedge
    assert data["monitors/x/low"] == data["monitors/x/amplitude"] == data["monitors/x/high"]
    assert data["monitors/x/mean_high"] - data["monitors/x/mean_low"] > 1e-5


def test_both_load_paths_end_in_members_of_one_family(stuck_wedge, tmp_path):
    _, data = stuck_wedge
    other = solved(tmp_path, wedge(force=1.0) | {"static": {"load_path": [0.0, 2.5, 1.0]}})
    for name in ("t1", "n"):
        (low, shown, high), (other_low, other_shown, other_high) = bounds(data, name), bounds(other, name)
        # The points are solved to 1e-10 of motions that make forces of some 10.
        assert (other_low, other_high) == (pytest.approx(low, abs=1e-7), pytest.approx(high, abs=1e-7))
        assert abs(other_shown - shown) > 1.0


def test_integration_in_time_after_many_load_paths_ends_within_the_bounds_and_on_both(stuck_wedge):
    folder, data = stuck_wedge
    means = [settled_means(folder, [0.0, top, 1.0], [0.0], FREQUENCY) for top in np.linspace(1.0, 2.5, 13)]
    for reached, name in zip(np.transpose(means), ("t1", "n"), strict=True):
        low, _, high = (values[0, 0] for values in bounds(data, name))
        assert len(np.unique(reached.round(3))) > 4
        # Steady to 1e-12 a period, of a motion that decays by some 10 % in each.
        assert (reached.min(), reached.max()) == (pytest.approx(low, abs=1e-6), pytest.approx(high, abs=1e-6))


def test_on_a_level_wall_the_normal_force_is_unique_and_the_tangential_one_has_a_closed_form(tmp_path):
    job = wedge(force=1.0)
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, -1.0]]]}
    job["load"][1]["cosine"] = [[0, 1.0]]
    data = solved(tmp_path, job)
    low, shown, high = bounds(data, "n")
    assert low == shown == high
    low, _, high = bounds(data, "t1")
    room = 0.5 * shown - 3.0e5 * data["monitors/x/amplitude"]
    assert (low, high) == (pytest.approx(-room, rel=1e-8), pytest.approx(room, rel=1e-8))


def test_many_contacts_feel_each_other_and_integration_in_time_stays_within_their_bounds(tmp_path):
    data = solved(tmp_path, stuck_chain())
    assert np.all(data["contacts/state"] <= 1)
    generator = np.random.default_rng(3)
    starts = generator.uniform(-1e-3, 1e-3, (6, 3))
    means = np.array([settled_means(tmp_path, [0.0, 1.0], sliders, 40.0) for sliders in starts])
    for column, name in enumerate(("t1", "n")):
        low, _, high = (values[0] for values in bounds(data, name))
        reached = means[:, column::2]
        assert np.all((reached >= low - 1e-6) & (reached <= high + 1e-6))
        assert np.all(np.ptp(reached, axis=0) > 0.1 * (high - low))


def mixed_chain(harmonics=3, bounds="sampled"):
    """Three contacts of which one slips and two are free: what these hold presses on it and moves its amplitude."""
    job = tilted_chain()
    job["load"][1] |= {"cosine": [[0, 12.0]], "sine": [[0, 6.0]]}
    job["balance"] = {"harmonics": harmonics}
    job["static"] = {"bounds": bounds}
    job["sweep"] = {"frequencies_hz": [85.0]}
    return job


def all_bounds(data):
    """Every bound of a result but those that do not apply, contacts' then monitors': `[low or high, ...]`."""
    both = [np.concatenate([data[name].ravel() for name in sorted(data) if name.endswith(s)]) for s in ("low", "high")]
    return np.array(both)[:, ~np.isnan(both[0])]


def at_the_point(folder, job, work):
    """What some work on the family of a job's one point returns."""
    checked = read_job(folder / write_job(folder, job))
    scene = reduced_scene(checked, build_scene(checked))
    options = Options(harmonics=checked["balance"]["harmonics"])
    with Solver(MPI.COMM_WORLD, scene, options) as solver:
        frequency = checked["sweep"]["frequencies_hz"]
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, frequency[0])
        assert [point.outcome for point in solver.solve_at(frequency, 1.0, 0)] == ["converged"]
        sizes = len(scene.laws["tangents"]), len(scene.monitors)
        return Family(MPI.COMM_WORLD, solver, *sizes).visit(lambda family: work(family, scene))


def test_where_every_contact_sticks_visiting_members_reaches_the_exact_bounds_and_not_beyond(tmp_path):
    exact, sampled = (solved(tmp_path, stuck_chain() | {"static": {"bounds": how}}) for how in ("auto", "sampled"))
    assert (exact["points/bounds"], sampled["points/bounds"]) == ([1], [2])
    (low, high), (least, greatest) = all_bounds(exact), all_bounds(sampled)
    width = high - low
    assert np.all(least - low <= 1e-6 * width)
    assert np.all(high - greatest <= 1e-6 * width)
    # Forces of some 50 that are solved to 1e-10.
    assert np.all(least >= low - 1e-8)
    assert np.all(greatest <= high + 1e-8)


def test_where_some_contacts_slip_integration_in_time_ends_within_the_sampled_bounds_and_near_both(tmp_path):
    coarse, data = (solved(tmp_path, mixed_chain(harmonics)) for harmonics in (20, 40))
    assert data["contacts/state"].tolist()[0][0] == 2
    assert np.all(data["contacts/state"][0, 1:] <= 1)
    assert data["points/bounds"] == [2]
    assert data["contacts/unique"].tolist() == [[0, 0, 0]]
    # Truncation falls with the harmonics: what is left at 40 is less than what half of them change.
    truncation = np.nanmax(np.abs(all_bounds(coarse) - all_bounds(data)))
    assert truncation < 1e-3
    generator = np.random.default_rng(3)
    reached = np.array(
        [
            settled_means(tmp_path, [0.0, 1.0], sliders, 85.0, ramp=50)
            for sliders in generator.uniform(-2e-4, 2e-4, (120, 3))
        ]
    )
    for column, name in enumerate(("t1", "n")):
        low, _, high = (values[0] for values in bounds(data, name))
        means = reached[:, column::2]
        assert np.all((means >= low - truncation) & (means <= high + truncation))
        assert np.all(np.ptp(means, axis=0) > 0.85 * (high - low))


def test_where_some_contacts_slip_the_amplitude_has_bounds_of_its_own(tmp_path):
    data = solved(tmp_path, mixed_chain())
    low, shown, high = (data[f"monitors/end/{name}"][0] for name in ("low", "amplitude", "high"))
    assert low <= shown <= high
    assert high - low > 0.01 * shown


@pytest.mark.parametrize("tangents", [1, 2])
def test_no_member_that_the_solver_reaches_from_random_sliders_is_outside_the_bounds(tmp_path, tangents):
    job = mixed_chain() if tangents == 1 else chain(tangents=2) | {"sweep": {"frequencies_hz": [76.0]}}
    if tangents == 2:
        job["load"][1] |= {"cosine": [[0, 30.0]], "sine": [[3, 15.0]]}
    generator = np.random.default_rng(5)

    def visit(family, scene):
        hull = Search(scene.laws)(family)
        assert hull.members > 1
        shown = family.describe()
        assert 0 < shown.free.sum() < 3
        # Two tangents: the solver holds |T| <= mu N at 128 samples, of which a peak may be half a spacing away.
        order = np.repeat(np.arange(4), 2)[1:]
        between = (np.pi / 128) ** 2 / 2 * (order**2 * np.abs(shown.force)).sum(axis=2).max()
        allowance = hull.accuracy * 100.0 + (between if tangents == 2 else 0.0)
        family.keep(0)
        for size in np.tile([1e-5, 5e-5, 3e-4], 15):
            moved = shown.slider + generator.normal(0.0, size, (3, 2)) * [1.0, tangents - 1.0]
            assert family.move(moved)
            mean = family.describe().force[:, :, 0]
            assert np.all((mean >= hull.force[0] - allowance) & (mean <= hull.force[1] + allowance))
            family.go_back(0)
        return True

    assert at_the_point(tmp_path, job, visit)


@pytest.mark.parametrize("tangents", [1, 2])
def test_the_derivative_of_a_member_is_the_difference_of_its_neighbours(tmp_path, tangents):
    job = mixed_chain() if tangents == 1 else chain(tangents=2) | {"sweep": {"frequencies_hz": [76.0]}}
    if tangents == 2:
        job["load"][1] |= {"cosine": [[0, 30.0]], "sine": [[3, 15.0]]}

    def visit(family, scene):
        shown = family.describe()
        # Half way to where nothing pulls: off every limit.
        middle = shown.slider + 0.5 * shown.force[:, :2, 0] / scene.laws["tangential_stiffness"][:, None]
        assert family.move(middle)
        shown = family.describe()
        family.keep(0)
        contact, tangent = int(np.flatnonzero(shown.free)[-1]), tangents - 1
        derivative = family.differentiate(contact, tangent)
        # Second-order terms of a force of 1e-3 among some 30, and a residual of 1e-10 of them over it.
        force, sides = 1e-3, []
        for sign in (1.0, -1.0):
            moved = shown.slider.copy()
            moved[contact, tangent] -= sign * force / scene.laws["tangential_stiffness"][contact]
            assert family.move(moved)
            sides.append(family.describe())
            family.go_back(0)
        difference = (sides[0].force - sides[1].force) / (2.0 * force)
        assert np.abs(difference - derivative.force).max() < 1e-4
        length = (sides[0].monitors - sides[1].monitors) / (2.0 * force)
        assert np.abs(length - derivative.monitors).max() < 1e-4 * np.abs(derivative.monitors).max()
        return True

    assert at_the_point(tmp_path, job, visit)


def test_a_stuck_contact_with_two_tangents_on_a_level_wall_has_closed_form_bounds(tmp_path):
    job = wedge(force=1.0)
    stiffness = 3.0e5
    job["model"] = {"mass": np.eye(3).tolist(), "stiffness": np.diag([4.0e5, 2.5e6, stiffness]).tolist()}
    job["damping"] = {"ratio": 0.01}
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]], [[2, 1.0]]]}
    job["load"][1]["cosine"] = [[0, 1.0]]
    job["output"]["monitors"] = [{"name": "x", "dofs": [[0, 1.0]]}, {"name": "end", "dofs": [[2, 1.0]]}]
    job["static"] = {"bounds": "sampled"}
    data = solved(tmp_path, job)
    assert data["points/bounds"] == [2]
    low, shown, high = (values[0, 0] for values in bounds(data, "n"))
    assert (low, high) == (pytest.approx(shown, rel=1e-12), pytest.approx(shown, rel=1e-12))
    # Discs of radius mu N0 whose centres go to and fro by kt times the amplitude: their lens. Visits stay 1e-9 within.
    limit, swing = 0.5 * shown, 3.0e5 * data["monitors/x/amplitude"][0]
    for name, half in (("t1", limit - swing), ("t2", np.sqrt(limit**2 - swing**2))):
        low, _, high = (values[0, 0] for values in bounds(data, name))
        assert (low, high) == (pytest.approx(-half, rel=1e-7), pytest.approx(half, rel=1e-7))
    # The spring across takes what the contact holds.
    half /= stiffness
    ends = data["monitors/end/mean_low"][0], data["monitors/end/mean_high"][0]
    assert ends == (pytest.approx(-half, rel=1e-7), pytest.approx(half, rel=1e-7))


@pytest.mark.parametrize(("tangents", "slider"), [(1, "keep"), (1, "reset"), (2, "keep")])
def test_points_are_the_same_to_the_last_bit_with_and_without_visits(tmp_path, tangents, slider):
    job = chain(contacts=2, tangents=tangents)
    job["load"][1]["cosine"] = [[0, 30.0]]
    job["sweep"] = {"start_hz": 79.0, "stop_hz": 77.5}
    without, visited = (
        everything(tmp_path, job | {"static": {"slider": slider, "bounds": how}}) for how in ("none", "sampled")
    )
    mixed = (visited["contacts/state"] >= 2).any(axis=1) & (visited["points/unique"] == 0)
    assert np.all(visited["points/bounds"][mixed] == 2)
    assert mixed.any()
    assert 2 not in without["points/bounds"]
    for name in without.keys() - {"points/bounds", "points/amplitude_change", "contacts/unique"}:
        if not name.endswith(("low", "high")):
            assert np.array_equal(without[name], visited[name], equal_nan=without[name].dtype.kind == "f"), name


def test_what_other_members_change_of_an_amplitude_lies_within_its_bounds_and_is_nothing_where_all_stick(tmp_path):
    job = chain(contacts=4, tangents=2)
    job["load"][1]["cosine"] = [[0, 30.0]]
    job["sweep"] = {"frequencies_hz": [79.5, 78.5], "levels": [0.1, 1.0]}
    # The budget pays no search where four contacts have two tangents each; one member is visited all the same.
    auto, sampled = (everything(tmp_path, job | {"static": {"bounds": how}}) for how in ("auto", "sampled"))
    change, height = auto["points/amplitude_change"], auto["monitors/end/amplitude"]
    sticks = (auto["contacts/state"] < 2).all(axis=1)
    assert sticks.any() and np.all(change[sticks] == 0.0)
    slips = ~sticks & (auto["points/unique"] == 0)
    highest = np.argmax(np.where(slips, height, 0.0))
    assert auto["points/bounds"][highest] == 3
    assert np.all(change[highest] > 1e-6)
    width = (sampled["monitors/end/high"] - sampled["monitors/end/low"]) / height
    for one in (change, sampled["points/amplitude_change"]):
        known = np.isfinite(one) & slips
        # Members are solved to residuals of 1e-10, and bounds lie 1e-9 of the forces within the cones; the law holds at
        # samples only while the bounds keep it at every instant, as above.
        assert known.any() and np.all(one[known] <= width[known] + 1e-6)


def test_one_two_and_four_ranks_find_the_same_sampled_bounds(tmp_path):
    job = chain(tangents=2)
    job["contact"][2]["tangents"].pop()
    job["load"][1]["cosine"] = [[0, 30.0]]
    job["sweep"] = {"frequencies_hz": [78.0, 76.0]}
    job["static"] = {"bounds": "sampled"}
    one, two, four = (solved(tmp_path, job, ranks) for ranks in (1, 2, 4))
    assert one["points/bounds"].tolist() == [2, 2]
    assert np.any(one["contacts/state"] == 2)
    for other in (two, four):
        assert np.array_equal(all_bounds(one), all_bounds(other))


def test_bounds_without_an_end_are_infinite(tmp_path):
    # With mu kt R_nt above 1 - kt R_tt a slider that is pushed presses harder than it pulls: the contact jams.
    job = wedge(force=1.0)
    job["contact"][0]["friction_coefficient"] = 5.0
    exact, sampled = (solved(tmp_path, job | {"static": {"bounds": how}}) for how in ("auto", "sampled"))
    assert np.isinf(all_bounds(exact)).any()
    assert np.array_equal(np.isinf(all_bounds(exact)), np.isinf(all_bounds(sampled)))


def test_bounds_are_left_open_where_the_approach_is_uncoupled_or_the_job_wants_none(tmp_path):
    stuck = wedge(force=1.0)
    stuck["balance"]["approach"] = "uncoupled"
    for job in (stuck, mixed_chain(bounds="none"), wedge(force=1.0) | {"static": {"bounds": "none"}}):
        data = solved(tmp_path, job)
        assert data["points/bounds"] == [0]
        assert np.isnan(data["contacts/n_low"]).all()
        assert np.isnan(data["contacts/t1_high"]).all()


def test_automatic_bounds_end_at_the_work_of_the_point_and_leave_the_rest_open(tmp_path):
    job = chain(contacts=5, tangents=2)
    job["sweep"] = {"frequencies_hz": [60.0]}
    open_ended = solved(tmp_path, job)
    assert open_ended["points/bounds"] == [3]
    assert np.isnan(open_ended["contacts/n_low"]).all()
    assert np.isnan(open_ended["contacts/t2_high"]).all()
    assert set(open_ended["contacts/unique"].ravel().tolist()) == {-1}
    assert solved(tmp_path, job | {"static": {"bounds": "sampled"}})["points/bounds"] == [2]


class CountedFamily:
    """A family, what its visits come to, and a stop that is asked for after so many answers."""

    def __init__(self, family, most=10**9):
        self._family, self._left, self.moves = family, most, 0

    def __getattr__(self, name):
        return getattr(self._family, name)

    def move(self, slider, most_work=np.inf):
        self.moves += 1
        return self._family.move(slider, most_work)

    def is_interrupted(self):
        self._left -= 1
        return self._left < 0


def test_a_search_does_no_more_than_its_budget_and_finds_the_same_as_far_as_it_comes(tmp_path):
    def visit(family, scene):
        def search(part=np.inf, most=10**9):
            counted = CountedFamily(family, most)
            hull = Search(scene.laws)(counted, part)
            return hull, counted.moves, hull.work

        whole, moves, spent = search()
        assert whole.complete
        part, fewer, less = search(0.5 * spent)
        assert not part.complete
        assert 0 < fewer < moves
        assert less < 0.75 * spent
        # Monitors come first, and what was found is what the whole search finds.
        assert not np.isnan(part.mean).all()
        assert np.isnan(part.force).any()
        for name in ("mean", "amplitude"):
            ours, theirs = getattr(part, name), getattr(whole, name)
            known = ~np.isnan(ours)
            assert np.allclose(ours[known], theirs[known], rtol=1e-6, atol=1e-12)
        stopped, none, _ = search(most=0)
        assert none == 0
        assert np.isnan(stopped.mean).all()
        return True

    assert at_the_point(tmp_path, mixed_chain(), visit)


def test_a_visit_is_given_up_when_it_has_taken_what_it_may_and_nothing_has_changed(tmp_path):
    def visit(family, scene):
        shown = family.describe()
        family.keep(0)
        slider = shown.slider.copy()
        # So far that the law takes sliders back, which takes many steps.
        slider[:, 0] += 50.0 * shown.free * shown.force[:, 0, 0] / scene.laws["tangential_stiffness"]
        before = family.work()
        assert family.move(slider)
        whole = family.work() - before
        family.go_back(0)
        before = family.work()
        assert not family.move(slider, 0.1 * whole)
        assert family.work() - before < 0.8 * whole
        assert np.array_equal(family.describe().force, shown.force)
        return True

    assert at_the_point(tmp_path, mixed_chain(), visit)


class UnwillingFamily(CountedFamily):
    """A family of which no other member is found, and whose visits take so much, or what they may."""

    def __init__(self, family, cost):
        super().__init__(family)
        self._cost, self.taken = cost, 0.0

    def move(self, slider, most_work=np.inf):
        self.moves += 1
        self.taken += min(self._cost, most_work)
        return False

    def work(self):
        return self._family.work() + self.taken


def test_the_one_member_that_is_visited_in_any_case_takes_no_more_than_it_may(tmp_path):
    def visit(family, scene):
        for part, moves in ((0.6, 2), (2.0, 1)):
            least = 1e9
            unwilling = UnwillingFamily(family, part * least / VISITS)
            hull = Search(scene.laws)(unwilling, -1.0, 0.0, least)
            assert (hull.members, hull.complete) == (1, False)
            assert unwilling.moves >= moves
            assert unwilling.taken <= least / VISITS * (1.0 + 1e-9)
        return True

    assert at_the_point(tmp_path, mixed_chain(), visit)


def test_a_run_is_stopped_between_the_visits_of_its_bounds_and_keeps_no_half_examined_point(tmp_path):
    job = chain(contacts=5, tangents=2) | {"static": {"bounds": "sampled"}}
    job["sweep"] = {"frequencies_hz": [60.0]}
    done = attrito(tmp_path, "run", write_job(tmp_path, job), "--max-seconds", "1e-3")
    assert done.returncode == 1
    assert "stopped by --max-seconds 0.001" in done.stderr
    # The point is kept, what was found of its members is not.
    records = [record for record, _ in read_journal(str(tmp_path / "result.h5.partial"))]
    assert len(records) == 2 and all(is_point(record) for record in records)


def test_bounds_are_as_wide_as_the_truncation_error_makes_them_and_none_where_a_contact_may_slip(tmp_path):
    def visit(family, scene):
        shown = family.describe()
        exact, rough = (Search(scene.laws)(family, error=error) for error in (0.0, 1e-3))
        scale = np.abs(shown.force).sum(axis=(1, 2)).max()
        assert np.allclose(exact.force[0] - rough.force[0], 1e-3 * scale, rtol=1e-6)
        assert np.allclose(rough.force[1] - exact.force[1], 1e-3 * scale, rtol=1e-6)
        assert np.all(rough.amplitude[0] < exact.amplitude[0])
        # More than all the room that a contact has between its limits, or not known at all.
        room = least_room(shown, scene.laws)
        assert 0.0 < room < scale
        for error in (1.01 * room / scale, np.nan):
            none = Search(scene.laws)(family, error=error)
            assert not none.complete
            assert np.isnan(none.force).all()
        return True

    assert at_the_point(tmp_path, mixed_chain(), visit)


def test_the_room_of_a_contact_is_twice_what_friction_leaves_of_its_swing():
    # T = 3 cos, N = 20.
    force = np.zeros((2, 3, 5))
    force[0, 0, 1], force[0, 2, 0] = 3.0, 20.0
    force[1, 2, 0] = 1.0
    member = Member(force, np.zeros((1, 5)), np.zeros(1), np.zeros((2, 2)), np.array([1.0, 0.0]))
    laws = {"friction_coefficient": np.array([0.5, 0.5]), "tangents": np.array([1, 1])}
    assert least_room(member, laws) == pytest.approx(2.0 * (0.5 * 20.0 - 3.0))
    # Nor more than keeps it closed.
    laws["friction_coefficient"][0] = 5.0
    assert least_room(member, laws) == pytest.approx(20.0)
    member.free[0] = 0.0
    assert np.isinf(least_room(member, laws))


def test_where_the_bounds_come_from_has_names(tmp_path):
    run(tmp_path, wedge(force=5.0))
    with Result(tmp_path / "result.h5") as result:
        assert result.names("/points/bounds") == ["none", "exact", "sampled", "not_examined"]
        # It slips: unique.
        assert result.array("/points/bounds").tolist() == [1]


def test_a_way_to_bounds_that_is_not_known_is_refused(tmp_path):
    done = attrito(tmp_path, "run", write_job(tmp_path, wedge() | {"static": {"bounds": "guessed"}}))
    assert done.returncode == 2
    expected = 'expected one of "auto", "sampled", "none"'
    assert ": [static] bounds" in done.stderr
    assert "guessed" in done.stderr
    assert expected in done.stderr
