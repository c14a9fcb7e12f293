"""HDF5 datasets that say what they hold: a description, a unit, and names where whole numbers stand for some."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

from attrito.support.units import units_of


def described(
    group: h5py.Group, name: str, description: str, unit: str = "1", names: Sequence[str] = (), **options: Any
) -> h5py.Dataset:
    """Make a dataset.

    Parameters
    ----------
    group : where, a file or a group of it
    name : path of the dataset below it
    description, unit : one line; `1` for pure numbers, `user length` for a length in the user's own unit, which the
        file's attribute `units` names, if it does
    names : what the values 0, 1, 2, ... stand for; empty where they are numbers
    options : `data`, `shape`, `dtype`, `compression`, ... of `h5py.Group.create_dataset`
    """
    dataset = group.create_dataset(name, **options)
    units = units_of(str(group.file.attrs.get("units", "")))
    dataset.attrs["description"], dataset.attrs["unit"] = description, unit if units is None else units.name(unit)
    if names:
        dataset.attrs["names"] = np.array(names, dtype=f"S{max(map(len, names))}")
    return dataset
