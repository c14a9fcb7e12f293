"""Lists of ids in a CalculiX or Abaqus deck: elements of a block, members of sets."""

from __future__ import annotations

import re

import numpy as np

from attrito.importers.deck import Block
from attrito.importers.mesh_data import DIGITS, LONGEST_RANGE, is_id
from attrito.model.surfaces import element_family
from attrito.support.errors import InputError

_WHOLE = re.compile(r"[+-]?\d+")
# Types that are read, each as the one it is solved as
ELEMENT_TYPES = {
    **{name: name for name in ("C3D4", "C3D8", "C3D8R", "C3D8I", "C3D10", "C3D10M", "C3D20", "C3D20R")},
    "C3D10HS": "C3D10",
}
NODES_PER_FAMILY = {"C3D4": 4, "C3D8": 8, "C3D10": 10, "C3D20": 20}


def element_type(block: Block) -> str:
    """As the deck says it, in capitals."""
    return block.parameters.get("TYPE", "").upper()


def element_ids(block: Block) -> np.ndarray:
    """Ids of the elements of an `*ELEMENT` block of a type that is read; none of others."""
    kind = element_type(block)
    if kind not in ELEMENT_TYPES:
        return np.empty(0, dtype=np.int64)
    words = [word for line in block.data for word in fields(line)]
    return integers(words[:: NODES_PER_FAMILY[element_family(kind)] + 1], block, "element ids")


def set_members(block: Block, known: dict[str, np.ndarray], what: str = "node ids or names of sets") -> np.ndarray:
    """Ids that the lines of a set name, by themselves, by `GENERATE` or by sets known so far (in capitals)."""
    if "GENERATE" in block.parameters:
        rows = [integers(fields(line), block, "first, last, step") for line in block.data]
        if not rows or any(len(row) not in (2, 3) or row[-1] < 1 for row in rows):
            raise InputError(block.fault("GENERATE", "lines of first, last, step"))
        longest = max(rows, key=lambda row: row[1] - row[0])
        if longest[1] - longest[0] > LONGEST_RANGE:
            words = ", ".join(map(str, longest))
            raise InputError(block.fault(words, f"ranges of at most {LONGEST_RANGE} ids"))
        return np.concatenate([np.arange(row[0], row[1] + 1, row[2] if len(row) == 3 else 1) for row in rows])
    words = [word for line in block.data for word in fields(line)]
    named = [known[word.upper()] for word in words if word.upper() in known]
    ids = integers([word for word in words if word.upper() not in known], block, what)
    return np.concatenate([ids, *named])


def fields(line: str) -> list[str]:
    """The entries of a data line."""
    return [word.strip() for word in line.rstrip(", ").split(",")]


def integers(words: list[str], block: Block, what: str) -> np.ndarray:
    """Entries that are whole numbers; a fault says what they should be."""
    grouped = next((word for word in words if "_" in word), None)
    if grouped is not None:
        raise InputError(block.fault(grouped, what))
    try:
        found = np.array(words, dtype=np.int64)
    except (ValueError, OverflowError):
        found = None
    if found is None or np.any(np.abs(found) // 10**DIGITS != 0):
        # Zeros in front may make a number longer than any.
        odd = (word for word in words if not (_WHOLE.fullmatch(word) and is_id(word.lstrip("+-"))))
        wrong = next(odd, max(words, key=len))
        raise InputError(block.fault(wrong, f"{what} of at most {DIGITS} digits" if _WHOLE.fullmatch(wrong) else what))
    return found
