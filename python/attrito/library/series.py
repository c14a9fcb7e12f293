"""What a series of numbers is that the library reports."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Series:
    """What a series of numbers is: `real64` or `int32`, in words, its unit, and what whole numbers stand for."""

    kind: str
    description: str
    unit: str
    names: tuple[str, ...] = ()
