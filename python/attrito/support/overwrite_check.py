"""No file that is read is written over, and nothing is read that is no file."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from attrito.support.errors import Fault, InputError


def is_same_file(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> bool:
    """Whether two names lead, or would lead, to one file."""
    if Path(one).exists() and Path(other).exists():
        return os.path.samefile(one, other)
    return os.path.abspath(one) == os.path.abspath(other)


# Where a shell passes what it reads or pipes to a command.
PASSED_ON = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")


def is_no_file(path: str | os.PathLike[str]) -> bool:
    """Whether there is a pipe, a socket or a device: to read it may take for ever, or fill the memory."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    passed_on = os.fspath(path).startswith(PASSED_ON) and not stat.S_ISCHR(mode)
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or passed_on)


def is_nameless(path: str) -> bool:
    """Whether a name is only a folder's way, as `/`, `.` or `..`: no other file's name can be made of it."""
    return Path(path).name in ("", "..")


def is_text(name: str) -> bool:
    """Whether a name is UTF-8: other bytes, as of old network shares, Python hides where HDF5 and pages take none."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_files(faults_of: str, key: str, paths: Iterable[str]) -> None:
    """Raise where something to be read is no file, or files made from it could not say where it is.

    Parameters
    ----------
    faults_of, key : file and key that name it, for the message
    paths : what is to be read
    """
    faults = []
    for path in paths:
        if is_no_file(path):
            faults.append(Fault(faults_of, key, path, "a file, not a pipe or a device"))
        elif not is_text(os.path.abspath(path)):
            expected = "names of files and folders in UTF-8: rename it, as by `convmv -f latin1 -t utf8`"
            faults.append(Fault(faults_of, key, os.path.abspath(path), expected))
    if faults:
        raise InputError(*faults)


def check_spared(
    file: str, key: str, outputs: Iterable[str | os.PathLike[str]], inputs: Iterable[str | os.PathLike[str]]
) -> None:
    """Raise `InputError` where a file to be written is a folder, or one of those that are read.

    Parameters
    ----------
    file, key : what chooses the outputs, as `export` and `-o`
    outputs, inputs : names of files
    """
    read, written = list(inputs), list(outputs)
    faults = [Fault(file, key, str(output), "a file, not a folder") for output in written if os.path.isdir(output)]
    faults += [
        Fault(file, key, str(output), f"a file other than {name}, which is read")
        for output in written
        for name in read
        if is_same_file(output, name)
    ]
    if faults:
        raise InputError(*faults)
