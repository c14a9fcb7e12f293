"""The stages of attrito from Python: what the commands of the same names do, with files and arrays in place of words.

All functions that take ranks are collective: every rank calls them with the same arguments.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from attrito.job.job import Job
from attrito.job.reading import plain, read_job
from attrito.library.names import REFERENCES
from attrito.results.quantities import File
from attrito.support.errors import Fault, InputError, UnsolvedError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.fits.design import Fit
    from attrito.optima.design import Optimum
    from attrito.studies.design import Study

JobSource: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Job"
StudySource: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Study"
FitSource: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Fit"
OptimumSource: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Optimum"


class UnsolvedWarning(UserWarning):
    """Points without a solution, or a sweep that ended early: the result says which."""


def open(path: str | os.PathLike[str]) -> File:
    """Open a file of attrito: model, reduced model, result, peaks or study.

    Parameters
    ----------
    path : the file

    Returns
    -------
    its groups and arrays by name; see `File`

    Raises
    ------
    InputError : not there, or not a file of attrito

    Examples
    --------
    >>> with attrito.open("result.h5") as result:
    ...     peak = result.monitors["tip"].amplitude.max()
    """
    return File(path)


def run(
    job: JobSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Run a job: reduce the model if the job says so, follow the static loads, then the response.

    Parameters
    ----------
    job : a job file, or the same tables as a dictionary; arrays stand for lists
    comm : the ranks that share the work; None: all (`MPI.COMM_WORLD`)
    folder : what file names in a dictionary are relative to; those in a job file are relative to it
    quiet : print nothing
    strict : points without a solution are an error

    Returns
    -------
    the result, opened by every rank

    Raises
    ------
    InputError : the job or the model is at fault; all faults together
    UnsolvedError : with `strict`, points are without a solution; else an `UnsolvedWarning` is given
    NumericsError : the solver gave up; there is no result, and points that were solved are in its journal

    Examples
    --------
    >>> result = attrito.run("input/wedge.toml")
    >>> result = attrito.run(job | {"sweep": {"frequencies_hz": [132.0]}}, MPI.COMM_SELF)
    """
    from attrito.runs.run import run_job

    return File(_do(run_job, job, comm, folder, quiet, strict))


