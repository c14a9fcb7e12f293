"""Frequencies of a shaft with Coriolis forces against CalculiX's `*COMPLEX FREQUENCY, CORIOLIS`."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from calculix_beam import beam_model, solve, write_mesh
from jobs import attrito_here, table, write_job

HZ, COUNT = 150.0, 6


def complex_frequencies(text):
    """Real parts, Hz, of what a `.dat` file lists after its real eigenvalues."""
    rows = text.split("E I G E N V A L U E   O U T P U T")[2].splitlines()
    found = []
    for row in rows:
        words = row.split()
        if len(words) == 4 and words[0] == str(len(found) + 1):
            found.append(float(words[2]))
    return np.array(found)


def test_a_shaft_about_its_own_axis_has_the_frequencies_that_calculix_finds(tmp_path, capfd):
    """Nearly square, 396 and 485 Hz without them, at 150 Hz: bending both ways is coupled by Coriolis forces alone.

    A whole model is the one sector of a wheel of one.
    """
    body = synthetic.block("C3D20", (1, 1, 8), (6.0, 5.0, 100.0), lambda points: points - np.array([0.0, 2.5, 0.0]))
    write_mesh(tmp_path / "mesh.inp", body, {"root": np.flatnonzero(body.points[:, 2] < 1e-6)})
    load = f"*DLOAD\nbody, CENTRIF, {(2 * np.pi * HZ) ** 2:.17g}, 0., 0., 0., 0., 0., 1.\n"
    turning = f"*BOUNDARY\nroot, 1, 3\n*STEP\n*STATIC\n{load}*END STEP\n*STEP, PERTURBATION\n"
    solve(tmp_path, "matrices", f"{turning}*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    modes = "*FREQUENCY, STORAGE=YES\n10\n*END STEP\n"
    solve(tmp_path, "coriolis", f"{turning}{modes}*STEP, PERTURBATION\n*COMPLEX FREQUENCY, CORIOLIS\n6\n*END STEP\n")
    expected = complex_frequencies((tmp_path / "coriolis.dat").read_text())[:COUNT]
    beam_model(tmp_path, "matrices", holds=["stress_stiffening", "spin_softening"], spin_hz=HZ)
    law = {"tangential_stiffness": 1e-6, "normal_stiffness": 1e-6, "friction_coefficient": 0.3}
    axis = {"axis_point": [0.0, 0.0, 0.0], "axis_direction": [0.0, 0.0, 1.0]}
    job = {
        "model": {"file": "matrices.h5"},
        "cyclic": {"sectors": 1, "engine_order": 0, "coriolis": True, **axis},
        "reduction": {"modes": 60},
        "contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], "gap": 1.0, **law}],
        "load": [{"kind": "centrifugal", "speed_hz": HZ, **axis}],
        "output": {"file": "result.h5"},
    }
    found = {}
    for coriolis in (True, False):
        job["cyclic"]["coriolis"] = coriolis
        done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job), "--count", str(COUNT))
        assert done.returncode == 0, done.stderr
        rows = table(tmp_path, result="result.modes.h5")
        found[coriolis] = np.array([float(row["frequency_hz"]) for row in rows])
    assert np.abs(found[True] / found[False] - 1.0)[:2].min() > 0.05, "Coriolis forces do nothing: the test is void"
    # CalculiX finds them among 10 modes without Coriolis forces, to 7 digits; of 20 and more its own scatter by 6e-5.
    assert found[True] == pytest.approx(expected, rel=1e-5)
