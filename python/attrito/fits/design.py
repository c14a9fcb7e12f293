"""What a fit looks for, and the measurements it is to meet: its file, checked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from attrito.fits.data import Data, data_of
from attrito.job.checks import Check, boolean, choice, dataset_name, integer, listing, number, text
from attrito.job.job import Job, files_read, rom_path
from attrito.job.reading import read_job
from attrito.job.varied import checked, faults_of_keys, read_keys, with_values
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared


@dataclass(frozen=True)
class Parameter:
    """One unknown: the keys of the job that have its value, or (`factor`) are multiplied by it.

    `log`: it is looked for by its logarithm. `start`: None where the jobs' own value is to begin with.
    """

    name: str
    keys: tuple[str, ...]
    low: float
    high: float
    start: float | None
    log: bool
    factor: bool

    def scaled(self, value: float) -> float:
        """Its logarithm, or itself between its bounds as 0 to 1."""
        return float(np.log(value)) if self.log else (value - self.low) / (self.high - self.low)

    def rate(self, value: float) -> float:
        """Derivative of the value by the scaled one."""
        return value if self.log else self.high - self.low

    def value(self, scaled: float) -> float:
        """The inverse of `scaled`, within the bounds whatever rounding says."""
        value = float(np.exp(scaled)) if self.log else self.low + scaled * (self.high - self.low)
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Fit:
    """A checked fit.

    `noise`: whether deviations are known ("given") or only their ratios are ("estimated" from the residuals).
    """

    path: str
    file: str
    noise: str
    starts: int
    seed: int
    profile: bool
    parameters: tuple[Parameter, ...]
    data: tuple[Data, ...]

    @property
    def picture(self) -> str:
        """The picture that goes beside the file."""
        return f"{os.path.splitext(self.file)[0]}.png"

    @property
    def kept(self) -> str:
        """Evaluations of a fit that has not ended."""
        return f"{self.file}.partial"

    def as_table(self) -> dict[str, Any]:
        """All that the result depends on beside the jobs and measurements."""
        return {
            "parameters": [vars(parameter) for parameter in self.parameters],
            "data": [one.as_table() for one in self.data],
            "noise": self.noise,
            "starts": self.starts,
            "seed": self.seed,
        }

    def check(self, jobs: list[Job]) -> None:
        """Raise unless every key is a number of each data's job, and takes its bounds."""
        faults: list[Fault] = []
        for one, job in zip(self.data, jobs, strict=True):
            faults += one.faults_of_job(self.path, job)
            for i, parameter in enumerate(self.parameters):
                faults += faults_of_keys(job, parameter.keys, self.path, f"parameter[{i}] keys")
        if faults:
            raise InputError(*dict.fromkeys(faults))
        read = [self.path, *(one.file for one in self.data)]
        for job in jobs:
            read += [*files_read(job), *filter(None, [rom_path(job)])]
        check_spared(self.path, "file", [self.file, self.picture], read)
        for one, job in zip(self.data, jobs, strict=True):
            for parameter in self.parameters:
                for value in (parameter.low, parameter.high):
                    try:
                        with_values(job, [(parameter, value)], self.path, "parameter", one.is_excited)
                    except InputError as error:
                        faults += error.faults
        if faults:
            raise InputError(*dict.fromkeys(faults))


CHECKS: dict[str, tuple[Check, Any]] = {
    "job": (text, None),
    "file": (text, "fit.h5"),
    "noise": (choice("estimated", "given"), "estimated"),
    "starts": (integer(1), 1),
    "seed": (integer(0), 1),
    "profile": (boolean, True),
}
PARAMETER_CHECKS: dict[str, tuple[Check, Any]] = {
    "name": (dataset_name, None),
    "keys": (listing(text, 1), None),
    "low": (number(), None),
    "high": (number(), None),
    "start": (number(), None),
    "log": (boolean, None),
    "factor": (boolean, False),
}


def read_fit(source: str | os.PathLike[str] | Mapping[str, Any] | Fit, folder: str | os.PathLike[str] = ".") -> Fit:
    """Read and check a fit and its measurements; raises `InputError` with all faults together.

    Parameters
    ----------
    source : a fit file, or its keys as a dictionary, whose job may be one, too; a fit that is checked stays
    folder : what file names of a dictionary are relative to
    """
    if isinstance(source, Fit):
        return source

    def with_job(fit: Fit, job: Any) -> Fit:
        meant = os.path.normpath(Path(folder) / "job")
        jobs = (read_job(job, folder, excited=one.is_excited) if one.job == meant else one.job for one in fit.data)
        return replace(fit, data=tuple(replace(one, job=own) for one, own in zip(fit.data, jobs, strict=True)))

    return read_keys(source, folder, "fit", _check_fit, with_job)


def parameters_in(path: str, raw: dict[str, Any], faults: list[Fault]) -> tuple[Parameter, ...]:
    """Take the tables [[parameter]] out of a file's keys; what is not fine goes to the faults."""
    rows = _rows(path, raw.pop("parameter", []), "parameter", faults)
    found = [_parameter(path, i, row, faults) for i, row in enumerate(rows)]
    names = [one.name for one in found if one is not None]
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.append(Fault(path, "parameter name", name, "names that differ"))
    return tuple(one for one in found if one is not None)


def _check_fit(raw: dict[str, Any], path: str) -> Fit:
    """Check the keys of a fit that is called `path`, and read its measurements."""
    faults: list[Fault] = []
    parameters = parameters_in(path, raw, faults)
    rows = _rows(path, raw.pop("data", []), "data", faults)
    keys = checked(path, "", raw, CHECKS, faults)
    data = [data_of(path, i, row, keys["job"], faults) for i, row in enumerate(rows)]
    names = [one.name for one in data if one is not None]
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.append(Fault(path, "data name", name, "names that differ"))
    if faults:
        raise InputError(*faults)
    file = os.path.normpath(Path(path).parent / keys["file"])
    rest = (keys[name] for name in ("noise", "starts", "seed", "profile"))
    return Fit(path, file, *rest, parameters, tuple(one for one in data if one is not None))


def _rows(path: str, rows: Any, name: str, faults: list[Fault]) -> list[dict[str, Any]]:
    if isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows):
        return rows
    faults.append(Fault(path, name, "missing", f"at least one table [[{name}]]"))
    return []


def _parameter(path: str, i: int, row: dict[str, Any], faults: list[Fault]) -> Parameter | None:
    where = f"parameter[{i}]"
    one = checked(path, f"{where} ", row, PARAMETER_CHECKS, faults)
    for name in ("name", "keys", "low", "high"):
        if one[name] is None:
            faults.append(Fault(path, f"{where} {name}", "missing", "name, keys, low and high"))
            return None
    low, high = one["low"], one["high"]
    if not low < high:
        faults.append(Fault(path, f"{where} high", high, f"a number above low = {low:g}"))
    log = low > 0.0 if one["log"] is None else one["log"]
    if log and low <= 0.0:
        faults.append(Fault(path, f"{where} low", low, "a number above 0 with log = true"))
    if one["start"] is not None and not low <= one["start"] <= high:
        faults.append(Fault(path, f"{where} start", one["start"], f"a number from {low:g} to {high:g}"))
    return Parameter(one["name"], tuple(one["keys"]), low, high, one["start"], log, one["factor"])
