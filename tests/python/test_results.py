"""result.h5 read back, and its tables as CSV."""

from __future__ import annotations

import csv
import io

import h5py
import numpy as np
import pytest
import synthetic
from edited import edited

from attrito.results.result import Result
from attrito.results.tables import contact_table, multiplier_table, table
from attrito.support.errors import InputError


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def three_points(tmp_path):
    return synthetic.write_result(
        tmp_path / "result.h5",
        [140.0, 139.9, 1 / 3],
        {"tip": [1e-3, 2 / 3, np.nan], "axial": [0.0, -0.0, 1e100]},
        outcome=["converged", "unstable", "not_converged"],
        stable=[1, 0, -1],
        unique=[0, 1, -1],
        branch=[0, 0, 1],
        iterations=[3, 12, 50],
        period=[1, 2, 1],
        estimate=[1.5e-3, np.nan, np.nan],
        tip_low=[0.9e-3, np.nan, np.nan],
        tip_high=[1.1e-3, np.nan, np.nan],
        contacts=synthetic.contact_data(3, 2),
        multipliers={
            "point": np.array([0, 0, 1], dtype=np.int32),
            "method": np.array([0, 1, 0], dtype=np.int32),
            "real": np.array([0.7899, 0.0, 1.0]),
            "imag": np.array([0.0402, 0.0, 0.0]),
            "kind": np.array([0, 1, 2], dtype=np.int32),
        },
    )


def test_the_table_reads_as_the_design_says_to_the_letter(three_points):
    with Result(three_points) as result:
        text = table(result)
    assert text.splitlines() == [
        "point,branch,frequency_hz,converged,outcome,stable,unique,period,iterations,estimate,"
        "tip_amplitude,tip_mean,tip_low,tip_high,axial_amplitude,axial_mean,axial_low,axial_high",
        "0,0,140,true,converged,true,false,1,3,0.0015,0.001,0.0001,0.0009,0.0011,0,0,,",
        "1,0,139.9,true,unstable,false,true,2,12,,0.666666666667,0.0666666666667,,,0,0,,",
        "2,1,0.333333333333,false,not_converged,,,1,50,,,,,,1e+100,1e+99,,",
    ]
    assert text.endswith("\n")


def test_monitors_keep_the_order_of_the_job(three_points):
    with Result(three_points) as result:
        assert result.monitors == ["tip", "axial"]


def test_the_contact_table_has_one_line_a_point_and_contact(three_points):
    with Result(three_points) as result:
        text = contact_table(result)
        force = result.array("/contacts/n_mean")
    assert text.splitlines()[0] == (
        "point,frequency_hz,contact,state,n_mean,n_min,n_low,n_high,t1_mean,t1_low,t1_high,"
        "stick,slip,open,dissipated_energy,unique"
    )
    lines = rows(text)
    assert [line["point"] + line["contact"] for line in lines] == ["00", "01", "10", "11", "20", "21"]
    assert [line["state"] for line in lines] == ["stuck", "shaken_down", "slipping", "open", "stuck", "shaken_down"]
    assert [float(line["n_mean"]) for line in lines] == pytest.approx(force.ravel(), rel=1e-11)
    assert {line["n_low"] for line in lines} == {line["unique"] for line in lines} == {""}


def test_a_second_tangent_adds_its_columns_after_the_first(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [1.0], {}, contacts=synthetic.contact_data(1, 3, tangents=2))
    with Result(path) as result:
        header = contact_table(result).splitlines()[0]
    assert "t1_mean,t1_low,t1_high,t2_mean,t2_low,t2_high,stick" in header


def test_the_multiplier_table_names_method_and_kind(three_points):
    with Result(three_points) as result:
        assert multiplier_table(result).splitlines() == [
            "point,frequency_hz,method,real,imag,kind",
            "0,140,monodromy,0.7899,0.0402,floquet",
            "0,140,hill,0,0,slip",
            "1,139.9,monodromy,1,0,stuck",
        ]


def test_tables_of_a_result_without_contacts_multipliers_or_points_are_headers(tmp_path):
    with Result(synthetic.write_result(tmp_path / "r.h5", [], {"x": []})) as result:
        assert len(table(result).splitlines()) == 1
        assert len(contact_table(result).splitlines()) == 1
        assert multiplier_table(result) == "point,frequency_hz,method,real,imag,kind\n"


def test_several_levels_append_a_last_column(tmp_path):
    data = synthetic.contact_data(2, 1)
    path = synthetic.write_result(tmp_path / "r.h5", [1.0, 1.0], {"x": [1, 2]}, level=[5.0, 7.5], contacts=data)
    with Result(path) as result:
        for text in (table(result), contact_table(result)):
            assert text.splitlines()[0].endswith(",level")
            assert [line["level"] for line in rows(text)] == ["5", "7.5"]


def test_one_level_has_no_level_column(three_points):
    with Result(three_points) as result:
        assert "level" not in table(result) + contact_table(result)


def test_an_indeterminate_point_holds_a_solution_and_a_missing_orbit_does_not(tmp_path):
    outcome = ["indeterminate", "no_period_one_orbit"]
    with Result(synthetic.write_result(tmp_path / "r.h5", [1, 2], {}, outcome=outcome)) as result:
        assert result.converged.tolist() == [True, False]


def test_names_written_as_python_strings_or_one_line_are_read_alike(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [1.0], {}, outcome=["not_converged"])
    for names in (list(synthetic.OUTCOMES), ", ".join(synthetic.OUTCOMES)):
        with edited(path) as file:
            del file["points/outcome"].attrs["names"]
            file["points/outcome"].attrs["names"] = names
        with Result(path) as result:
            assert result.outcome == ["not_converged"]


def test_a_file_that_is_no_result_is_named_in_one_line(tmp_path):
    text, model = tmp_path / "text.h5", tmp_path / "model.h5"
    text.write_text("not HDF5")
    with h5py.File(model, "w") as file:
        file.attrs["format"] = "attrito model"
    for path, found in ((text, "not HDF5"), (model, "attrito model"), (tmp_path / "none.h5", "absent")):
        with pytest.raises(InputError) as caught:
            Result(path)
        assert str(path) in str(caught.value) and found in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_missing_dataset_an_unknown_monitor_and_a_wrong_point_are_faults(three_points):
    with edited(three_points) as file:
        del file["points/estimate"]
    with Result(three_points) as result:
        with pytest.raises(InputError, match="/points/estimate"):
            table(result)
        with pytest.raises(InputError, match=r"monitor = 'tipp': expected .*\(tip, axial\)"):
            result.monitor("tipp", "amplitude")
        for point in (-1, 3):
            with pytest.raises(InputError, match="a number from 0 to 2"):
                result.check_point(point)


def test_units_become_axis_labels(three_points):
    with Result(three_points) as result:
        assert result.unit("/monitors/tip/amplitude") == "length, user units"
        assert result.unit("/points/frequency_hz") == "Hz"
        assert result.unit("/points/branch") == ""
