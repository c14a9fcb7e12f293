"""On which line of a TOML file a table begins and a key stands: TOML's own reader does not say.

Only what jobs are written in is followed: headers and keys at the beginning of lines, values over several lines.
"""

from __future__ import annotations

import re
from collections import Counter

HEADER = re.compile(r"""\s*(\[\[?)\s*["']?([\w.-]+)["']?\s*\]\]?""")
KEY = re.compile(r"""\s*["']?([\w-]+)["']?\s*(?:\.\s*["']?([\w-]+)["']?\s*)?=\s*(.*)""")
# Texts and comments, which may have brackets in them
WORDS = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*')
Place = tuple[str, int | None, str | None]


def places(text: str) -> dict[Place, int]:
    """Lines, from 1, by (table, which of an array's tables, key); of a table itself the key is None."""
    found: dict[Place, int] = {}
    counts: Counter[str] = Counter()
    table: tuple[str, int | None] = ("", None)
    depth, quotes = 0, ""
    for number, line in enumerate(text.split("\n"), 1):
        # A text of several lines may hold what looks like keys.
        if quotes:
            quotes = "" if quotes in line else quotes
            continue
        quotes = next((sign for sign in ('"""', "'''") if line.count(sign) % 2), "")
        if depth > 0:
            depth += _opened(line)
            continue
        header, key = HEADER.match(line), KEY.match(line)
        if header and not key:
            name, is_array = header[2], header[1] == "[["
            table = (name, counts[name] if is_array else None)
            counts[name] += is_array
            found.setdefault((*table, None), number)
        elif key:
            found.setdefault((*table, key[1]), number)
            # `balance.harmonics = 5`, and tables within a line, before any header
            if table == ("", None):
                found.setdefault((key[1], None, key[2]), number)
                found.setdefault((key[1], None, None), number)
            depth = 0 if quotes else _opened(key[3])
    return found


def line_of(key: str, known: dict[Place, int]) -> int:
    """The line of `[table] key`, `table[0] key`, or of their table; 0: not known."""
    named = re.match(r"\[(\w+)\]|(\w+)\[(\d+)\]|(\w+)", key)
    if named is None:
        return 0
    table = (named[1] or named[2] or named[4], None if named[3] is None else int(named[3]))
    last = re.match(r" ([\w-]+)", key[named.end() :])
    whole = known.get((*table, None), known.get((table[0], None, None), 0))
    return known.get((*table, last[1] if last else None), whole)


def _opened(text: str) -> int:
    """By how many brackets and braces a line opens more than it closes."""
    plain = WORDS.sub("", text)
    return sum(plain.count(sign) for sign in "[{") - sum(plain.count(sign) for sign in "]}")
