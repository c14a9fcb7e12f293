"""Checks of a job's values.

A check takes a value and returns the value as the program wants it, or raises `ValueError` with what was expected.
It also says in JSON Schema what it takes, for editors (`json_schema.py`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from attrito.support.near import nearest
from attrito.support.units import units_of

Check = Callable[[Any], Any]

# Integers cross to the library as 32 bits.
LARGEST_INTEGER = 2**31 - 1
# In Hz, far above any: angular frequencies of all harmonics have finite squares, with room for what these are times.
LARGEST_FREQUENCY = 1e100
# Datasets beside those of the monitors.
RESERVED = ("frequency_hz", "natural_hz")
# Displacements along the axes, rotations about them, and generalised coordinates.
DIRECTIONS = {"q": 0, "x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}

# JSON Schema of what tables share
NODE = [{"const": "node"}, {"type": ["integer", "string"]}, {"enum": list(DIRECTIONS)}]
DOF = {"anyOf": [{"type": "integer", "minimum": 0}, {"type": "array", "items": NODE, "minItems": 3, "maxItems": 3}]}
TERM = {"type": "array", "items": [DOF, {"type": "number"}], "minItems": 2, "maxItems": 2}
PAIR = {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 2, "maxItems": 2}
NAME = {"type": "string", "minLength": 1, "maxLength": 64, "pattern": "^[^/,]+$"}
MONITOR = {
    "type": "object",
    "properties": {"name": NAME, "dofs": {"type": "array", "items": TERM, "minItems": 1}},
    "required": ["name", "dofs"],
    "additionalProperties": False,
}


@dataclass(frozen=True)
class Described:
    """A check, and what it takes in JSON Schema."""

    check: Check
    schema: dict[str, Any]

    def __call__(self, value: Any) -> Any:
        """What the check makes of a value."""
        return self.check(value)


def described(schema: dict[str, Any]) -> Callable[[Check], Described]:
    """Say what a check takes in JSON Schema."""
    return lambda check: Described(check, schema)


def number(low: float = -math.inf, high: float = math.inf, *, above: bool = False, below: bool = False) -> Check:
    """A finite number from `low` (or above it) to `high` (or below it)."""
    words = "a number"
    if low > -math.inf:
        words += f" above {low:g}" if above else f" of at least {low:g}"
    if high < math.inf:
        words += f" {'and ' if low > -math.inf else ''}{'below' if below else 'of at most'} {high:g}"

    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(words)
        try:
            finite = math.isfinite(value)
        except OverflowError:
            finite = False
        if not finite or value < low or value > high or (above and value == low) or (below and value == high):
            raise ValueError(words)
        return float(value)

    bounds = {"exclusiveMinimum" if above else "minimum": low, "exclusiveMaximum" if below else "maximum": high}
    return Described(
        check, {"type": "number"} | {name: value for name, value in bounds.items() if math.isfinite(value)}
    )


def frequency(low: float = 0.0, *, above: bool = True) -> Check:
    """A frequency in Hz whose harmonics' squares are numbers, too."""
    return number(low, LARGEST_FREQUENCY, above=above)


