"""Units that a job names: in files, axes and reports; without them they are the user's own."""

from __future__ import annotations

import json

import h5py
import pytest
from jobs import attrito, run, wedge, write_job

from attrito.results.result import Result
from attrito.support.units import units_of


@pytest.mark.parametrize(
    "units, unit, expected",
    [
        ("m, kg, s", "user force/length", "N/m"),
        ("mm, t, s", "user force/length", "N/mm"),
        ("mm, t, s", "user energy", "mJ"),
        ("mm, kg, s", "user force", "mN"),
        ("mm, g, s", "user force*time/length", "uN*s/mm"),
        ("cm,g,s", "user energy", "erg"),
        ("in, slinch, s", "user force", "lbf"),
        ("ft, slug, s", "user energy", "lbf*ft"),
        ("in, lb, s", "user force/length", "(lb*in/s^2)/in"),
        ("mm, t, s", "user length (user mass)^0.5", "mm t^0.5"),
        ("mm, t, s", "user (force*length)^0.5", "mJ^0.5"),
        ("mm, t, s", "user area", "mm^2"),
        ("mm, t, s", "Hz", "Hz"),
        ("mm, t, s", "1", "1"),
    ],
)
def test_units_of_quantities_follow_from_length_mass_and_time(units, unit, expected):
    assert units_of(units).name(unit) == expected


@pytest.mark.parametrize("units", ["mm", "mm, t", "mm, t, ms", "furlong, t, s", "t, mm, s", "mm, t, s, N"])
def test_what_is_no_consistent_set_is_refused(tmp_path, units):
    job = wedge()
    job["model"]["units"] = units
    done = attrito(tmp_path, "run", write_job(tmp_path, job))
    assert done.returncode == 2
    assert f"[model] units = '{units}'" in done.stderr or f"units = '{units}'" in done.stderr, done.stderr
    assert 'such as "mm, t, s"' in done.stderr and len(done.stderr.strip().splitlines()) == 1, done.stderr


def test_named_units_are_in_every_dataset_axis_and_report_and_change_no_number(tmp_path):
    job = wedge()
    plain = run(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        before = units_in(file)
        amplitude = file["monitors/" + next(iter(file["monitors"])) + "/amplitude"][:]
    job["model"]["units"] = "mm, t, s"
    (tmp_path / "result.h5").unlink()
    named = run(tmp_path, job)
    assert plain.returncode == named.returncode == 0
    assert any(unit.startswith("user ") for unit in before.values())
    with h5py.File(tmp_path / "result.h5") as file:
        after = units_in(file)
        assert file.attrs["units"] == "mm, t, s" and json.loads(file.attrs["job"])["model"]["units"] == "mm, t, s"
        monitor = next(iter(file["monitors"]))
        assert (file[f"monitors/{monitor}/amplitude"][:] == amplitude).all()
    assert after == {name: units_of("mm, t, s").name(unit) for name, unit in before.items()}
    assert not any("user" in unit for unit in after.values())
    with Result(str(tmp_path / "result.h5")) as result:
        assert result.unit("/contacts/force") == "N" and result.unit("/contacts/dissipated_energy") == "mJ"
    done = attrito(tmp_path, "report", "result.h5")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "report.html").read_text()
    assert "(mm)" in page and "user units" not in page


def units_in(file: h5py.File) -> dict[str, str]:
    """The unit of every dataset."""
    found: dict[str, str] = {}
    file.visititems(lambda name, one: found.update({name: one.attrs["unit"]}) if "unit" in one.attrs else None)
    return found
