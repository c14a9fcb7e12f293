"""Standard output that may break: closed, a pipe that nobody reads any longer, a disk that is full.

A command whose result is a file goes on without it, since its result does not depend on what it says; a command whose
result is what it prints ends.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from collections.abc import Iterator
from typing import TextIO


def open_closed_descriptors() -> bool:
    """Lead the descriptors 0, 1 and 2 that are closed to /dev/null; returns whether standard output was.

    Otherwise the next file that is opened takes the number, and what is printed goes into it.
    """
    closed = []
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            closed.append(number)
            # The lowest number that is free.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (for as long as the program runs)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    return 1 in closed


@contextlib.contextmanager
def unbreakable_output() -> Iterator[None]:
    """Standard output in whose place nothing is printed from the first write that fails."""
    before = sys.stdout
    sys.stdout = _Unbreakable(before)
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stdout = before


def print_names_in_any_encoding() -> None:
    """Characters that the encoding of standard output lacks are written as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def escape_controls() -> None:
    """On a terminal, control characters of names are written as escapes: there they could do anything."""
    sys.stdout, sys.stderr = (_Escaping(one) if one.isatty() else one for one in (sys.stdout, sys.stderr))


def forget_output() -> None:
    """What standard output does not take is not tried again when Python ends."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Escaping:
    """A stream to a terminal that shows control characters but those that attrito itself writes."""

    # New lines and tabs; a line written over, a word in colour (`Progress`, `_print_error`)
    _FOREIGN = re.compile(r"(?!\r?\x1b\[(?:K|1;31m|0m))[\0-\x08\x0b-\x1f\x7f-\x9f]")

    def __init__(self, stream: TextIO):
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(self._FOREIGN.sub(lambda found: f"\\x{ord(found[0]):02x}", text))
        return len(text)

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


class _Unbreakable:
    """A stream that drops what is written to it once it has broken; otherwise as the stream that it stands for."""

    def __init__(self, stream: TextIO):
        self._stream = stream
        self._broken = False

    def write(self, text: str) -> int:
        self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, work) -> None:
        if self._broken:
            return
        try:
            work()
        except (OSError, ValueError):
            self._broken = True
            forget_output()

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)
