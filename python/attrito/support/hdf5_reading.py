"""HDF5 files that may hold anything: opened and looked over so that what is wrong with one is a fault of the file.

HDF5 says what it cannot read in exceptions of many kinds, or not before a dataset of a few bytes has asked for all the
memory there is; a file that is cut off may still open.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import check_sums

# What h5py and numpy raise on contents that are not what was written.
UNREADABLE = (
    LookupError, OSError, RuntimeError, ValueError, TypeError, AttributeError, MemoryError, ArithmeticError,
)  # fmt: skip
# Bytes that a dataset may claim whatever it has on disk, and how many times as many as it has.
SMALL, MOST_TIMES = 1 << 26, 16


@contextmanager
def stored(path: str | Path, expected: str) -> Iterator[h5py.File]:
    """The file, open for reading while the block lasts, in which nothing else is to be done.

    Parameters
    ----------
    path : the file
    expected : what it should be

    Raises
    ------
    InputError : it is not there, not HDF5, or the block found that it is not what it should be
    """
    try:
        with h5py.File(path, "r") as file:
            check_datasets(file, str(path))
            if as_text(file.attrs.get("format", "")).startswith("attrito "):
                check_sums(file, str(path))
            yield file
    except UNREADABLE as error:
        raise spoilt(path, error, expected) from error


def format_of(path: str | Path) -> str:
    """A file's attribute `format`; empty if it has none, or is no file that can be read."""
    try:
        with h5py.File(path, "r") as file:
            return as_text(file.attrs.get("format", ""))
    except UNREADABLE:
        return ""


def is_of_format(path: str | Path, name: str) -> bool:
    """Whether a file's attribute `format` is this; False too if it is no file that can be read."""
    return format_of(path) == name


def spoilt(path: str | Path, error: BaseException, expected: str) -> InputError:
    """The fault of a file that could not be made sense of."""
    if not Path(path).is_file():
        return InputError(Fault(str(path), "file", "absent", expected))
    said = " ".join(str(error).split()) or type(error).__name__
    if "unable to lock file" in said:
        # HDF5 was loaded before attrito could ask it not to.
        expected = "a file system with locks, or the environment variable HDF5_USE_FILE_LOCKING=FALSE"
        return InputError(Fault(str(path), "file", said, expected))
    key = "file" if isinstance(error, OSError) and not h5py.is_hdf5(path) else "contents"
    return InputError(Fault(str(path), key, said, f"{expected}, intact"))


def check_datasets(file: h5py.File, path: str) -> None:
    """Everything lies in the file itself, and no dataset claims more than the file holds of it.

    Links lead to what another file holds, or round in circles; a virtual dataset may be made of itself, which HDF5
    follows until the stack ends.
    """
    faults: list[Fault] = []

    def look_at_link(name: bytes, link: h5py.h5l.LinkInfo) -> None:
        if link.type != h5py.h5l.TYPE_HARD:
            kind = {h5py.h5l.TYPE_SOFT: "a soft link", h5py.h5l.TYPE_EXTERNAL: "an external link"}
            expected = (
                "the data in the file itself: attrito follows no links (h5copy -f soft,ext puts data in their place)"
            )
            faults.append(Fault(path, name.decode(errors="replace"), kind.get(link.type, "a link"), expected))

    def look(name: str, thing: h5py.Group | h5py.Dataset) -> None:
        if not isinstance(thing, h5py.Dataset):
            return
        if thing.is_virtual or thing.external:
            faults.append(Fault(path, name, "data in other places", "a dataset whose data the file itself holds"))
        elif thing.nbytes > max(SMALL, MOST_TIMES * thing.id.get_storage_size()):
            held = thing.id.get_storage_size()
            faults.append(
                Fault(path, name, f"shape {thing.shape}", f"no more than the {held} bytes that the file holds of it")
            )

    file.id.links.visit(look_at_link, info=True)
    if not faults:
        file.visititems(look)
    if faults:
        raise InputError(*faults)


def as_text(value: object) -> str:
    """Text of an HDF5 attribute, whether Python or Fortran wrote it."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    # h5py hides bytes that are no UTF-8 in surrogates, which nothing can write.
    raw = value if isinstance(value, bytes) else str(value).encode(errors="surrogateescape")
    return raw.decode(errors="replace").rstrip("\0 ")
