"""What results are called in a legend: by what differs between their jobs, or by their files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from attrito.results.result import Result

# Keys that may be named together, and letters of a value beyond which files are named instead
MOST_KEYS, LONGEST_VALUE = 2, 24
# Where results go says nothing of what was solved.
UNSAID = ("output",)


def names_of(results: Sequence[Result]) -> list[str]:
    """A name a result, each another: `friction coefficient 0.3`, or the file."""
    if len(results) == 1:
        return [""]
    jobs = [_flat(_job(result)) for result in results]
    absent = object()
    differing = [
        key
        for key in dict.fromkeys(key for job in jobs for key in job)
        if len({json.dumps(job.get(key, "absent"), sort_keys=True) for job in jobs}) > 1
    ]
    if differing and all(key in job for key in differing for job in jobs):
        # One value at several places, as of all contact sets, is said once.
        columns: dict[tuple[Any, ...], str] = {}
        for key in differing:
            columns.setdefault(tuple(_shown(job.get(key, absent)) for job in jobs), key)
        shown = [f"{_short(key)} {{}}" for key in columns.values()]
        if len(shown) <= MOST_KEYS and all(len(value) <= LONGEST_VALUE for values in columns for value in values):
            found = [
                ", ".join(text.format(value) for text, value in zip(shown, row, strict=True))
                for row in zip(*columns, strict=True)
            ]
            if len(set(found)) == len(found):
                return found
    return distinct_names([result.path for result in results])


def distinct_names(paths: Sequence[str]) -> list[str]:
    """File names without their ending; with their folders where these are alike."""
    stems = [Path(path).name.partition(".h5")[0] for path in paths]
    if len(set(stems)) == len(stems):
        return stems
    folders = [Path(path).resolve().parent.name for path in paths]
    if len(set(folders)) == len(folders):
        return folders
    return list(paths)


def _job(result: Result) -> dict[str, Any]:
    try:
        tables = json.loads(result.attribute("job"))
    except ValueError:
        return {}
    return {name: table for name, table in tables.items() if name not in UNSAID} if isinstance(tables, dict) else {}


def _flat(thing: Any, place: str = "") -> dict[str, Any]:
    """Every number and text of a job by its key, as `contact_set[0].friction_coefficient`."""
    if isinstance(thing, dict):
        pairs = [(f"{place}.{name}" if place else name, value) for name, value in thing.items()]
    elif isinstance(thing, list) and any(isinstance(value, dict) for value in thing):
        pairs = [(f"{place}[{number}]", value) for number, value in enumerate(thing)]
    else:
        return {place: thing}
    return {key: value for name, part in pairs for key, value in _flat(part, name).items()}


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _short(key: str) -> str:
    return key.rpartition(".")[2].replace("_", " ")
