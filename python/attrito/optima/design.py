"""What is to be made small, and by which keys of the job: the file of `attrito optimise`, checked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from attrito.fits.design import Parameter, parameters_in
from attrito.job.checks import Check, choice, integer, listing, number, text
from attrito.job.job import Job, files_read, rom_path
from attrito.job.reading import read_job
from attrito.job.varied import checked, faults_of_keys, read_keys, with_values
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared

OBJECTIVES = ("amplitude", "amplitude_per_level")


@dataclass(frozen=True)
class Optimum:
    """A checked file.

    Parameters
    ----------
    path, job, file : the file, the job whose peaks are meant, and what is written
    objective : a name of `OBJECTIVES`; of several levels the largest counts
    levels : factors on the harmonic loads
    most : samples that are solved at most
    tolerance : in a parameter, part of its (scaled) range, at which the search ends
    seed : of the points that a search in several parameters begins at
    parameters : what is varied
    """

    path: str
    job: str | Job
    file: str
    objective: str
    levels: tuple[float, ...]
    most: int
    tolerance: float
    seed: int
    parameters: tuple[Parameter, ...]

    def check(self, job: Job) -> None:
        """Raise unless every key is a number of the job that takes its bounds, and the job has peaks."""
        faults: list[Fault] = []
        if job["sweep"]["start_hz"] is None:
            faults.append(job.fault("[sweep] start_hz", "missing", "start_hz and stop_hz, the band of the peaks"))
        if job["peak"]["parameter"] != "level":
            faults.append(job.fault("[peak] parameter", job["peak"]["parameter"], '"level", with `attrito optimise`'))
        for i, parameter in enumerate(self.parameters):
            faults += faults_of_keys(job, parameter.keys, self.path, f"parameter[{i}] keys")
        if faults:
            raise InputError(*faults)
        check_spared(self.path, "file", [self.file], [self.path, *files_read(job), *filter(None, [rom_path(job)])])
        for parameter in self.parameters:
            for value in (parameter.low, parameter.high):
                try:
                    with_values(job, [(parameter, value)], self.path, "parameter")
                except InputError as error:
                    faults += error.faults
        if faults:
            raise InputError(*dict.fromkeys(faults))


CHECKS: dict[str, tuple[Check, Any]] = {
    "job": (text, None),
    "file": (text, "optimum.h5"),
    "objective": (choice(*OBJECTIVES), OBJECTIVES[0]),
    "levels": (listing(number(0, above=True), 1), [1.0]),
    "most": (integer(1), 100),
    "tolerance": (number(0, 0.1, above=True), 1e-3),
    "seed": (integer(0), 1),
}


def read_optimum(
    source: str | os.PathLike[str] | Mapping[str, Any] | Optimum, folder: str | os.PathLike[str] = "."
) -> Optimum:
    """Read and check a file of `attrito optimise`; raises `InputError` with all faults together.

    Parameters
    ----------
    source : the file, or its keys as a dictionary, whose job may be one, too; what is checked stays
    folder : what file names of a dictionary are relative to
    """
    if isinstance(source, Optimum):
        return source
    return read_keys(
        source,
        folder,
        "optimum",
        _check,
        lambda optimum, job: replace(optimum, job=read_job(job, folder)),
    )


def _check(raw: dict[str, Any], path: str) -> Optimum:
    faults: list[Fault] = []
    parameters = parameters_in(path, raw, faults)
    keys = checked(path, "", raw, CHECKS, faults)
    if keys["job"] is None:
        faults.append(Fault(path, "job", "missing", "the job file whose peaks are to be small"))
    if faults:
        raise InputError(*faults)
    job, file = (os.path.normpath(Path(path).parent / keys[name]) for name in ("job", "file"))
    rest = (keys[name] for name in ("most", "tolerance", "seed"))
    return Optimum(path, job, file, keys["objective"], tuple(keys["levels"]), *rest, parameters)
