"""Harwell-Boeing files, as ANSYS's `HBMAT` writes them (text form).

A header of four lines (five with right-hand sides), which says how many lines, in which Fortran formats, hold the
column pointers, the row numbers (both from 1) and the values. RSA: the lower triangle of a symmetric matrix by columns;
RUA: all of the matrix.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from attrito.importers.entries import Entries
from attrito.importers.source import Source, refuse
from attrito.importers.text import Block, read_text

_TYPES = {
    "RSA": "symmetric",
    "RUA": "full",
}
_TYPE = re.compile(r"[RCP][SUHZR][AE]")
_FORMAT = re.compile(r"(\d*)\(?([IEDFG])(\d+)")


@dataclass(frozen=True)
class _Section:
    """Lines of numbers: how many lines, numbers a line, characters a number, numbers in all, and what they are."""

    lines: int
    fields: int
    width: int
    count: int
    what: str


def is_harwell_boeing(start: bytes) -> bool:
    """Whether the third line of a file begins with the type of a matrix."""
    lines = start.decode(errors="replace").split("\n")
    return len(lines) > 3 and _TYPE.match(lines[2][:3].upper()) is not None


def read_harwell_boeing(path: str | Path, key: str) -> Source:
    """One matrix: real, assembled, symmetric or unsymmetric."""
    path = str(path)
    size, storage, skip, sections = _header(path, key)
    pointers, indices, values = (np.zeros(0, kind) for kind in (np.int64, np.int32, np.float64))
    parts: dict[str, list[np.ndarray]] = {section.what: [] for section in sections}
    entries, done = Entries(path, key), 0
    for section, block, lines, numbers in _numbers(path, skip, sections):
        if section.what == "values":
            if done == 0:
                pointers = _whole(path, key, parts["column pointers"], sections[0], (1, sections[1].count + 1))
                indices = _whole(path, key, parts["row numbers"], sections[1], (1, size))
                if len(pointers) != size + 1 or pointers[-1] != sections[1].count or np.any(np.diff(pointers) < 0):
                    expected = f"ascending, from 1 to {sections[1].count + 1}"
                    raise refuse(path, "column pointers", f"{pointers[0] + 1} to {pointers[-1] + 1}", expected)
                parts.clear()
            if done + len(numbers) > section.count:
                raise block.fault(lines[-1], f"{section.count} values in all")
            here = np.arange(done, done + len(numbers))
            column = np.searchsorted(pointers, here, side="right") - 1
            entries.add(indices[here], column, numbers)
            done += len(numbers)
        else:
            parts[section.what].append(numbers)
    if done != sections[2].count:
        raise refuse(path, key, f"{done} values", f"{sections[2].count} values, as the header says: a whole file")
    return Source(path, key, entries=entries, size=size, storage=storage)


def _header(path: str, key: str) -> tuple[int, str, int, list[_Section]]:
    with Path(path).open("rb") as file:
        lines = [file.readline(200).decode(errors="replace").rstrip("\r\n") for _ in range(4)]
    kind = lines[2][:3].upper()
    if kind not in _TYPES:
        raise refuse(path, f"{key}, line 3", kind, "RSA or RUA: a real, assembled, square matrix")
    try:
        cards = [int(word) for word in lines[1].split()]
        rows, columns, entries = (int(word) for word in lines[2][3:].split()[:3])
        formats = [_format(lines[3][:16]), _format(lines[3][16:32]), _format(lines[3][32:52])]
        counts = (cards[1], cards[2], cards[3])
    except (ValueError, IndexError, TypeError):
        expected = "a Harwell-Boeing header: numbers of lines, type and size, formats"
        raise refuse(path, f"{key}, lines 2 to 4", lines[1:4], expected) from None
    if rows != columns or rows < 1:
        raise refuse(path, f"{key}, line 3", f"{rows} x {columns}", "a square matrix")
    if counts[2] == 0:
        raise refuse(path, f"{key}, line 2", "no values", "a matrix with values")
    names = ("column pointers", "row numbers", "values")
    numbers = (columns + 1, entries, entries)
    sections = [_Section(n, *f, c, name) for n, f, c, name in zip(counts, formats, numbers, names, strict=True)]
    return rows, _TYPES[kind], 5 if len(cards) > 4 and cards[4] > 0 else 4, sections


def _format(text: str) -> tuple[int, int]:
    """Numbers a line and characters a number of a Fortran format such as (1P,3E25.16)."""
    found = _FORMAT.search(re.sub(r"[+-]?\d*P,?", "", text.upper().replace(" ", "")))
    return int(found[1] or 1), int(found[3])


def _numbers(
    path: str, skip: int, sections: list[_Section]
) -> Iterator[tuple[_Section, Block, np.ndarray, np.ndarray]]:
    """The numbers of each section, block by block."""
    ends = np.cumsum([skip, *(section.lines for section in sections)])
    for block in read_text(path, counted=True):
        number = block.number - 1 + np.arange(len(block))
        for section, begin, end in zip(sections, ends[:-1], ends[1:], strict=True):
            lines = np.flatnonzero((number >= begin) & (number < end))
            if len(lines) == 0:
                continue
            places = [(k * section.width, section.width) for k in range(section.fields)]
            expected = f"{section.what} in {section.fields} fields of {section.width} characters"
            table = block.columns(lines, places, expected)
            missing = np.isnan(table)
            short = np.flatnonzero(missing.any(axis=1))
            if np.any(missing[:, 0]) or np.any(short < len(lines) - 1):
                raise block.fault(lines[short[0]], expected)
            if len(short) and number[lines[-1]] != end - 1:
                raise block.fault(lines[short[0]], expected)
            yield section, block, lines, table[~missing]


def _whole(path: str, key: str, parts: list[np.ndarray], section: _Section, bounds: tuple[int, int]) -> np.ndarray:
    """Pointers or row numbers, from 0."""
    numbers = np.concatenate(parts) if parts else np.zeros(0)
    if len(numbers) != section.count:
        raise refuse(path, key, f"{len(numbers)} {section.what}", f"{section.count}, as the header says")
    bad = np.flatnonzero((numbers < bounds[0]) | (numbers > bounds[1]) | (numbers != np.floor(numbers)))
    if len(bad):
        value = f"{numbers[bad[0]]:g} among the {section.what}"
        raise refuse(path, key, value, f"whole numbers from {bounds[0]} to {bounds[1]}")
    kind = np.int64 if section.what == "column pointers" else np.int32
    return numbers.astype(kind) - kind(1)
