"""Measurements out of a file, in the quantities and units of the job."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from attrito.fits.columns import Columns, read_columns
from attrito.fits.measured import COLUMNS, SIGNED, Measured
from attrito.support.errors import Fault, InputError

# Beside columns of `COLUMNS`: what else may be read
OTHERS = {"response": ("real", "imaginary"), "mode": (), "loop": ("normal_force", "time")}
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
    monitor : whose amplitudes may be in a column `<monitor>_amplitude`, as those of `attrito table`
    normal_force : of a loop without a column of it
    closed : whether a loop is whole cycles of a steady one
    frequency_hz : of a loop of a solved point
    """

    columns: dict[str, str] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    decibel: bool = False
    phase: bool = False
    monitor: str | None = None
    normal_force: float | None = None
    closed: bool = True
    frequency_hz: float | None = None


def known_columns(of: str) -> tuple[str, ...]:
    """Names of the columns that a kind of measurements may have, but for deviations."""
    where, compared = COLUMNS[of]
    return tuple(dict.fromkeys((where, *compared, *OTHERS[of])))


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
    _take_monitor(table, of, layout)
    if of == "response":
        _take_response(table, layout)
    for name, factor in layout.factors.items():
        if name in table:
            table[name] = factor * table[name]
    names = [name for name in compared if name in table and (name != "phase_deg" or layout.phase)]
    for name in (where, *compared):
        if name in columns.words and name not in table and (name != "phase_deg" or layout.phase):
            raise InputError(columns.fault_of_words(name))
    if (
        where not in table
        or not names
        or (of == "loop" and len(names) < 2)
        or (layout.phase and "phase_deg" not in table)
    ):
        raise InputError(Fault(path, "columns", columns.names, _expected(of, layout)))
    return _loop(columns, table, layout, deviations) if of == "loop" else _curve(path, of, table, names, deviations)


def _expected(of: str, layout: Layout) -> str:
    where, compared = COLUMNS[of]
    others = "; real and imaginary make an amplitude" if of == "response" else ""
    if layout.phase:
        others += ", and with phase = true a phase_deg"
    shown = ", ".join(name for name in compared if name != "phase_deg")
    words = f"a column {where}, and of {shown} at least one{others}"
    if of == "loop":
        words = "columns displacement and tangential_force"
    return words + ', or columns = { NAME = "that of the file" }'


def _take_monitor(table: dict[str, np.ndarray], of: str, layout: Layout) -> None:
    """A monitor's amplitudes from the column that `attrito table` has; beside it, a mode's `amplitude` is Q."""
    own = f"{layout.monitor}_amplitude"
    if own in table and ("amplitude" not in table or (of == "mode" and "amplitude" not in layout.columns)):
        table["amplitude"] = table[own]


def _take_response(table: dict[str, np.ndarray], layout: Layout) -> None:
    """Amplitudes, and phases, out of what the file has."""
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
    solved = layout.frequency_hz is not None
    if not solved and ("normal_force" in table) == (layout.normal_force is not None):
        there = "both" if "normal_force" in table else "missing"
        expected = "a column of it in the file, or the key normal_force of the data; frequency_hz where it is solved"
        raise InputError(Fault(path, "normal_force", there, expected))
    along = "time" if solved else "normal_force"
    if along in table:
        names.append(along)
    whole = np.all([np.isfinite(table[name]) for name in names], axis=0)
    count = int(whole.sum())
    if count < FEWEST:
        raise InputError(Fault(path, ", ".join(names), f"{count} lines", f"at least {FEWEST} lines of numbers"))
    values = {name: table[name][whole] for name in names[:2]}
    if any(np.ptp(column) == 0.0 for column in values.values()):
        raise InputError(Fault(path, "tangential_force, displacement", "one value", "a loop"))
    compared = {name: values[name] for name in (("tangential_force", "displacement") if solved else names[1:2])}
    kinds = COLUMNS["loop"][1]
    own = {
        name: np.full(count, deviations[kinds[name]] * 0.5 * float(np.ptp(column))) for name, column in compared.items()
    }
    for name in compared:
        if f"{name}_deviation" in table:
            own[name] = table[f"{name}_deviation"][whole]
            if not np.all(own[name] > 0.0):
                raise InputError(Fault(path, f"{name}_deviation", "not above 0", "standard deviations above 0"))
    if layout.frequency_hz is None:
        beside = {"normal_force": table[along][whole] if along in table else np.full(count, layout.normal_force)}
    else:
        beside = {"turns": layout.frequency_hz * table[along][whole] if along in table else np.arange(count) / count}
    centred = tuple(compared) if layout.closed else ()
    return Measured(values["displacement"], compared, own, (), centred, beside)
