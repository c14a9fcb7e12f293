"""Tables that are asked for: contact sets, more columns, studies, frames; and what `attrito info` says of files."""

from __future__ import annotations

import csv
import io

import h5py
import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import attrito

from attrito.results.info import describe
from attrito.results.result import Result
from attrito.results.tables import set_table, table


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def two_sets(tmp_path):
    """Two points, contacts 0, 2 and 4 of a set `root`, 1 and 3 of a set `shroud`."""
    data = synthetic.contact_data(2, 5)
    data["dissipated_energy"] = np.array([[1.0, 2.0, 3.0, 4.0, 5.0], np.zeros(5)])
    names = np.array([b"root", b"shroud", b"root", b"shroud", b"root"], dtype="S24")
    path = synthetic.write_result(tmp_path / "result.h5", [90.0, 91.0], {"tip": [3.0, 4.0]}, contacts=data,
                                  parameters={"set": names}, stable=[1, -1])  # fmt: skip
    with edited(path) as file:
        file["monitors/tip/harmonics"] = np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 4.0]])
    return path


def test_totals_of_a_set_are_sums_over_its_contacts(two_sets):
    with Result(two_sets) as result:
        found = rows(set_table(result))
        normal = result.array("/contacts/n_mean")
    assert [row["set"] for row in found] == ["root", "shroud"] * 2
    assert [int(row["contacts"]) for row in found] == [3, 2, 3, 2]
    assert [float(row["dissipated_energy"]) for row in found] == [9.0, 6.0, 0.0, 0.0]
    assert [row["share"] for row in found] == ["0.6", "0.4", "", ""]
    assert float(found[2]["n_mean"]) == pytest.approx(normal[1, [0, 2, 4]].sum(), rel=1e-11)
    # States of contacts 0 to 4 of point 0: stuck, shaken down, slipping, open, stuck.
    assert [found[0][name] for name in ("stuck", "shaken_down", "slipping", "opened")] == ["2", "0", "1", "0"]
    assert float(found[1]["open"]) == 0.5


def test_columns_that_are_asked_for_follow_those_of_their_monitor(two_sets):
    with Result(two_sets) as result:
        text = table(result, ["first_harmonic", "phase", "velocity"])
    assert text.splitlines()[0].endswith("tip_high,tip_first_harmonic,tip_phase,tip_velocity")
    first, second = rows(text)
    assert (first["tip_phase"], second["tip_phase"]) == ("0", "-90")
    assert float(second["tip_velocity"]) == pytest.approx(2.0 * np.pi * 91.0 * 4.0, rel=1e-11)


def test_a_table_is_written_into_a_file_but_not_over_its_result(two_sets):
    folder = two_sets.parent
    printed = attrito(folder, "table", "result.h5", "--sets").stdout
    done = attrito(folder, "table", "result.h5", "--sets", "-o", "sets.csv")
    assert done.stdout == "sets.csv\n" and (folder / "sets.csv").read_text() == printed
    refused = attrito(folder, "table", "result.h5", "-o", "result.h5")
    assert refused.returncode == 2 and len(Result(two_sets).monitors) == 1


def test_a_frame_has_the_numbers_of_the_table(two_sets):
    pytest.importorskip("pandas")
    with Result(two_sets) as result:
        frame = result.to_dataframe()
    assert frame["tip_amplitude"].tolist() == [3.0, 4.0] and frame["frequency_hz"].tolist() == [90.0, 91.0]
    assert frame["stable"].isna().tolist() == [False, True] and frame["outcome"].tolist() == ["converged"] * 2


def test_a_notebook_shows_what_a_result_holds_and_no_markup_of_the_file(two_sets):
    with edited(two_sets) as file:
        file.attrs["job_file"] = "<script>"
    with Result(two_sets) as result:
        page = result._repr_html_()
    assert "<td>at most 4 (length, user units) at 91 Hz, level 1</td>" in page
    assert "&lt;script&gt;" in page and "<script>" not in page


def study(path):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["parameter"] = "attrito study", "level"
        file["parameter"] = [1.0, 2.0]
        file["values/mu"] = [0.3, 0.5]
        file["peaks/frequency_hz"] = [[10.0, 11.0], [12.0, np.nan]]
        file["peaks/level"] = [[1.0, 2.0], [1.0, 2.0]]
        file["peaks/outcome"] = np.array([[0, 0], [0, 1]], dtype=np.int32)
        file["peaks/outcome"].attrs["names"] = ["converged", "not_converged"]
    return path


def test_the_table_of_a_study_has_a_row_a_sample_and_value(tmp_path):
    study(tmp_path / "study.h5")
    done = attrito(tmp_path, "table", "study.h5")
    assert done.stdout.splitlines() == [
        "sample,mu,level,frequency_hz,outcome",
        "0,0.3,1,10,converged",
        "0,0.3,2,11,converged",
        "1,0.5,1,12,converged",
        "1,0.5,2,,not_converged",
    ]


def test_files_of_every_kind_are_described(tmp_path, two_sets):
    assert describe(str(two_sets))[0] == "attrito result"
    assert "levels: 1" in describe(str(two_sets))
    assert "values/mu [2]: " in describe(str(study(tmp_path / "study.h5")))


def test_a_result_that_is_not_there_points_at_the_points_of_a_run_that_is_not_over(tmp_path):
    (tmp_path / "a.h5.partial").write_bytes(b"")
    assert "a.h5.partial holds the points so far" in attrito(tmp_path, "table", "a.h5").stderr
    assert "partial" not in attrito(tmp_path, "plot", "b.h5").stderr
