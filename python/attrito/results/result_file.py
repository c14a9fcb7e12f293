"""`result.h5` out of a run's journal: its first record is what holds for the run, each further one a point."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

import h5py
import numpy as np

from attrito.library.series import Series
from attrito.results.journal import Record, read_journal
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_writing import described

# Bytes of points gathered before they are written.
BLOCK = 1 << 26


def fill_result(file: h5py.File, journal: str) -> None:
    """Put what a journal holds into a result file.

    Parameters
    ----------
    file : empty, open for writing
    journal : path of the journal
    """
    first, shapes, series, points = _survey(journal)
    file.attrs.update(first.note["attributes"])
    for name, values in first.arrays.items():
        what = first.series[name]
        described(file, name, what.description, what.unit, what.names, data=_texts(first, name, values))
    if points:
        for name, what in series.items():
            kind = np.int32 if what.kind == "int32" else np.float64
            shape = points, *shapes[name]
            described(file, name, what.description, what.unit, what.names, shape=shape, dtype=kind)
        _fill(file, series, journal, points)


def _survey(journal: str) -> tuple[Record, dict[str, tuple[int, ...]], dict[str, Series], int]:
    """The first record; size of an entry of each series, the largest there is, what it is; number of points."""
    records = (record for record, _ in read_journal(journal))
    first = next(records, None)
    if first is None or "attributes" not in first.note:
        raise InputError(Fault(journal, "file", "empty", "what an `attrito run` left that had begun to solve"))
    shapes: dict[str, tuple[int, ...]] = {}
    series: dict[str, Series] = {}
    points = 0
    for record in records:
        points += 1
        series |= record.series
        for name in series:
            extent = record.arrays[name].shape
            shapes[name] = tuple(np.maximum(shapes.get(name, extent), extent).tolist())
    return first, shapes, series, points


def _fill(file: h5py.File, series: Iterable[str], journal: str, points: int) -> None:
    """The entries of so many points, some at a time; a run that goes on may have added more since they were counted."""
    records = (record for record, _ in islice(read_journal(journal), 1, points + 1))
    start, block, size = 0, [], 0
    for record in records:
        block.append(record)
        size += sum(record.arrays[name].nbytes for name in series)
        if size >= BLOCK:
            _fill_block(file, series, start, block)
            start, block, size = start + len(block), [], 0
    _fill_block(file, series, start, block)


def _fill_block(file: h5py.File, series: Iterable[str], start: int, block: list[Record]) -> None:
    if not block:
        return
    for name in series:
        stored = file[name]
        rows = np.zeros((len(block), *stored.shape[1:]), stored.dtype)
        for i, record in enumerate(block):
            values = record.arrays[name]
            rows[(i, *(slice(n) for n in values.shape))] = values
        stored[start : start + len(block)] = rows


def _texts(record: Record, name: str, values: np.ndarray) -> np.ndarray:
    """Texts are in the note of a record, and their numbers in its array."""
    texts = record.note.get("texts", {})
    if name not in texts:
        return values
    return np.array([texts[name][i] for i in values], dtype=h5py.string_dtype())
