"""A checked job, and the files that it names."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from attrito.support.errors import Fault


@dataclass
class Job:
    """A checked job.

    Parameters
    ----------
    path : the job file, as the user wrote it
    tables : every table with every key, defaults filled in; lists of tables for `contact`, `contact_set`, `load`
    given : the tables that the file holds
    settings : values that stand for those of the file, as `balance.harmonics=9`
    notes : what is to be said of keys that have no effect any more
    """

    path: str
    tables: dict[str, Any]
    given: frozenset[str]
    settings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __getitem__(self, table: str) -> Any:
        return self.tables[table]

    @property
    def attributes(self) -> dict[str, str]:
        """What a file that is made from the job says of it at its root, before anything else is written."""
        return {"job": json.dumps(self.tables), "units": self["model"]["units"] or ""}

    def file(self, name: str) -> str:
        """A file name of the job: relative ones are relative to the folder of the job file."""
        return os.path.normpath(Path(self.path).parent / name)

    def fault(self, key: str, value: object, expected: str) -> Fault:
        """A fault at a key of this job."""
        return Fault(self.path, key, value, expected)


def rom_path(job: Job) -> str | None:
    """Where the job's reduced model is kept, the first of a folder; None when the matrices are used as they are."""
    if "reduction" not in job.given:
        return None
    if job["reduction"]["file"] is not None:
        return job.file(job["reduction"]["file"])
    return str(Path(job.file(job["output"]["file"])).parent / "rom.h5")


def peak_path(job: Job) -> str:
    """Where the peaks of a job go."""
    if job["peak"]["file"] is not None:
        return job.file(job["peak"]["file"])
    return str(Path(job.file(job["output"]["file"])).with_suffix(".peaks.h5"))


def linear_modes_path(job: Job, state: str) -> str:
    """Where linear modes of a job go, contacts being in one of `REFERENCES`: a file for each."""
    ending = ".modes.h5" if state == "tangent" else f".{state}.modes.h5"
    return str(Path(job.file(job["output"]["file"])).with_suffix(ending))


def campbell_path(job: Job) -> str:
    """Where the Campbell diagram of a job goes."""
    if job["campbell"]["file"] is not None:
        return job.file(job["campbell"]["file"])
    return str(Path(job.file(job["output"]["file"])).with_suffix(".campbell.h5"))


def mode_path(job: Job) -> str:
    """Where a nonlinear mode of a job goes."""
    if job["mode"]["file"] is not None:
        return job.file(job["mode"]["file"])
    return str(Path(job.file(job["output"]["file"])).with_suffix(".mode.h5"))


def model_path(job: Job, rom: str | None) -> str | None:
    """The job's model file: its own, or one beside the file of the reduced model for matrices given otherwise."""
    if job["model"]["file"] is not None:
        return job.file(job["model"]["file"])
    return None if rom is None else str(Path(rom).with_suffix(".model.h5"))


def files_read(job: Job) -> list[str]:
    """The job file and all that it names to be read."""
    return list(files_by_key(job).values())


def files_by_key(job: Job) -> dict[str, str]:
    """The job file and all that it names to be read, by the key that names it."""
    taken = {"the job": os.path.normpath(job.path)}
    for key, name in job["model"].items():
        if isinstance(name, str) and key != "units":
            taken[f"[model] {key}"] = _file_of_matrix(job, name)
    at_rest = job["campbell"]["stiffness_at_rest"]
    if isinstance(at_rest, str):
        taken["[campbell] stiffness_at_rest"] = _file_of_matrix(job, at_rest)
    for i, contacts in enumerate(job["contact_set"]):
        if contacts["gap_file"] is not None:
            taken[f"contact_set[{i}] gap_file"] = job.file(contacts["gap_file"])
    for i, load in enumerate(job["load"]):
        named = {key: load[key] for key in ("file", "cosine", "sine") if isinstance(load[key], str)}
        taken |= {f"load[{i}] {key}": job.file(name) for key, name in named.items()}
    return taken


def _file_of_matrix(job: Job, name: str) -> str:
    """The file that a matrix is in; `FILE:NAME` is one matrix of a file of several."""
    whole = Path(job.file(name)).exists() or ":" not in name
    return job.file(name if whole else name.rpartition(":")[0])
