r"""The journal of a run: a file that only grows, one record a point, whole or not there.

    attrito journal 1\n
    record, record, ...
    record = b"REC\n", header bytes (u32), payload bytes (u64), CRC-32 of header and payload (u32), header, payload

Numbers are little-endian. The header is JSON: `note`, free; `arrays`, `[name, type, shape]` each, whose numbers follow
one another in the payload; and, in the record where a series first occurs, what it is. A process that is killed while
it writes leaves a record that is cut short or whose sum is wrong: reading ends before it, and going on cuts it off.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from attrito.library.series import Series
from attrito.support.atomic_files import new_file
from attrito.support.errors import Fault, InputError

MAGIC = b"attrito journal 1\n"
_HEAD = struct.Struct("<4sIQI")
_MARK = b"REC\n"
# Types of numbers that a journal holds: nothing that reading could run.
_TYPES = ("<f8", "<i4", "<i8", "|i1", "|u1", "|b1")


@dataclass(frozen=True)
class Record:
    """One record.

    Parameters
    ----------
    note : what JSON holds
    arrays : by name
    series : what those of them are that occur for the first time
    """

    note: dict
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)


def is_point(record: Record) -> bool:
    """Whether a record is of a point (or holds for the run); else it is what was found later of an earlier one."""
    return "found_of" not in record.note


class Journal:
    """A journal open for writing, by one process alone.

    Parameters
    ----------
    path : the file
    keep : bytes of it to go on after; 0 makes it again

    Raises
    ------
    InputError : another process writes it
    OSError : the system does not let it be written
    """

    def __init__(self, path: str, keep: int = 0):
        self.path = path
        _make(path)
        # Nothing of it is cut before it is known that no other process writes it.
        self._file = open(path, "r+b", buffering=0, opener=_open_own)  # noqa: SIM115
        try:
            _lock(self._file, path)
        except InputError:
            self._file.close()
            raise
        if not keep:
            self._end = 0
            self._write(MAGIC)
        self._end = keep or len(MAGIC)
        self._file.truncate(self._end)

    def append(self, record: Record) -> int:
        """Write a record and wait until it is on disk, and say where; what cannot be written whole is taken back."""
        start = self._end
        arrays = {name: _plain(values) for name, values in record.arrays.items()}
        header = json.dumps(
            {
                "note": record.note,
                "arrays": [[name, values.dtype.str, values.shape] for name, values in arrays.items()],
                "series": {name: [s.kind, s.description, s.unit, s.names] for name, s in record.series.items()},
            }
        ).encode()
        payload = b"".join(values.tobytes() for values in arrays.values())
        checksum = zlib.crc32(payload, zlib.crc32(header))
        self._write(_HEAD.pack(_MARK, len(header), len(payload), checksum) + header + payload)
        return start

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            self._file.seek(self._end)
            while rest:
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(self._end)
            error.filename = self.path
            raise
        self._end += len(data)

    def close(self) -> None:
        """Closing twice does no harm."""
        self._file.close()


def set_aside(path: str, owner: str) -> None:
    """Keep a journal under another name, `<path>.old`, unless another process writes it or it holds nothing."""
    old = f"{path}.old"
    for name in (path, old):
        check_own(name, owner)
    if not _holds_something(path):
        return
    # What was set aside before held something.
    if os.path.lexists(old) and not _holds_something(old):
        raise InputError(Fault(old, "file", "not a journal", "nothing that attrito has not written under this name"))
    with open(path, "r+b", opener=_open_own) as file:
        _lock(file, path)
        os.replace(path, old)


def find_earlier(path: str, owner: str, resume: bool) -> bool:
    """Whether an earlier run left a journal; one that is not gone on from is kept once, under another name."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    if not check_own(path, owner):
        return False
    if not resume:
        set_aside(path, owner)
    return True


def check_own(path: str, owner: str) -> bool:
    """Whether a journal of an owner, the format of what it is to become, is there.

    Raises
    ------
    InputError : something else is there, or a link: it stays as it is
    """
    if not os.path.lexists(path):
        return False
    if not _is_plain_journal(path):
        raise InputError(Fault(path, "file", "not a journal", "nothing that attrito has not written under this name"))
    there = owner_of(path)
    if there not in ("", owner):
        expected = f"what an unfinished {owner} has left: end or delete that {there}, or give one another name"
        raise InputError(Fault(path, "format", there, expected))
    return True


