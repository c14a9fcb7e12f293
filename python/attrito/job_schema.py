"""What a job file may hold: its tables, their keys, what each key takes, and what it is when absent.

A check takes a value and returns the value as the program wants it, or raises `ValueError` with what was expected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Check = Callable[[Any], Any]

# Integers cross to the library as 32 bits.
LARGEST_INTEGER = 2**31 - 1
# Displacements along the axes, and rotations about them.
DIRECTIONS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}
# Of the rows for the factorisation of the interior stiffness, the default first.
ORDERINGS = ("scotch", "pord", "amf", "qamd", "amd")


@dataclass(frozen=True)
class Key:
    """One key of a table: how its value is checked, and its value when absent (required if there is none)."""

    check: Check
    default: Any = None
    required: bool = False


def number(low: float = -math.inf, high: float = math.inf, *, above: bool = False) -> Check:
    """A finite number from `low` (or above it) to `high`."""
    words = "a number"
    if low > -math.inf:
        words += f" above {low:g}" if above else f" of at least {low:g}"
    if high < math.inf:
        words += f" {'and ' if low > -math.inf else ''}of at most {high:g}"

    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(words)
        try:
            finite = math.isfinite(value)
        except OverflowError:
            finite = False
        if not finite or value < low or value > high or (above and value == low):
            raise ValueError(words)
        return float(value)

    return check


def integer(low: int, high: int = LARGEST_INTEGER, later: tuple[str, ...] = ()) -> Check:
    """An integer from `low` to `high`; the words of `later` are known in its place, but not in this version."""
    words = f"an integer from {low} to {high}"

    def check(value: Any) -> int:
        if isinstance(value, str) and value in later:
            raise ValueError(f'{words} ("{value}" is not in this version)')
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(words)
        return value

    return check


def text(value: Any) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ValueError("a text of printable characters")
    return value


def boolean(value: Any) -> bool:
    """true or false."""
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def choice(*names: str, later: tuple[str, ...] = ()) -> Check:
    """One of some names; those of `later` are known but not in this version."""
    words = "one of " + ", ".join(f'"{name}"' for name in names) if len(names) > 1 else f'"{names[0]}"'

    def check(value: Any) -> str:
        if isinstance(value, str) and value in later:
            raise ValueError(f'{words} ("{value}" is not in this version)')
        if value not in names:
            raise ValueError(words)
        return value

    return check


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

    return check


def listing(item: Check, low: int = 0, high: int | None = None) -> Check:
    """A list of items, `low` to `high` of them."""

    def check(value: Any) -> list:
        if not isinstance(value, list) or len(value) < low or (high is not None and len(value) > high):
            count = f"{low}" if high == low else f"at least {low}" if high is None else f"{low} to {high}"
            raise ValueError(f"a list of {count} items")
        checked = []
        for place, entry in enumerate(value):
            try:
                checked.append(item(entry))
            except ValueError as error:
                inner = str(error)
                words = f"{inner} of item {place}" if "as item" in inner else f"{inner}, not {entry!r}, as item {place}"
                raise ValueError(words) from None
        return checked

    return check


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


def term(value: Any) -> tuple[Any, float]:
    """A pair [dof, coefficient]."""
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError("a pair [dof, coefficient]")
    return dof(value[0]), number()(value[1])


terms = listing(term)


def monitor(value: Any) -> dict[str, Any]:
    """A table { name, dofs }."""
    if not isinstance(value, dict) or set(value) != {"name", "dofs"}:
        raise ValueError("a table { name = ..., dofs = [[dof, coefficient], ...] }")
    name = text(value["name"])
    reserved = (".", "..", "frequency_hz", "natural_hz")
    if "/" in name or "," in name or name != name.strip() or len(name.encode()) > 64 or name in reserved:
        raise ValueError(
            "a name of at most 64 bytes without slash, comma or outer blanks, other than " + ", ".join(reserved[2:])
        )
    return {"name": name, "dofs": listing(term, 1)(value["dofs"])}


def corner(value: Any) -> float | dict[str, float]:
    """A corner of the load path: one factor, or factors by the names of loads."""
    if isinstance(value, dict):
        return {name: number()(factor) for name, factor in value.items()}
    return number()(value)


def matrix(value: Any) -> str | list:
    """A file, or rows of numbers."""
    if isinstance(value, str):
        return text(value)
    if isinstance(value, list) and value and all(isinstance(row, list) for row in value):
        return value
    raise ValueError("a file name or a list of rows of numbers")


def start(value: Any) -> str:
    """Where an integration starts: "static", "rest" or "point:<number>"."""
    if value in ("static", "rest") or (isinstance(value, str) and re.fullmatch(r"point:\d+", value)):
        return value
    raise ValueError('"static", "rest" or "point:<number>"')


def node_reference(value: Any) -> int | str:
    """A node's id or a node set's name."""
    return either(integer(1), text)(value)


LAW = {
    "tangential_stiffness": Key(number(0, above=True), required=True),
    "normal_stiffness": Key(number(0, above=True), required=True),
    "friction_coefficient": Key(number(0), required=True),
    "gap": Key(number(), 0.0),
    "preload": Key(number(0), 0.0),
}

pair_of_numbers = listing(number(), 2, 2)

TABLES: dict[str, dict[str, Key]] = {
    "model": {
        "file": Key(text),
        "mass": Key(matrix),
        "stiffness": Key(matrix),
        "damping": Key(matrix),
    },
    "damping": {
        "rayleigh": Key(listing(number(0), 2, 2)),
        "ratio": Key(number(0, 1)),
        "loss_factor": Key(number(0, 1)),
    },
    "reduction": {
        "modes": Key(either(integer(0), choice("auto"))),
        "max_frequency_hz": Key(number(0, above=True)),
        "error": Key(number(0, 1, above=True), 1e-3),
        "ordering": Key(choice(*ORDERINGS), ORDERINGS[0]),
        "out_of_core": Key(either(boolean, choice("auto")), "auto"),
        "memory_gb": Key(number(0, above=True)),
        "boundary": Key(listing(node_reference), []),
        "file": Key(text),
    },
    "static": {
        "load_path": Key(listing(corner, 1), [0.0, 1.0]),
        "slider": Key(choice("keep", "reset"), "keep"),
        "steps": Key(integer(1), 20),
        "bounds": Key(choice("auto", "sampled", "none"), "auto"),
    },
    "balance": {
        "approach": Key(choice("coupled", "uncoupled"), "coupled"),
        "harmonics": Key(integer(1, 1000, later=("auto",)), 5),
        "tolerance": Key(number(0, 1, above=True)),
        "quadrature": Key(choice("event", "sampled", later=("auto",)), "event"),
        "samples": Key(integer(8, 2**20), 128),
        "residual_tolerance": Key(number(1e-14, 1e-3), 1e-10),
        "max_iterations": Key(integer(1), 30),
    },
    "sweep": {
        "start_hz": Key(number(0, above=True)),
        "stop_hz": Key(number(0, above=True)),
        "frequencies_hz": Key(listing(number(0, above=True), 1)),
        "levels": Key(listing(number(0, above=True), 1), [1.0]),
    },
    "continuation": {
        "branches": Key(integer(1, 1), 1),
        "both_directions": Key(boolean, False),
        "max_points": Key(integer(2), 1000),
    },
    "stability": {
        "method": Key(choice("none", "monodromy", "hill", "both"), "none"),
        "orbit": Key(choice("auto", "balance", "exact"), "auto"),
    },
    "integrate": {
        "scheme": Key(
            choice("event", "central_difference", "newmark", "hht", "generalised_alpha", "exponential"), "event"
        ),
        "steps_per_period": Key(integer(2)),
        "dissipation": Key(number(0, 1)),
        "frequency_hz": Key(number(0, above=True)),
        "level": Key(number(0), 1.0),
        "static_profile": Key(listing(pair_of_numbers, 1)),
        "harmonic_profile": Key(listing(pair_of_numbers, 1)),
        "start": Key(start, "static"),
        "sliders": Key(listing(either(number(), pair_of_numbers), 1)),
        "cycles": Key(integer(1), 400),
        "fewest_cycles": Key(integer(0), 0),
        "periodicity_tolerance": Key(number(0, above=True), 1e-10),
        "max_period_multiple": Key(integer(1), 4),
        "samples": Key(integer(8), 256),
        "history": Key(choice("period", "run"), "period"),
        "equivalent_viscous": Key(boolean, False),
    },
    "output": {
        "file": Key(text, required=True),
        "monitors": Key(listing(monitor, 1), required=True),
    },
}

ARRAYS: dict[str, dict[str, Key]] = {
    "contact": {
        "normal": Key(listing(term, 1), required=True),
        "tangents": Key(listing(listing(term, 1), 1, 2), required=True),
        **LAW,
    },
    "contact_set": {
        "a": Key(text, required=True),
        "b": Key(text, required=True),
        "tolerance": Key(number(0), required=True),
        "tangents": Key(integer(1, 2), 2),
        "stiffness_per": Key(choice("area", "node"), "area"),
        **LAW,
    },
    "load": {
        "name": Key(text),
        "kind": Key(choice("static", "harmonic", "centrifugal"), required=True),
        "dofs": Key(terms),
        "file": Key(text),
        "harmonic": Key(integer(1), 1),
        "cosine": Key(either(terms, text), []),
        "sine": Key(either(terms, text), []),
        "speed_hz": Key(number(0)),
        "axis_point": Key(listing(number(), 3, 3)),
        "axis_direction": Key(listing(number(), 3, 3)),
        "spin_softening": Key(boolean, False),
    },
}

REQUIRED_TABLES = ("model", "sweep", "output")
LOAD_KEYS = {
    "static": {"name", "kind", "dofs", "file"},
    "harmonic": {"name", "kind", "harmonic", "cosine", "sine"},
    "centrifugal": {"name", "kind", "speed_hz", "axis_point", "axis_direction", "spin_softening"},
}
