"""attrito from Python: jobs as dictionaries, arrays that know their units, one rank and several."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import ENVIRONMENT, TIMEOUT, attrito_here, wedge, write_job
from mpi4py import MPI

import attrito
from attrito.job.reading import read_job
from attrito.library.session import Solver
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.solver_options import solver_options

# N/m; with it the balance meets the forces in the paper's text.
PAPER = 3.04e5


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The wedge at 132 Hz, run from a dictionary with arrays in it."""
    job = wedge(PAPER)
    job["model"] = {name: np.array(rows) for name, rows in job["model"].items()}
    job["contact"] = tuple(job["contact"])
    with attrito.run(job, MPI.COMM_SELF, folder=tmp_path_factory.mktemp("python"), quiet=True) as opened:
        yield opened


def test_a_job_as_a_dictionary_gives_what_its_file_gives(result, tmp_path, capfd):
    write_job(tmp_path, wedge(PAPER))
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    with attrito.open(tmp_path / "result.h5") as other:
        assert other.resolved_job == result.resolved_job
        for name in ("frequency_hz", "residual", "coordinates"):
            assert np.array_equal(other.points[name], result.points[name])


def test_arrays_know_their_units_names_and_descriptions(result):
    frequency = result.points.frequency_hz
    assert frequency.unit == "Hz" and frequency.values.tolist() == [132.0]
    assert frequency.description == "frequency of the fundamental harmonic"
    assert result.monitors["x"].amplitude.unit == "user length"
    assert result.points.outcome.labels.tolist() == ["converged"]
    assert result.contacts.state.labels.tolist() == [["slipping"]]
    assert result.contacts.parameters.set.values.tolist() == ["explicit"]
    # The text of the paper gives 23.9, three digits.
    assert result.contacts.n_mean.max() == pytest.approx(23.9, abs=0.05)


def test_a_group_lists_and_completes_its_members(result):
    assert {"points", "monitors", "contacts", "linear"} <= set(result)
    assert "amplitude" in dir(result.monitors.x) and list(result.monitors) == ["x", "y"]
    assert result.attributes["format"] == "attrito result" and result.resolved_job["balance"]["harmonics"] == 5
    assert result.points.dataset("coordinates")[0, :, 0].shape == (2,)
    with pytest.raises(AttributeError, match="has no 'frequency'; it has .*frequency_hz"):
        result.points.frequency.max()
    with pytest.raises(attrito.InputError, match="/points/frequency = 'absent': expected one of"):
        result.points["frequency"]
    with pytest.raises(attrito.InputError, match="/points/frequency"):
        result.points.dataset("frequency")


def test_quantities_compute_like_arrays_and_give_plain_ones():
    length = attrito.Quantity([[1.0, 2.0], [3.0, 4.0]], "user length", "of a thing")
    for plain in (
        2 * length,
        length + length,
        np.sqrt(length),
        length.mean(axis=0),
        np.max(length, axis=1),
        length @ [1, 1],
    ):
        assert type(plain) is np.ndarray
    assert np.array_equal(length - np.asarray(length), np.zeros((2, 2))) and (length > 2).sum() == 2
    assert length[1].unit == "user length" and length[1, 0] == 3.0 and length.shape == (2, 2) and len(length) == 2
    assert repr(length[0]) == "Quantity([1., 2.], 'user length')" and float(attrito.Quantity(2.5)) == 2.5
    assert int(attrito.Quantity(3)) == 3 and f"{attrito.Quantity(3)}" == "3"
    assert [row.sum() for row in length] == [3.0, 7.0] and bool(attrito.Quantity(1))
    states = attrito.Quantity([0, 2, -1], "1", "", ("stuck", "open"))
    assert states.labels.tolist() == ["stuck", "", ""]
    with pytest.raises(attrito.InputError, match="values that stand for names"):
        length.labels.tolist()


def test_points_without_a_solution_warn_or_raise_and_are_in_the_result(tmp_path):
    job = wedge()
    job["sweep"] = {"start_hz": 132.0, "stop_hz": 120.0}
    job["continuation"] = {"max_points": 2}
    with pytest.warns(attrito.UnsolvedWarning, match="max_points"):
        result = attrito.run(job, MPI.COMM_SELF, folder=tmp_path, quiet=True)
    with result:
        assert len(result.points.frequency_hz) == 2
    with pytest.raises(attrito.UnsolvedError, match="max_points") as caught:
        attrito.run(job, MPI.COMM_SELF, folder=tmp_path, quiet=True, strict=True)
    assert caught.value.file == str(tmp_path / "result.h5") and isinstance(caught.value, attrito.NumericsError)


