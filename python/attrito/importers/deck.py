"""Keyword blocks of a CalculiX or Abaqus input deck, `*INCLUDE` files in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from attrito.support.errors import Fault, InputError


@dataclass
class Block:
    """One keyword with its data lines.

    Parameters
    ----------
    keyword : in capitals, without the star
    parameters : names in capitals; the value is empty for a flag such as GENERATE
    file, line : where the keyword is
    data : the lines below it, comments and empty lines left out
    """

    keyword: str
    parameters: dict[str, str]
    file: Path
    line: int
    data: list[str] = field(default_factory=list)

    def fault(self, value: object, expected: str) -> Fault:
        """A fault at this block."""
        return Fault(str(self.file), f"line {self.line}, *{self.keyword}", value, expected)


def read_blocks(path: str | Path, including: tuple[Path, ...] = ()) -> Iterator[Block]:
    """Blocks of a deck in order; the files that `*INCLUDE` names are read in its place.

    Parameters
    ----------
    path : the deck
    including : the decks that include this one, outermost first
    """
    path = Path(path)
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(Fault(str(path), "file", str(error), "a mesh file that can be read")) from error
    block: Block | None = None
    for block in _split(lines, path):
        if block.keyword != "INCLUDE":
            yield block
            continue
        name = block.parameters.get("INPUT", "").strip('"')
        # CalculiX looks from where it runs, most people mean the deck's own folder.
        places = [path.parent / name, including[0].parent / name if including else Path(name)]
        found = next((place for place in places if place.is_file()), None)
        if found is None or found in (*including, path):
            raise InputError(block.fault(name, "INPUT=, a file that exists and does not include itself"))
        yield from read_blocks(found, (*including, path))
    if block is None:
        raise InputError(Fault(str(path), "file", "no keyword", "a CalculiX or Abaqus deck (.inp)"))


def _split(lines: list[str], path: Path) -> Iterator[Block]:
    block: Block | None = None
    continued = ""
    for number, text in enumerate(lines, start=1):
        text = text.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*") or continued:
            text = continued + text
            # A keyword line that ends in a comma goes on in the next.
            continued = text if text.endswith(",") else ""
            if continued:
                continue
            if block is not None:
                yield block
            block = _keyword_line(text, path, number)
        elif block is not None:
            block.data.append(text)
    if block is not None:
        yield block


def _keyword_line(text: str, path: Path, number: int) -> Block:
    keyword, *words = text.split(",")
    parameters = {}
    for word in words:
        name, _, value = word.partition("=")
        parameters[name.strip().upper()] = value.strip()
    return Block(" ".join(keyword[1:].upper().split()), parameters, path, number)
