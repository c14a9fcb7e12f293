"""Modes of equal frequency: the one that is asked for is followed, whatever mixture it is of."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import attrito, table, write_job
from mode_jobs import KT, LIMIT, MASS, K, cut_short, described, follow, rubbing
from mpi4py import MPI

from attrito.modes import tracker
from attrito.modes.mode_slopes import EQUAL
from attrito.modes.nonlinear import mode_job
from attrito.runs.tangent_modes import equal_modes, said_of_equal

# What panels of slip leave of the forces at most
PANELS = 1e-8


def sliding(stop: float = 2.0e-2) -> dict:
    """A mass on a plane with friction: along both tangents alike, modes 1 and 2 are equal, and so is any direction."""
    job = rubbing(stop=stop)
    job["model"] = {"mass": (MASS * np.eye(3)).tolist(), "stiffness": (K * np.eye(3)).tolist()}
    job["contact"][0] |= {"normal": [[2, 1.0]], "tangents": [[[0, 1.0]], [[1, 1.0]]]}
    job["load"] = [{"name": "press", "kind": "static", "dofs": [[2, 46.875]]}]
    job["balance"] = {"harmonics": 1}
    return job


def check_describing_function(rows: list[dict[str, float]]) -> None:
    """Frequency and work of one harmonic of a Coulomb element, along any tangent."""
    slipping = 0
    for row in rows:
        omega, work, slips = described(row["amplitude"])
        slipping += slips
        largest = 4.0 * LIMIT * row["amplitude"] / np.sqrt(MASS)
        assert row["frequency_hz"] == pytest.approx(omega / (2 * np.pi), rel=PANELS)
        assert row["dissipated_energy"] == pytest.approx(work, abs=PANELS * largest)
    assert 0 < slipping < len(rows), "the test is void unless it sticks at first and slips later"


@pytest.mark.parametrize("number", [1, 2])
def test_each_of_two_equal_modes_of_a_sliding_mass_is_that_of_its_describing_function(tmp_path, number):
    job = sliding()
    job["mode"]["number"] = number
    check_describing_function(follow(tmp_path, job))


@pytest.mark.parametrize("turn", [0.3, 0.25 * np.pi, 2.0])
def test_a_mixture_of_equal_modes_stays_the_one_that_was_asked_for(tmp_path, monkeypatch, turn):
    begin = tracker.ModeTracker.__init__

    def begin_turned(self, solver, scene, shapes, frequency_hz):
        turned = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]] @ shapes
        begin(self, solver, scene, turned, frequency_hz)

    monkeypatch.setattr(tracker.ModeTracker, "__init__", begin_turned)
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path, sliding())
    mode_job(MPI.COMM_WORLD, "job.toml")
    names = ("amplitude", "frequency_hz", "dissipated_energy")
    rows = table(tmp_path, result="result.mode.h5")
    check_describing_function([{name: float(row[name]) for name in names} for row in rows])
    with h5py.File(tmp_path / "result.mode.h5") as file:
        motion = file["points/coordinates"][:, :2, 1]
    # In one plane with the mode that was asked for, or Q would not be the amplitude of the motion.
    direction = motion[0] / np.linalg.norm(motion[0])
    across = motion @ [-direction[1], direction[0]]
    assert min(abs(direction)) > 0.1, "the test is void unless both modes are in the mixture"
    assert across == pytest.approx(0.0, abs=1e-6 * np.abs(motion).max())


def test_a_mode_among_equal_ones_that_is_cut_short_goes_on_as_if_it_had_not_been(tmp_path, monkeypatch):
    whole = follow(tmp_path, sliding())
    iterations = [row["iterations"] for row in table(tmp_path, result="result.mode.h5")]
    (tmp_path / "result.mode.h5").unlink()
    cut_short(tmp_path, monkeypatch, 8)
    done = attrito(tmp_path, "mode", "job.toml", "--resume")
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    for row, other in zip(rows, whole, strict=True):
        assert {name: float(row[name]) for name in other} == pytest.approx(other, rel=1e-7, abs=1e-12)
    assert [row["iterations"] for row in rows] == iterations


def test_a_mode_among_equal_ones_has_no_derivatives_and_says_so(tmp_path):
    job = sliding()
    job["mode"]["points"] = 2
    job["sensitivity"] = {"to": ["contact[0].friction_coefficient"]}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(EQUAL) == 2
    with h5py.File(tmp_path / "result.mode.h5") as file:
        assert np.isnan(file["sensitivity/frequency_hz"][:]).all()


def test_a_mode_among_equal_ones_is_said_to_be_one_of_them(tmp_path):
    job = rubbing()
    # Along its normal as stiff as along its tangent: both modes have sqrt((K + KT) / MASS).
    job["contact"][0]["normal_stiffness"] = KT
    job["mode"] |= {"points": 2}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    sentence = said_of_equal([1, 2])
    assert "tangent modes 1, 2 have the same frequency" in sentence
    assert f"warning: {sentence}" in done.stdout
    with h5py.File(tmp_path / "result.mode.h5") as file:
        assert sentence in file.attrs["warnings"].split("\n")
    # Where it is lost nevertheless that is the reason that is given.
    assert done.returncode == 0 or sentence in done.stderr


def test_modes_are_equal_to_rounding_and_no_further():
    hertz = np.array([100.0, 100.0 * (1.0 + 1e-9), 100.0 * (1.0 + 1e-5)])
    assert [equal_modes(hertz, number) for number in (1, 2, 3)] == [[1, 2], [2, 1], [3]]
    assert not said_of_equal([3])
