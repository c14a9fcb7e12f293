"""DMIG matrices in Nastran's bulk data or punch file, which name their dofs by grid or scalar point and component.

Header `DMIG, name, 0, form, type in, type out, polar, , columns`; then a card for each column, `DMIG, name, grid,
component, , grid, component, value, ...`, with continuations. Fields of 8 characters (two entries a continuation), of
16 (`DMIG*`, one entry a line, continued by `*`: what Nastran punches), or between commas. Form 6: one entry of each
pair of a symmetric matrix; form 1: both; forms 2 and 9 are rectangular. Types 1 and 2 are real, 3 and 4 complex. The
component of a scalar point, a generalised coordinate of a superelement, is 0 or blank.

Beside the matrices of a model a punch file of EXTSEOUT holds load vectors and output maps, which are rectangular: they
are left out where nobody asks for them by name.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.importers.dof_numbers import DIRECTIONS, DofNumbers
from attrito.importers.entries import Entries
from attrito.importers.source import USABLE, Source, integers, no_such_matrix
from attrito.importers.text import Block, read_text

_FORMS = {1: "full", 6: "symmetric"}
_RECTANGULAR, _COMPLEX = (2, 9), (3, 4)
_LARGE, _SMALL, _FREE = 1, 2, 3
_COLUMN = "DMIG with a name, a point and its component (1 to 6; 0 of a scalar point)"
_ENTRY = "a point, its component (1 to 6; 0 of a scalar point) and a real value"
_LARGE_ENTRY = [(8, 16), (24, 16), (40, 16), (56, 16)]
_SMALL_ENTRIES = [(8 * k, 8) for k in range(1, 9)]
_LARGEST = 2**53


def is_dmig(start: bytes) -> bool:
    """Whether a card DMIG occurs."""
    return b"\nDMIG" in b"\n" + start.upper()


class DmigFile:
    """Reads the matrices of a file in one pass.

    Parameters
    ----------
    path : punch or bulk data file
    numbers : of the dofs, shared by all matrices of a model
    wanted : names to read, in capitals; None: all that are square and real
    """

    def __init__(self, path: str | Path, numbers: DofNumbers, wanted: set[str] | None = None):
        self.path = str(path)
        self.numbers, self.wanted = numbers, wanted
        self.sources: dict[str, Source] = {}
        self.skipped: set[str] = set()
        # Names of those that are left out for what they are, in words.
        self.left_out: dict[str, str] = {}
        # The card that a continuation at the beginning of a block belongs to.
        self._kind, self._name, self._column = 0, "", 0
        for block in read_text(self.path, ends=b"ENDDATA"):
            self._read(block)

    def _read(self, block: Block) -> None:
        initials = block.initials()
        letter = ((initials >= ord("A")) & (initials <= ord("Z"))) | ((initials >= ord("a")) & (initials <= ord("z")))
        cards = np.flatnonzero(letter)
        kind = np.zeros(len(cards) + 1, np.int8)
        name = np.zeros(len(cards) + 1, np.int32)
        column = np.zeros(len(cards) + 1, np.int32)
        names = [self._name]
        kind[0], column[0] = self._kind, self._column
        kind[1:] = _kinds(block, cards)
        parsed = []
        for which, read in ((_LARGE, self._fixed_cards), (_SMALL, self._fixed_cards), (_FREE, self._free_cards)):
            index = np.flatnonzero(kind[1:] == which) + 1
            if len(index) > 0:
                parsed.append((index, *read(block, cards[index - 1], which)))
        # Headers of all kinds before columns: Nastran punches those in small fields and these in large ones.
        for index, words, table in parsed:
            for k in np.flatnonzero(table[:, 0] == 0.0):
                self._header(block, cards[index[k] - 1], _name(words[k]), table[k])
                kind[index[k]] = 0
        for index, words, table in parsed:
            some = table[:, 0] != 0.0
            self._columns(block, cards, index[some], words[some], table[some], (kind, name, column, names))
        self._continuations(block, initials, letter, kind, name, column, names)
        self._kind, self._name, self._column = int(kind[-1]), names[name[-1]], int(column[-1])

    def _columns(self, block, cards, index, words, table, state) -> None:
        """Columns that cards begin, and the entries on the cards themselves."""
        kind, name, column, names = state
        labels, label_of = np.unique(words, return_inverse=True)
        base = len(names)
        names.extend(map(_name, labels))
        name[index] = base + label_of
        lines = cards[index - 1]
        unwanted = [self._unwanted(block, lines, label_of, k, names[base + k]) for k in range(len(labels))]
        here = ~np.array(unwanted, bool)[label_of]
        kind[index[~here]] = 0
        if not here.any():
            return
        index, lines, table, label_of = index[here], lines[here], table[here], label_of[here]
        node = integers(block, lines, table[:, 0], (1, _LARGEST), _COLUMN)
        column[index] = self.numbers.numbers(node, self._components(block, lines, table[:, 1], _COLUMN))
        filled = np.flatnonzero(~np.isnan(table[:, 3])) if table.shape[1] > 3 else index[:0]
        for k in np.unique(label_of[filled]):
            some = filled[label_of[filled] == k]
            self._add(block, lines[some], table[some, 3:7], column[index[some]], names[base + k])

    def _fixed_cards(self, block: Block, lines: np.ndarray, which: int) -> tuple[np.ndarray, np.ndarray]:
        width = 16 if which == _LARGE else 8
        words = _characters(block, lines, 8, width)
        first = 8 + width
        places = [(first, width), (first + width, width), (first + 2 * width, width)]
        if which == _SMALL:
            places += [(first + k * width, width) for k in range(3, 7)]
        return words, block.columns(lines, places, _COLUMN)

    def _free_cards(self, block: Block, lines: np.ndarray, which: int) -> tuple[np.ndarray, np.ndarray]:
        commas = np.flatnonzero(block.text == ord(","))
        index = np.searchsorted(commas, block.first[lines])
        commas = np.append(commas, [len(block.text)] * 2)
        lacking = commas[index + 1] > block.last[lines]
        if lacking.any():
            raise block.fault(lines[np.argmax(lacking)], _COLUMN)
        begin, end = commas[index] + 1, commas[index + 1]
        words = np.array([block.text[a:b].tobytes().strip() for a, b in zip(begin, end, strict=True)], dtype="S16")
        return words, block.separated(lines, 8, _COLUMN, skip=end + 1 - block.first[lines])

    def _header(self, block: Block, line: int, name: str, fields: np.ndarray) -> None:
        if self.wanted is not None and name not in self.wanted:
            self.skipped.add(name)
            return
        if name in self.sources:
            raise block.fault(line, f"one header of {name}")
        # Free and small fields are read here; the header of a large field punch is in small fields.
        values = np.nan_to_num(np.asarray(fields, float)[1:4], nan=0.0).astype(int).tolist()
        form, kind = (values[0], values[1]) if len(values) > 1 else (0, 0)
        what = "rectangular" if form in _RECTANGULAR else "complex" if kind in _COMPLEX else ""
        if what and self.wanted is None:
            self.left_out[name] = what
            self.skipped.add(name)
            return
        if what:
            raise block.fault(line, USABLE[what], f"{name}, {what}")
        if form not in _FORMS:
            raise block.fault(line, "form 6 (symmetric) or 1 (square) in the fifth field")
        if kind not in (1, 2):
            raise block.fault(line, "type 1 or 2, a real matrix, in the sixth field")
        entries = Entries(self.path, name)
        self.sources[name] = Source(self.path, name, entries=entries, storage=_FORMS[form], numbers=self.numbers)

    def _unwanted(self, block: Block, lines: np.ndarray, label_of: np.ndarray, label: int, name: str) -> bool:
        if name in self.left_out:
            return True
        if self.wanted is not None and name not in self.wanted:
            self.skipped.add(name)
            return True
        if name not in self.sources:
            raise block.fault(lines[np.argmax(label_of == label)], f"a header DMIG, {name}, 0, ... before its columns")
        return False

    def _continuations(self, block, initials, letter, kind, name, column, names) -> None:
        owner = np.cumsum(letter)
        continued = ~letter & (kind[owner] > 0) & np.isin(initials, (ord("*"), ord("+"), ord(" "), ord(",")))
        for which, fields in ((_LARGE, _LARGE_ENTRY), (_SMALL, _SMALL_ENTRIES), (_FREE, None)):
            lines = np.flatnonzero(continued & (kind[owner] == which))
            if len(lines) == 0:
                continue
            if fields is not None:
                table = block.columns(lines, fields, _ENTRY)
            else:
                # What stands before the first comma only marks the continuation.
                commas = np.flatnonzero(block.text == ord(","))
                skip = commas[np.minimum(np.searchsorted(commas, block.first[lines]), len(commas) - 1)] + 1
                table = block.separated(lines, 8, _ENTRY, skip=skip - block.first[lines])
            for part in range(0, table.shape[1], 4):
                filled = np.flatnonzero(~np.isnan(table[:, part : part + 4]).all(axis=1))
                labels = name[owner[lines[filled]]]
                for label in np.unique(labels):
                    some = filled[labels == label]
                    fields = table[some, part : part + 4]
                    self._add(block, lines[some], fields, column[owner[lines[some]]], names[label])

    def _add(self, block: Block, lines: np.ndarray, fields: np.ndarray, column: np.ndarray, name: str) -> None:
        node = integers(block, lines, fields[:, 0], (1, _LARGEST), _ENTRY)
        row = self.numbers.numbers(node, self._components(block, lines, fields[:, 1], _ENTRY))
        value = fields[:, 2]
        # The imaginary part of a real matrix is blank or zero.
        bad = np.isnan(value) | (np.nan_to_num(fields[:, 3]) != 0.0)
        if bad.any():
            raise block.fault(lines[np.argmax(bad)], _ENTRY)
        self.sources[name].entries.add(row, column, value)

    def _components(self, block: Block, lines: np.ndarray, values: np.ndarray, expected: str) -> np.ndarray:
        return integers(block, lines, np.nan_to_num(values), (0, DIRECTIONS), expected)


def read_dmig(path: str | Path, key: str, numbers: DofNumbers, name: str | None = None) -> Source:
    """One matrix of a file, by its name or the only one in it."""
    read = DmigFile(path, numbers, None if name is None else {name.upper()})
    if name is not None and name.upper() in read.sources:
        return read.sources[name.upper()]
    found = ", ".join([*read.sources, *sorted(read.skipped)]) or "none"
    if name is None and len(read.sources) == 1:
        return next(iter(read.sources.values()))
    if name is None and not read.sources and len(read.left_out) == 1:
        # Asked for by its name it is refused, with its line.
        DmigFile(path, DofNumbers(), set(read.left_out))
    raise no_such_matrix(str(path), key, name, found)


def _name(word: bytes) -> str:
    return word.decode(errors="replace").strip().upper()


def _kinds(block: Block, cards: np.ndarray) -> np.ndarray:
    """Which cards are DMIG, and in which fields."""
    start = _characters(block, cards, 0, 8)
    upper = np.char.upper(start)
    dmig = np.char.startswith(upper, b"DMIG")
    kind = np.zeros(len(cards), np.int8)
    kind[dmig] = _SMALL
    kind[dmig & (np.char.find(start, b"*") >= 0)] = _LARGE
    # A comma among the first characters: free fields.
    kind[dmig & (np.char.find(start, b",") >= 0)] = _FREE
    return kind


def _characters(block: Block, lines: np.ndarray, begin: int, width: int) -> np.ndarray:
    """Characters at the same place of lines, as an array of byte strings."""
    place = block.first[lines][:, None] + begin + np.arange(width)
    inside = place < block.last[lines][:, None]
    letters = np.where(inside, block.text[np.minimum(place, len(block.text) - 1)], ord(" ")).astype(np.uint8)
    return np.char.strip(np.ascontiguousarray(letters).view(f"S{width}").ravel())
