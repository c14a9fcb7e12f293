"""Derivatives where a contact is at the onset of slip or of lift-off: on both sides, where these differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jobs import Job, run, table, wedge
from mpi4py import MPI
from slopes import pressed, with_parameter

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


def one_sided(values: np.ndarray) -> float:
    """f' from f(0), then f at `STEPS` of one side of it, where f(h) = f(0) + a h + b h^(3/2) + c h^2 + ...

    Quotients q(h) = a + b sqrt(h) + c h: 2 q(h / 4) - q(h) is without b, and the like again without c.
    """
    first = (values[1:] - values[0]) / STEPS
    second = 2.0 * first[1:] - first[:-1]
    return float((4.0 * second[1] - second[0]) / 3.0)


def of_level(folder: Path, job: Job, level: float, side: float, name: str) -> float:
    """Derivative by the level of what `at_levels` finds, from one side of it."""
    found = at_levels(folder, job, [level, *(level * (1.0 + side * STEPS))])
    return side * one_sided(found[name]) / level


def of_parameter(folder: Path, job: Job, name: str, side: float) -> float:
    """Derivative of the amplitude by a parameter times its scale, from one side."""
    levels = job["sweep"]["levels"]
    jobs = [job, *(with_parameter(job, name, side * step)[0] for step in STEPS)]
    return side * one_sided(np.array([at_levels(folder, each, levels)["x_amplitude"][0] for each in jobs]))


def test_both_derivatives_at_the_onset_of_slip(tmp_path: Path, job: Job) -> None:
    level = onset_of_slip(tmp_path, job)
    assert at_levels(tmp_path, job, [level * (1 - 1e-6), level * (1 + 1e-6)])["slips"].tolist() == [False, True]
    names = ["level", "load.preload"]
    names += [
        f"contact[0].{key}" for key in ("friction_coefficient", "tangential_stiffness", "normal_stiffness", "gap")
    ]
    asked = {"to": names, "of": ["dissipated_energy"]}
    job["sweep"]["levels"] = [level, 1.01 * level]
    done = run(tmp_path, job | {"sensitivity": asked})
    assert done.stdout.count("120 Hz: a contact is at the onset of slip") == 1
    rows = {(row["point"], row["quantity"], row["parameter"]): row for row in table(tmp_path, "--sensitivities")}
    job["sweep"]["levels"] = [level]
    found, expected = [], []
    for name in names:
        _, scale = with_parameter(job, name, 1.0)
        row = rows["0", "x_amplitude", name]
        found.append([float(row[side]) * scale for side in ("below", "above")])
        if name == "level":
            expected.append([of_level(tmp_path, job, level, side, "x_amplitude") for side in (-1.0, 1.0)])
        else:
            expected.append([of_parameter(tmp_path, job, name, side) for side in (-1.0, 1.0)])
        assert rows["1", "x_amplitude", name]["below"] == rows["1", "x_amplitude", name]["above"] == ""
    differences = np.array(expected)
    largest = np.abs(differences).max(axis=1)
    # Taken as slipping a contact slips for sqrt(1e-9) of a period, and differences leave h^(3/2), as much.
    assert np.all(np.abs(np.array(found) - differences).max(axis=1) < 1e-3 * largest)
    # Sliding begins with a loop whose area grows in proportion: the response has a corner.
    assert np.all(np.abs(differences[:, 1] - differences[:, 0]) > 0.03 * largest)
    lost = rows["0", "dissipated_energy", "level"]
    slope = of_level(tmp_path, job, level, 1.0, "dissipated_energy")
    assert float(lost["above"]) == pytest.approx(slope, rel=1e-3)
    assert abs(float(lost["below"])) < 1e-9 * slope


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_one_derivative_at_the_onset_of_lift_off(tmp_path: Path, job: Job, friction: float) -> None:
    """Forces leave those of a closed contact as the power 3/2 of how far it opens, and slide on as before."""
    job = job | {"contact": [job["contact"][0] | {"friction_coefficient": friction, "preload": 5.0}]}
    # Along both axes of the contact, so that it moves along its tangent when it opens
    job["load"] = [job["load"][0], job["load"][1] | {"cosine": [[0, 30.0]]}]
    low, high = 0.1, 30.0
    assert at_levels(tmp_path, job, [low, high])["opens"].tolist() == [False, True]
    # To a thousandth of the shortest step
    while high - low > 1e-3 * STEPS[-1] * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if at_levels(tmp_path, job, [middle])["opens"][0] else (middle, high)
    run(tmp_path, job | {"sweep": job["sweep"] | {"levels": [low]}, "sensitivity": {"to": ["level"]}})
    row = next(row for row in table(tmp_path, "--sensitivities") if row["quantity"] == "x_amplitude")
    for side in (-1.0, 1.0):
        slope = of_level(tmp_path, job, low, side, "x_amplitude")
        assert float(row["derivative"]) == pytest.approx(slope, rel=1e-3)
    assert row["below"] == row["above"] == ""