def test_the_job_in_a_result_can_be_changed_and_run_again(result, tmp_path):
    job = result.job | {"sweep": {"frequencies_hz": [131.0, 132.0], "start_hz": None}}
    with attrito.run(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as again:
        assert again.points.frequency_hz.values.tolist() == [131.0, 132.0]
        assert again.monitors.x.amplitude[1] == pytest.approx(result.monitors.x.amplitude[0], rel=1e-6)


def test_faults_of_a_dictionary_are_told_together(tmp_path):
    job = wedge() | {"sweep": {"start_hz": -1.0}, "balance": {"harmonic": 3}}
    with pytest.raises(attrito.InputError) as caught:
        attrito.run(job, MPI.COMM_SELF, folder=tmp_path)
    assert {fault.key for fault in caught.value.faults} >= {"[sweep] start_hz", "[balance] harmonic"}


def test_an_integration_is_opened_like_a_result(tmp_path):
    job = wedge() | {"integrate": {"frequency_hz": 132.0}}
    with attrito.integrate(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as file:
        assert file.integration.attributes["outcome"] == "converged"
        assert file.integration.history.time.unit == "s"


def test_files_of_other_programs_and_absent_ones_are_faults(tmp_path):
    (tmp_path / "text.h5").write_text("no")
    for name, expected in (("none.h5", "absent"), ("text.h5", "not HDF5")):
        with pytest.raises(attrito.InputError, match=expected):
            attrito.open(tmp_path / name)
    path = synthetic.write_result(tmp_path / "other.h5", [1.0], {"tip": [1.0]})
    with edited(path) as file:
        file.attrs["format"] = "else"
    with pytest.raises(attrito.InputError, match="a file of attrito"):
        attrito.open(path)


def test_an_error_of_petsc_itself_ends_a_run_with_a_message(tmp_path):
    job = read_job(tmp_path / write_job(tmp_path, wedge()))
    scene = build_scene(job)
    # No number of iterations can be so small.
    options = dataclasses.replace(solver_options(job), max_iterations=-100)
    with Solver(MPI.COMM_SELF, reduced_scene(job, scene), options) as solver:
        with pytest.raises(attrito.NumericsError, match=r"PETSc failed \(error \d+\) while solving the static balance"):
            solver.follow_static_path(scene.load_path, 10, 132.0)
        with pytest.raises(attrito.NumericsError, match=r"PETSc failed \(error \d+\) while solving a point"):
            next(solver.solve_at([132.0], 1.0, 0))


def test_where_petsc_cannot_make_a_solver_the_run_ends_with_that_error(tmp_path):
    """Contacts that are handed over, as other friction is, get a solver of their own."""
    (tmp_path / "script.py").write_text(
        textwrap.dedent("""
        import ctypes, re
        from dataclasses import replace
        import numpy as np
        from mpi4py import MPI
        from attrito.library.session import Solver
        from attrito.support.errors import NumericsError
        from attrito_verification.paper.wedge import PARAMETER_SETS, Wedge

        wedge = Wedge(PARAMETER_SETS["unrounded"], 45.0, "C", 5)
        laws = wedge.scene.laws | {"friction_coefficient": np.full(1, 0.4)}
        with Solver(MPI.COMM_SELF, wedge.scene, wedge._options) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 20, 100.0)
            petsc = ctypes.CDLL(re.search(r"\\S*/libpetsc\\S*", open("/proc/self/maps").read())[0])
            # No type of vector is known any more.
            petsc.PetscFunctionListDestroy(ctypes.byref(ctypes.c_void_p.in_dll(petsc, "VecList")))
            solver.take(replace(wedge.scene, laws=laws))
            try:
                next(solver.solve_at([132.0], 10.0, 0))
            except NumericsError as error:
                print(error)
        """)
    )
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env=os.environ | ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    # The error of an unknown type, not what follows from it.
    assert "PETSc failed (error 86) while solving a point" in done.stdout, done.stdout + done.stderr


def on_two_ranks(folder, script: str) -> list[str]:
    """Run a script on two ranks; returns the words that it prints."""
    (folder / "script.py").write_text(textwrap.dedent(script))
    done = subprocess.run(
        ["mpirun", "-n", "2", sys.executable, "script.py"],
        cwd=folder,
        env=os.environ | ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_script_runs_under_mpirun_and_every_rank_has_the_result(tmp_path):
    write_job(tmp_path, wedge())
    script = """
        from mpi4py import MPI
        import attrito
        with attrito.run("job.toml", MPI.COMM_WORLD, quiet=True) as result:
            values = MPI.COMM_WORLD.gather(float(result.monitors["x"].amplitude[0]))
        if MPI.COMM_WORLD.rank == 0:
            print(len(values), len(set(values)), values[0])
    """
    count, different, amplitude = on_two_ranks(tmp_path, script)
    assert (count, different) == ("2", "1") and 1e-5 < float(amplitude) < 1e-4


def test_peaks_and_studies_run_under_mpirun_and_every_rank_has_what_one_rank_finds(tmp_path):
    job = wedge(force=1.0)
    job["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    job["static"] = {"load_path": [0.0, 1.0]}
    job["peak"] = {"start": 10.0, "stop": 11.0, "file": "peaks.h5"}
    write_job(tmp_path, job)
    vary = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.4, "high": 0.5}
    study = {"job": "job.toml", "file": "study.h5", "samples": 4, "vary": [vary]}
    script = f"""
        from mpi4py import MPI
        import attrito
        with attrito.peak("job.toml", MPI.COMM_WORLD, quiet=True) as curve:
            values = list(curve.peaks.amplitude)
        with attrito.study({study!r}, MPI.COMM_WORLD, quiet=True) as study:
            values += list(study.peaks.amplitude.values.ravel())
        told = MPI.COMM_WORLD.gather(values)
        if MPI.COMM_WORLD.rank == 0:
            assert told[0] == told[1]
            print(*map(float, told[0]))
    """
    found = [float(word) for word in on_two_ranks(tmp_path, script)]
    with attrito.peak(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as curve:
        alone = list(curve.peaks.amplitude)
    with attrito.study(study, MPI.COMM_SELF, folder=tmp_path, quiet=True) as one:
        alone += list(one.peaks.amplitude.values.ravel())
    # Residuals of 1e-10 of the motion, and more where Newton's method ends one iteration later.
    assert found == pytest.approx(alone, rel=1e-8) and len(found) > 4


def test_every_name_of_the_package_is_there_and_says_what_it_is():
    for name in attrito.__all__:
        assert getattr(attrito, name).__doc__.strip(), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        attrito.nothing()
