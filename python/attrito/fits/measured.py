"""Measurements from a CSV file, and how far a solution is from them.

A residual is a difference over a standard deviation, which is relative unless the file has a column of it. Amplitudes
and frequencies with a relative one are compared by their logarithms, so that an amplitude half as large is as far off
as one twice as large.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass

import numpy as np

from attrito.support.errors import Fault, InputError

# By kind of measurement: the column that says where, and those that are compared, with what names their deviation
COLUMNS = {
    "response": ("frequency_hz", {"amplitude": "amplitude"}),
    "mode": ("amplitude", {"frequency_hz": "frequency", "frequency_ratio": "frequency", "damping_ratio": "damping"}),
}
# What may be zero is compared as it is
LINEAR = ("damping_ratio",)


@dataclass(frozen=True)
class Measured:
    """Numbers of a file.

    Parameters
    ----------
    at : where, `[n]`: frequencies of a response, ascending; amplitudes of a mode, ascending
    values : by column `[n]`; NaN: not measured
    deviations : standard deviation of each, `[n]`
    relative : columns whose deviations are relative
    """

    at: np.ndarray
    values: dict[str, np.ndarray]
    deviations: dict[str, np.ndarray]
    relative: tuple[str, ...]

    @property
    def count(self) -> int:
        """How many numbers are compared."""
        return sum(int(np.isfinite(values).sum()) for values in self.values.values())

    def residuals(self, found: dict[str, np.ndarray], weight: float) -> np.ndarray:
        """Differences over standard deviations, column after column `[count]`."""
        parts = [self.differences(found, name)[np.isfinite(values)] for name, values in self.values.items()]
        return weight * np.concatenate(parts)

    def differences(self, found: dict[str, np.ndarray], name: str) -> np.ndarray:
        """Of one column, over standard deviations `[n]`; NaN where it was not measured."""
        own, there, deviation = self.values[name], found[name], self.deviations[name]
        if name not in self.relative:
            return np.asarray((there - own) / deviation)
        if name in LINEAR:
            return np.asarray((there - own) / (deviation * np.abs(own)))
        return np.asarray(np.log(there / own) / deviation)

    def slopes(self, found: dict[str, np.ndarray], rates: dict[str, np.ndarray], weight: float) -> np.ndarray:
        """Derivatives of the residuals where those of the solution are `rates`, `[n, parameters]` by column."""
        parts = []
        for name, values in self.values.items():
            known = np.isfinite(values)
            scale = self.deviations[name][known]
            if name in self.relative:
                scale = scale * np.abs(values[known] if name in LINEAR else found[name][known])
            parts.append(rates[name][known] / scale[:, np.newaxis])
        return weight * np.concatenate(parts)


def read_measured(path: str, of: str, monitor: str | None, deviations: dict[str, float]) -> Measured:
    """Read a CSV file with a line of names.

    Parameters
    ----------
    path, of : the file; a name of `COLUMNS`
    monitor : of a response, whose amplitudes may be in a column `<monitor>_amplitude`, as those of `attrito table`
    deviations : relative, by kind, where the file has no column `<name>_deviation`

    Raises
    ------
    InputError : a column is missing, or something is no number
    """
    where, compared = COLUMNS[of]
    table = _columns(path)
    if monitor is not None and "amplitude" not in table and f"{monitor}_amplitude" in table and of == "response":
        table["amplitude"] = table[f"{monitor}_amplitude"]
    names = [name for name in compared if name in table]
    if where not in table or not names:
        expected = f"a column {where}, and of {', '.join(compared)} at least one"
        raise InputError(Fault(path, "columns", ", ".join(table) or "none", expected))
    order = np.argsort(table[where], kind="stable")
    at, values, own = table[where][order], {}, {}
    relative = []
    for name in names:
        values[name] = table[name][order]
        known = np.isfinite(values[name])
        if not np.any(known) or np.any(values[name][known] <= 0.0):
            raise InputError(Fault(path, name, "none, or not above 0", "numbers above 0, blank where not measured"))
        if f"{name}_deviation" in table:
            own[name] = table[f"{name}_deviation"][order]
            if not np.all(own[name][known] > 0.0):
                raise InputError(Fault(path, f"{name}_deviation", "not above 0", "standard deviations above 0"))
        else:
            own[name] = np.full(len(at), deviations[compared[name]])
            relative.append(name)
    if not np.all(np.isfinite(at)) or np.any(at <= 0.0):
        raise InputError(Fault(path, where, "missing, or not above 0", "a number above 0 in every line"))
    return Measured(at, values, own, tuple(relative))


def _columns(path: str) -> dict[str, np.ndarray]:
    try:
        with open(path, newline="") as stream:
            rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(Fault(path, "file", str(error), "a CSV file of measurements that can be read")) from None
    if len(rows) < 2:
        raise InputError(Fault(path, "file", f"{len(rows)} lines", "a line of names, then lines of numbers"))
    names = [name.strip() for name in rows[0]]
    columns: dict[str, np.ndarray] = {}
    for i, name in enumerate(names):
        try:
            columns[name] = np.array([_number(row[i]) if i < len(row) else np.nan for row in rows[1:]])
        except ValueError:
            # Words: of no use here, unless they are where numbers are looked for.
            continue
    return columns


def _number(entry: str) -> float:
    return float(entry) if entry.strip() else np.nan
