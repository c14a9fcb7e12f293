"""Files that take their name when they are whole: whoever reads finds the old file or the new one, never half of one.

HDF5 crashes where the disk is full: what it could not write it tries once more as the program ends. So it writes
through a file that never fails it, and what the system said is raised as soon as HDF5 has closed.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py

from attrito.support.file_sums import add_sums

ENDING = ".new"


def target(path: str | os.PathLike[str]) -> str:
    """Where a file lies: what a link leads to, whether or not it is there yet; else the name itself."""
    return os.path.realpath(path) if os.path.islink(path) else os.fspath(path)


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[str]:
    """The name under which to write a file in the block; it then takes its own, or is removed where the block failed.

    The name is of this process alone, in the same folder, and the file is made empty: nothing that is there is written
    over, and no link is followed. Where `path` is a link, it stays one, and what it leads to is replaced; the new file
    has the mode of the old one. What is there at `path` and is no file, as /dev/stdout, is written as it is.

    Raises
    ------
    OSError : no folder, no permission, no room; it names `path`
    """
    if Path(path).exists() and not Path(path).is_file():
        yield str(path)
        return
    goal = target(path)
    with new_file(path) as new:
        yield new
        if os.path.exists(goal):
            shutil.copymode(goal, new)
        os.replace(new, goal)


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[str]:
    """An empty file beside one, gone at the end if it is still there; what the system says of it names `path`."""
    new = f"{target(path)}.{secrets.token_hex(4)}{ENDING}"
    made = False
    try:
        os.close(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))
        made = True
        yield new
    except OSError as error:
        if error.filename in (None, new):
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        if made:
            Path(new).unlink(missing_ok=True)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise `OSError` where `whole_file` could not make its file, as by a name too long for it; it names `path`."""
    if not Path(path).exists() or Path(path).is_file():
        with new_file(path):
            pass


def remove_left_overs(path: str | os.PathLike[str]) -> None:
    """Remove what killed processes left of a file that no process writes now."""
    path = target(path)
    of_this = re.compile(re.escape(Path(path).name) + r"\.[0-9a-f]{8}" + re.escape(ENDING))
    for entry in os.scandir(Path(path).parent):
        if of_this.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
            with contextlib.suppress(OSError):
                os.unlink(entry.path)


@contextlib.contextmanager
def whole_hdf5(
    path: str | os.PathLike[str], start: str | None = None, named: Callable[[str], None] | None = None
) -> Iterator[h5py.File]:
    """The same for an HDF5 file, open for writing in the block, and on disk with its sums after it.

    Parameters
    ----------
    path : the file
    start : a file to begin with: copied if it is `path` itself, else used up
    named : receives the name that the file has until it is whole, for others to write numbers to; it has no sums then
    """
    with whole_file(path) as new:
        if named is not None:
            named(new)
        if start is not None:
            # A link may lead to another file system.
            (shutil.copyfile if start == str(path) else shutil.move)(start, new)
        with _NeverFailing(new, "w+b" if start is None else "r+b") as disk:
            try:
                with h5py.File(disk, "w" if start is None else "r+") as file:
                    yield file
                    if named is None:
                        add_sums(file)
            except Exception:
                # What HDF5 or h5py say of a disk that is full follows from what the system said.
                disk.tell_error()
                raise
            disk.tell_error()
            os.fsync(disk.fileno())


class _NeverFailing(io.FileIO):
    """A file that keeps the first thing the system says against writing, and from then on pretends."""

    def __init__(self, path: str, mode: str):
        super().__init__(path, mode)
        self._error: OSError | None = None

    def write(self, data: bytes) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while rest and self._error is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self._error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def tell_error(self) -> None:
        """Raise what the system said."""
        if self._error is not None:
            raise self._error
