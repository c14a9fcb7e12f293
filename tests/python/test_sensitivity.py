"""Derivatives by parameters against differences of solved points, and what is no parameter."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito, attrito_here, chain, run, table, wedge, write_job
from slopes import LAW, SHORT_STEP, STEP, by_contact, compared, pressed, solved, with_parameter

from attrito.results.result import Result
from attrito.support.errors import InputError


def test_by_events(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(force=30.0))
    job["balance"] = {"harmonics": 7, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [110.0, 125.0, 140.0]}
    compared(tmp_path, job, STEP, 1e-6, capfd)


def test_quantities_of_contacts_by_loads_and_damping(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Directly, and by the adjoint where there are more parameters than quantities."""
    job = pressed(wedge(force=30.0)) | {"damping": {"rayleigh": [3.0, 1e-4]}}
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0], "levels": [1.1]}
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    job["load"][1]["name"] = "shaker"
    columns = ("dissipated_energy", "n_mean", "t1_mean")
    names = ["load.shaker", "damping.rayleigh[0]", "damping.rayleigh[1]", "load.preload"]
    names += [f"contact[0].{key}" for key in LAW]

    def derivatives(to: list[str]) -> np.ndarray:
        asked = {"to": to, "of": [f"contact[0].{name}" for name in columns[:2]] + ["t1_mean"]}
        rows = solved(tmp_path, job | {"sensitivity": asked}, capfd, "--sensitivities")
        assert [row["quantity"] for row in rows[2 * len(to) :: len(to)]] == asked["of"]
        return np.array([float(row["derivative"]) for row in rows]).reshape(5, len(to))

    def found(changed: Job) -> np.ndarray:
        (point,), (contact,) = solved(tmp_path, changed, capfd), solved(tmp_path, changed, capfd, "--contacts")
        return np.array([float(point["x_amplitude"]), float(point["x_mean"]), *(float(contact[c]) for c in columns)])

    adjoint, direct = derivatives(names), np.hstack([derivatives(names[:4]), derivatives(names[4:])])
    expected = np.zeros_like(adjoint)
    scales = np.array([with_parameter(job, name, 1.0)[1] if "damp" not in name else 1.0 for name in names])
    scales[1:3] = job["damping"]["rayleigh"]
    for number, name in enumerate(names):
        slopes = []
        for step in (STEP, 2.0 * STEP):
            sides = [found(with_parameter(job, name, side * step)[0]) for side in (-1.0, 1.0)]
            slopes.append((sides[1] - sides[0]) / (2.0 * step * scales[number]))
        expected[:, number] = (4.0 * slopes[0] - slopes[1]) / 3.0
    largest = np.max(np.abs(expected * scales), axis=1)
    assert np.all(largest > 0.0)
    for exact in (adjoint, direct):
        # As above, of each quantity.
        assert np.max(np.abs(exact - expected) * scales / largest[:, np.newaxis]) < 1e-6


def test_contacts_that_stick_hold_their_sliders(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(), friction_coefficient=5.0)
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [110.0, 132.0]}
    compared(tmp_path, job, STEP, 1e-6, capfd)


@pytest.mark.parametrize("tangents", [1, 2])
def test_along_one_tangent_and_two(tmp_path: Path, capfd: pytest.CaptureFixture[str], tangents: int) -> None:
    job = pressed(chain(2, tangents))
    del job["damping"]
    job["model"]["damping"] = (20.0 * np.eye(len(job["model"]["mass"]))).tolist()
    job["balance"] = {"harmonics": 3, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [84.0, 79.0], "levels": [6.0]}
    compared(tmp_path, job, SHORT_STEP, 1e-4, capfd)


def test_elements_in_parallel(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # At lower frequencies its last slider rests where the load path left it, which differences follow.
    job = pressed(wedge(force=20.0), law="iwan", chi=-0.4, beta=0.5, sliders=5)
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [125.0, 130.0]}
    compared(tmp_path, job, STEP, 1e-6, capfd)


@pytest.mark.parametrize("tangents", [1, 2])
def test_directly_and_by_the_adjoint(tmp_path: Path, tangents: int) -> None:
    """Few parameters go directly, all of them by the adjoint; more than 400 unknowns by GMRES."""
    job = chain(9, tangents)
    job["damping"] = {"rayleigh": [20.0, 0.0]}
    job["balance"] = {"harmonics": 15 if tangents == 1 else 7, "residual_tolerance": 1e-12}
    job["sweep"] = {"frequencies_hz": [80.0], "levels": [8.0]}
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    names = by_contact(job)
    run(tmp_path, job | {"sensitivity": {"to": names}})
    adjoint = {row["parameter"]: row for row in table(tmp_path, "--sensitivities") if "amplitude" in row["quantity"]}
    largest = max(abs(float(row["derivative"]) * float(row["value"] or 1.0)) for row in adjoint.values())
    for pair, ranks in ((names[:2], None), (names[2:5:2], 2), (names[-2:], None)):
        run(tmp_path, job | {"sensitivity": {"to": pair}}, ranks)
        for row in table(tmp_path, "--sensitivities"):
            if "amplitude" in row["quantity"]:
                change = float(row["derivative"]) - float(adjoint[row["parameter"]]["derivative"])
                # Both solve their systems to 1e-9, with what is between their norms and this.
                assert abs(change * float(row["value"] or 1.0)) < 1e-7 * largest


