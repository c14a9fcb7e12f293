"""What answers must not depend on: units of time, length and mass; the number of ranks."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import attrito_here, chain, run, wedge, write_job
from units import Units, numbers

# A million and a millionth as powers of two: rounding is the same, and every absolute constant shows. One that is not.
UNITS = [Units(time=2.0**-20), Units(time=2.0**20), Units(length=2.0**-20), Units(mass=2.0**20), Units(1e-6, 1e3, 1e-6)]
NAMES = ["time / 2^20", "time x 2^20", "length / 2^20", "mass x 2^20", "us, mm, t"]
# What rounding alone makes: residuals, work of contacts that stick, and margins of couplings that are none.
ROUNDING = ("residual", "defect", "contraction", "dissipated_energy", "dissipated_energy_error", "friction_margin")
ROUNDING = (*ROUNDING, "evaluations", "work", "elasticity", "seconds")


def jobs():
    """Scenes that stick, slip, open, are one of a family, maybe stable, followed, integrated, at their peak."""
    sweep = wedge(force=5.0)
    sweep["sweep"] = {"start_hz": 140.0, "stop_hz": 125.0}
    family = wedge(force=1.0)
    family["sweep"] = {"frequencies_hz": [132.0, 125.0]}
    opening = wedge(force=30.0)
    opening["balance"] = {"tolerance": 0.01}
    opening["sweep"] = {"frequencies_hz": [132.0, 120.0]}
    opening["stability"] = {"method": "monodromy"}
    discs = chain(tangents=2)
    discs["damping"] = {"rayleigh": [3.0, 2.0e-5]}
    discs["load"][1] |= {"cosine": [[0, 48.0]], "sine": [[3, 24.0]]}
    discs["sweep"] = {"frequencies_hz": [82.0, 79.0, 76.0, 73.0]}
    structural = chain()
    structural["damping"] = {"loss_factor": 0.02}
    structural["load"][1] |= {"cosine": [[0, 48.0]]}
    structural["sweep"] = {"frequencies_hz": [82.0, 79.0, 76.0, 73.0]}
    integrated = wedge()
    integrated["integrate"] = {"frequency_hz": 132.0}
    stepped = wedge()
    stepped["integrate"] = {"frequency_hz": 132.0, "scheme": "hht"}
    peak = wedge()
    peak["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    peak["peak"] = {"start": 0.2, "stop": 0.4}
    return {
        "sweep": ("run", sweep),
        "family": ("run", family),
        "opening": ("run", opening),
        "discs": ("run", discs),
        "structural": ("run", structural),
        "events in time": ("integrate", integrated),
        "steps in time": ("integrate", stepped),
        "peak": ("peak", peak),
    }


def result(folder, capfd, command, job, units=None):
    """Numbers of a job run in units."""
    folder.mkdir()
    done = attrito_here(folder, capfd, command, write_job(folder, job if units is None else units.job(job)))
    assert done.returncode == 0, done.stderr
    (file,) = [path for path in folder.iterdir() if path.suffix == ".h5"]
    return numbers(file, units)


@pytest.mark.parametrize("name", jobs())
def test_units_change_neither_answers_nor_iterations(tmp_path, capfd, name):
    command, job = jobs()[name]
    before = result(tmp_path / "before", capfd, command, job)
    for units, words in zip(UNITS, NAMES, strict=True):
        after = result(tmp_path / words.replace(" / ", "_"), capfd, command, job, units)
        assert before.keys() == after.keys()
        for path, expected in before.items():
            if path.endswith(ROUNDING) or "multipliers" in path:
                continue
            found = after[path]
            assert found.shape == expected.shape, (words, path)
            assert np.array_equal(np.isfinite(found), np.isfinite(expected)), (words, path)
            finite = np.isfinite(expected)
            size = np.abs(expected[finite]).max(initial=0.0)
            assert np.abs(found - expected)[finite].max(initial=0.0) <= 1e-9 * size, (words, path)
            if path.endswith("iterations"):
                assert np.array_equal(found, expected), words


def largest(values):
    """By point."""
    return np.nanmax(np.abs(values).reshape(len(values), -1), axis=1)


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_change_nothing_where_contacts_slip_stick_and_are_started_in_time(tmp_path, tangents, ranks):
    job = chain(12, tangents)
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["static"] = {"bounds": "none"}
    job["load"][1] = {"kind": "harmonic", "cosine": [[i, 40.0 * float(np.cos(i))] for i in range(12)]}
    # Points that motion in time leads to are among them; it leaves the sliders of contacts that stick.
    job["sweep"] = {"frequencies_hz": [95.0, 90.0, 85.0, 80.0, 75.0]}
    found = []
    for count in (1, ranks):
        folder = tmp_path / str(count)
        folder.mkdir()
        run(folder, job, ranks=count)
        found.append(numbers(folder / "result.h5"))
    one, other = found
    states = one["contacts/state"]
    assert np.mean(states == 2) > 0.4
    assert np.any(states == 0)
    assert np.array_equal(states, other["contacts/state"])
    force = np.nanmax(np.abs(one["contacts/force"]))
    # Sliders that contacts keep from motion in time sum up what its steps, some thousands, leave: 1e-13 each.
    kept = one["points/unique"] == 0
    near = np.where(kept, 1e-9, 1e-10)
    assert not kept.all()
    for path in ("contacts/force", "contacts/t1_mean", "contacts/n_mean"):
        assert np.all(largest(one[path] - other[path]) <= near * force), path
    for path in ("monitors/end/amplitude", "monitors/end/mean", "contacts/slider"):
        assert np.all(largest(one[path] - other[path]) <= near * np.abs(one[path]).max()), path
