"""Contacts with two tangents by events: the limit of ever more samples."""

from __future__ import annotations

import pytest
from jobs import by_samples, chain, run, table


def amplitudes(folder, job, **balance):
    folder.mkdir()
    run(folder, job | {"balance": {"harmonics": 5, **balance}})
    return [float(row["end_amplitude"]) for row in table(folder)]


def test_samples_come_to_the_exact_response_with_the_square_of_their_number(tmp_path):
    sweep = {"sweep": {"frequencies_hz": [107.0, 102.0, 97.0]}}
    exact = amplitudes(tmp_path / "exact", chain(3, 2) | sweep)
    for samples, most in ((256, 2e-3), (4096, 8e-6)):
        sampled = amplitudes(tmp_path / str(samples), by_samples(chain(3, 2)) | sweep, samples=samples)
        assert sampled == pytest.approx(exact, rel=most)
        assert samples > 256 or sampled != pytest.approx(exact, rel=1e-7)
