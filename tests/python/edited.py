"""Files of attrito that a test changes, and means to be whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py

from attrito.support.file_sums import COUNT, SUM, add_sums
from attrito.support.hdf5_reading import UNREADABLE


@contextmanager
def summed(path: str | Path) -> Iterator[h5py.File]:
    """A new file, open for writing in the block, with sums as attrito's have."""
    with h5py.File(path, "w") as file:
        yield file
        add_sums(file)


@contextmanager
def edited(path: str | Path) -> Iterator[h5py.File]:
    """The file, open for writing in the block; its sums, if it has any, are made again if it can be read."""
    with h5py.File(path, "r+") as file:
        yield file
        if COUNT in file.attrs:
            with suppress(*UNREADABLE):
                add_sums(file)


def without_sums(path: str | Path) -> None:
    """As earlier versions wrote it."""
    with h5py.File(path, "r+") as file:
        things: list[h5py.Group | h5py.Dataset] = [file]
        file.visititems(lambda name, thing: things.append(thing))
        for thing in things:
            del thing.attrs[SUM]
        del file.attrs[COUNT]
