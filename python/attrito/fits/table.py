"""The table of a fit: one row a parameter."""

from __future__ import annotations

import numpy as np

from attrito.support.csv_text import cell
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, is_of_format, stored

FORMAT = "attrito fit"


def holds_fit(path: str) -> bool:
    """Whether a file is that of a fit."""
    return is_of_format(path, FORMAT)


def table(path: str) -> str:
    """CSV: `parameter, value, low, high, profile_low, profile_high, identified`; intervals of 95 %, blank where open.

    Raises
    ------
    InputError : the file lacks what a fit's has
    """
    with stored(path, "a file of `attrito fit`") as file:
        if "parameters/value" not in file:
            raise InputError(Fault(path, "parameters/value", "absent", "a file of `attrito fit`"))
        group = file["parameters"]
        numbers = np.column_stack([group["value"][()], group["interval"][()], group["profile_interval"][()]])
        names = [as_text(name) for name in group["name"][()]]
        identified = ["true" if one else "false" for one in group["identified"][()]]
    lines = ["parameter,value,low,high,profile_low,profile_high,identified"]
    for name, row, known in zip(names, numbers, identified, strict=True):
        lines.append(",".join([cell(name), *("" if value != value else f"{value:.12g}" for value in row), known]))
    return "\n".join(lines) + "\n"