def test_a_result_gives_a_derivative_by_name(tmp_path: Path) -> None:
    job = pressed(wedge(force=30.0)) | {"sensitivity": {"to": ["level", "contact[0].friction_coefficient"]}}
    run(tmp_path, job)
    with Result(tmp_path / "result.h5") as result:
        rows = table(tmp_path, "--sensitivities")
        for row in rows:
            name, _, quantity = row["quantity"].partition("_")
            found = result.sensitivity(row["parameter"], name, quantity)
            assert found == pytest.approx([float(row["derivative"])], rel=1e-9)
        with pytest.raises(InputError, match="one of level, contact"):
            result.sensitivity("contact[0].gap", "x")
        with pytest.raises(InputError, match="one of x, y"):
            result.sensitivity("level", "z")


def test_peaks_change_as_their_derivatives_say(tmp_path: Path) -> None:
    job = tomllib.loads((Path(__file__).resolve().parents[2] / "input" / "wedge_peak.toml").read_text())
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-12}
    job["peak"] = {"start": 18.0, "stop": 24.0}
    job["output"]["file"] = "result.h5"
    names = ["contact[0].tangential_stiffness", "contact[0].friction_coefficient", "load.preload", "level"]

    def peaks(changed: Job) -> list[dict[str, str]]:
        write_job(tmp_path, changed)
        done = attrito(tmp_path, "peak", "job.toml")
        assert done.returncode == 0, done.stderr
        return table(tmp_path, result="result.peaks.h5")

    rows = peaks(job | {"sensitivity": {"to": names}})
    for row in rows:
        # The tracker's own slope along the peaks: response A/L, elasticity d ln (A/L)/d ln L.
        slope = (1.0 + float(row["elasticity"])) * float(row["response"])
        assert float(row["amplitude by level"]) == pytest.approx(slope, rel=1e-6)
    first = rows[0]
    slopes: dict[str, list[float]] = {"frequency by level": []}
    for name in names:
        there = []
        for side in (-1.0, 1.0):
            changed, change = with_parameter(job | {"peak": {"start": 18.0, "stop": 18.5}}, name, side * 1e-3)
            if name == "level":
                changed["peak"]["start"] += side * 1e-3
            there.append(peaks(changed)[0])
        for what, column in (("amplitude", "amplitude"), ("frequency", "frequency_hz")):
            slope = (float(there[1][column]) - float(there[0][column])) / (2.0 * abs(change))
            scale = float(first[column]) / (abs(change) / 1e-3)
            # Central differences over 1e-3, of peaks that are exact to second order in their frequency.
            assert float(first[f"{what} by {name}"]) == pytest.approx(slope, abs=1e-5 * scale)
            if what == "frequency":
                slopes[name] = [float(first[f"{what} by {name}"]) / scale, slope / scale]
    # Frequencies change little: relative to the largest change, whose differences leave 1e-6 times third derivatives.
    largest = max(abs(slope) for _, slope in filter(None, slopes.values()))
    for exact, slope in filter(None, slopes.values()):
        assert abs(exact - slope) < 1e-4 * largest


def test_derivatives_of_another_amplitude_than_the_peak_s_are_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    job = wedge() | {"sensitivity": {"to": ["level"]}, "sweep": {"start_hz": 150.0, "stop_hz": 85.0}}
    write_job(tmp_path, job | {"peak": {"start": 1.0, "stop": 2.0, "amplitude": "first_harmonic"}})
    done = attrito_here(tmp_path, capfd, "peak", "job.toml")
    assert done.returncode == 2
    assert '"half_range" with [sensitivity]' in done.stderr


def test_a_set_is_the_sum_of_its_contacts(tmp_path: Path) -> None:
    job = chain(3)
    job["sweep"] = {"frequencies_hz": [80.0], "levels": [4.0]}
    single = [f"contact[{i}].friction_coefficient" for i in range(3)]
    job["sensitivity"] = {"to": [*single, "contact[*].friction_coefficient"]}
    for ranks in (None, 2):
        run(tmp_path, job, ranks)
        values = [float(row["derivative"]) for row in table(tmp_path, "--sensitivities")][:4]
        assert sum(values[:3]) == pytest.approx(values[3], rel=1e-7)
        assert values[3] != 0.0


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("contact[3].gap", "one of the job's [[contact]], of which there are 1"),
        ("contact[0].law", "KEY one of tangential_stiffness"),
        ("load.none", "the name of a load: preload"),
        ("damping.scale", 'or "level"'),
        ("damping.ratio", "a damping that the job gives"),
        ("contact[0].chi", "a parameter that is a number"),
        ("contact[0].friction_coefficient[1]", "a row, from 0, of a table by pressure"),
    ],
)
def test_no_parameter(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, expected: str) -> None:
    write_job(tmp_path, wedge() | {"sensitivity": {"to": ["level", name]}})
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2
    assert f"[sensitivity] to[1] = {name}" in done.stderr.replace('"', "") or f"to[1] = {name!r}" in done.stderr
    assert expected in done.stderr


@pytest.mark.parametrize(("monitor", "quantity"), [("n_mean", "n_mean"), ("n", "n_mean")])
def test_a_quantity_named_like_a_monitor_s_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monitor: str, quantity: str
) -> None:
    job = wedge() | {"sensitivity": {"to": ["level"], "of": ["dissipated_energy", quantity]}}
    job["output"]["monitors"][0]["name"] = monitor
    write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2
    assert "[sensitivity] of[1]" in done.stderr and "a quantity that no monitor is named like" in done.stderr


def test_no_derivative_by_friction_where_there_is_none(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = pressed(wedge(), friction_coefficient=0.0)
    write_job(tmp_path, job | {"sensitivity": {"to": ["contact[0].friction_coefficient"]}})
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2
    assert "a friction coefficient above 0" in done.stderr


def test_stiffness_with_a_ratio_of_stuck_modes_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_job(tmp_path, chain(2) | {"sensitivity": {"to": ["contact[0].normal_stiffness"]}})
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2
    assert "a ratio of the stuck modes" in done.stderr
