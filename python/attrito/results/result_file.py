"""`result.h5` out of a run's journal: its first record is what holds for the run, each further one a point.

All of it comes from there but the bounds of points that are not unique, which need the scene (`runs.bounds`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice

import h5py
import numpy as np

from attrito.library.series import Series
from attrito.results.bifurcations import Bifurcation, added, narrowest_fold, of_rows, write_bifurcations
from attrito.results.journal import Record, is_point, read_journal
from attrito.results.stability_part import write_stability
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_writing import described

# Where records have what was found of a point's stability.
EXAMINED = "stability/"
# Bytes of points gathered before they are written.
BLOCK = 1 << 26


def fill_result(file: h5py.File, journal: str) -> None:
    """Put what a journal holds into a result file.

    Parameters
    ----------
    file : empty, open for writing
    journal : path of the journal
    """
    found = _survey(journal)
    first = found.first
    file.attrs.update(first.note["attributes"])
    for name, values in first.arrays.items():
        what = first.series[name]
        described(file, name, what.description, what.unit, what.names, data=_texts(first, name, values))
    for name, attributes in first.note.get("group_attributes", {}).items():
        file[name].attrs.update(attributes)
    if found.points:
        for name, what in found.series.items():
            kind = np.int32 if what.kind == "int32" else np.float64
            shape = found.points, *found.shapes[name]
            described(file, name, what.description, what.unit, what.names, shape=shape, dtype=kind)
        _fill(file, found.series, journal, found.points)
        write_stability(file, found.examined)
        write_bifurcations(file, found.bifurcations, _monitors(first))


@dataclass
class _Survey:
    """What a journal holds, but for its series.

    Parameters
    ----------
    first : the first record
    shapes : size of an entry of each series, the largest there is
    series : what each is
    points : their number
    examined : of each point, arrays below `stability/`
    bifurcations : of all points
    """

    first: Record
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)
    points: int = 0
    examined: list[dict[str, np.ndarray]] = field(default_factory=list)
    bifurcations: list[Bifurcation] = field(default_factory=list)

    def add(self, record: Record) -> None:
        """Count a point's record in."""
        self.series |= record.series
        for name in self.series:
            extent = record.arrays[name].shape
            self.shapes[name] = tuple(np.maximum(self.shapes.get(name, extent), extent).tolist())
        arrays = record.arrays.items()
        self.examined.append({n.removeprefix(EXAMINED): values for n, values in arrays if n.startswith(EXAMINED)})
        narrow = narrowest_fold(json.loads(self.first.note["attributes"]["job"]))
        for one in of_rows(self.points, record.arrays.get("bifurcations", ())):
            self.bifurcations = added(self.bifurcations, one, narrow)
        self.points += 1


def _survey(journal: str) -> _Survey:
    """Read a journal once."""
    records = (record for record, _ in read_journal(journal) if is_point(record))
    first = next(records, None)
    if first is None or "attributes" not in first.note:
        raise InputError(Fault(journal, "file", "empty", "what an `attrito run` left that had begun to solve"))
    found = _Survey(first)
    for record in records:
        found.add(record)
    return found


def _monitors(first: Record) -> list[str]:
    """Names, in the job's order."""
    return [monitor["name"] for monitor in json.loads(first.note["attributes"]["job"])["output"]["monitors"]]


def _fill(file: h5py.File, series: Iterable[str], journal: str, points: int) -> None:
    """The entries of so many points, some at a time; a run that goes on may have added more since they were counted."""
    records = (record for record, _ in read_journal(journal) if is_point(record))
    start, block, size = 0, [], 0
    for record in islice(records, 1, points + 1):
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
