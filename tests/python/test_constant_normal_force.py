"""Contacts without a normal displacement: their normal force is the preload at all times.

The twin is the same structure with masses beside it, on springs, pressed by the preload: each stays at rest, and as the
normal displacement of a contact it makes a normal force that is the preload, too.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path

import h5py
import no_folds
import numpy as np
import pytest
from jobs import Job, attrito, run, table, write_job

MASSES, LIMIT, KT, ALPHA = 3, 10.0, 2.0e5, 4.0
MODE = {"start": 1.0e-5, "stop": 1.0e-3, "points": 6}


def chain(tangents: int = 1, **keys: object) -> Job:
    """Masses in a row, of which the last two rub against the ground with a constant limit."""
    size = tangents * MASSES
    ladder = 2 * np.eye(MASSES) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
    return {
        "model": {
            "mass": np.eye(size).tolist(),
            "stiffness": np.kron(np.diag([1.0, 1.3][:tangents]), 2.0e5 * ladder).tolist(),
        },
        "damping": {"rayleigh": [ALPHA, 0.0]},
        "contact": [
            {
                "tangents": [[[t * MASSES + i, 1.0]] for t in range(tangents)],
                "tangential_stiffness": KT,
                "friction_coefficient": 0.5,
                "preload": LIMIT / 0.5,
                **keys,
            }
            for i in (1, 2)
        ],
        "load": [{"kind": "harmonic", "cosine": [[0, 12.0]], "sine": [[size - 1, 5.0]]}],
        "balance": {"harmonics": 7},
        "sweep": {"frequencies_hz": [48.0, 58.0, 70.0], "levels": [0.3, 2.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "end", "dofs": [[MASSES - 1, 1.0]]}]},
    }


def twin(job: Job) -> Job:
    """The same with a mass beside it that contacts press on."""
    job = copy.deepcopy(job)
    for name, value in (("mass", 1.0), ("stiffness", 1.0e6)):
        matrix = np.array(job["model"][name])
        beside = np.zeros((len(matrix) + 2, len(matrix) + 2))
        beside[:-2, :-2], beside[-2:, -2:] = matrix, value * np.eye(2)
        job["model"][name] = beside.tolist()
    size = len(job["model"]["mass"])
    for contact, dof in zip(job["contact"], (size - 2, size - 1), strict=True):
        contact |= {"normal": [[dof, 1.0]], "normal_stiffness": 3.0e5}
        press = {"name": f"press {dof}", "kind": "static", "dofs": [[dof, contact["preload"]]]}
        job["load"].append(press)
    return job


def both(folder: Path, job: Job, command: Callable[[Path, Job], list[dict[str, str]]]) -> list[list[dict[str, str]]]:
    """Rows of the contacts without a normal displacement, and of the twin."""
    found = []
    for name, other in (("without", job), ("twin", twin(job))):
        (folder / name).mkdir()
        found.append(command(folder / name, other))
    return found


def close(rows: list[list[dict[str, str]]], keys: tuple[str, ...], relative: float) -> None:
    """Assert that columns agree, relative to the largest of each."""
    for key in keys:
        without, beside = (np.array([float(row[key]) for row in part]) for part in rows)
        assert np.any(beside != 0.0), key
        assert np.abs(without - beside).max() <= relative * np.abs(beside).max(), key


@pytest.mark.parametrize(
    ("tangents", "keys"),
    [(1, {}), (2, {}), (1, {"law": "iwan", "chi": -0.5, "beta": 0.2})],
    ids=["one tangent", "two tangents", "iwan"],
)
def test_points_are_those_of_contacts_pressed_by_a_mass_at_rest(tmp_path: Path, tangents: int, keys: dict) -> None:
    def points(folder: Path, job: Job) -> list[dict[str, str]]:
        run(folder, job)
        ends = {row["point"]: row for row in table(folder)}
        assert {row["outcome"] for row in ends.values()} == {"converged"}
        return [ends[row["point"]] | row for row in table(folder, "--contacts")]

    rows = both(tmp_path, chain(tangents, **keys), points)
    # The residual's tolerance is 1e-10 of the stuck response.
    close(rows, ("end_amplitude", "dissipated_energy"), 1e-8)
    assert {float(row["n_mean"]) for row in rows[0]} == {LIMIT / 0.5}


def test_multipliers_and_derivatives_are_those_of_contacts_pressed_by_a_mass_at_rest(tmp_path: Path) -> None:
    job = chain()
    job["stability"] = {"method": "monodromy"}
    job["sensitivity"] = {"to": [f"contact[*].{name}" for name in ("tangential_stiffness", "friction_coefficient")]}

    def derivatives(folder: Path, other: Job) -> list[dict[str, str]]:
        run(folder, other)
        return table(folder, "--sensitivities")

    rows = both(tmp_path, job, derivatives)
    assert [row["parameter"] for row in rows[0]] == [row["parameter"] for row in rows[1]]
    close(rows, ("derivative",), 1e-6)
    moduli = {}
    for name in ("without", "twin"):
        with h5py.File(tmp_path / name / "result.h5") as file:
            assert set(file["points/stable"][()].tolist()) == {1}
        for row in table(tmp_path / name, "--multipliers"):
            modulus = float(np.hypot(float(row["real"]), float(row["imag"])))
            moduli.setdefault((row["point"], float(row["frequency_hz"])), {"without": [], "twin": []})[name].append(
                modulus
            )
    for (_, frequency), found in moduli.items():
        # Two pairs are those of the masses beside, which move alone: exp(-alpha T/2) in modulus.
        expected = sorted([*found["without"], *[np.exp(-0.5 * ALPHA / frequency)] * 4])
        assert sorted(found["twin"]) == pytest.approx(expected, abs=1e-6)


def test_a_nonlinear_mode_is_that_of_contacts_pressed_by_a_mass_at_rest(tmp_path: Path) -> None:
    def mode(folder: Path, job: Job) -> list[dict[str, str]]:
        job["mode"] = MODE
        done = attrito(folder, "mode", write_job(folder, job))
        assert done.returncode == 0, done.stdout + done.stderr
        return table(folder, result="result.mode.h5")

    rows = both(tmp_path, chain(), mode)
    close(rows, ("frequency_hz", "damping_ratio", "dissipated_energy"), 1e-6)


def test_integration_in_time_comes_to_the_balance(tmp_path: Path) -> None:
    job = chain()
    job["balance"] = {"harmonics": 40}
    job["sweep"] = {"frequencies_hz": [70.0]}
    run(tmp_path, job)
    balance = float(table(tmp_path)[0]["end_amplitude"])
    job["integrate"] = {"frequency_hz": 70.0, "cycles": 2000}
    done = attrito(tmp_path, "integrate", write_job(tmp_path, job))
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(tmp_path / "result.h5") as file:
        in_time = float(file["integration/monitors/end/amplitude"][()])
    # What 40 harmonics leave of forces with corners in their slope: h^-2 of the force, h^-4 of the motion.
    assert balance == pytest.approx(in_time, rel=1e-5)


def test_a_loop_loses_what_a_jenkins_element_does(tmp_path: Path) -> None:
    stiffness = 1.0e5
    job = chain()
    job["model"] = {"mass": [[1.0]], "stiffness": [[stiffness]]}
    job["contact"] = [job["contact"][0] | {"tangents": [[[0, 1.0]]]}]
    job["load"] = [{"kind": "harmonic", "cosine": [[0, 1.0]]}]
    job["output"]["monitors"][0]["dofs"] = [[0, 1.0]]
    job["mode"] = MODE | {"method": "quasi_static"}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stdout + done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    amplitude = np.array([float(row["amplitude"]) for row in rows])
    lost = np.where(amplitude > LIMIT / KT, 4.0 * LIMIT * (amplitude - LIMIT / KT), 0.0)
    assert np.any(lost)
    assert np.array([float(row["dissipated_energy"]) for row in rows]) == pytest.approx(lost, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"preload": 0.0},
            "contact[0] preload = 0.0: expected a number above 0 without normal: the normal force, which",
        ),
        ({"gap": 1e-6}, "contact[0] gap = 1e-06: expected no such key without normal"),
        ({"normal_stiffness": 1e5}, "contact[0] normal_stiffness = 100000.0: expected no such key without normal"),
        ({"normal": [[0, 1.0]]}, "contact[0] normal_stiffness is missing: expected a number above 0, the stiffness"),
    ],
)
def test_a_contact_that_is_neither_one_nor_the_other_is_refused(tmp_path: Path, change: dict, said: str) -> None:
    job = chain()
    job["contact"][0] |= change
    done = run(tmp_path, job, code=2)
    assert said in done.stderr


def test_a_derivative_by_a_gap_that_is_not_there_is_refused(tmp_path: Path) -> None:
    job = chain()
    job["sensitivity"] = {"to": ["contact[*].gap"]}
    done = run(tmp_path, job, code=2)
    assert "expected a contact with normal; contact[0] has a constant normal force" in done.stderr


def test_a_branch_is_not_said_to_close_where_its_resonance_passes_near_the_small_motion_it_began_with(tmp_path: Path):
    # Two masses of which the sweep begins far above the resonance: there is one motion at each frequency, and across
    # the resonance its phase turns, so that a step passes as small a motion as the first one.
    job: Job = {
        "model": {
            "mass": [[0.95, 0.0], [0.0, 0.947]],
            "stiffness": [[208000.0, -48300.0], [-48300.0, 289000.0]],
            "damping": [[5.47, -0.588], [-0.588, 6.44]],
        },
        "contact": [
            {
                "tangents": [[[0, -0.647], [1, 0.763]]],
                "tangential_stiffness": 1.13e6,
                "friction_coefficient": 0.5,
                "preload": 18.8,
            }
        ],
        "load": [{"kind": "harmonic", "cosine": [[0, -14.3], [1, 14.0]]}],
        "balance": {"harmonics": 7},
        "sweep": {"start_hz": 86.3, "stop_hz": 49.3},
        "output": {"file": "result.h5", "monitors": [{"name": "q0", "dofs": [[0, 1.0]]}]},
    }
    run(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["points/branch"][-1] == 0
        assert np.all(np.diff(file["points/frequency_hz"][:]) < 0.0)


@pytest.mark.parametrize("scene", [91, 373, 490])
def test_a_sweep_goes_on_over_the_corner_at_which_a_contact_begins_to_slip(tmp_path, scene):
    # A harmonic meets a natural frequency: the corner is sharper than a right angle. Theory has one branch, no fold.
    job = no_folds.make(26, scene, 1)
    del job["stability"]
    found = no_folds.look(job, str(tmp_path))
    assert found["branches"] == 1
    assert found["folds"] == 0
    assert found["others"] == []


def test_a_verdict_does_not_wait_for_what_the_monitor_does_not_see(tmp_path):
    # The mass that the monitor is on knows nothing of the one that rubs, whose first harmonic alone is up to 0.1 off.
    # The orbit is the only one there is, and stable: the normal force is constant.
    springs = np.square(2.0 * np.pi * np.array([100.0, 60.0]))
    contact = {
        "tangents": [[[1, 1.0]]],
        "tangential_stiffness": springs[1],
        "friction_coefficient": 0.5,
        "preload": 20.0,
    }
    job = {
        "model": {
            "mass": np.eye(2).tolist(),
            "stiffness": np.diag(springs).tolist(),
            "damping": [[6.0, 0.0], [0.0, 4.0]],
        },
        "contact": [contact],
        "load": [{"kind": "harmonic", "cosine": [[0, 5.0], [1, 20.0]]}],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [28.0, 36.0, 44.0, 52.0]},
        "stability": {"method": "monodromy"},
        "output": {"file": "r.h5", "monitors": [{"name": "beside", "dofs": [[0, 1.0]]}]},
    }
    run(tmp_path, job)
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["points/estimate"][:].max() < 1.0e-3
        assert np.all((file["stability/distance"][:] > 0.01) & (file["stability/distance"][:] < 0.1))
        assert file["points/stable"][:].tolist() == [1, 1, 1, 1]
