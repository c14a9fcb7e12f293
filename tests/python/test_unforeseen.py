"""What no reader has in mind ends in one message; names go through tables and pictures as they are."""

from __future__ import annotations

import csv
import io
import os
import warnings

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
from edited import edited
from full_disk import one_message, with_room_for
from fuzz import run_cases
from jobs import attrito_here, table, wedge, write_job
from matplotlib.figure import Figure
from mpi4py import MPI
from synthetic import write_result

from attrito.plots import response, style
from attrito.support.csv_text import cell
from attrito.support.errors import InputError
from attrito.support.parallel import on_root


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError("Unable to allocate 7 EiB"), "memory = Unable to allocate 7 EiB: expected input that fits into"),
        (RecursionError("maximum depth"), "nesting = maximum depth: expected input that is less deeply nested"),
        (OverflowError("too large"), "contents = OverflowError: too large: expected input that attrito can work with"),
        (KeyError("a\nb"), "contents = KeyError: 'a\\nb': expected input"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_no_reader_foresaw_is_one_message_that_names_the_input(tmp_path, capfd, monkeypatch, error, said):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("attrito.results.result.Result.__init__", fail)
    done = attrito_here(tmp_path, capfd, "table", "result.h5")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"attrito: result.h5: {said}") and done.stderr.count("\n") == 1
    monkeypatch.setenv("ATTRITO_TRACEBACK", "1")
    assert "Traceback" in attrito_here(tmp_path, capfd, "table", "result.h5").stderr


def test_what_fails_on_the_root_is_a_fault_on_every_rank():
    with pytest.raises(InputError, match="ZeroDivisionError") as caught:
        on_root(MPI.COMM_SELF, lambda: 1 / 0)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_a_matrix_that_declares_more_rows_than_its_entries_bear_out_is_refused(tmp_path, capfd):
    scipy.io.mmwrite(tmp_path / "K.mtx", sparse.identity(3, format="coo"))
    text = (tmp_path / "K.mtx").read_text().replace("3 3 3", "2000000000 2000000000 3")
    (tmp_path / "huge.mtx").write_text(text)
    done = attrito_here(tmp_path, capfd, "import", "out.h5", "--stiffness", "huge.mtx", "--mass", "K.mtx")
    assert done.returncode == 2
    assert (
        "huge.mtx: stiffness = '2000000000 rows, 3 entries': expected a size that the entries bear out" in done.stderr
    )


@pytest.mark.parametrize("name", ["twins", "a/b", ".", "frequency_hz", "x,y"])
def test_names_in_a_study_that_cannot_be_kept_are_told_before_the_first_sample(tmp_path, capfd, name):
    job = wedge(force=1.0)
    job["sweep"], job["peak"] = {"start_hz": 150.0, "stop_hz": 85.0}, {"start": 10.0, "stop": 11.0}
    write_job(tmp_path, job)
    vary = [{"name": name, "keys": [f"contact[0].{key}"], "low": 0.1, "high": 0.2} for key in ("gap", "preload")]
    write_job(tmp_path, {"job": "job.toml", "file": "study.h5", "samples": 2, "vary": vary}, "study.toml")
    done = attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 2 and done.stdout == ""
    expected = "vary name = 'twins': expected names that differ" if name == "twins" else "a name of at most 64 bytes"
    assert expected in done.stderr
    assert not (tmp_path / "study.h5.parts").exists()


FORMULAS = ["=cmd|' calc'!A0", "+1", "-1", "@SUM(A1)"]


@pytest.mark.parametrize("name", FORMULAS)
def test_a_name_that_is_a_formula_is_text_in_a_table_and_numbers_stay_numbers(tmp_path, capfd, name):
    job = wedge()
    job["output"]["monitors"] = [{"name": name, "dofs": [[0, -1.0]]}]
    assert attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job)).returncode == 0
    (row,) = table(tmp_path)
    assert not [column for column in row if column.startswith(("=", "+", "-", "@"))]
    assert float(row[f"'{name}_amplitude"]) > 0.0
    # A negative number begins with a minus, and is no formula.
    assert row[f"'{name}_mean"].lstrip("-")[0].isdigit()


@pytest.mark.parametrize("text", ["a,b", 'say "x"', "two\nlines", " outer ", "=1,2", "plain", "x-1"])
def test_any_text_is_one_cell(text):
    ((read, after),) = csv.reader(io.StringIO(f"{cell(text)},1\n"))
    assert after == "1"
    assert read == (f"'{text}" if text.startswith("=") else text)


