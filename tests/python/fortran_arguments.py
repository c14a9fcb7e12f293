"""Dummy arguments of Fortran's procedures, and which of them are declared below a `!>` line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_TYPE = r"(?:integer|real|logical|complex|character|type|class)\s*(?:\([^()]*(?:\([^()]*\))?[^()]*\))?"
_HEAD = re.compile(
    rf"(?:(?:pure|elemental|impure|recursive|module|{_TYPE})\s+)*(subroutine|function)\s+(\w+)\s*\(([^)]*)\)", re.I
)


@dataclass(frozen=True)
class Argument:
    """A dummy argument: of which procedure, and whether its declaration has a line of its own above it."""

    procedure: str
    name: str
    described: bool


def _statements(text: str) -> Iterator[tuple[str, bool]]:
    """Statements with their continuations, without comments, and whether a `!>` line stands above."""
    described, open_statement = False, ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("!"):
            described = described or line.startswith("!>")
        elif not line:
            described = False
        else:
            open_statement += re.sub(r"!.*", "", line).strip().lstrip("&")
            if open_statement.endswith("&"):
                open_statement = open_statement[:-1]
                continue
            yield open_statement, described
            described, open_statement = False, ""


def _names(entities: str) -> list[str]:
    """Names of a declaration's list: `a(:, :), b = 1` has a and b."""
    while (bare := re.sub(r"\([^()]*\)", "", entities)) != entities:
        entities = bare
    return [found[0].lower() for part in entities.split(",") if (found := re.search(r"\w+", part))]


def arguments(path: Path) -> list[Argument]:
    """Dummy arguments of a file but the object that a procedure is bound to, `self`."""
    found, procedure, dummies = [], "", set()
    for statement, described in _statements(path.read_text()):
        if head := _HEAD.match(statement):
            procedure = head[2]
            dummies = set(re.findall(r"\w+", head[3].lower())) - {"self"}
        elif re.match(r"end\s+(subroutine|function)|contains$", statement, flags=re.I):
            dummies = set()
        elif dummies and "::" in statement:
            names = _names(statement.split("::", 1)[1])
            found += [Argument(procedure, name, described) for name in names if name in dummies]
    return found
