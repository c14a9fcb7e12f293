"""Text OUTPUT4 files: the records of `nastran_op4` as lines.

Three kinds of lines differ by what only they hold: a header has a name, so letters, and no decimal point before it; a
line of numbers has decimal points; the heads of columns (three integers) and of strings (one, or two in bigmat) have
neither. A header ends with the format of numbers (`1P,3E23.16`; some codes add that of integers, `|I16`); five numbers
of 16 characters a line where it does not.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from attrito.importers.op4_matrix import STRING, Op4Matrix, new_matrix
from attrito.importers.source import refuse
from attrito.importers.text import Block, read_text

_HEADER = re.compile(r"\s*(\d+)\s*(-?\d+)\s+(\d+)\s+(\d)(.{8})\s*\S*,(\d+)[ED](\d+)\.\d+(?:\|I\d+)?\s*$")
_BARE_HEADER = re.compile(r"([ \d]{7}\d)([- \d]{7}\d)( {7}\d)( {7}\d)([A-Za-z]\w{0,7})\s*()()$")
_FIELDS, _WIDTH = 5, 16
# Characters before the name
_NUMBERS = 32
_INTEGERS = "the head of a column or a string"
POINT = ord(".")


def is_op4_text(start: bytes) -> bool:
    """Whether the first line is a header."""
    return _header(start.split(b"\n")[0].decode(errors="replace").rstrip()) is not None


def _header(line: str) -> re.Match[str] | None:
    """Columns, rows, form, type, name, numbers a line and characters a number."""
    return _HEADER.match(line) or _BARE_HEADER.match(line)


def matrices_of_text(path: str, key: str, wanted: set[str] | None) -> Iterator[Op4Matrix]:
    """Each matrix of the file, once it is read whole."""
    reader: _Reader | None = None
    for block in read_text(path, counted=True):
        headers = _headers(block)
        begins, ends = np.append(0, headers), np.append(headers, len(block))
        for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            if k > 0:
                if reader is not None:
                    yield reader.finished()
                reader = _Reader(block, begin, wanted)
                begin += 1
            elif end > begin and reader is None:
                raise block.fault(begin, "a header: columns, rows, form, type, name, format")
            if end > begin:
                reader.read(block, np.arange(begin, end))
    if reader is None:
        raise refuse(path, key, "empty", "a matrix of OUTPUT4")
    yield reader.finished()


def _headers(block: Block) -> np.ndarray:
    """Lines with letters whose first characters hold no decimal point."""
    letters = (block.text >= ord("A")) & (block.text <= ord("Z")) | (block.text >= ord("a")) & (block.text <= ord("z"))
    found = np.flatnonzero(np.maximum.reduceat(letters, block.first))
    points = np.flatnonzero(block.text == POINT)
    following = np.append(points, len(block.text))[np.searchsorted(points, block.first[found])]
    return found[following >= np.minimum(block.first[found] + _NUMBERS, block.last[found])]


class _Reader:
    """Reads the lines of one matrix. What a block leaves open: the string whose numbers still come."""

    def __init__(self, block: Block, line: int, wanted: set[str] | None):
        found = _header(block.line(line).rstrip())
        if found is None:
            raise block.fault(line, "a header: columns, rows, form, type, name, format")
        self.matrix = new_matrix(block.path, found[5], [int(found[k]) for k in (1, 2, 3, 4)], wanted)
        fields, width = int(found[6] or _FIELDS), int(found[7] or _WIDTH)
        self.places = [(k * width, width) for k in range(fields)]
        self.column, self.ended = 0, False
        # Column, row and words of the string at hand, and the numbers found of it.
        self.string, self.done = (0, 0, 0), 0

    def read(self, block: Block, lines: np.ndarray) -> None:
        """Lines that are no headers."""
        if self.matrix.entries is None:
            # What is not wanted is only checked for its end.
            self.ended = True
            return
        lines = lines[~block.blank()[lines]]
        if len(lines) == 0:
            return
        is_values = np.maximum.reduceat(block.text == POINT, block.first)[lines]
        column, row, words, owner = self._heads(block, lines, is_values)
        values = block.columns(lines[is_values], self.places, "numbers in the format of the header")
        missing = np.isnan(values)
        if np.any(missing[:, 0]) or np.any(missing[:, :-1] & ~missing[:, 1:]):
            bad = np.argmax(missing[:, 0] | np.any(missing[:, :-1] & ~missing[:, 1:], axis=1))
            raise block.fault(lines[is_values][bad], "numbers in the format of the header")
        found = np.bincount(owner[is_values], (~missing).sum(axis=1), minlength=len(column)).astype(np.int64)
        self._check(block, lines, is_values, column, words, found)
        flat = values[~missing]
        start = row.copy()
        start[0] += self.done
        whole = column <= self.matrix.columns
        some = whole & (found > 0)
        self.matrix.add(column[some], start[some], found[some], flat[np.repeat(whole, found)])
        self.done = int(found[-1]) + (self.done if len(column) == 1 else 0)
        self.string = (int(column[-1]), int(row[-1]), int(words[-1]))
        self.ended = self.ended or bool(np.any(column > self.matrix.columns))

    def _heads(
        self, block: Block, lines: np.ndarray, is_values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Column, row and words of the string at hand and of those that begin here, and to which each line belongs."""
        integer = lines[~is_values]
        table = block.separated(integer, 3, _INTEGERS)
        count = (~np.isnan(table)).sum(axis=1)
        expected = 2 if self.matrix.bigmat else 1
        bad = (count != 3) & (count != expected)
        if bad.any():
            raise block.fault(integer[np.argmax(bad)], _INTEGERS)
        is_column = count == 3
        numbers = np.nan_to_num(table).astype(np.int64)
        last = np.cumsum(is_column)
        column = np.append(self.column, numbers[is_column, 0])[last]
        code = numbers[:, 0]
        row = np.where(is_column, numbers[:, 1], numbers[:, 1] if self.matrix.bigmat else code % STRING)
        words = np.where(is_column, numbers[:, 2], (code if self.matrix.bigmat else code // STRING) - 1)
        # The head of a column of strings holds nothing itself.
        own = ~is_column | (numbers[:, 1] > 0)
        self.column = int(column[-1]) if len(column) else self.column
        owner = np.zeros(len(lines), np.int64)
        begins = np.zeros(len(lines), bool)
        begins[np.flatnonzero(~is_values)[own]] = True
        np.cumsum(begins, out=owner)
        old = self.string
        return (
            np.append(old[0], column[own]),
            np.append(old[1], row[own]),
            np.append(old[2], words[own]),
            owner,
        )

    def _check(self, block, lines, is_values, column, words, found) -> None:
        """Strings that ended here hold as many numbers as their heads say, of one or two words."""
        total = found.copy()
        total[0] += self.done
        good = (total == words) | (2 * total == words) if self.matrix.kind == 2 else total == words
        good[-1] |= total[-1] <= words[-1]
        if not good.all():
            k = int(np.argmin(good))
            value = f"column {column[k]}: {total[k]} numbers"
            raise block.fault(lines[0], f"as many as {words[k]} words make, in lines from here on", value)

    def finished(self) -> Op4Matrix:
        """The matrix, once all of its lines were read."""
        if not self.ended:
            raise refuse(self.matrix.path, self.matrix.name, f"ends in column {self.column}", "a whole matrix")
        return self.matrix
