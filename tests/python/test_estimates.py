"""The estimated errors of peaks and of dissipated energy, held against long series."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest
from jobs import Job, attrito, run, table, wedge, write_job

LONG = 40


def at_level(level: float, harmonics: int) -> Job:
    """The paper's wedge on few harmonics, between sticking and lift-off."""
    made = wedge(force=1.0)
    made["static"] = {"load_path": [0.0, 1.0]}
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["peak"] = {"start": level, "stop": 1.2 * level}
    made["balance"] = {"harmonics": harmonics}
    return made


def peaks(folder: Path, level: float, harmonics: int) -> list[dict[str, str]]:
    """Table of the peaks of a job in a folder of its own."""
    folder.mkdir()
    done = attrito(folder, "peak", write_job(folder, at_level(level, harmonics)))
    assert done.returncode == 0, done.stdout + done.stderr
    return table(folder, result=next(folder.glob("*.h5")).name)


@pytest.mark.parametrize("level", [10.0, 40.0])
def test_the_errors_of_a_peak_are_those_of_its_amplitude_and_its_frequency(tmp_path, level):
    short, long = (peaks(tmp_path / str(count), level, count) for count in (3, LONG))
    errors = []
    for row, reference in ((short[0], long[0]), (short[-1], long[-1])):
        for name, of in (("amplitude", "amplitude_error"), ("frequency_hz", "frequency_error")):
            error, estimate = abs(float(row[name]) / float(reference[name]) - 1.0), float(row[of])
            # The reference's own error is a hundredth of this one. Parts of a change may cancel, so there is a floor.
            assert error / 3.0 <= estimate <= 30.0 * error + 1e-5
            errors.append(error)
    assert max(errors) > 1e-4, "the test is void unless three harmonics are too few"


def test_a_peak_above_the_tolerance_by_its_own_error_is_solved_with_more_harmonics(tmp_path):
    made = at_level(40.0, 3) | {"balance": {"tolerance": 1e-5}}
    done = attrito(tmp_path, "peak", write_job(tmp_path, made))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "again with" in done.stdout + done.stderr
    assert all(
        float(row["amplitude_error"]) <= 1e-5 for row in table(tmp_path, result=next(tmp_path.glob("*.h5")).name)
    )


def test_the_error_of_a_contact_s_work_is_estimated(tmp_path):
    found = {}
    for count in (3, LONG):
        folder = tmp_path / str(count)
        folder.mkdir()
        made = wedge(force=40.0) | {"balance": {"harmonics": count}}
        run(folder, made | {"sweep": {"frequencies_hz": [132.0, 120.0, 110.0, 103.0]}})
        found[count] = table(folder, "--contacts")
    amplitudes = [float(row["estimate"]) for row in table(tmp_path / "3")]
    with h5py.File(tmp_path / "3" / "result.h5") as file:
        assert file["contacts/dissipated_energy_error"].attrs["unit"] == "user energy"
        estimates = file["contacts/dissipated_energy_error"][:, 0]
    slipping = 0
    for row, reference, of_amplitude, estimate in zip(found[3], found[LONG], amplitudes, estimates, strict=True):
        work = float(reference["dissipated_energy"])
        if row["state"] not in ("slipping", "open"):
            assert estimate <= 1e-9 * max(work, 1e-9)
            continue
        error = abs(float(row["dissipated_energy"]) - work)
        # No less than what the amplitude's error makes of it, and no more than that unless the error is.
        assert 2.0 * of_amplitude * float(row["dissipated_energy"]) <= 1.001 * estimate
        assert error / 3.0 <= estimate <= max(30.0 * error, 2.001 * of_amplitude * float(row["dissipated_energy"]))
        slipping += error > 1e-3 * work
    assert slipping, "the test is void unless three harmonics are too few"
