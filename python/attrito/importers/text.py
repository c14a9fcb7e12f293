"""Large text files in blocks of whole lines, and the numbers in them.

A block of text is turned into a table of numbers by the library (some 5 to 20 million numbers a second, each correctly
rounded), lines of whole numbers and a value into arrays of these, in half the time; which lines hold what is decided
here, on arrays of line beginnings.
"""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from attrito.library import loading
from attrito.library.structures import pointer
from attrito.support.errors import Fault, InputError

# Text and table of a block stay in the cache.
BLOCK_BYTES = 1 << 20
_BLANK = ord(" ")
_NEWLINE = 10


@dataclass(frozen=True)
class Block:
    """Whole lines of a file.

    Parameters
    ----------
    path : the file
    text : the characters, uint8
    first, last : `[lines]` int64, where each line begins in `text`, and the character after its end
    number : number of the first line in the file, from 1
    """

    path: str
    text: np.ndarray
    first: np.ndarray
    last: np.ndarray
    number: int

    def __len__(self) -> int:
        return len(self.first)

    def line(self, index: int) -> str:
        """One line as text."""
        return self.text[self.first[index] : self.last[index]].tobytes().decode(errors="replace").rstrip("\r")

    def fault(self, index: int, expected: str, value: object = None) -> InputError:
        """A fault at a line of the block, which quotes the line if no value is given."""
        shown = self.line(index).strip() if value is None else value
        return InputError(Fault(self.path, f"line {self.number + int(index)}", shown, expected))

    def initials(self) -> np.ndarray:
        """First character of each line, 10 for an empty line."""
        letters = np.full(len(self), _NEWLINE, np.uint8)
        filled = self.last > self.first
        letters[filled] = self.text[self.first[filled]]
        return letters

    def blank(self) -> np.ndarray:
        """Which lines hold nothing but blanks, bool."""
        return ~np.maximum.reduceat(self.text > _BLANK, self.first)

    def separated(self, lines: np.ndarray, fields: int, expected: str, skip: np.ndarray | int = 0) -> np.ndarray:
        """Numbers `[lines, fields]` separated by blanks or commas; NaN where a line has less.

        Parameters
        ----------
        lines : indices of lines of the block
        fields : the most that a line may hold
        expected : what a line should hold, for the fault of one that does not
        skip : characters to leave out at the beginning of each line
        """
        return self._numbers(lines, np.zeros(fields, np.intc), np.zeros(fields, np.intc), expected, skip)

    def columns(self, lines: np.ndarray, fields: list[tuple[int, int]], expected: str) -> np.ndarray:
        """Numbers `[lines, fields]` at fixed places, `(first character, width)` each; NaN where there are blanks."""
        begin, width = (np.array(part, np.intc) for part in zip(*fields, strict=True))
        return self._numbers(lines, begin, width, expected, 0)

    def records(self, lines: np.ndarray, fields: int, expected: str) -> tuple[np.ndarray, np.ndarray]:
        """Numbers `[records, fields]` of lines that hold so many of them, and these lines; blank lines are left out."""
        table = self.separated(lines, fields, expected)
        # One NaN makes the sum NaN; most blocks have none.
        if np.isnan(table.sum()):
            filled = ~np.isnan(table[:, 0])
            table, lines = table[filled], lines[filled]
            self.complete(table, lines, expected)
        return table, lines

    def entries(self, lines: np.ndarray, fields: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Whole numbers above 0 `[fields - 1, lines]`, int32, and the value `[lines]` that ends each line.

        None if a line holds anything else, or nothing: `records` reads such lines, or says what is wrong with them.
        """
        whole, values = np.empty((fields - 1, len(lines)), np.int32), np.empty(len(lines))
        first, last = (np.ascontiguousarray(place[lines], np.int64) for place in (self.first, self.last))
        bad = loading.load().attrito_read_entries(
            pointer(self.text),
            len(lines),
            *map(pointer, (first, last)),
            fields - 1,
            *map(pointer, (whole, values)),
        )
        return None if bad else (whole, values)

    def complete(self, table: np.ndarray, lines: np.ndarray, expected: str) -> np.ndarray:
        """The table, if every line filled all its fields."""
        short = np.flatnonzero(np.isnan(table).any(axis=1))
        if len(short) > 0:
            raise self.fault(lines[short[0]], expected)
        return table

    def _numbers(
        self, lines: np.ndarray, begin: np.ndarray, width: np.ndarray, expected: str, skip: np.ndarray | int
    ) -> np.ndarray:
        table = np.empty((len(lines), len(begin)))
        first = np.ascontiguousarray(self.first[lines] + skip, np.int64)
        last = np.ascontiguousarray(self.last[lines], np.int64)
        bad = loading.load().attrito_read_numbers(
            pointer(self.text),
            len(lines),
            *map(pointer, (first, last)),
            len(begin),
            *map(pointer, (begin, width, table)),
        )
        if bad:
            raise self.fault(lines[bad - 1], expected)
        return table


def read_text(path: str | Path, counted: bool = False, ends: bytes = b"") -> Iterator[Block]:
    """The lines of a file, block after block.

    Parameters
    ----------
    path : the file
    counted : the file says how much it holds; if it does not, a last line without an end is at fault: it is cut off
    ends : first word of a line that ends a file, in capitals: such a last line needs no end
    """
    size, number, rest = BLOCK_BYTES, 1, b""
    try:
        with Path(path).open("rb") as file:
            while True:
                read = file.read(size)
                if not read and not rest:
                    return
                end = read.rfind(b"\n") + 1 if read else 0
                if read and end == 0:
                    if len(rest) > 8 * size:
                        raise InputError(Fault(str(path), f"line {number}", "no end", "a text file of short lines"))
                    rest += read
                    continue
                if not read and not counted and not (ends and rest.upper().startswith(ends)):
                    value = rest[-60:].decode(errors="replace")
                    raise InputError(Fault(str(path), "last line", value, "the end of the line: the file is cut off"))
                whole, rest = (rest + read[:end], read[end:]) if read else (rest + b"\n", b"")
                block = _lines(str(path), whole.removeprefix(BOM_UTF8) if number == 1 else whole, number)
                number += len(block)
                yield block
    except OSError as error:
        expected = "a file that can be read"
        raise InputError(Fault(str(path), "file", error.strerror or str(error), expected)) from error


def whole_text(path: str | Path) -> Block:
    """All lines of a file that is not large."""
    try:
        read = Path(path).read_bytes()
    except OSError as error:
        expected = "a file that can be read"
        raise InputError(Fault(str(path), "file", error.strerror or str(error), expected)) from error
    read = read.removeprefix(BOM_UTF8)
    return _lines(str(path), read if read.endswith(b"\n") else read + b"\n", 1)


def _lines(path: str, whole: bytes, number: int) -> Block:
    text = np.frombuffer(whole, np.uint8)
    last = np.flatnonzero(text == _NEWLINE)
    first = np.empty_like(last)
    first[0] = 0
    first[1:] = last[:-1] + 1
    return Block(path, text, first, last, number)
