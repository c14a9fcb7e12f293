"""Derivatives where a contact is at the onset of slip or of lift-off: on both sides, where these differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jobs import Job, run, table, wedge
from mpi4py import MPI
from slopes import pressed

import attrito

# Steps h, h / 4, h / 16 of one-sided differences, part of the level
STEPS = 1e-3 / 4.0 ** np.arange(3)


@pytest.fixture
def job() -> Job:
    """The wedge at 120 Hz, which begins to slip with the level."""
    job = pressed(wedge(force=30.0))
    job["balance"] = {"harmonics": 5, "quadrature": "event", "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [120.0]}
    return job


def at_levels(folder: Path, job: Job, levels: list[float], **sensitivity: list[str]) -> dict[str, np.ndarray]:
    """Amplitude and dissipation, and whether the contact slips or opens."""
    asked = {"sweep": job["sweep"] | {"levels": levels}} | ({"sensitivity": sensitivity} if sensitivity else {})
    with attrito.run(job | asked, MPI.COMM_SELF, folder=folder, quiet=True) as result:
        return {
            "x_amplitude": np.asarray(result.monitors.x.amplitude),
            "dissipated_energy": np.asarray(result.contacts.dissipated_energy)[:, 0],
            "opens": np.asarray(result.contacts.open)[:, 0] > 0.0,
            "slips": result.contacts.state.labels[:, 0] == "slipping",
        }


def onset_of_slip(folder: Path, job: Job) -> float:
    """The level at which the contact begins to slip, from two levels below at which it sticks.

    There u and v swing by l u1 and l v1 in proportion to the level l, and [u - r, u + r], r = mu N / kt, ceases to hold
    a slider as soon as l (|u1 - r1| + |u1 + r1|) = 2 r0, amplitudes of complex numbers. The slider is at an end of what
    is left, so that the mean of N is linear in l.
    """
    levels = [0.5, 0.6]
    asked = {"sweep": job["sweep"] | {"levels": levels}}
    with attrito.run(job | asked, MPI.COMM_SELF, folder=folder, quiet=True) as result:
        assert result.contacts.state.labels.ravel().tolist() == ["shaken_down"] * 2
        rows = np.asarray(result.contacts.displacement)[1, 0]
        normal = np.asarray(result.contacts.n_mean)[:, 0]
    (contact,) = job["contact"]
    ratio = contact["friction_coefficient"] / contact["tangential_stiffness"]
    u, v = (complex(rows[axis][1], rows[axis][2]) / levels[1] for axis in (0, -1))
    change = ratio * contact["normal_stiffness"] * v
    slope = (normal[1] - normal[0]) / (levels[1] - levels[0])
    swing = abs(u - change) + abs(u + change)
    return float(2.0 * ratio * (normal[1] - slope * levels[1]) / (swing - 2.0 * ratio * slope))


def one_sided(folder: Path, job: Job, level: float, side: float) -> dict[str, float]:
    """Derivatives by the level from one side of it, where the rest is in powers of the root of the step.

    With f(h) = a + b sqrt(h) + c h: 2 f(h / 4) - f(h) is without b, and the like again without c.
    """
    found = at_levels(folder, job, [level, *(level * (1.0 + side * STEPS))])
    slopes = {}
    for name in ("x_amplitude", "dissipated_energy"):
        first = (found[name][1:] - found[name][0]) / (side * level * STEPS)
        second = 2.0 * first[1:] - first[:-1]
        slopes[name] = float((4.0 * second[1] - second[0]) / 3.0)
    return slopes


def test_both_derivatives_at_the_onset_of_slip(tmp_path: Path, job: Job) -> None:
    level = onset_of_slip(tmp_path, job)
    assert at_levels(tmp_path, job, [level * (1 - 1e-6), level * (1 + 1e-6)])["slips"].tolist() == [False, True]
    asked = {"to": ["level"], "of": ["dissipated_energy"]}
    done = run(tmp_path, job | {"sweep": job["sweep"] | {"levels": [level, 1.01 * level]}, "sensitivity": asked})
    assert done.stdout.count("120 Hz: a contact is at the onset of slip") == 1
    rows = {(row["point"], row["quantity"]): row for row in table(tmp_path, "--sensitivities")}
    sides = {name: one_sided(tmp_path, job, level, side) for name, side in (("stuck", -1.0), ("slipping", 1.0))}
    for quantity in ("x_amplitude", "dissipated_energy"):
        largest = max(abs(sides[name][quantity]) for name in sides)
        for name, slopes in sides.items():
            # Taken as slipping a contact slips for sqrt(1e-9) of a period; differences leave h^(3/2), as much.
            assert abs(float(rows["0", quantity][name]) - slopes[quantity]) < 1e-3 * largest
        # Sliding begins with a loop whose area grows in proportion: the response has a corner.
        assert abs(sides["stuck"][quantity] - sides["slipping"][quantity]) > 0.1 * largest
        assert rows["1", quantity]["stuck"] == rows["1", quantity]["slipping"] == ""


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_one_derivative_at_the_onset_of_lift_off(tmp_path: Path, job: Job, friction: float) -> None:
    """Forces leave those of a closed contact as the power 3/2 of how far it opens, and land as they would have slid."""
    job = job | {"contact": [job["contact"][0] | {"friction_coefficient": friction, "preload": 5.0}]}
    # Along both axes of the contact, so that it moves along its tangent when it opens
    job["load"] = [job["load"][0], job["load"][1] | {"cosine": [[0, 30.0]]}]
    low, high = 0.1, 30.0
    assert at_levels(tmp_path, job, [low, high])["opens"].tolist() == [False, True]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if at_levels(tmp_path, job, [middle])["opens"][0] else (middle, high)
    run(tmp_path, job | {"sweep": job["sweep"] | {"levels": [low]}, "sensitivity": {"to": ["level"]}})
    row = next(row for row in table(tmp_path, "--sensitivities") if row["quantity"] == "x_amplitude")
    for side in (-1.0, 1.0):
        slope = one_sided(tmp_path, job, low, side)["x_amplitude"]
        assert float(row["derivative"]) == pytest.approx(slope, rel=1e-3)
    assert row["stuck"] == row["slipping"] == ""
