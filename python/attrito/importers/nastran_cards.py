"""Cards of Nastran's bulk data: fields of 8 or 16 characters or between commas, continuations and INCLUDE in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from attrito.importers.mesh_data import LONGEST_RANGE, is_id
from attrito.support.errors import Fault, InputError
from attrito.support.text_files import read_lines


@dataclass
class Card:
    """One card: its name in capitals without a star, its fields after the name, stripped, and where it begins."""

    name: str
    fields: list[str]
    path: str
    line: int

    def fault(self, expected: str) -> Fault:
        """A fault at this card."""
        return Fault(self.path, f"line {self.line}, {self.name}", ",".join(self.fields), expected)


def read_cards(path: str | Path, including: tuple[Path, ...] = ()) -> Iterator[Card]:
    """Cards in order; lines of the executive and case control sections come as cards, too, of names no one asks for."""
    path = Path(path)
    lines = read_lines(path, "a file that can be read")
    card: Card | None = None
    opened = ""
    for number, line in enumerate(lines, start=1):
        text = opened + (line.strip() if opened else line).partition("$")[0].rstrip()
        opened = ""
        if not text:
            continue
        if text[0] in "+* ,":
            if card is not None:
                card.fields += _fields(text, text[0] == "*")[1]
            continue
        if card is not None:
            yield card
            card = None
        if text.upper().startswith("INCLUDE"):
            if text.count("'") % 2 or text.count('"') % 2:
                opened = text  # the name goes on in the next line
                continue
            yield from _included(path, number, text, including)
            continue
        name, fields = _fields(text, "*" in text.replace(",", " ")[:8])
        card = Card(name.rstrip("*").rstrip().upper(), fields, str(path), number)
        if card.name == "ENDDATA":
            break
    if card is not None:
        yield card


def whole_numbers(card: Card, begin: int, known: set[int] | None = None) -> list[int]:
    """Node ids from a field on; `THRU` stands for those between, as far as they are known."""
    numbers: list[int] = []
    words = [word for word in card.fields[begin:] if word]
    through = False
    for word in words:
        if word.upper() == "THRU":
            through = bool(numbers)
        elif not is_id(word):
            raise InputError(card.fault("whole numbers of at most 18 digits, or two with THRU between them"))
        elif through:
            numbers += [*_between(card, numbers[-1], int(word), known), int(word)]
            through = False
        else:
            numbers.append(int(word))
    return numbers


def _between(card: Card, first: int, last: int, known: set[int] | None) -> list[int]:
    """Ids above one and below another, of those that are known if any are: a range may be far longer."""
    if known is not None:
        return sorted(k for k in known if first < k < last)
    if last - first > LONGEST_RANGE:
        raise InputError(card.fault(f"ranges of at most {LONGEST_RANGE} ids"))
    return list(range(first + 1, last))


def _fields(text: str, large: bool) -> tuple[str, list[str]]:
    """First field, and the others up to the mark of a continuation."""
    if "," in text:
        words = [word.strip() for word in text.split(",")]
        count = 4 if large else 8
        while words and not words[-1]:
            words.pop()
        # More than ten fields: the line goes on by itself, without a mark of the continuation.
        if len(words) > 2 + count and not words[1 + count].startswith("+"):
            return words[0], words[1:] + [""] * (-(len(words) - 1) % count)
        return words[0], (words[1 : 1 + count] + [""] * count)[:count]
    text = text.expandtabs(8)
    width, count = (16, 4) if large else (8, 8)
    return text[:8].strip(), [text[8 + k * width : 8 + (k + 1) * width].strip() for k in range(count)]


def _included(path: Path, number: int, text: str, including: tuple[Path, ...]) -> Iterator[Card]:
    name = text[7:].strip().strip("'\"")
    found = path.parent / name
    if not found.is_file() or found in (*including, path):
        expected = "a file that exists and does not include itself"
        raise InputError(Fault(str(path), f"line {number}, INCLUDE", name, expected))
    yield from read_cards(found, (*including, path))
