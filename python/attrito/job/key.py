"""One key of a table of a job."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from attrito.job.checks import Check


@dataclass(frozen=True)
class Key:
    """One key of a table: how its value is checked, its value when absent, and what it means (Markdown).

    `retired`: what is done whatever its value; the key is accepted, since older jobs have it, and a line says so.
    """

    check: Check
    default: Any = None
    meaning: str = ""
    required: bool = False
    retired: str = ""
