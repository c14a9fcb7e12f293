"""Faults of the input: one line each, naming file, key, value and what was expected."""

from __future__ import annotations

import errno
from dataclasses import dataclass

# Faults that a message lists
MOST_SHOWN = 20


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the input.

    Parameters
    ----------
    file : the file the user gave, as the user wrote it
    key : the place inside it: a TOML key, a line, a dataset, a node set
    value : what is there; "missing": nothing
    expected : what should be there, as a phrase that follows "expected"
    line : of the file, from 1; 0: not known
    """

    file: str
    key: str
    value: object
    expected: str
    line: int = 0

    def __str__(self) -> str:
        value = repr(self.value) if isinstance(self.value, str) else str(self.value)
        if len(value) > 120:
            value = value[:117] + "..."
        place = f"{self.file}:{self.line}" if self.line else self.file
        there = "is missing" if self.value == "missing" else f"= {value}"
        return f"{place}: {self.key} {there}: expected {self.expected}"


class InputError(Exception):
    """The input is at fault (exit code 2); carries every fault found, not only the first."""

    def __init__(self, *faults: Fault):
        shown = [str(fault) for fault in faults[:MOST_SHOWN]]
        if more := len(faults) - len(shown):
            shown.append(f"and {more} faults more, which may have the same cause")
        elif len(faults) > 1:
            shown.append(f"{len(faults)} faults")
        super().__init__("\n".join(shown))
        self.faults = faults

    def __reduce__(self):
        """Faults cross ranks by pickle."""
        return (type(self), self.faults)


class UnforeseenError(InputError):
    """What no reader of the input foresaw; its text names no file."""

    def __init__(self, text: str):
        super().__init__()
        self.args = (text,)

    def __reduce__(self):
        """It crosses ranks by pickle."""
        return (type(self), self.args)


def unforeseen(error: Exception) -> UnforeseenError:
    """The fault for an exception that no reader turned into one of its own."""
    said = " ".join(str(error).split())
    shown = f"{said[:297]}..." if len(said) > 300 else said
    if isinstance(error, ImportError) and "failed to map" in said:
        return UnforeseenError(f"memory = {shown}: expected a limit (ulimit -v) above what libraries alone take")
    if isinstance(error, MemoryError):
        return UnforeseenError(f"memory = {shown or 'exhausted'}: expected input that fits into the memory there is")
    if isinstance(error, RecursionError):
        return UnforeseenError(f"nesting = {shown}: expected input that is less deeply nested")
    what = f"{type(error).__name__}: {shown}" if shown else type(error).__name__
    expected = "input that attrito can work with (the environment variable ATTRITO_TRACEBACK=1 shows where it failed)"
    return UnforeseenError(f"contents = {what}: expected {expected}")


# What the system says of a disk that is full, of a quota, and of a limit on the size of files.
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def unusable_file(error: OSError) -> InputError:
    """What the system said when a file could not be read or written (no folder, no permission, no space)."""
    path = error.filename if error.filename is not None else "output"
    expected = "room on the disk to write it" if error.errno in NO_ROOM else "a file that can be read and written"
    return InputError(Fault(str(path), "file", error.strerror or str(error), expected))


class NumericsError(Exception):
    """The numerics did not deliver (exit code 1)."""


class UnsolvedError(NumericsError):
    """A result is complete, but points or stretches of it were not solved; the result says which.

    Parameters
    ----------
    file : the result
    complaints : what was not solved, one sentence each
    """

    def __init__(self, file: str, complaints: str) -> None:
        super().__init__(f"{file}: {complaints}")
        self.file, self._complaints = file, complaints

    def __reduce__(self):
        """Failures cross ranks by pickle."""
        return (type(self), (self.file, self._complaints))
