"""The command `attrito`."""

from attrito.cli.program import main

__all__ = ["main"]
