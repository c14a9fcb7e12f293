"""A point of an older result, to start from."""

from __future__ import annotations

import h5py
import numpy as np

from attrito.job.job import Job
from attrito.library.kernels import slider_width
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.scene.reduced_model import coordinates_fingerprint
from attrito.support.errors import InputError
from attrito.support.file_sums import check_sums
from attrito.support.hdf5_reading import UNREADABLE, check_datasets

NAMES = ("points/coordinates", "contacts/slider", "points/frequency_hz")


def read_point(job: Job, key: str, start: str, path: str, scene: ReducedScene) -> StoredPoint:
    """The point that `start`, as "point:12", names in the result at `path`; faults name `key`.

    Its coordinates must stand for what those of the scene stand for; what presses, shakes, damps and rubs may differ.
    """
    number = int(start.split(":")[1])
    try:
        with h5py.File(path) as file:
            check_datasets(file, path)
            check_sums(file, path)
            points = len(file["points/frequency_hz"])
            if number >= points:
                raise InputError(job.fault(key, start, f"a point of {path}: 0 to {points - 1}"))
            motion, slider, frequency = (np.asarray(file[name][number], dtype=float) for name in NAMES)
            made_of = str(file.attrs.get("coordinates_fingerprint", ""))
    except UNREADABLE:
        raise InputError(job.fault(key, start, f"a result of `attrito run` in {path}")) from None
    contacts = len(scene.laws["tangents"])
    shaped = motion.ndim == 2 and len(motion) == len(scene.mass) and motion.shape[1] % 2 == 1
    if not shaped or slider.shape != (contacts, slider_width(scene.laws)) or frequency.ndim != 0:
        raise InputError(job.fault(key, start, f"a result of this scene in {path}"))
    # Results of earlier versions do not tell.
    if made_of and made_of != coordinates_fingerprint(scene):
        expected = f"a result of this scene in {path}: it was made of another model, reduction or contacts"
        raise InputError(job.fault(key, start, expected))
    if not all(np.all(np.isfinite(values)) for values in (motion, slider, frequency)):
        raise InputError(job.fault(key, start, "a point that has converged"))
    return StoredPoint(float(frequency), motion, slider)
