"""Largest stable steps of the schemes of time integration: theory, sharp to one step a period, and their study."""

from __future__ import annotations

import csv
import dataclasses

import numpy as np
import pytest
from figures import marks
from jobs import attrito_here

from attrito.library.integrator import Integrator
from attrito_verification.scene_grid.integrators import (
    BOUND,
    FEWEST_STEPS,
    FINEST,
    LIMIT,
    PATH,
    SCHEMES,
    draw,
    failure,
    highest_frequencies,
    march,
    steps_tried,
)
from attrito_verification.scene_grid.scenes import DAMPING, FORCE, STIFFNESS, Family

STUCK = Family(1, 100.0, 3.0, "large", 45.0)
OPEN = Family(1, 100.0, 0.3, "apart", 0.0)


def outcome(scene, family, scheme, frequency_hz, steps):
    """A march from the static solution, and whether it is bounded."""
    with Integrator(scene) as session:
        session.start_static(PATH)
        orbit = march(session, session.state(), frequency_hz, scheme, steps)
    return not failure(orbit, family), orbit


def reach(scene, start):
    """The motion up to which one contact, kt = kn, does what it does in a state: it sticks, or it is open."""
    displacement, _, slider = start
    u, v = scene.directions @ displacement
    friction = scene.laws["friction_coefficient"][0]
    # A motion of length a changes u and v by at most a.
    return -v if v < 0.0 else (friction * v - abs(u - slider[0, 0])) / (1.0 + friction)


def growth(step, damping):
    """Of central difference on one mode, a step: q+ - 2 q + q- + (h c / 2) (q+ - q-) + (h omega)^2 q = 0."""
    return np.abs(np.roots([1.0 + damping / 2.0, step**2 - 2.0, 1.0 - damping / 2.0])).max()


@pytest.mark.parametrize(("family", "which"), [(STUCK, 0), (OPEN, 1)], ids=["stuck", "open"])
@pytest.mark.parametrize("damping", [1.0, 10.0])
def test_central_difference_is_bounded_up_to_two_over_the_highest_frequency_whatever_the_damping(
    family, which, damping
):
    scene = family.scene()
    # The highest mode moves along y.
    along_y = np.array([[0.0, 0.0], [FORCE, 0.1 * FORCE], [0.0, 0.0]])
    # Pressed, or held apart, so hard that the structure is linear far beyond the bound. Where it is not, strong damping
    # keeps a growing motion at the size at which the contact changes: a bound near that would be passed by chance.
    scene = dataclasses.replace(
        scene, damping=damping * DAMPING * np.eye(2), harmonic=along_y, static=1000.0 * scene.static
    )
    bound = BOUND * FORCE / STIFFNESS[0]
    with Integrator(scene) as session:
        session.start_static(PATH)
        assert reach(scene, session.state()) > 5.0 * bound
    frequency_hz = 63.0
    highest = highest_frequencies(scene)[which] / (2.0 * np.pi * frequency_hz)
    # h omega <= 2: with one step a period fewer it grows by 1.1 and more a step, over hundreds of steps; a period that
    # stays within the bound would have to begin within a tenth of it, a fiftieth of where the contact changes.
    fewest = int(np.ceil(2.0 * np.pi * highest / LIMIT))
    beyond = 2.0 * np.pi * highest / (fewest - 1)
    assert beyond > 1.005 * LIMIT
    factor = growth(beyond, damping * DAMPING / frequency_hz / (fewest - 1))
    assert factor > 1.1 and factor ** (fewest - 1) > 10.0
    stable, orbit = outcome(scene, family, "central_difference", frequency_hz, fewest)
    assert stable
    if family is STUCK:
        assert orbit.stick[0] == pytest.approx(1.0)
    else:
        assert orbit.open[0] == pytest.approx(1.0)
    assert not outcome(scene, family, "central_difference", frequency_hz, fewest - 1)[0]


@pytest.mark.parametrize("scheme", [scheme for scheme in SCHEMES if scheme != "central_difference"])
def test_implicit_and_exponential_schemes_are_stable_at_any_step_where_a_contact_sticks(scheme):
    family = dataclasses.replace(STUCK, ratio=1.0e4)
    scene = family.scene()
    stable, orbit = outcome(scene, family, scheme, 63.0, FEWEST_STEPS)
    # Two hundred times what central difference allows.
    assert (
        2.0 * np.pi * highest_frequencies(scene)[0] / (2.0 * np.pi * 63.0) / FEWEST_STEPS * 2.0 * np.pi > 100.0 * LIMIT
    )
    assert stable
    assert orbit.stick[0] == pytest.approx(1.0)


def test_steps_that_are_tried_are_doubled_from_a_quarter_of_a_period_to_the_finest():
    counts = np.array(steps_tried(50.0))
    assert counts[0] == FEWEST_STEPS
    assert counts[-1] == np.ceil(2.0 * np.pi * 50.0 / FINEST)
    # Whole numbers of steps.
    assert np.all(np.abs(counts[2:] / 2.0 - counts[1:-1]) <= 1.0)
    # None but the finest is as small as half of it, and the limit of central difference is tried, from below.
    assert np.any(np.abs(2.0 * np.pi * 50.0 / counts / LIMIT - 1.0) < 0.01)


def test_scenes_are_drawn_once_each_and_are_no_more_than_there_are():
    assert len(set(draw(500))) == 500
    assert len(draw(10**6)) == 14_400


def test_the_study_of_steps_finds_theory_where_contacts_stick(tmp_path, capfd, written):
    done = attrito_here(tmp_path, capfd, "verify", "integrators", "--scenes", "8", "-o", "steps")
    assert done.returncode == 0, done.stdout + done.stderr
    with (tmp_path / "steps" / "steps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["scheme"] for row in rows} == set(SCHEMES)
    linear = [row for row in rows if "True" not in (row["slips"], row["opens"])]
    assert {row["scheme"] for row in linear} == set(SCHEMES)
    for row in rows:
        assert 0.0 <= float(row["stable"]) < float(row["fails"])
    for row in linear:
        # No step within the limit of central difference fails, and none at all of the others.
        assert float(row["fails"]) > (LIMIT if row["scheme"] == "central_difference" else 1e300)
    assert (tmp_path / "steps" / "report.md").read_text().startswith("# Largest stable steps, 8 scenes")
    # A mark for each row in the panel of its scheme, a triangle where no step fails.
    (figure,) = written
    for panel, scheme in zip(figure.axes, SCHEMES, strict=True):
        own = [row for row in rows if row["scheme"] == scheme]
        for marker, whole in (("o", False), ("^", True)):
            sizes = [float(row["stable"]) for row in own if np.isinf(float(row["fails"])) == whole]
            assert sorted(marks(panel, marker)[:, 1]) == pytest.approx(sorted(sizes), rel=1e-5)
