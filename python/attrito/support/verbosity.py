"""How much a run says, by the environment, so that every rank and every process that one starts knows it."""

from __future__ import annotations

import os

VERBOSE, QUIET = "ATTRITO_VERBOSE", "ATTRITO_QUIET"


def is_verbose() -> bool:
    """Whether every point has a line."""
    return bool(os.environ.get(VERBOSE))


def is_quiet() -> bool:
    """Whether nothing but warnings and errors is said, and these on standard error."""
    return bool(os.environ.get(QUIET))