def integrate(
    job: JobSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Integrate a job in time until steady; the file that is returned has the history in its group `integration`.

    Parameters and errors are those of `run`; motion that does not become steady is unsolved.
    """
    from attrito.integration.run import integrate_job

    return File(_do(integrate_job, job, comm, folder, quiet, strict))


def reduce(
    job: JobSource, comm: Comm | None = None, *, folder: str | os.PathLike[str] = ".", quiet: bool = False
) -> File:
    """Make the reduced model of a job, `rom.h5`, unless it is there already, and open it; `run` makes it, too.

    Parameters are those of `run`; errors are `InputError` and `NumericsError`.
    """
    from attrito.runs.run import reduce_job

    return File(_do(reduce_job, job, comm, folder, quiet, strict=True))


def peak(
    job: JobSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Follow a job's resonance peak in the level or the preload (`[peak]`), without sweeps.

    Parameters and errors are those of `run`; a curve that is lost before its end is unsolved.

    Examples
    --------
    >>> with attrito.peak("input/wedge_peak.toml") as curve:
    ...     curve.peaks.level, curve.peaks.response
    """
    from attrito.peaks.run import peak_job

    return File(_do(peak_job, job, comm, folder, quiet, strict))


def linear_modes(
    job: JobSource,
    comm: Comm | None = None,
    *,
    state: str = "tangent",
    count: int = 20,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
) -> File:
    """The modes of a linear system that a job's scene is compared with.

    Parameters
    ----------
    job, comm, folder, quiet : as of `run`; the job needs neither a sweep nor a harmonic load nor monitors
    state : "stuck", "frictionless" or "tangent"
    count : of modes, at most; of a sector's wheel, of each nodal diameter

    Raises
    ------
    InputError, NumericsError : as of `run`

    Examples
    --------
    >>> with attrito.linear_modes("input/blade.toml", state="stuck") as modes:
    ...     modes.points.frequency_hz
    """
    from attrito.modes.linear import linear_modes_job

    if state not in REFERENCES:
        raise InputError(Fault("linear_modes", "state", state, "one of " + ", ".join(REFERENCES)))

    def work(comm: Comm, job: Job) -> str:
        return linear_modes_job(comm, job, state, count)

    return File(_do(work, job, comm, folder, quiet, True, _read_without_excitation))


def campbell(
    job: JobSource, comm: Comm | None = None, *, folder: str | os.PathLike[str] = ".", quiet: bool = False
) -> File:
    """The tangent modes of a job against the speed of rotation (`[campbell]`), and critical speeds of engine orders.

    Parameters and errors are those of `linear_modes`.

    Examples
    --------
    >>> with attrito.campbell("job.toml") as diagram:
    ...     diagram.points.speed_hz, diagram.points.frequency_hz, diagram.crossings.speed_hz
    """
    from attrito.modes.campbell import campbell_job

    return File(_do(campbell_job, job, comm, folder, quiet, True, _read_without_excitation))


def mode(
    job: JobSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Follow a nonlinear mode of a job in its amplitude (`[mode]`): frequency, damping and what contacts dissipate.

    Parameters and errors are those of `run`; the job needs neither a sweep nor a harmonic load nor monitors. A mode
    that is lost before its last amplitude is unsolved.

    Examples
    --------
    >>> with attrito.mode("job.toml") as mode:
    ...     mode.points.amplitude, mode.points.frequency_hz, mode.points.damping_ratio
    """
    from attrito.modes.nonlinear import mode_job

    return File(_do(mode_job, job, comm, folder, quiet, strict, _read_without_excitation))


def _read_without_excitation(source: JobSource, folder: str | os.PathLike[str]) -> Job:
    """A checked job that need not be excited."""
    return read_job(source, folder, excited=False)


def study(
    study: StudySource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Locate a job's peaks for many values of its keys; a study that was interrupted goes on from its batches.

    Parameters
    ----------
    study : a study file, or its keys as a dictionary, whose `job` is a job file or a dictionary
    comm, folder, quiet, strict : as of `run`; samples without a peak are unsolved

    Raises
    ------
    InputError, UnsolvedError : as of `run`
    """
    from attrito.studies.design import read_study
    from attrito.studies.run import run_study

    return File(_do(run_study, study, comm, folder, quiet, strict, read_study))


def fit(
    fit: FitSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Find parameters of a job that bring its solutions nearest to measurements.

    Parameters
    ----------
    fit : a fit file, or its keys as a dictionary, whose `job` is a job file or a dictionary
    comm, folder, quiet, strict : as of `run`; a search that did not end at a minimum is unsolved

    Raises
    ------
    InputError, UnsolvedError : as of `run`
    NumericsError : some measurements have no solution where the search begins
    """
    from attrito.fits.design import read_fit
    from attrito.fits.run import run_fit

    return File(_do(run_fit, fit, comm, folder, quiet, strict, read_fit))


def optimise(
    optimum: OptimumSource,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
    quiet: bool = False,
    strict: bool = False,
) -> File:
    """Find values of a job's keys at which its largest peak is least.

    Parameters
    ----------
    optimum : a file of `attrito optimise`, or its keys as a dictionary, whose `job` is a job file or a dictionary
    comm, folder, quiet, strict : as of `run`; a search that did not come to its end is unsolved

    Raises
    ------
    InputError, UnsolvedError : as of `run`
    """
    from attrito.optima.design import read_optimum
    from attrito.optima.run import run_optimum

    return File(_do(run_optimum, optimum, comm, folder, quiet, strict, read_optimum))


def _do(
    work: Callable[..., str],
    source: JobSource | StudySource | FitSource | OptimumSource,
    comm: Comm | None,
    folder: str | os.PathLike[str],
    quiet: bool,
    strict: bool,
    read: Callable[..., Any] = read_job,
) -> str:
    """One stage on a job or a study; returns the file it wrote."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD if comm is None else comm
    check_alike(comm, work.__name__, source, folder)
    checked = on_root(comm, lambda: read(source, folder))
    with contextlib.redirect_stdout(io.StringIO()) if quiet else contextlib.nullcontext():
        try:
            return work(comm, checked)
        except UnsolvedError as error:
            if strict:
                raise
            warnings.warn(str(error), UnsolvedWarning, stacklevel=3)
            return error.file


def check_alike(
    comm: Comm, what: str, source: JobSource | StudySource | FitSource | OptimumSource, folder: str | os.PathLike[str]
) -> None:
    """Raise `InputError` on every rank where not all of them ask for the same.

    Parameters
    ----------
    comm : the ranks
    what : the stage asked for
    source, folder : of the job or the study
    """
    if isinstance(source, str | os.PathLike):
        asked: object = os.path.abspath(source)
    elif isinstance(source, Mapping):
        asked = [os.path.abspath(folder), plain(source)]
    else:
        asked = [getattr(source, "path", ""), getattr(source, "tables", None) or repr(source)]
    text = json.dumps([what, asked], sort_keys=True, default=repr)
    digests = comm.allgather(hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest())
    others = [rank for rank, digest in enumerate(digests) if digest != digests[0]]
    if others:
        named = ", ".join(map(str, others[:5])) + (", ..." if len(others) > 5 else "")
        raise InputError(Fault("job", f"on rank(s) {named}", "another than on rank 0", "the same job on every rank"))
