"""Measurements out of a file, in the quantities and units of the job."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from attrito.fits.columns import Columns, read_columns
from attrito.fits.measured import COLUMNS, SIGNED, Measured
from attrito.support.errors import Fault, InputError

# Beside columns of `COLUMNS`: what else may be read
OTHERS = {"response": ("real", "imaginary"), "mode": (), "loop": ("normal_force",)}
# Fewest points of a loop
FEWEST = 8


@dataclass(frozen=True)
class Layout:
    """How a file says it.

    Parameters
    ----------
    columns : names in the file by those of `known_columns`
    factors : by these names, on the file's numbers: units of the job per unit of the file
    decibel : whether amplitudes are 20 log10 of what is meant
    phase : whether the phase of a response is compared, too
    monitor : of a response, whose amplitudes may be in a column `<monitor>_amplitude`, as those of `attrito table`
    normal_force : of a loop without a column of it
    closed : whether a loop is whole cycles of a steady one
    """

    columns: dict[str, str] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    decibel: bool = False
    phase: bool = False
    monitor: str | None = None
    normal_force: float | None = None
    closed: bool = True


def known_columns(of: str) -> tuple[str, ...]:
    """Names of the columns that a kind of measurements may have, but for deviations."""
    where, compared = COLUMNS[of]
    return (where, *compared, *OTHERS[of])


def read_measured(path: str, of: str, layout: Layout, deviations: dict[str, float]) -> Measured:
    """Read a file of measurements.

    Parameters
    ----------
    path, of : the file; a name of `COLUMNS`
    layout : of the file
    deviations : by kind, where the file has no column `<name>_deviation`: relative; of phases in degrees; of a loop's
        force part of half its range

    Raises
    ------
    InputError : a column is missing, or something is no number
    """
    columns = read_columns(path)
    table = columns.named(layout.columns)
    where, compared = COLUMNS[of]
    if of == "response":
        _take_response(table, layout)
    for name, factor in layout.factors.items():
        if name in table:
            table[name] = factor * table[name]
    names = [name for name in compared if name in table and (name != "phase_deg" or layout.phase)]
    for name in (where, *compared):
        if name in columns.words and name not in table and (name != "phase_deg" or layout.phase):
            raise InputError(columns.fault_of_words(name))
    if where not in table or not names or (layout.phase and "phase_deg" not in table):
        raise InputError(Fault(path, "columns", columns.names, _expected(of, layout)))
    return _loop(columns, table, layout, deviations) if of == "loop" else _curve(path, of, table, names, deviations)


def _expected(of: str, layout: Layout) -> str:
    where, compared = COLUMNS[of]
    others = "; real and imaginary make an amplitude" if of == "response" else ""
    if layout.phase:
        others += ", and with phase = true a phase_deg"
    shown = ", ".join(name for name in compared if name != "phase_deg")
    words = f"a column {where}, and of {shown} at least one{others}"
    return words + ', or columns = { NAME = "that of the file" }'


def _take_response(table: dict[str, np.ndarray], layout: Layout) -> None:
    """Amplitudes, and phases, out of what the file has."""
    if "amplitude" not in table and layout.monitor is not None and f"{layout.monitor}_amplitude" in table:
        table["amplitude"] = table[f"{layout.monitor}_amplitude"]
    if "amplitude" not in table and "real" in table and "imaginary" in table:
        value = table["real"] + 1j * table["imaginary"]
        table["amplitude"], table["phase_deg"] = np.abs(value), np.degrees(np.angle(value))
    elif "amplitude" in table and layout.decibel:
        table["amplitude"] = 10.0 ** (table["amplitude"] / 20.0)


def _curve(
    path: str, of: str, table: dict[str, np.ndarray], names: list[str], deviations: dict[str, float]
) -> Measured:
    """A response or a mode, in ascending order."""
    where, compared = COLUMNS[of]
    order = np.argsort(table[where], kind="stable")
    at, values, own = table[where][order], {}, {}
    relative = []
    for name in names:
        values[name] = table[name][order]
        known = np.isfinite(values[name])
        if not np.any(known) or (name not in SIGNED and np.any(values[name][known] <= 0.0)):
            expected = "numbers above 0, blank where not measured"
            if name == "amplitude":
                expected += "; decibel = true where they are in decibels"
            raise InputError(Fault(path, name, "none, or not above 0", expected))
        if f"{name}_deviation" in table:
            own[name] = table[f"{name}_deviation"][order]
            if not np.all(own[name][known] > 0.0):
                raise InputError(Fault(path, f"{name}_deviation", "not above 0", "standard deviations above 0"))
        else:
            own[name] = np.full(len(at), deviations[compared[name]])
            if name not in SIGNED:
                relative.append(name)
    if not np.all(np.isfinite(at)) or np.any(at <= 0.0):
        raise InputError(Fault(path, where, "missing, or not above 0", "a number above 0 in every line"))
    return Measured(at, values, own, tuple(relative))


def _loop(columns: Columns, table: dict[str, np.ndarray], layout: Layout, deviations: dict[str, float]) -> Measured:
    """A loop in the order of its points."""
    path, names = columns.path, ["displacement", "tangential_force"]
    if ("normal_force" in table) == (layout.normal_force is not None):
        there = "both" if "normal_force" in table else "missing"
        expected = "a column of it in the file, or the key normal_force of the data"
        raise InputError(Fault(path, "normal_force", there, expected))
    if "normal_force" in table:
        names.append("normal_force")
    whole = np.all([np.isfinite(table[name]) for name in names], axis=0)
    if whole.sum() < FEWEST:
        raise InputError(Fault(path, ", ".join(names), f"{whole.sum()} lines", f"at least {FEWEST} lines of numbers"))
    at, force = table["displacement"][whole], table["tangential_force"][whole]
    half = 0.5 * float(np.ptp(force))
    if half == 0.0 or np.ptp(at) == 0.0:
        raise InputError(Fault(path, "tangential_force, displacement", "one value", "a loop"))
    own = np.full(len(at), deviations["force"] * half)
    if "tangential_force_deviation" in table:
        own = table["tangential_force_deviation"][whole]
        if not np.all(own > 0.0):
            expected = "standard deviations above 0"
            raise InputError(Fault(path, "tangential_force_deviation", "not above 0", expected))
    normal = table["normal_force"][whole] if "normal_force" in table else np.full(len(at), layout.normal_force)
    centred = ("tangential_force",) if layout.closed else ()
    values = {"tangential_force": force}
    return Measured(at, values, {"tangential_force": own}, (), centred, {"normal_force": normal})
