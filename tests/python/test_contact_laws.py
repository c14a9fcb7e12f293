"""Contact laws beside Coulomb's, from job to table: against it, against integration in time, and who refuses them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import attrito, chain, run, table, wedge, write_job

from attrito.library.kernels import contact_at_instants
from attrito.library.structures import make_law

# The wedge's normal force is some 23 +- 11 N: over an area of 2 the pressures below are all met.
AREA = 2.0
TABLE = [[4.0, 0.8], [10.0, 0.5], [16.0, 0.35]]


def pressed(friction: list[list[float]], **balance: object) -> dict:
    """The wedge with friction that depends on pressure."""
    job = wedge()
    job["contact"][0] |= {"law": "pressure", "friction_coefficient": friction, "area": AREA}
    job["balance"] |= balance
    return job


def test_one_coefficient_for_all_pressures_gives_the_points_of_coulombs_law(tmp_path: Path) -> None:
    rows = []
    for name, job in (("law", pressed([[1.0, 0.5]])), ("plain", wedge())):
        (tmp_path / name).mkdir()
        run(tmp_path / name, job)
        rows.append(table(tmp_path / name)[0])
    for key in ("x_amplitude", "x_mean", "y_amplitude", "y_mean"):
        # Both are solved to 1e-10 of the response, and cut at other instants.
        assert float(rows[0][key]) == pytest.approx(float(rows[1][key]), rel=1e-9)


def test_the_balance_has_the_amplitude_of_integration_in_time(tmp_path: Path) -> None:
    job = pressed(TABLE, harmonics=25)
    job["integrate"] = {"scheme": "exponential", "steps_per_period": 4000, "frequency_hz": 132.0, "cycles": 2000}
    job["integrate"] |= {"periodicity_tolerance": 1e-9}
    run(tmp_path, job)
    balance = table(tmp_path)[0]
    (tmp_path / "time").mkdir()
    done = attrito(tmp_path / "time", "integrate", write_job(tmp_path / "time", job))
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(tmp_path / "time" / "result.h5") as file:
        in_time = {f"{name}_amplitude": float(file[f"integration/monitors/{name}/amplitude"][()]) for name in "xy"}
    (tmp_path / "plain").mkdir()
    run(tmp_path / "plain", wedge())
    plain = float(table(tmp_path / "plain")[0]["x_amplitude"])
    for key in ("x_amplitude", "y_amplitude"):
        # Second order of 4000 steps and 25 harmonics of forces that fade like h^-2: some 1e-5 each.
        assert float(balance[key]) == pytest.approx(in_time[key], rel=1e-4)
    assert abs(float(balance["x_amplitude"]) / plain - 1.0) > 1e-2, "Coulomb's law gives the same: the test is void"


def test_slip_takes_the_friction_of_the_pressure_at_every_instant() -> None:
    laws = {name: np.ones(1) for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient")}
    laws |= {"tangents": np.ones(1, dtype=np.int32), "gap": np.zeros(1), "preload": np.zeros(1)}
    laws |= {"law": np.ones(1, dtype=np.int32), "law_numbers": np.array([[AREA, *np.ravel(TABLE)]])}
    # A large swing under a normal force of 20 +- 15 in quadrature: it slips almost always.
    motion = np.array([[0.0, 300.0, 0.0], [20.0, 0.0, 15.0]])
    _, force = contact_at_instants(make_law(laws, 0), motion, np.zeros(2), 4096)
    pressures, coefficients = np.array(TABLE).T
    limit = np.interp(force[1] / AREA, pressures, coefficients) * force[1]
    slips = np.abs(np.abs(force[0]) / limit - 1.0) < 1e-12
    assert slips.mean() > 0.8
    assert np.all(np.abs(force[0]) <= limit * (1.0 + 1e-12))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stability": {"method": "monodromy"}}, "contact[0] law = 'pressure': expected \"coulomb\" where stability"),
        ({"static": {"bounds": "sampled"}}, "contact[0] law = 'pressure': expected \"coulomb\" where bounds are"),
    ],
)
def test_engines_without_the_law_refuse_it_by_name(tmp_path: Path, change: dict, words: str) -> None:
    done = run(tmp_path, pressed(TABLE) | change, code=2)
    assert words in done.stderr


@pytest.mark.parametrize("force", [12.0, 25.0], ids=["every contact sticks", "one slips, others stick"])
def test_bounds_by_themselves_leave_out_a_law_without_friction_cones_and_say_so(tmp_path: Path, force: float) -> None:
    job = chain()
    job["contact"][1] |= {"law": "pressure", "friction_coefficient": [[10.0, 0.6], [100.0, 0.3]], "area": 1.0}
    job["load"][1] |= {"cosine": [[0, force]], "sine": [[0, 0.0]]}
    job["static"]["bounds"] = "auto"
    job["sweep"] = {"frequencies_hz": [70.0]}
    run(tmp_path, job)
    states = {row["state"] for row in table(tmp_path, "--contacts")}
    assert ("slipping" in states) == (force == 25.0), "the scene is another: the test is void"
    row = table(tmp_path)[0]
    assert (row["unique"], row["end_low"], row["end_high"]) == ("false", "", "")
    with h5py.File(tmp_path / "result.h5") as file:
        bounds = file["points/bounds"]
        assert bounds.attrs["names"][int(bounds[0])] == b"not_examined"


def test_event_exact_integration_refuses_the_law_by_name_and_names_schemes(tmp_path: Path) -> None:
    job = pressed(TABLE) | {"integrate": {"frequency_hz": 132.0}}
    done = attrito(tmp_path, "integrate", write_job(tmp_path, job))
    assert done.returncode == 2
    assert "contact[0] law = 'pressure': expected \"coulomb\" (another law has no events)" in done.stderr
    assert 'scheme = "exponential"' in done.stderr


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"area": None}, "contact[0] area is missing: expected the contact area"),
        (
            {"friction_coefficient": 0.5},
            "friction_coefficient = 0.5: expected [[pressure, coefficient], ...] with law",
        ),
        ({"law": "coulomb", "area": None}, 'expected a number with law = "coulomb"'),
        ({"law": "coulomb", "friction_coefficient": 0.5}, "contact[0] area = 2.0: expected no such key"),
        ({"friction_coefficient": [[2.0, 0.1], [1.0, 0.2]]}, "pressures ascending"),
        ({"law": "dry"}, 'contact[0] law = \'dry\': expected one of "coulomb", "pressure"'),
    ],
)
def test_keys_of_a_law_that_do_not_go_together_are_refused(tmp_path: Path, keys: dict, words: str) -> None:
    job = pressed(TABLE)
    contact = job["contact"][0] | keys
    job["contact"][0] = {key: value for key, value in contact.items() if value is not None}
    done = run(tmp_path, job, code=2)
    assert words in done.stderr
