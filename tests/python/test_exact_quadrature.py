"""Contacts with two tangents by events."""

from __future__ import annotations

import numpy as np
import peaks
import peaks_scenes
import pytest
from jobs import attrito_here, by_pressure, chain, run, table, write_job
from mpi4py import MPI
from slopes import with_parameter

from attrito.library.session import Options, Solver
from attrito.peaks.run import follow


def amplitudes(folder, job, **balance):
    folder.mkdir()
    run(folder, job | {"balance": {"harmonics": 5, **balance}})
    return [float(row["end_amplitude"]) for row in table(folder)]


def test_one_coefficient_for_all_pressures_is_coulombs_law(tmp_path):
    job = chain(3, 2) | {"sweep": {"frequencies_hz": [107.0, 102.0, 97.0]}}
    plain = amplitudes(tmp_path / "plain", job)
    # Panels are cut at other instants: they leave 1e-8 of the forces.
    assert amplitudes(tmp_path / "law", by_pressure(job)) == pytest.approx(plain, rel=1e-7)


def test_a_contact_without_friction_opens_along_two_tangents_as_along_one(tmp_path):
    # The damping of modes would feel the springs of the second tangent.
    job = chain(3, 2) | {"damping": {"rayleigh": [12.0, 0.0]}, "sweep": {"frequencies_hz": [100.0, 110.0]}}
    for contact in job["contact"]:
        contact["friction_coefficient"] = 0.0
    # Normal to the walls.
    job["load"][-1] |= {"cosine": [[7, 60.0], [0, 20.0]], "sine": [[1, 10.0]]}
    along_two = amplitudes(tmp_path / "two", job)
    rows = table(tmp_path / "two", "--contacts")
    assert any(0.0 < float(row["open"]) < 1.0 for row in rows), "nothing opens: the test is void"
    for contact in job["contact"]:
        del contact["tangents"][1]
    assert amplitudes(tmp_path / "one", job) == pytest.approx(along_two, rel=1e-8)


@pytest.mark.parametrize("number", [15, 27, 44, 51])
def test_peaks_are_found_by_newtons_method(number):
    scene = peaks_scenes.make(1, number)
    assert "2 tangents" in scene.kind
    options = Options(5, 128)
    job = peaks.keys_of(scene, "level_up")
    with Solver(MPI.COMM_SELF, scene.reduced, options) as solver:
        solver.follow_static_path(peaks.PATH, peaks.STATIC_STEPS, scene.band_hz[0])
        followed = [(one, solver.save_state()) for one in follow(solver, job, scene.reduced, peaks.PATH)]
    assert followed[-1][0].peak.parameter == pytest.approx(job["peak"]["stop"], rel=1e-12)
    evaluations = np.diff([one.peak.evaluations for one, _ in followed])
    # A climb takes some 20, and 60 to see whether another maximum is higher.
    assert np.median(evaluations) <= 6
    for one, state in followed:
        assert one.converged and one.peak.curvature < 0.0
        if one.kind == "value":
            assert peaks.dense(scene, options, one, state, 1.0) == pytest.approx(one.peak.amplitude, rel=1e-9)


def test_the_frequency_of_a_peak_has_the_derivatives_of_differences(tmp_path, capfd):
    job = chain(3, 2) | {"damping": {"rayleigh": [12.0, 0.0]}, "sweep": {"start_hz": 105.0, "stop_hz": 120.0}}
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-12}
    names = ["contact[0].friction_coefficient", "contact[2].normal_stiffness", "load.press"]
    job["peak"] = {"start": 5.0, "stop": 5.01}

    def first_peak(changed):
        write_job(tmp_path, changed)
        done = attrito_here(tmp_path, capfd, "peak", "job.toml")
        assert done.returncode == 0, done.stderr
        return table(tmp_path, result="result.peaks.h5")[0]

    first = first_peak(job | {"sensitivity": {"to": names}})
    exact, expected = [], []
    for name in names:
        slopes = []
        for step in (1e-3, 2e-3):
            there = [with_parameter(job, name, side * step) for side in (1.0, -1.0)]
            above, below = (float(first_peak(changed)["frequency_hz"]) for changed, _ in there)
            slopes.append((above - below) / 2e-3 * 1e-3 / step)
            scale = abs(there[0][1]) / step
        exact.append(float(first[f"frequency by {name}"]) * scale)
        expected.append((4.0 * slopes[0] - slopes[1]) / 3.0)
    # By parts of the parameters; what the two steps leave is of their fourth power.
    assert exact == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
