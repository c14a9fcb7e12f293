"""A point of an older result, to start from."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np

from attrito.faults import InputError
from attrito.job import Job
from attrito.stored import UNREADABLE, check_sizes


@dataclass(frozen=True)
class StoredPoint:
    """A point of a result: `coordinates` `[m, nk]`, `slider` `[nc, 2]` at the start of the period."""

    frequency_hz: float
    coordinates: np.ndarray
    slider: np.ndarray


def read_point(job: Job, key: str, start: str, path: str, size: int, contacts: int) -> StoredPoint:
    """The point that `start`, as "point:12", names in the result at `path`; faults are told of `key`."""
    number = int(start.split(":")[1])
    try:
        with h5py.File(path) as file:
            check_sizes(file, path)
            coordinates = file["points/coordinates"]
            if number >= len(coordinates):
                raise InputError(job.fault(key, start, f"a point of {path}: 0 to {len(coordinates) - 1}"))
            if coordinates.shape[1] != size or file["contacts/slider"].shape[1] != contacts:
                raise InputError(job.fault(key, start, f"a result of this scene in {path}"))
            motion, slider = coordinates[number], file["contacts/slider"][number]
            frequency = float(file["points/frequency_hz"][number])
    except UNREADABLE:
        raise InputError(job.fault(key, start, f"a result of `attrito run` in {path}")) from None
    if not np.all(np.isfinite(motion)):
        raise InputError(job.fault(key, start, "a point that has converged"))
    return StoredPoint(frequency, motion, slider)
