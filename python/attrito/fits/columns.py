"""Columns of numbers of a CSV file as instruments and spreadsheets write it.

A line of names, then lines of numbers. Entries are separated by commas, or by semicolons or tabs, where a number may
have a decimal comma. Lines that begin with `#` or `%` are left out, and so are lines above the names that have another
number of entries, as an instrument's own, and a line of units below the names; a blank is not measured.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass

import numpy as np

from attrito.support.errors import Fault, InputError
from attrito.support.text_files import decoded

SEPARATORS = (";", "\t", ",")


@dataclass(frozen=True)
class Columns:
    """Of a file.

    Parameters
    ----------
    path : of the file
    numbers : by name `[n]`; NaN: blank
    words : by name of the other columns, the first entry that is no number, with its line from 1 of those
    """

    path: str
    numbers: dict[str, np.ndarray]
    words: dict[str, tuple[str, int]]

    @property
    def names(self) -> str:
        """All of them, for faults."""
        return ", ".join([*self.numbers, *self.words]) or "none"

    def named(self, columns: dict[str, str]) -> dict[str, np.ndarray]:
        """Its numbers by its own names and, first, by others.

        Parameters
        ----------
        columns : names in the file by other names

        Raises
        ------
        InputError : the file has no such column, or it holds words
        """
        faults = []
        for name, own in columns.items():
            if own in self.words:
                faults.append(self.fault_of_words(own))
            elif own not in self.numbers:
                faults.append(Fault(self.path, "columns", self.names, f"a column {own!r}, the {name} of the data"))
        if faults:
            raise InputError(*faults)
        return self.numbers | {name: self.numbers[own] for name, own in columns.items()}

    def fault_of_words(self, name: str) -> Fault:
        """What is wrong with a column that holds words."""
        entry, line = self.words[name]
        return Fault(
            self.path, name, entry, f"a number, or a blank, in every line of numbers (it is in their line {line})"
        )


def read_columns(path: str) -> Columns:
    """Read a file.

    Raises
    ------
    InputError : it cannot be read, or has no lines of numbers
    """
    lines = [line for line in _text(path).splitlines() if line.strip() and not line.lstrip(' "').startswith(("#", "%"))]
    if len(lines) < 2:
        raise InputError(Fault(path, "file", f"{len(lines)} lines", "a line of names, then lines of numbers"))
    separator = next((one for one in SEPARATORS if one in lines[-1]), ",")
    all_rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
    first = next(i for i, row in enumerate(all_rows) if len(row) == len(all_rows[-1]))
    names, *rows = all_rows[first:] if first < len(all_rows) - 1 else all_rows
    if len(rows) > 1 and not any(_is_number(entry, separator) for entry in rows[0]):
        rows = rows[1:]
    numbers: dict[str, np.ndarray] = {}
    words: dict[str, tuple[str, int]] = {}
    for i, name in enumerate(name.strip() for name in names):
        values = np.full(len(rows), np.nan)
        for j, row in enumerate(rows):
            entry = row[i].strip() if i < len(row) else ""
            try:
                values[j] = _number(entry, separator)
            except ValueError:
                words[name] = entry, j + 1
                break
        else:
            numbers[name] = values
    return Columns(path, numbers, words)


def _text(path: str) -> str:
    """In whichever encoding."""
    try:
        with open(path, "rb") as stream:
            content = stream.read()
    except OSError as error:
        raise InputError(Fault(path, "file", error.strerror, "a CSV file of measurements that can be read")) from None
    return decoded(content)


def _is_number(entry: str, separator: str) -> bool:
    try:
        return bool(np.isfinite(_number(entry.strip(), separator)))
    except ValueError:
        return False


def _number(entry: str, separator: str) -> float:
    if not entry:
        return np.nan
    return float(entry.replace(",", ".") if separator != "," else entry)
