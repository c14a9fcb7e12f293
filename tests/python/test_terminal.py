"""What the command line takes and says: values beside the job, how much it says, lines that fit a terminal."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys

import h5py
import pytest
from jobs import ENVIRONMENT, attrito, swept, wedge, write_job

from attrito.job.settings import apply_settings
from attrito.runs.progress import fitted, in_time, share_done, wrapped
from attrito.support.errors import InputError


def changed(tables, *settings):
    apply_settings(tables, list(settings), "job.toml")
    return tables


def test_a_setting_replaces_a_key_or_adds_it_and_reaches_every_entry_of_a_list():
    job = {"balance": {"harmonics": 5}, "contact": [{"gap": 0.0}, {"gap": 1.0}], "static": {"load_path": [0.0, 1.0]}}
    given = ("balance.harmonics=9", "static.slider=reset", "contact[*].friction_coefficient=0.4", "contact[1].gap=2.5",
             "static.load_path[1]=0.5", "sweep.levels=[1, 2.0]",
             "integrate.start=point:12", "peak.monitor=blade tip (mm)")  # fmt: skip
    assert changed(job, *given) == {
        "balance": {"harmonics": 9},
        "static": {"slider": "reset", "load_path": [0.0, 0.5]},
        "contact": [{"gap": 0.0, "friction_coefficient": 0.4}, {"gap": 2.5, "friction_coefficient": 0.4}],
        "sweep": {"levels": [1, 2.0]},
        "integrate": {"start": "point:12"},
        "peak": {"monitor": "blade tip (mm)"},
    }


def test_the_name_of_a_load_stands_for_a_factor_on_its_forces():
    loads = [
        {"name": "bolts", "dofs": [[1, 10.0]]},
        {"name": "tip", "cosine": [[0, -3.0], [1, 4.0]], "sine": [[0, 1.0]]},
    ]
    changed({"load": loads}, "load.tip=2", "load.bolts=0.5")
    assert loads[0]["dofs"] == [[1, 5.0]]
    assert (loads[1]["cosine"], loads[1]["sine"]) == ([[0, -6.0], [1, 8.0]], [[0, 2.0]])


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("balance.harmnics=3", "expected a known key: approach, harmonics"),
        ("balnce.harmonics=3", "expected a table of the job: "),
        ("balance.harmonics", "expected a key and its value"),
        ("balance.harmonics=[3", "expected a value of TOML"),
        ("contact[4].gap=1", "expected one of the job's [[contact]], of which there are 1"),
        ("contact.gap=1", 'as "contact[0].gap", or "contact[*].gap" for all'),
        ("load.none=2", "expected load.<name> with the name of a load: tip"),
        ("load.tip=fast", "expected a number, the factor on the load"),
        ("static.load_path[7]=1", "expected an entry of a list of 2"),
    ],
)
def test_a_setting_that_is_none_is_refused(setting, said):
    job = {"contact": [{}], "load": [{"name": "tip", "cosine": [[0, 1.0]]}], "static": {"load_path": [0.0, 1.0]}}
    with pytest.raises(InputError) as caught:
        changed(job, setting, "balance.more=1")
    assert said in str(caught.value) and "--set balance.more" in str(caught.value)


def test_a_result_holds_the_job_with_its_settings(tmp_path):
    job = write_job(tmp_path, wedge(force=1.0) | {"sweep": {"frequencies_hz": [132.0]}})
    done = attrito(tmp_path, "run", job, "--set", "contact[*].friction_coefficient=0.75", "--set", "output.file=mu.h5")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "mu.h5") as file:
        resolved = json.loads(file.attrs["job"])
        assert file["contacts/parameters/friction_coefficient"][:].tolist() == [0.75]
    assert [contact["friction_coefficient"] for contact in resolved["contact"]] == [0.75]


def test_a_run_that_was_stopped_says_how_to_go_on_with_its_settings(tmp_path):
    job = write_job(tmp_path, wedge(force=1.0) | {"sweep": {"frequencies_hz": [132.0, 131.0]}})
    settings = ["--set", "contact[*].friction_coefficient=0.75"]
    done = attrito(tmp_path, "run", job, *settings, "--max-seconds", "1e-9")
    hint = "attrito run --resume job.toml --set 'contact[*].friction_coefficient=0.75'"
    assert done.returncode == 1 and done.stderr.rstrip().endswith(f"go on with {hint}")
    assert attrito(tmp_path, *shlex.split(hint)[1:]).returncode == 0


def test_quiet_says_nothing_and_verbose_a_line_for_every_point(tmp_path):
    job = write_job(tmp_path, wedge(force=1.0) | {"sweep": {"frequencies_hz": [132.0, 131.0, 130.0, 129.0]}})
    assert attrito(tmp_path, "run", job, "-q").stdout == ""
    said = attrito(tmp_path, "run", job, "-v").stdout
    assert sum(" Hz " in line and "level" in line for line in said.splitlines()) == 4


def test_quiet_keeps_warnings_and_puts_them_on_standard_error(tmp_path):
    # From 60 to 90 Hz the wedge has no resonance.
    done = attrito(tmp_path, "run", write_job(tmp_path, swept(wedge(), 60.0, 90.0)), "-q")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith("warning: no natural frequency from 60 to 90 Hz")


def test_an_unknown_option_shows_the_usage_of_its_command(tmp_path):
    done = attrito(tmp_path, "report", "a.h5", "--bogus")
    assert done.returncode == 2 and done.stderr.startswith("usage: attrito report ")
    assert "attrito report: error: unrecognized arguments: --bogus" in done.stderr


def test_a_line_leaves_out_what_matters_least_until_it_fits():
    parts = [("frequency", 0), (" level", 3), (" amplitude", 1), (" states", 4), (" outcome", 0), (" left", 2)]
    assert fitted(parts, None) == "frequency level amplitude states outcome left"
    assert fitted(parts, 38) == "frequency level amplitude outcome left"
    assert fitted(parts, 37) == "frequency amplitude outcome left"
    assert fitted(parts, 17) == "frequency outcome"
    assert fitted(parts, 5) == "frequ"


def test_a_sentence_is_broken_between_words_and_a_name_stays_whole():
    assert wrapped("static load path followed", 25) == "static load path followed"
    assert wrapped("static load path followed", 24) == "static load path\n  followed"
    assert wrapped("points: out/a-long-name.h5", 10) == "points:\n  out/a-long-name.h5"


def test_the_share_of_a_sweep_grows_from_nothing_to_all_over_its_levels():
    sweep = {"start_hz": 140.0, "stop_hz": 100.0, "levels": [1.0, 5.0], "frequencies_hz": None}
    places = [(140.0, 1.0), (120.0, 1.0), (100.0, 1.0), (120.0, 5.0), (100.0, 5.0), (99.0, 5.0)]
    assert [share_done(sweep, *place, 1) for place in places] == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]
    listed = {"frequencies_hz": [1.0, 2.0], "levels": [1.0, 5.0]}
    assert [share_done(listed, 1.0, 1.0, number) for number in (1, 4)] == [0.25, 1.0]


def test_times_are_said_in_the_unit_that_one_would_choose():
    assert [in_time(seconds) for seconds in (42.4, 600.0, 9000.0)] == ["42 s", "10 min", "2.5 h"]


def test_a_shell_is_given_the_options_of_a_command(tmp_path):
    pytest.importorskip("argcomplete")
    line = "attrito table --bif"
    asked = {
        "_ARGCOMPLETE": "1",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_STDOUT_FILENAME": "out",
    }
    command = [sys.executable, "-m", "attrito.cli"]
    subprocess.run(command, cwd=tmp_path, env=os.environ | ENVIRONMENT | asked, check=True)
    assert (tmp_path / "out").read_text().strip() == "--bifurcations"
