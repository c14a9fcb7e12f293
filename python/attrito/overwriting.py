"""No file that is read is written over."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from attrito.faults import Fault, InputError


def is_same_file(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> bool:
    """Whether two names lead, or would lead, to one file."""
    if Path(one).exists() and Path(other).exists():
        return os.path.samefile(one, other)
    return os.path.abspath(one) == os.path.abspath(other)


def check_spared(
    file: str, key: str, outputs: Iterable[str | os.PathLike[str]], inputs: Iterable[str | os.PathLike[str]]
) -> None:
    """Raise `InputError` where a file to be written is one of those that are read.

    Parameters
    ----------
    file, key : what chooses the outputs, as `export` and `-o`
    outputs, inputs : names of files
    """
    read = list(inputs)
    faults = [
        Fault(file, key, str(output), f"a file other than {name}, which is read")
        for output in outputs
        for name in read
        if is_same_file(output, name)
    ]
    if faults:
        raise InputError(*faults)
