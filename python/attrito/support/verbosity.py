"""How much a run says, by the environment, so that every rank and every process that one starts knows it."""

from __future__ import annotations

import os

VERBOSE = "ATTRITO_VERBOSE"


def is_verbose() -> bool:
    """Whether every point has a line."""
    return bool(os.environ.get(VERBOSE))
