"""The command line explains itself: groups, examples, what a misspelt command may mean."""

from __future__ import annotations

import shlex
import subprocess
import sys

import pytest
from jobs import TIMEOUT, attrito_here, run, wedge, write_job

from attrito.cli.arguments import parser
from attrito.cli.words import EXAMPLES, in_groups


def choices():
    return next(action for action in parser()._actions if action.dest == "command").choices


def test_every_command_is_in_a_group_with_an_example_that_it_takes():
    assert sorted(EXAMPLES) == sorted(choices())
    for name, example in EXAMPLES.items():
        words = shlex.split(example)
        assert parser().parse_args(words[words.index("attrito") + 1 :]).command == name
        assert choices()[name].format_help().rstrip().endswith(example)
    assert f"\n  run{'':11}a job -> result.h5\n" in parser().format_help()
    assert in_groups(dict.fromkeys(EXAMPLES, "")).startswith("model:\n  import")


@pytest.mark.parametrize(
    ("typed", "meant"), [("runn", "'run'"), ("linear-mode", "'linear-modes'"), ("optimize", "'optimise'")]
)
def test_a_misspelt_command_is_answered_with_the_nearest(capfd, typed, meant):
    with pytest.raises(SystemExit) as ended:
        parser().parse_args([typed, "job.toml"])
    assert ended.value.code == 2
    assert f"no command {typed!r}; do you mean {meant}? (attrito --help lists all)" in capfd.readouterr().err


def test_a_word_that_is_near_no_command_is_answered_without_a_guess(capfd):
    with pytest.raises(SystemExit):
        parser().parse_args(["xyz"])
    assert "no command 'xyz' (attrito --help lists all)" in capfd.readouterr().err


def test_a_table_waits_for_no_picture_and_no_numerics(tmp_path):
    run(tmp_path, wedge())
    code = (
        "import sys; from attrito.cli.program import main; code = main(['table', 'result.h5']);"
        "heavy = [name for name in ('matplotlib', 'meshio', 'scipy', 'mpi4py.MPI') if name in sys.modules];"
        "sys.exit(code or ' '.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("point,branch")


def test_a_table_of_bands_is_a_study_s_alone(tmp_path, capfd):
    light = wedge() | {"mode": {"start": 1e-6, "stop": 1e-4, "points": 3}}
    assert attrito_here(tmp_path, capfd, "mode", write_job(tmp_path, light)).returncode == 0
    done = attrito_here(tmp_path, capfd, "table", "result.mode.h5", "--bands")
    assert (done.returncode, "--bands = 'given': expected a file of `attrito study`" in done.stderr) == (2, True)
