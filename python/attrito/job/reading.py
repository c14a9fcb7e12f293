"""The job file: read, checked as a whole, every fault reported with its place, defaults filled in."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from attrito.job.cross_checks import cross_check
from attrito.job.defaults import fill_accuracy
from attrito.job.job import Job
from attrito.job.key import Key
from attrito.job.schema import ARRAYS, REQUIRED_TABLES, TABLES
from attrito.job.settings import apply_settings
from attrito.support.errors import Fault, InputError
from attrito.support.near import nearest
from attrito.support.overwrite_check import check_files
from attrito.support.toml_files import read_toml
from attrito.support.toml_places import line_of, places


def read_job(
    source: str | os.PathLike[str] | Mapping[str, Any] | Job,
    folder: str | os.PathLike[str] = ".",
    excited: bool = True,
    settings: Sequence[str] = (),
) -> Job:
    """Read and check a job; raises `InputError` with all faults together.

    Parameters
    ----------
    source : a job file, or its tables as a dictionary, in which arrays stand for lists; a job that is checked stays
    folder : what file names of a dictionary are relative to
    excited : False for motion without excitation: neither `[sweep]` nor a harmonic load nor monitors are needed
    settings : keys with values that stand for those of a job file, as `balance.harmonics=9` (`job/settings.py`)
    """
    if isinstance(source, Job):
        return source
    if isinstance(source, Mapping):
        return check_job(plain(source), str(Path(folder) / "job"), excited)
    path = str(source)
    check_files(path, "file", [path])
    raw = read_toml(path, "a job")
    apply_settings(raw, list(settings), path)
    try:
        return replace(check_job(raw, path, excited), settings=tuple(settings))
    except InputError as error:
        raise InputError(*located(error.faults, path, settings)) from None


def located(faults: Sequence[Fault], path: str, settings: Sequence[str]) -> list[Fault]:
    """Faults of a job's file with their lines; what `--set` gave has none."""
    known = places(Path(path).read_text(encoding="utf-8-sig"))
    given = {_place(setting.partition("=")[0].replace(".", " ")) for setting in settings}
    return [
        fault if fault.file != path or _place(fault.key) in given else replace(fault, line=line_of(fault.key, known))
        for fault in faults
    ]


def _place(key: str) -> tuple[str, ...]:
    """Table and key of `[table] key`, `table[0] key[1]` or, of a setting, `table[*] key`."""
    return tuple(re.sub(r"\[[\d*]*\]|[\[\]]", "", key).split()[:2])


def plain(value: Any) -> Any:
    """What TOML knows: arrays and tuples as lists, numbers of numpy as Python's, paths as text; None is absent."""
    # Most of a long job are numbers and words in lists: these are asked for first.
    if type(value) in (float, int, str, bool):
        return value
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items() if item is not None}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def check_job(raw: dict[str, Any], path: str, excited: bool = True, like: Job | None = None) -> Job:
    """Check the tables of a job that is called `path`; see `read_job`.

    `like`: one that differs in a few numbers. Values that are its own objects were checked with it, and are not again,
    which of a long job takes longer than much that is solved.
    """
    faults: list[Fault] = []
    before = {} if like is None else like.tables
    tables: dict[str, Any] = {}
    known = sorted(TABLES | ARRAYS)
    meant: set[str | None] = set()
    for name in raw:
        if name not in known:
            near = nearest(name, [one for one in known if one not in raw])
            meant.add(near)
            expected = f"a known table; do you mean {near}?" if near else "one of " + ", ".join(known)
            faults.append(Fault(path, f"[{name}]", "unknown table", expected))
    for name, keys in TABLES.items():
        table = raw.get(name, {})
        if not isinstance(table, dict):
            faults.append(Fault(path, name, table, f"a table [{name}]"))
            table = {}
        if name in raw or name not in REQUIRED_TABLES or (name == "sweep" and not excited):
            needed = keys
            if name == "output" and not excited:
                needed = keys | {"monitors": replace(keys["monitors"], required=False)}
                # An empty list is none, too.
                table = {key: value for key, value in table.items() if key != "monitors" or value != []}
            there = before.get(name, {})
            tables[name] = _check_table(path, f"[{name}]", table, needed, faults, there, required=name in raw)
        else:
            if name not in meant:
                faults.append(Fault(path, f"[{name}]", "missing", f"a table with {', '.join(keys)}"))
            tables[name] = {key: spec.default for key, spec in keys.items()}
    for name, keys in ARRAYS.items():
        rows = raw.get(name, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            faults.append(Fault(path, name, type(rows).__name__, f"tables [[{name}]]"))
            rows = []
        there = before.get(name, [{}] * len(rows))
        tables[name] = [
            _check_table(path, f"{name}[{i}]", row, keys, faults, old)
            for i, (row, old) in enumerate(zip(rows, there, strict=True))
        ]
    job = Job(path, tables, frozenset(raw), notes=tuple(f"{path}: {note}" for note in retire(tables)))
    fill_accuracy(job)
    if not excited and tables["output"]["monitors"] is None:
        tables["output"]["monitors"] = []
    faults += cross_check(job, faults, excited)
    if faults:
        raise InputError(*faults)
    return job


def retire(tables: dict[str, Any]) -> list[str]:
    """Take the keys that have no effect any more out of a job's tables; a sentence for each that is given."""
    balance = tables["balance"]
    was_held = balance.get("quadrature") == "auto" and balance["tolerance"] is None
    retired = [
        (table, key, spec.retired)
        for table, keys in TABLES.items()
        for key, spec in keys.items()
        if spec.retired and tables[table].pop(key, None) is not None
    ]
    notes = [f"[{table}] {key} has no effect: {instead}; the key can be deleted" for table, key, instead in retired]
    if was_held and isinstance(balance["harmonics"], int):
        notes.append(
            '[balance] tolerance is not given: quadrature = "auto" stood for 0.01, too; errors of fixed harmonics are'
            " now estimated, but held against nothing; give it to have them held"
        )
    return notes


def _check_table(
    path: str,
    place: str,
    table: dict[str, Any],
    keys: dict[str, Key],
    faults: list[Fault],
    known: dict[str, Any],
    required: bool = True,
) -> dict[str, Any]:
    checked = {name: key.default for name, key in keys.items()}
    # What misspelt keys may stand for is not missing.
    meant: set[str | None] = set()
    for name, value in table.items():
        if name in known and value is known[name]:
            checked[name] = value
            continue
        if name not in keys:
            near = nearest(name, [key for key in keys if key not in table])
            meant.add(near)
            expected = f"a known key; do you mean {near}?" if near else "a known key: " + ", ".join(keys)
            faults.append(Fault(path, f"{place} {name}", value, expected))
            continue
        try:
            checked[name] = keys[name].check(value)
        except ValueError as error:
            faults.append(Fault(path, f"{place} {name}", value, str(error)))
    for name, key in keys.items():
        if required and key.required and table.get(name) is None and name not in meant:
            faults.append(Fault(path, f"{place} {name}", "missing", "this key to be given"))
    return checked
