"""Keys of a job that take other values, as studies and fits give them: where they are, and the job with them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from attrito.job.checks import Check
from attrito.job.job import Job, rom_path
from attrito.job.laws import FURTHER_KEYS, LAW_KEYS
from attrito.job.reading import check_job, plain
from attrito.support.errors import Fault, InputError
from attrito.support.toml_files import read_toml

Asked = TypeVar("Asked")

# What these hold is in the reduced model, but for the contacts' laws and the engine order.
MODEL_TABLES = ("model", "reduction", "cyclic", "load", "output", "contact", "contact_set")
ENGINE_ORDER = "cyclic.engine_order"


class Varied(Protocol):
    """A quantity: the keys of the job that have its value, or (`factor`) are multiplied by it."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Paths as of `places`."""

    @property
    def factor(self) -> bool:
        """Whether the value multiplies what the job has."""


def read_keys(
    source: str | os.PathLike[str] | Mapping[str, Any],
    folder: str | os.PathLike[str],
    name: str,
    check: Callable[[dict[str, Any], str], Asked],
    with_job: Callable[[Asked, Any], Asked],
) -> Asked:
    """What a file asks of a job, checked.

    Parameters
    ----------
    source : the file, or its keys as a dictionary, whose job may be one, too
    folder, name : what file names of a dictionary are relative to, and what it is called there
    check : from keys and the path that faults name
    with_job : the same with a job that was not in a file

    Raises
    ------
    InputError : the file cannot be read, or is at fault
    """
    if not isinstance(source, Mapping):
        return check(read_toml(source, f"a {name}"), str(source))
    given = source.get("job")
    path = str(Path(folder) / name)
    if not isinstance(given, Mapping | Job):
        return check(plain(source), path)
    return with_job(check(plain({**source, "job": "job"}), path), given)


def with_values(job: Job, values: Sequence[tuple[Varied, float]], path: str, table: str, excited: bool = True) -> Job:
    """The job with values of some quantities, checked as a job is.

    Parameters
    ----------
    path, table : of the file that asks for them, and what it calls a quantity, for faults
    excited : as of `check_job`

    Raises
    ------
    InputError : faults of the job, as those of the values
    """
    touched = {_table(key) for varied, _ in values for key in varied.keys}
    tables = {name: table for name, table in job.tables.items() if name in job.given | touched}
    for varied, value in values:
        for key in varied.keys:
            tables = _copied_along(tables, _steps(key))
            set_value(tables, key, value, varied.factor)
    try:
        return check_job(tables, job.path, excited, job)
    except InputError as error:
        shown = ", ".join(f"{varied.name} = {value:g}" for varied, value in values)
        raise InputError(
            *(Fault(path, f"{table} ({shown}): {it.key}", it.value, it.expected) for it in error.faults)
        ) from None


def faults_of_keys(job: Job, keys: Sequence[str], path: str, where: str) -> list[Fault]:
    """Keys that are no number of the job, or one that its reduced model holds."""
    faults = []
    for key in keys:
        if rom_path(job) is not None and is_of_model(key):
            laws = ", ".join((*LAW_KEYS, *FURTHER_KEYS))
            expected = f"a number that the reduced model does not hold: of contacts, {laws}; {ENGINE_ORDER}"
            faults.append(Fault(path, where, key, expected))
            continue
        try:
            places(job.tables, key)
        except ValueError as error:
            faults.append(Fault(path, where, key, str(error)))
    return faults


def is_of_model(key: str) -> bool:
    """Whether the model has to be read again for it, and reduced."""
    # Without the places in a table by pressure
    name = key.rpartition(".")[2].partition("[")[0]
    of_law = _table(key) in ("contact", "contact_set") and name in (*LAW_KEYS, *FURTHER_KEYS)
    return _table(key) in MODEL_TABLES and not of_law and key != ENGINE_ORDER


def _copied_along(value: Any, steps: Sequence[str]) -> Any:
    """What a path leads through as copies, all else as it is."""
    if steps and isinstance(value, dict) and steps[0] in value:
        return value | {steps[0]: _copied_along(value[steps[0]], steps[1:])}
    if steps and isinstance(value, list):
        chosen = range(len(value)) if steps[0] == "*" else (int(steps[0]),)
        return [_copied_along(item, steps[1:]) if i in chosen else item for i, item in enumerate(value)]
    return value


def _steps(key: str) -> list[str]:
    """Names and places that a path goes by; `*` for every entry of a list."""
    return re.findall(r"\w+|\*", key)


def _table(key: str) -> str:
    found = re.match(r"\w*", key)
    return found.group() if found is not None else ""


def places(tables: dict[str, Any], key: str) -> list[tuple[Any, Any]]:
    """Where a key's numbers are, as (container, index); `[*]` stands for every entry of a list.

    Raises
    ------
    ValueError : it is not a number of the job
    """
    found: list[tuple[Any, Any]] = [({"": tables}, "")]
    if not re.fullmatch(r"\w+(\.\w+|\[(\d+|\*)\])*", key):
        raise ValueError('a path such as "contact[0].friction_coefficient" or "static.load_path[1]"')
    for step in _steps(key):
        ahead: list[tuple[Any, Any]] = []
        for container, index in found:
            inner = container[index]
            if isinstance(inner, dict) and step in inner:
                ahead.append((inner, step))
            elif isinstance(inner, list) and step == "*":
                ahead += [(inner, i) for i in range(len(inner))]
            elif isinstance(inner, list) and step.isdecimal() and int(step) < len(inner):
                ahead.append((inner, int(step)))
            else:
                known = ", ".join(inner) if isinstance(inner, dict) else "an index of the list"
                raise ValueError(f"a key of the job; at {step!r}: {known}")
        found = ahead
    for container, index in found:
        value = container[index]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"a number of the job, not {value!r}")
    return found


def set_value(tables: dict[str, Any], key: str, value: float, factor: bool) -> None:
    """Give a key of the job a value, or multiply what it has; whole numbers stay whole where they can."""
    for container, index in places(tables, key):
        new = container[index] * value if factor else value
        container[index] = int(new) if isinstance(container[index], int) and new == int(new) else new


def checked(
    path: str, place: str, table: dict[str, Any], checks: dict[str, tuple[Check, Any]], faults: list[Fault]
) -> dict[str, Any]:
    """Values of a table's known keys, the others at their defaults; what is not fine goes to the faults."""
    values = {name: default for name, (_, default) in checks.items()}
    for name, value in table.items():
        if name not in checks:
            faults.append(Fault(path, f"{place}{name}", value, "a known key: " + ", ".join(checks)))
            continue
        try:
            values[name] = checks[name][0](value)
        except ValueError as error:
            faults.append(Fault(path, f"{place}{name}", value, str(error)))
    return values
