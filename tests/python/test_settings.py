"""`--set` gives a job other values for one command: every command that takes a job has it."""

from __future__ import annotations

import argparse

import h5py
import pytest
from jobs import attrito_here, wedge, write_job
from rubbing_fit import FRICTION, measured, rubbing, write_fit
from wedge_optimum import wedge_peak, write_optimum

from attrito.cli.arguments import parser

# Positional arguments of commands that are jobs, or that name one
JOBS = {"job", "study", "fit", "optimum"}


def test_every_command_that_takes_a_job_takes_other_values_for_it():
    (commands,) = (one.choices for one in parser()._actions if isinstance(one, argparse._SubParsersAction))
    takes_job = {name for name, one in commands.items() if JOBS & {action.dest for action in one._actions}}
    settable = {name for name, one in commands.items() for action in one._actions if action.metavar == "KEY=VALUE"}
    assert takes_job - {"verify"} == settable


@pytest.mark.parametrize("command", ["linear-modes", "campbell", "chart", "fit", "optimise", "peak"])
def test_a_value_that_is_none_is_refused(tmp_path, capfd, command):
    files = {"fit": write_fit(tmp_path), "optimise": write_optimum(tmp_path)}
    measured(tmp_path, rubbing())
    job = write_job(tmp_path, wedge_peak())
    more = ["-o", "chart.csv"] if command == "chart" else []
    done = attrito_here(tmp_path, capfd, command, files.get(command, job), *more, "--set", "balance.harmonics=-1")
    assert done.returncode == 2
    assert "[balance] harmonics = -1" in done.stderr
    assert not list(tmp_path.glob("*.png"))


def test_linear_modes_are_those_of_a_job_with_the_value(tmp_path, capfd):
    said = []
    for stiffness, settings in ((3.0e5, ["--set", "contact[*].tangential_stiffness=6e5"]), (6.0e5, [])):
        job = wedge()
        job["contact"] = [contact | {"tangential_stiffness": stiffness} for contact in job["contact"]]
        done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job), *settings)
        assert done.returncode == 0, done.stderr
        said.append(done.stdout)
    assert said[0] == said[1]


def test_a_fit_is_of_the_job_as_it_is_set(tmp_path, capfd):
    measured(tmp_path, rubbing())
    write_fit(tmp_path, profile=False)
    # A fifth more force, at the same preload, than that of the measurement
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml", "--set", "load.excitation=1.2")
    assert done.returncode in (0, 1), done.stderr
    with h5py.File(tmp_path / "fit.h5") as file:
        assert abs(file["parameters/value"][1] / FRICTION - 1.0) > 0.01


def test_an_optimum_is_of_the_job_as_it_is_set(tmp_path, capfd):
    write_job(tmp_path, wedge_peak())
    write_optimum(tmp_path)
    # Half of the force: half of the amplitude, at half of the preload
    done = attrito_here(tmp_path, capfd, "optimise", "optimum.toml", "--set", "load[1].cosine=[[0, 0.5]]")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "optimum.h5") as file:
        assert file["value"][()] == pytest.approx(0.5 * 7.044e-6, rel=1e-3)