def integer(low: int, high: int = LARGEST_INTEGER) -> Check:
    """An integer from `low` to `high`."""
    words = f"an integer from {low} to {high}"

    def check(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(words)
        return value

    return Described(check, {"type": "integer", "minimum": low, "maximum": high})


@described({"type": "string", "minLength": 1})
def text(value: Any) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ValueError("a text of printable characters")
    return value


@described({"type": "string", "minLength": 1})
def unit_set(value: Any) -> str:
    """Names of a consistent set of units."""
    name: str = text(value)
    units_of(name)
    return name


@described({"type": "boolean"})
def boolean(value: Any) -> bool:
    """true or false."""
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def choice(*names: str) -> Check:
    """One of some names."""
    words = "one of " + ", ".join(f'"{name}"' for name in names) if len(names) > 1 else f'"{names[0]}"'

    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            near = nearest(value, names) if isinstance(value, str) else None
            raise ValueError(f'{words}; do you mean "{near}"?' if near else words)
        return value

    return Described(check, {"enum": list(names)})


def either(*checks: Check) -> Check:
    """What any of some checks takes."""

    def check(value: Any) -> Any:
        expected = []
        for one in checks:
            try:
                return one(value)
            except ValueError as error:
                expected.append(str(error))
        raise ValueError(", or ".join(expected))

    return Described(check, {"anyOf": [schema_of(one) for one in checks]})


@dataclass(frozen=True)
class Listing:
    """The check of a list of items, `low` to `high` of them, or any number from `low`."""

    item: Check
    low: int = 0
    high: int | None = None

    def __call__(self, value: Any) -> list[Any]:
        """The list of what the items' check makes of them."""
        low, high = self.low, self.high
        if not isinstance(value, list) or len(value) < low or (high is not None and len(value) > high):
            count = f"{low}" if high == low else f"at least {low}" if high is None else f"{low} to {high}"
            raise ValueError(f"a list of {count} items")
        checked = []
        for place, entry in enumerate(value):
            try:
                checked.append(self.item(entry))
            except ValueError as error:
                inner = str(error)
                words = f"{inner} of item {place}" if "as item" in inner else f"{inner}, not {entry!r}, as item {place}"
                raise ValueError(words) from None
        return checked


def schema_of(check: Check) -> dict[str, Any]:
    """What a check takes, in JSON Schema."""
    if isinstance(check, Listing):
        counts = {"minItems": check.low} | ({} if check.high is None else {"maxItems": check.high})
        return {"type": "array", "items": schema_of(check.item)} | counts
    if isinstance(check, Described):
        return check.schema
    raise TypeError("a check that does not say what it takes")


def listing(item: Check, low: int = 0, high: int | None = None) -> Check:
    """A list of items, `low` to `high` of them."""
    return Listing(item, low, high)


def takes(check: Check) -> str:
    """What a check takes, in words: those with which it refuses what nothing takes; of a list its items' too."""
    if not isinstance(check, Listing):
        try:
            check(object())
        except ValueError as error:
            return re.sub(rf"from (\d+) to {LARGEST_INTEGER}\b", r"of at least \1", str(error))
        raise TypeError("a check that refuses nothing")
    if check.low == check.high:
        return f"a list of {check.low}, each {takes(check.item)}"
    count = f" of at least {check.low}" if check.high is None and check.low else ""
    count = f" of {check.low} to {check.high}" if check.high is not None else count
    return f"a list{count}, each {takes(check.item)}"


@described({"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 1})
def rising_speeds(value: Any) -> list[float]:
    """Speeds in Hz, each above the one before."""
    words = "a list of at least 1, each a speed in Hz of at least 0, above the one before"
    try:
        speeds: list[float] = listing(frequency(above=False), 1)(value)
    except ValueError:
        raise ValueError(words) from None
    if any(after <= before for before, after in zip(speeds, speeds[1:], strict=False)):
        raise ValueError(words)
    return speeds


@described({"type": "array", "items": PAIR, "minItems": 1})
def pressure_table(value: Any) -> list[list[float]]:
    """Pairs [pressure, friction coefficient], pressures ascending."""
    words = "pairs [pressure, coefficient], both at least 0, pressures ascending"
    try:
        pairs: list[list[float]] = listing(listing(number(0), 2, 2), 1)(value)
    except ValueError:
        raise ValueError(words) from None
    if any(after[0] <= before[0] for before, after in zip(pairs, pairs[1:], strict=False)):
        raise ValueError(words)
    return pairs


@described(DOF)
def dof(value: Any) -> int | tuple[str, int | str, str]:
    """A dof: a number from 0, or ["node", id, "x"] with an id or the name of a set of one node."""
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    if (
        isinstance(value, list)
        and len(value) == 3
        and value[0] == "node"
        and isinstance(value[1], int | str)
        and not isinstance(value[1], bool)
        and isinstance(value[2], str)
        and value[2] in DIRECTIONS
    ):
        return tuple(value)
    raise ValueError('a dof: a number from 0, or ["node", id, "x"]')


@described(TERM)
def term(value: Any) -> tuple[Any, float]:
    """A pair [dof, coefficient]."""
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError("a pair [dof, coefficient]")
    return dof(value[0]), number()(value[1])


terms = listing(term)


@described({"type": "array", "items": {"anyOf": [{"type": "number"}, TERM]}})
def acceleration(value: Any) -> list[float] | list[tuple[Any, float]]:
    """Along x, y, z, or of dofs."""
    for check in (listing(number(), 3, 3), listing(term, 1)):
        try:
            return check(value)  # type: ignore[no-any-return]
        except ValueError:
            continue
    raise ValueError("a list of 3 numbers, along x, y, z, or of pairs [dof, acceleration]")


@described(MONITOR)
def monitor(value: Any) -> dict[str, Any]:
    """A table { name, dofs }."""
    if not isinstance(value, dict) or set(value) != {"name", "dofs"}:
        raise ValueError("a table { name = ..., dofs = [[dof, coefficient], ...] }")
    name = dataset_name(value["name"])
    return {"name": name, "dofs": listing(term, 1)(value["dofs"])}


@described(NAME)
def dataset_name(value: Any) -> str:
    """A name that a dataset of the output and a column of a table can have."""
    name: str = text(value)
    barred = "/" in name or "," in name or name != name.strip() or name in (".", "..", *RESERVED)
    if barred or len(name.encode(errors="surrogatepass")) > 64:
        others = ", other than " + ", ".join(RESERVED)
        raise ValueError("a name of at most 64 bytes without slash, comma or outer blanks" + others)
    return name


@described({"anyOf": [{"type": "number"}, {"type": "object", "additionalProperties": {"type": "number"}}]})
def corner(value: Any) -> float | dict[str, float]:
    """A corner of the load path: one factor, or factors by the names of loads."""
    if isinstance(value, dict):
        return {name: number()(factor) for name, factor in value.items()}
    try:
        factor: float = number()(value)
    except ValueError:
        raise ValueError("a number, or a table of numbers by the names of loads") from None
    return factor


@described(
    {"anyOf": [{"type": "string", "minLength": 1}, {"type": "array", "items": {"type": "array"}, "minItems": 1}]}
)
def matrix(value: Any) -> str | list[list[Any]]:
    """A file, or rows of numbers."""
    if isinstance(value, str):
        file: str = text(value)
        return file
    if isinstance(value, list) and value and all(isinstance(row, list) for row in value):
        return value
    raise ValueError("a file name or a list of rows of numbers")


@described({"type": "string", "pattern": r"^(static|rest|point:\d+)$"})
def start(value: Any) -> str:
    """Where an integration starts: "static", "rest" or "point:<number>"."""
    if isinstance(value, str) and re.fullmatch(r"static|rest|point:\d+", value):
        return value
    raise ValueError('"static", "rest" or "point:<number>"')


@described({"type": "string", "pattern": r"^point:\d+$"})
def stored_point(value: Any) -> str:
    """A point of a result: "point:<number>"."""
    if isinstance(value, str) and re.fullmatch(r"point:\d+", value):
        return value
    raise ValueError('"point:<number>"')


@described({"anyOf": [{"type": "integer", "minimum": 1}, {"type": "string", "minLength": 1}]})
def node_reference(value: Any) -> int | str:
    """A node's id or a node set's name."""
    node: int | str = either(integer(1), text)(value)
    return node
