"""Sums of what an HDF5 file holds, in the file itself, so that a byte that a disk or a copy has changed is noticed.

Each group and each dataset has an attribute `crc32` over its numbers, its shape and its other attributes; the root's
attribute `summed` says how many have one. What somebody has added by other means has none, and is not looked at.
"""

from __future__ import annotations

import os
import sys
import zlib
from collections.abc import Iterator

import h5py
import numpy as np

from attrito.support.errors import Fault, InputError

SUM, COUNT = "crc32", "summed"
# In these files datasets of more bytes are looked at where they are read: most commands do without them.
_BY_PARTS = ("attrito model", "attrito rom")
LARGE = 1 << 28
# Bytes that are read at a time
_PIECE = 1 << 24
_EXPECTED = "bytes as attrito wrote them: the file is damaged, so copy it, or make it, once more"
# States of files that this process has looked at, so that opening one again costs nothing.
_known: set[tuple[str, int, int, int]] = set()


def add_sums(file: h5py.File) -> None:
    """Give everything in a file that is open for writing its sum."""
    things = list(_things(file))
    file.attrs[COUNT] = len(things)
    for _, thing in things:
        thing.attrs[SUM] = np.uint32(_sum(thing))


def check_sums(file: h5py.File, path: str) -> None:
    """Raise where what a file of attrito holds is not what was written; say of one without sums that it has none.

    Parameters
    ----------
    file : open for reading; without links, as `check_datasets` has found
    path : what the user calls it
    """
    status = os.stat(path)
    state = (os.path.realpath(path), status.st_ino, status.st_size, status.st_mtime_ns)
    if state in _known:
        return
    if COUNT not in file.attrs:
        print(f"warning: {path}: no sums of what it holds, so damage to it is not noticed", file=sys.stderr, flush=True)
    else:
        summed = [(name, thing) for name, thing in _things(file) if SUM in thing.attrs]
        faults = [
            Fault(path, name if isinstance(thing, h5py.Dataset) else f"attributes of {name}", "changed", _EXPECTED)
            for name, thing in summed
            if not _is_later(thing) and _sum(thing) != thing.attrs[SUM]
        ]
        if file.attrs[COUNT] != len(summed):
            expected = f"{file.attrs[COUNT]}: {_EXPECTED}"
            faults.append(Fault(path, "groups and datasets", f"{len(summed)} with a sum", expected))
        if faults:
            raise InputError(*faults)
    _known.add(state)


def checked(dataset: h5py.Dataset, path: str) -> h5py.Dataset:
    """The same for a dataset that `check_sums` has left out, where it is read; returns it."""
    if _is_later(dataset) and SUM in dataset.attrs and _sum(dataset) != dataset.attrs[SUM]:
        raise InputError(Fault(path, dataset.name, "changed", _EXPECTED))
    return dataset


def _is_later(thing: h5py.Group | h5py.Dataset) -> bool:
    return isinstance(thing, h5py.Dataset) and thing.nbytes > LARGE and thing.file.attrs.get("format") in _BY_PARTS


def _things(file: h5py.File) -> Iterator[tuple[str, h5py.Group | h5py.Dataset]]:
    """The root, groups and datasets, each once."""
    found: list[tuple[str, h5py.Group | h5py.Dataset]] = [("/", file)]
    file.visititems(lambda name, thing: found.append((f"/{name}", thing)))
    return iter(found)


def _sum(thing: h5py.Group | h5py.Dataset) -> int:
    done = 0
    for name in sorted(thing.attrs):
        if name != SUM:
            done = zlib.crc32(_bytes(thing.attrs[name]), zlib.crc32(name.encode(errors="surrogateescape"), done))
    if isinstance(thing, h5py.Dataset):
        done = zlib.crc32(repr(thing.shape).encode(), done)
        for piece in _pieces(thing):
            done = zlib.crc32(_bytes(piece), done)
    return done


def _pieces(dataset: h5py.Dataset) -> Iterator[object]:
    """What it holds, in rows that fit into little memory."""
    if dataset.ndim == 0 or dataset.size == 0:
        yield dataset[()]
        return
    rows = max(1, _PIECE * len(dataset) // max(dataset.nbytes, 1))
    if dataset.chunks:
        rows = -(-rows // dataset.chunks[0]) * dataset.chunks[0]
    for first in range(0, len(dataset), rows):
        yield dataset[first : first + rows]


def _bytes(value: object) -> bytes:
    """The same on every machine: numbers little-endian, texts one after another with their lengths."""
    if isinstance(value, h5py.Empty):
        return b""
    values = np.asarray(value)
    if values.dtype.kind in "OU":
        texts = [one if isinstance(one, bytes) else str(one).encode(errors="surrogateescape") for one in values.flat]
        return b"".join(b"%d:%s" % (len(text), text) for text in texts)
    return values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