@pytest.mark.parametrize("name", ["$\\frac{$", "cost in $", "$a$ and $b$", "\\alpha", "50 %"])
def test_names_are_drawn_as_they_are_and_are_no_mathematics(tmp_path, name):
    figure = Figure()
    axes = figure.subplots()
    axes.set_xlabel(style.plain_text(name))
    style.save(figure, tmp_path / "picture.svg")
    assert name.replace("&", "&amp;") in (tmp_path / "picture.svg").read_text().replace("&#36;", "$")
    path = write_result(tmp_path / "result.h5", [100.0, 101.0], {name: [1.0, 2.0]})
    from attrito.results.result import Result

    with Result(path) as result, warnings.catch_warnings():
        warnings.simplefilter("error")
        style.save(response.frequency_response(result, name), tmp_path / "frf.svg")
    assert f"Amplitude of {name}" in (tmp_path / "frf.svg").read_text()


@pytest.mark.parametrize("ending", ["pdf", "svg", "png"])
def test_a_picture_that_finds_no_room_is_told_in_one_message(tmp_path, ending):
    write_result(tmp_path / "result.h5", np.linspace(1.0, 2.0, 400), {"tip": np.ones(400)})
    done = with_room_for(3000, tmp_path, "plot", "result.h5", "-o", f"frf.{ending}")
    assert done.returncode == 2
    assert f"frf.{ending}" in one_message(done)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.h5"]


@pytest.mark.parametrize("what", ["pipe", "device"])
def test_what_is_no_file_is_not_waited_for(tmp_path, capfd, what):

    for name in ("job.toml", "result.h5", "K.mtx"):
        os.mkfifo(tmp_path / name) if what == "pipe" else (tmp_path / name).symlink_to("/dev/zero")
    for arguments in (
        ("run", "job.toml"),
        ("table", "result.h5"),
        ("import", "out.h5", "--stiffness", "K.mtx", "--mass", "K.mtx"),
        ("import", "out.h5", "--stiffness", "K.mtx:KAAX", "--mass", "K.mtx:MAAX"),
    ):
        done = attrito_here(tmp_path, capfd, *arguments)
        assert done.returncode == 2 and "expected a file, not a pipe or a device" in done.stderr
    vary = [{"name": "mu", "keys": ["contact[0].friction_coefficient"], "low": 0.1, "high": 0.2}]
    write_job(tmp_path, {"job": "job.toml", "samples": 2, "vary": vary}, "study.toml")
    done = attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 2 and "expected a file, not a pipe or a device" in done.stderr
    job = wedge()
    job["model"]["stiffness"] = "K.mtx"
    (tmp_path / "own.toml").unlink(missing_ok=True)
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job, "own.toml"))
    assert done.returncode == 2 and "expected a file, not a pipe or a device" in done.stderr


def test_a_result_with_links_that_lead_nowhere_is_told(tmp_path, capfd):
    path = write_result(tmp_path / "result.h5", [100.0], {"tip": [1.0]})
    with edited(path) as file:
        del file["points/outcome"]
        file["points/outcome"] = h5py.SoftLink("/points/outcome")
    done = attrito_here(tmp_path, capfd, "table", "result.h5")
    assert done.returncode == 2 and done.stderr.count("attrito: ") == 1


def test_input_malformed_in_further_ways_ends_with_one_message_or_a_result():
    cases = run_cases(range(54), seed=11, ways="further")
    assert [(case.number, case.name, case.breaks, case.message) for case in cases if case.breaks] == []
    assert sum(case.code == 2 for case in cases) > len(cases) / 2


def test_names_of_files_that_are_no_utf8_are_told_before_anything_is_done(tmp_path, capfd):
    name = os.fsdecode(b"j\xf6b")
    (tmp_path / name).mkdir()
    for folder, job in ((tmp_path, f"{name}.toml"), (tmp_path / name, "job.toml")):
        (folder / job).write_text((tmp_path / write_job(tmp_path, wedge(), "good.toml")).read_text())
        before = sorted(os.listdir(folder))
        for arguments in (("run", job), ("mode", job), ("reduce", job)):
            done = attrito_here(folder, capfd, *arguments)
            assert done.returncode == 2 and "expected names of files and folders in UTF-8" in done.stderr
            assert "Error" not in done.stderr and done.stderr.count("attrito: ") == 1
        assert sorted(os.listdir(folder)) == before
    (tmp_path / f"{name}.h5").write_bytes(write_result(tmp_path / "result.h5", [1.0], {"tip": [1.0]}).read_bytes())
    done = attrito_here(tmp_path, capfd, "report", f"{name}.h5")
    assert done.returncode == 2 and "expected names of files and folders in UTF-8" in done.stderr
