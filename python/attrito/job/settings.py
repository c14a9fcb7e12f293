"""Keys of a job that are given beside its file, as `balance.harmonics=9` of `--set`."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from attrito.job.schema import ARRAYS, TABLES
from attrito.support.errors import Fault, InputError

PLACES = (
    'a key and its value in TOML, as "balance.harmonics=9", "contact_set[*].friction_coefficient=0.4",'
    ' "static.load_path[1]=0.5" or "load.<name>=2.0", a factor on that load'
)
# What a factor on a load multiplies
LOAD_KEYS = ("dofs", "cosine", "sine")


def apply_settings(raw: dict[str, Any], settings: list[str], path: str) -> None:
    """Give keys of a job that is called `path` their values; all faults together as `InputError`.

    A key that the job does not have is added to its table; `[*]` stands for every entry of a list of tables.
    """
    faults = []
    for setting in settings:
        key, equals, text = (part.strip() for part in setting.partition("="))
        try:
            if not equals or not key or not text:
                raise ValueError(PLACES)
            _apply(raw, key, _value(text))
        except ValueError as error:
            faults.append(Fault(path, f"--set {key}", text, str(error)))
    if faults:
        raise InputError(*faults)


def _value(text: str) -> Any:
    """A value of TOML; what has none of its brackets and quotes, which a shell takes away, is a text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        if re.fullmatch(r"""[^][{}"'\n]+""", text):
            return text
        raise ValueError("a value of TOML") from None


def _apply(raw: dict[str, Any], key: str, value: Any) -> None:
    found = re.fullmatch(r"(\w+)(?:\[(\d+|\*)\])?\.(\w+)((?:\[\d+\])*)", key)
    if found is None:
        raise ValueError(PLACES)
    table, place, name, within = found.groups()
    if table == "load" and place is None and not within:
        _scale_load(raw, name, value)
        return
    if table in TABLES and place is None:
        keys, rows = TABLES[table], [raw.setdefault(table, {})]
    elif table in ARRAYS and place is not None:
        keys, entries = ARRAYS[table], raw.get(table, [])
        if not isinstance(entries, list) or not entries or (place != "*" and int(place) >= len(entries)):
            count = len(entries) if isinstance(entries, list) else 0
            raise ValueError(f"one of the job's [[{table}]], of which there are {count}, counted from 0")
        rows = entries if place == "*" else [entries[int(place)]]
    elif table in ARRAYS:
        raise ValueError(f'a number of the list, as "{table}[0].{name}", or "{table}[*].{name}" for all')
    else:
        raise ValueError("a table of the job: " + ", ".join(sorted(TABLES | ARRAYS)))
    if name not in keys:
        raise ValueError("a known key: " + ", ".join(keys))
    for row in rows:
        if not isinstance(row, dict):
            raise ValueError(f"a table {table} in the job")
        holder: Any = row
        at: Any = name
        for index in (int(text) for text in re.findall(r"\d+", within)):
            if not isinstance(holder.get(at) if isinstance(holder, dict) else holder[at], list):
                raise ValueError(f"a list in the job at {at}")
            holder, at = holder[at], index
            if index >= len(holder):
                raise ValueError(f"an entry of a list of {len(holder)}, counted from 0")
        holder[at] = value


def _scale_load(raw: dict[str, Any], name: str, factor: Any) -> None:
    """Multiply the forces of the loads of a name."""
    if isinstance(factor, bool) or not isinstance(factor, int | float):
        raise ValueError("a number, the factor on the load")
    loads = [load for load in raw.get("load", []) if isinstance(load, dict)]
    own = [load for load in loads if load.get("name") == name]
    if not own:
        known = ", ".join(str(load["name"]) for load in loads if "name" in load) or "none has a name"
        raise ValueError(f"load.<name> with the name of a load: {known}")
    for load in own:
        if not any(load.get(key) for key in LOAD_KEYS) or "file" in load:
            raise ValueError("a load whose forces are in the job; of others set their keys")
        for key in LOAD_KEYS:
            if isinstance(load.get(key), list):
                load[key] = [_scaled(row, factor) for row in load[key]]


def _scaled(row: Any, factor: float) -> Any:
    """`[dof, force]` with its force multiplied; what is no such pair is left for the checks of the job."""
    if isinstance(row, list) and len(row) == 2 and isinstance(row[1], int | float):
        return [row[0], factor * row[1]]
    return row
