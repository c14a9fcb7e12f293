"""The estimated error of a nonlinear mode by periodic motion, held against longer series and against events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito, table, write_job
from mode_jobs import rubbing, weakly_damped_wedge

from attrito.results.result import Result


def rows_of(folder: Path, job: Job) -> list[dict[str, float]]:
    """Numbers of the table of a job's mode, in a folder of its own."""
    folder.mkdir()
    done = attrito(folder, "mode", write_job(folder, job))
    assert done.returncode == 0, done.stdout + done.stderr
    words = ("converged", "outcome")
    return [
        {name: float(value) for name, value in row.items() if name not in words}
        for row in table(folder, result="result.mode.h5")
    ]


def true_error(row: dict[str, float], reference: dict[str, float]) -> float:
    """The largest relative error of frequency, negative damping and monitors."""

    def numbers(of: dict[str, float]) -> np.ndarray:
        ratio = of["damping_ratio"] + of["damping_ratio_structure"]
        monitors = [value for name, value in of.items() if name.endswith("_amplitude")]
        return np.array([of["frequency_hz"], of["frequency_hz"] * ratio, *monitors])

    return float(np.abs(numbers(row) / numbers(reference) - 1.0).max())


def wedge_job(harmonics: int) -> Job:
    """A contact whose normal force varies and that opens."""
    job = weakly_damped_wedge()
    job["balance"]["harmonics"] = harmonics
    return job


@pytest.mark.parametrize("harmonics", [3, 7])
@pytest.mark.parametrize("job_of", [rubbing, wedge_job])
def test_the_estimate_is_the_error_against_a_series_six_times_as_long(tmp_path, job_of, harmonics):
    rows = rows_of(tmp_path / "short", job_of(harmonics))
    references = rows_of(tmp_path / "long", job_of(6 * harmonics))
    slipping = 0
    for row, reference in zip(rows, references, strict=True):
        if row["dissipated_energy"] == 0.0:
            # What sticks is linear.
            assert row["estimate"] == 0.0
            continue
        slipping += 1
        # The reference's own error is below 6^-2 of this one; an estimate is at least a third of the error. That of the
        # motion's change bounds what it does to an amplitude, whose parts may cancel: a tenth.
        error = true_error(row, reference)
        assert error / 3.0 <= row["estimate"] <= 10.0 * error + 1e-6
    assert slipping >= 6, "the test is void unless it slips"


@pytest.mark.parametrize("method", ["epmc", "quasi_static"])
def test_a_file_of_modes_has_no_errors_of_contacts_work_which_nobody_estimates(tmp_path, method):
    job = rubbing()
    job["mode"] |= {"method": method, "points": 4}
    assert rows_of(tmp_path / "mode", job)
    with Result(tmp_path / "mode" / "result.mode.h5") as result:
        assert result.has("/contacts/dissipated_energy")
        assert not result.has("/contacts/dissipated_energy_error")
