"""What is known of the model that a result was made with, where its files are still there: mesh, mass, reduction."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.results.result import Result
from attrito.support.errors import InputError
from attrito.support.hdf5_reading import UNREADABLE, stored

# Entries of a mass matrix that are still read, and how many at a time
MOST_ENTRIES, BLOCK = 200_000_000, 5_000_000


def mesh_of(result: Result) -> Model | None:
    """The model without its matrices; None where its file is gone, cannot be read, or has no elements."""
    name = result.attribute("model_file")
    if not name or not Path(name).is_file():
        return None
    try:
        model = read_model(name, matrices=False)
    except InputError:
        return None
    return model if model.has_mesh and model.elements else None


def mass_of(result: Result) -> float | None:
    """Mass that moves, user units: the largest r^T M r of unit translations r along x, y and z; None: not known."""
    name = result.attribute("model_file")
    if not name or not Path(name).is_file():
        return None
    try:
        with stored(name, "a model of `attrito import`") as file:
            if "dofs/direction" not in file or len(file["mass/values"]) > MOST_ENTRIES:
                return None
            direction, offsets = file["dofs/direction"][:], file["mass/row_offsets"][:]
            row_direction = np.repeat(direction, np.diff(offsets))
            total = np.zeros(3)
            for begin in range(0, len(row_direction), BLOCK):
                part = slice(begin, begin + BLOCK)
                same = row_direction[part] == direction[file["mass/columns"][part]]
                for axis in (1, 2, 3):
                    total[axis - 1] += file["mass/values"][part][same & (row_direction[part] == axis)].sum()
    except (InputError, *UNREADABLE):
        return None
    return float(total.max()) if total.max() > 0 else None


def reduction_errors(result: Result) -> tuple[np.ndarray, np.ndarray] | None:
    """Natural frequencies of the reduced model, Hz, and the part of itself by which each is too high, as estimated.

    None: no reduction, its file is gone or of another one, or it was not examined.
    """
    name = result.attribute("rom_file")
    if not name or not Path(name).is_file():
        return None
    try:
        with stored(name, "a rom.h5 of `attrito reduce`") as rom:
            same = str(rom.attrs.get("fingerprint", "")) == result.attribute("rom_fingerprint")
            if not same or "quality/frequency_hz" not in rom or not len(rom["quality/frequency_hz"]):
                return None
            return rom["quality/frequency_hz"][:], rom["quality/frequency_error"][:]
    except (InputError, *UNREADABLE):
        return None
