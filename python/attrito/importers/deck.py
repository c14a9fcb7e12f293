"""Keyword blocks of a CalculiX or Abaqus input deck, `*INCLUDE` files in place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from attrito.support.errors import Fault, InputError
from attrito.support.text_files import number, read_lines

# Keywords whose data lines may be in a file of their own
_DATA = ("NODE", "ELEMENT", "NSET", "ELSET", "CLOAD", "DLOAD")
# Parameters without a value
_FLAGS = ("GENERATE", "UNSORTED", "INTERNAL")
# A comma that is not in quotes
_COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')


@dataclass
class Block:
    """One keyword with its data lines.

    Parameters
    ----------
    keyword : in capitals, without the star
    parameters : names in capitals; the value is empty for a flag such as GENERATE
    file, line : where the keyword is
    data : the lines below it, comments and empty lines left out; those of the file that `INPUT=` names
    data_file, lines : where these are
    """

    keyword: str
    parameters: dict[str, str]
    file: Path
    line: int
    data: list[str] = field(default_factory=list)
    data_file: Path | None = None
    lines: list[int] = field(default_factory=list)

    def fault(self, value: object, expected: str) -> Fault:
        """A fault at this block."""
        return Fault(str(self.file), f"line {self.line}, *{self.keyword}", value, expected)

    def fault_at(self, index: int, value: object, expected: str) -> Fault:
        """A fault at one of its data lines."""
        return Fault(str(self.data_file or self.file), f"line {self.lines[index]}, *{self.keyword}", value, expected)

    def numbers(self, index: int, words: list[str]) -> list[float]:
        """Numbers on one of its data lines, what is left out being zero."""
        try:
            return [number(word) if word else 0.0 for word in words]
        except ValueError:
            raise InputError(self.fault_at(index, self.data[index], "numbers")) from None


def read_blocks(path: str | Path, including: tuple[Path, ...] = ()) -> Iterator[Block]:
    """Blocks of a deck in order; the files that `*INCLUDE` names are read in its place.

    Parameters
    ----------
    path : the deck
    including : the decks that include this one, outermost first
    """
    path = Path(path)
    block: Block | None = None
    for block in _split(read_lines(path, "a mesh file that can be read"), path):
        if block.keyword != "INCLUDE" and not ("INPUT" in block.parameters and block.keyword in _DATA):
            yield block
            continue
        name = block.parameters.get("INPUT", "")
        # CalculiX looks from where it runs, most people mean the deck's own folder.
        places = [path.parent / name, including[0].parent / name if including else Path(name)]
        found = next((place for place in places if place.is_file()), None)
        if found is None or found in (*including, path):
            raise InputError(block.fault(name, "INPUT=, a file that exists and does not include itself"))
        if block.keyword == "INCLUDE":
            yield from read_blocks(found, (*including, path))
        else:
            block.data_file = found
            for index, text in enumerate(read_lines(found), start=1):
                _add_line(block, text.strip(), index)
            yield block
    if block is None:
        raise InputError(Fault(str(path), "file", "no keyword", "a CalculiX or Abaqus deck (.inp)"))


def _split(lines: list[str], path: Path) -> Iterator[Block]:
    block: Block | None = None
    # A keyword line that ends in a comma goes on in the next where that has parameters; CalculiX takes all for data.
    begun = ""
    for line, text in enumerate(lines, start=1):
        text = text.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            if block is not None:
                yield block
            begun, block = text, _keyword_line(text, path, line)
        elif block is not None and begun.endswith(",") and _has_parameters(text):
            begun, block = begun + text, _keyword_line(begun + text, path, block.line)
        elif block is not None:
            begun = ""
            _add_line(block, text, line)
    if block is not None:
        yield block


def _has_parameters(text: str) -> bool:
    return "=" in text or text.split(",")[0].strip().upper() in _FLAGS


def _add_line(block: Block, text: str, line: int) -> None:
    if text and not text.startswith("**"):
        block.data.append(text)
        block.lines.append(line)


def _keyword_line(text: str, path: Path, line: int) -> Block:
    keyword, *words = _COMMA.split(text)
    parameters = {}
    for word in words:
        name, _, value = word.partition("=")
        parameters[name.strip().upper()] = value.strip().strip('"')
    return Block(" ".join(keyword[1:].upper().split()), parameters, path, line)