def owner_of(path: str) -> str:
    """Format of what a journal is to become; empty where it ends before it says so."""
    first = kept_record(path)
    return "" if first is None else str(first.note.get("attributes", {}).get("format", ""))


def _make(path: str) -> None:
    """A journal without records, unless something is there: never empty, so that an empty file is not attrito's."""
    if os.path.lexists(path):
        return
    with new_file(path) as new:
        with open(new, "r+b") as file:
            file.write(MAGIC)
            file.flush()
            os.fsync(file.fileno())
        try:
            os.link(new, path)
        except FileExistsError:
            pass
        except OSError:
            # A file system without hard links: for a moment the file is empty.
            with contextlib.suppress(FileExistsError), open(path, "xb", buffering=0) as file:
                file.write(MAGIC)
                os.fsync(file.fileno())


def _open_own(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW)


def _lock(file: BinaryIO, path: str) -> None:
    """Keep other processes from writing it while it is open; raises `InputError` where one does already."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(Fault(path, "file", "in use", "that no other run writes it")) from None
    except OSError:
        # A file system without locks.
        pass


def is_journal(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as a journal does, as one that is cut short within its first line does too."""
    with open(path, "rb") as file:
        begins = file.read(len(MAGIC))
    return bool(begins) and MAGIC.startswith(begins)


def remove_journals(path: str, owner: str) -> None:
    """Remove a journal and what was set aside for it; what is somebody else's stays."""
    for name in (path, f"{path}.old"):
        if _is_plain_journal(name) and owner_of(name) in ("", owner) and (name == path or _holds_something(name)):
            os.unlink(name)


def _holds_something(path: str) -> bool:
    """Whether a journal has more than its first line, or a part of it."""
    return os.path.getsize(path) > len(MAGIC)


def _is_plain_journal(path: str) -> bool:
    return os.path.isfile(path) and not os.path.islink(path) and is_journal(path)


def read_journal(path: str) -> Iterator[tuple[Record, int]]:
    """Whole records in their order, each with the number of bytes up to its end."""
    if not is_journal(path):
        raise InputError(Fault(path, "file", "not a journal", "what an unfinished `attrito run` left"))
    size = Path(path).stat().st_size
    with open(path, "rb") as file:
        file.seek(len(MAGIC))
        end = len(MAGIC)
        while (record := _read_record(file, size - end)) is not None:
            end = file.tell()
            yield record, end


def keep_record(path: str, record: Record) -> None:
    """Make a journal of one record, on disk when this returns."""
    with contextlib.closing(Journal(path)) as journal:
        journal.append(record)


def kept_record(path: str) -> Record | None:
    """The first record of a journal; None where there is none, or none that is as it was written."""
    first = next(read_journal(path), None) if os.path.lexists(path) else None
    return None if first is None else first[0]


def read_record(path: str, start: int) -> Record:
    """The record that begins after so many bytes."""
    with open(path, "rb") as file:
        file.seek(start)
        record = _read_record(file, Path(path).stat().st_size - start)
    if record is None:
        raise InputError(Fault(path, "file", "spoilt", "what this run has written"))
    return record


def _read_record(file: BinaryIO, room: int) -> Record | None:
    """The next record; None where there is no whole one."""
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    mark, header_bytes, payload_bytes, checksum = _HEAD.unpack(head)
    if mark != _MARK or header_bytes + payload_bytes > room - _HEAD.size:
        return None
    header, payload = file.read(header_bytes), file.read(payload_bytes)
    if zlib.crc32(payload, zlib.crc32(header)) != checksum:
        return None
    try:
        return _decode(json.loads(header), payload)
    except (ValueError, KeyError, TypeError):
        # Summed right, and yet nothing that `append` wrote.
        return None


def _decode(header: dict, payload: bytes) -> Record:
    arrays, place = {}, 0
    for name, kind, shape in header["arrays"]:
        if kind not in _TYPES:
            raise ValueError(kind)
        dtype, count = np.dtype(kind), math.prod(shape)
        arrays[name] = np.frombuffer(payload, dtype, count, place).reshape(shape)
        place += count * dtype.itemsize
    series = {
        name: Series(kind, description, unit, tuple(names))
        for name, (kind, description, unit, names) in header["series"].items()
    }
    return Record(header["note"], arrays, series)


def _plain(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values).reshape(np.shape(values))
    plain = values.astype(values.dtype.newbyteorder("<"), copy=False)
    if plain.dtype.str not in _TYPES:
        raise TypeError(f"a journal does not hold {plain.dtype}")
    return plain
