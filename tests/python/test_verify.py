"""The paper reproduced: its figures, the numbers of its text, and what the comparison of approaches must show."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from jobs import attrito

from attrito_verification.paper import schemes
from attrito_verification.paper.claims import CLAIMS, holds
from attrito_verification.paper.figures import select
from attrito_verification.paper.pictures import period_means
from attrito_verification.paper.statements import STATEMENTS
from attrito_verification.paper.study import INCLINED_WALL, LEVEL_WALL, Study, load_profile
from attrito_verification.paper.wedge import FORCES, PARAMETER_SETS

FIGURES = ("5", "6", "7", "9", "10", "11", "12", "13")
# Numbers of the text that do not round to their digits, by parameter set.
MISSED = {"rounded": 15, "unrounded": 10, "stiffer": 2}


@pytest.fixture(scope="module")
def study():
    return Study(PARAMETER_SETS["unrounded"], 5)


@pytest.fixture(scope="module")
def orders(study):
    found = {}
    for one in schemes.measure(study.parameters):
        found.setdefault(one.motion, []).append(one.order)
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    done = attrito(folder, "verify", "paper", "-o", "paper", "--quick")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "paper"


def columns(path):
    with path.open() as file:
        rows = list(csv.DictReader(file))
    texts = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return {name: values if name == "approach" else values.astype(float) for name, values in texts.items()}


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.what)
def test_it_shows_what_it_must(study, claim):
    value = claim.measure(study)
    assert holds(claim, value), value


@pytest.mark.parametrize("name", PARAMETER_SETS)
def test_the_text_s_numbers_agree_as_far_as_the_report_says(folder, name):
    with (folder / "numbers.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(STATEMENTS)
    assert sum(row[f"{name}_agrees"] == "false" for row in rows) == MISSED[name]
    # None is off by more than 5 %, but for which of two forces has the lower peak.
    off = [abs(float(row[f"{name}_difference"])) for row in rows if row["unit"] and row[f"{name}_difference"]]
    assert sorted(off)[-2] < 0.05


@pytest.mark.parametrize("motion", schemes.MOTIONS)
def test_schemes_are_of_second_order_against_event_exact_integration(study, orders, motion):
    # Four of five points lie within 5 % of a straight line; switches that fall between steps move lift-off by more.
    slack = 0.25 if motion == "lift-off" else 0.05
    assert len(orders[motion]) == len(schemes.SCHEMES)
    for order in orders[motion]:
        assert order == pytest.approx(2.0, abs=slack)


def test_every_number_that_may_disagree_has_its_sentence(folder):
    with (folder / "numbers.csv").open() as file:
        rows = list(csv.DictReader(file))
    for statement, row in zip(STATEMENTS, rows, strict=True):
        if any(row[f"{name}_agrees"] == "false" for name in PARAMETER_SETS):
            assert statement.remark.endswith("."), statement.quantity
    assert "| holds |" in (folder / "report.md").read_text()


def test_every_figure_is_there_as_data_and_picture(folder):
    for number in FIGURES:
        assert len(columns(folder / f"figure_{number}.csv")["approach"]) > 10
        assert (folder / f"figure_{number}.png").read_bytes()[1:4] == b"PNG"


def test_markers_of_integration_in_time_lie_on_the_coupled_curves(folder):
    for number in ("7", "10"):
        data = columns(folder / f"figure_{number}.csv")
        for force in FORCES:
            coupled, exact = (select(data, name, force)["x_per_force"][0] for name in ("C", "DTI"))
            assert coupled == pytest.approx(exact, rel=3e-4)


def test_the_preload_applied_in_time_ends_at_the_static_solutions(folder, study):
    data = columns(folder / "figure_9.csv")
    for approach in ("U1", "U2"):
        wedge = study.wedge(INCLINED_WALL, approach)
        static, history = wedge.static(wedge.path), select(data, approach)
        # The ramps take some 40 periods of the slowest mode; what swings then is a few thousandths.
        assert history["t"][-1] == pytest.approx(static.tangential, rel=2e-3)
        assert history["n"][-1] == pytest.approx(static.normal, rel=2e-3)


def test_both_histories_of_figure_13_end_in_the_coupled_steady_state(folder, study):
    data = columns(folder / "figure_13.csv")
    wedge = study.wedge(INCLINED_WALL, "C")
    mean = wedge.mean(wedge.respond(np.array([150.0, 132.0]), 5.0)[-1])
    for start in ("U1", "U2"):
        part = select(data, start)
        for name, steady in (("t", mean.tangential), ("n", mean.normal), ("x", mean.x), ("y", mean.y)):
            # 48 cycles in, and five harmonics against all.
            assert period_means(part["time"], part[name])[1][-1] == pytest.approx(steady, rel=5e-4)


def test_the_peak_is_the_largest_response_around_it(study):
    for degrees in (LEVEL_WALL, INCLINED_WALL):
        wedge = study.wedge(degrees, "C")
        peak = wedge.peak(24.0)
        around = peak.frequency_hz + np.array([1.0, 0.1, -0.1, -1.0])
        assert max(point.amplitude[0] for point in wedge.respond(around, 24.0)) / 24.0 < peak.response


def test_a_load_path_in_time_passes_its_corners():
    profile = load_profile([0.0, 2.5, 1.0])
    assert profile[-1, 1] == 1.0
    assert profile[:, 1].max() == 2.5
    assert np.all(np.diff(profile[:, 0]) > 0.0)


@pytest.mark.parametrize(("what", "option"), [("paper", "--scenes"), ("torture", "--harmonics")])
def test_an_option_of_another_verification_is_told(tmp_path, what, option):
    done = attrito(tmp_path, "verify", what, option, "3")
    assert done.returncode == 2
    assert f"verify: {option} = 3: expected none with '{what}'" in done.stderr


def test_a_wrong_number_of_harmonics_is_the_input_s_fault(tmp_path):
    done = attrito(tmp_path, "verify", "paper", "--harmonics", "0")
    assert done.returncode == 2
    assert "--harmonics" in done.stderr
