"""Derivatives where a contact is at the onset of slip or of lift-off: on both sides, where these differ."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from jobs import Job, run, table, wedge
from mode_jobs import KT, LIMIT, MASS, rubbing
from mpi4py import MPI
from slopes import pressed, with_parameter

import attrito
from attrito.modes import tracker
from attrito.runs.onsets import MARGIN, Onset, branches

# Steps h, h / 4, h / 16 of one-sided differences, part of the level
STEPS = 1e-3 / 4.0 ** np.arange(3)


@pytest.fixture
def job() -> Job:
    """The wedge at 120 Hz, which begins to slip with the level."""
    job = pressed(wedge(force=30.0))
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
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


class Merging:
    """A family whose contact seems to slip, and dissipates nothing, until friction is smaller by more than a part."""

    def __init__(self, part: float):
        self._part, self._missing = part, 0.0

    def keep(self, place: int) -> None: ...

    def go_back(self, place: int) -> None: ...

    def scale_friction(self, factor: float) -> None:
        self._missing = 1.0 - factor

    def describe(self) -> SimpleNamespace:
        return SimpleNamespace(free=np.array([float(self._missing < 0.0)]))

    def slopes(self) -> np.ndarray:
        """Of an amplitude and of what is dissipated, by one parameter: 1 + sqrt(missing) and 2 where it slips."""
        if self._missing <= self._part:
            return np.array([[3.0], [0.0]])
        return np.array([[1.0 + np.sqrt(self._missing)], [2.0]])


@pytest.mark.parametrize("part", [0.0, 2.0 * MARGIN])
def test_the_slipping_side_is_one_that_dissipates(part: float) -> None:
    """Where events are nearer one another than they can be distinguished it is looked for with less friction."""
    family, onset = Merging(part), Onset(np.ones(1), MARGIN)
    found = branches(family, onset, lambda family: family.slopes(), sliders_move=False)
    assert found is not None
    assert found[0] == pytest.approx(np.array([[3.0], [0.0]]))
    # 2 f(h) - f(4 h) of a root is exact, but for rounding of 1 - h: 1e-16 of 1e-9, 1e-8 of a root of some 1e-4.
    assert found[1] == pytest.approx(np.array([[1.0], [2.0]]), abs=1e-10)


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


def test_both_derivatives_where_a_contact_begins_to_slip_along_two_tangents(tmp_path: Path) -> None:
    """A mass that moves on an ellipse: it slips about both ends of the long axis at first."""
    law = {"tangential_stiffness": 3.0e5, "normal_stiffness": 3.0e5, "friction_coefficient": 0.5}
    job: Job = {
        "model": {
            "mass": np.eye(3).tolist(),
            "stiffness": np.diag((2 * np.pi * np.array([100.0, 140.0, 250.0])) ** 2).tolist(),
        },
        "damping": {"rayleigh": [20.0 * np.pi, 0.0]},
        "contact": [{"normal": [[2, 1.0]], "tangents": [[[0, 1.0]], [[1, 1.0]]], **law}],
        "load": [
            {"kind": "static", "dofs": [[2, 400.0]]},
            {"kind": "harmonic", "harmonic": 1, "cosine": [[0, 30.0]], "sine": [[1, 18.0]]},
        ],
        "balance": {"harmonics": 3, "residual_tolerance": 1e-13},
        "sweep": {"frequencies_hz": [110.0], "levels": [0.2]},
        "output": {"file": "result.h5", "monitors": [{"name": "x", "dofs": [[0, 1.0], [1, 0.5]]}]},
    }
    with attrito.run(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as result:
        (rows,) = np.asarray(result.contacts.displacement)[0]
        pressed_by = float(result.contacts.n_mean[0, 0])
    reach = np.linalg.norm(rows[:2, 1:3], 2)
    level = 0.2 * law["friction_coefficient"] * pressed_by / law["tangential_stiffness"] / reach
    # Within a hundredth of what is taken for the onset, and on the side where it sticks
    level *= 1.0 - 1e-9
    job["sweep"]["levels"] = [level]
    names = ["level", "contact[0].tangential_stiffness"]
    run(tmp_path, job | {"sensitivity": {"to": names}})
    rows_of = {row["parameter"]: row for row in table(tmp_path, "--sensitivities") if row["quantity"] == "x_amplitude"}

    def amplitudes(changed: Job) -> float:
        with attrito.run(changed, MPI.COMM_SELF, folder=tmp_path, quiet=True) as result:
            return float(result.monitors.x.amplitude[0])

    here = amplitudes(job)
    for name in names:
        corner = []
        for side, column in ((-1.0, "below"), (1.0, "above")):
            changed = [with_parameter(job, name, side * step) for step in STEPS]
            scale = changed[0][1] / (side * STEPS[0])
            corner.append(side * one_sided(np.array([here, *(amplitudes(other) for other, _ in changed)])) / scale)
            # The point is 1e-9 away from the corner, 2e-5 of the step, and friction 1e-7: what is left of its root.
            assert float(rows_of[name][column]) == pytest.approx(corner[-1], rel=1e-4)
        assert abs(corner[1] - corner[0]) > 0.01 * abs(corner[0])


def test_a_mode_has_both_derivatives_where_its_contact_begins_to_slip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One mass and one Coulomb element: W = 4 mu N (X - mu N / kt) beyond X = mu N / kt, where Q = X sqrt(M)."""
    monkeypatch.setattr(tracker, "AMPLITUDE_TOLERANCE", 1e-13)
    job = rubbing()
    job["balance"] = {"harmonics": 1, "residual_tolerance": 1e-13}
    amplitude = LIMIT / KT
    job["mode"] = {"start": 0.5 * amplitude * MASS**0.5, "stop": amplitude * MASS**0.5, "points": 2}
    job["sensitivity"] = {"to": ["contact[0].friction_coefficient"]}
    with attrito.mode(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as result:
        omega = 2.0 * np.pi * float(result.points.frequency_hz[1])
        sides = [np.asarray(getattr(result.sensitivity, side).damping_ratio)[:, 0] for side in ("below", "above")]
        frequency = [np.asarray(getattr(result.sensitivity, side).frequency_hz)[1, 0] for side in ("below", "above")]
    assert np.isnan(sides[0][0]) and np.isnan(sides[1][0])
    friction = job["contact"][0]["friction_coefficient"]
    slope = -4.0 * LIMIT * LIMIT / (KT * friction) / (2.0 * np.pi * omega**2 * MASS * amplitude**2)
    # Slip lasts for the root of 1e-9 of a period, 3e-5, which is extrapolated; the onset itself is met to 1e-13.
    assert sides[0][1] == pytest.approx(slope, rel=1e-6)
    assert abs(sides[1][1]) < 1e-9 * abs(slope)
    # The stiffness that is missing grows as the power 3/2 of how far it slips.
    assert np.abs(frequency).max() < 1e-3 * omega * abs(slope)


def test_a_peak_at_which_a_contact_begins_to_slip_stays_there(tmp_path: Path) -> None:
    """Across the contact the response rises until it sticks and falls from there on."""
    job = pressed(wedge(force=10.0))
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["output"]["monitors"] = [{"name": "m", "dofs": [[0, float(np.cos(1.5184))], [1, float(np.sin(1.5184))]]}]
    job["sweep"] = {"start_hz": 130.8, "stop_hz": 142.8}
    job["peak"] = {"start": 1.0, "stop": 1.01, "near_hz": 136.8}

    def peak(changed: Job) -> dict[str, np.ndarray]:
        with attrito.peak(changed, MPI.COMM_SELF, folder=tmp_path, quiet=True):
            pass
        with h5py.File(tmp_path / "result.peaks.h5") as file:
            found = {name: dataset[0] for name, dataset in file["peaks"].items() if isinstance(dataset, h5py.Dataset)}
        assert found["corner"] == 1
        return found

    names = ["contact[0].friction_coefficient", "load.preload"]
    exact = peak(job | {"sensitivity": {"to": names}})
    for number, name in enumerate(names):
        ends, changes = zip(*(with_parameter(job, name, side * 1e-2) for side in (-1.0, 1.0)), strict=True)
        low, high = map(peak, ends)
        for quantity, derivatives in (("amplitude", "sensitivity"), ("frequency_hz", "sensitivity_frequency")):
            slope = (high[quantity] - low[quantity]) / (changes[1] - changes[0])
            # The corner is found to 1e-9 of the height, that is 1e-7 of friction: slip lasts for the root of it.
            assert exact[derivatives][number] == pytest.approx(slope, rel=2e-3)


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
