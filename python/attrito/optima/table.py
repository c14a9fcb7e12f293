"""The table of a search for the least peak: one row a sample, in the order of the search."""

from __future__ import annotations

import numpy as np

from attrito.support.csv_text import cell, numbers
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import is_of_format, stored

FORMAT = "attrito optimum"


def holds_optimum(path: str) -> bool:
    """Whether a file is that of `attrito optimise`."""
    return is_of_format(path, FORMAT)


def table(path: str) -> str:
    """CSV: `sample`, a column a parameter, `value`, the largest peak there (blank: none), and `least`.

    Raises
    ------
    InputError : the file lacks what that of a search has
    """
    with stored(path, "a file of `attrito optimise`") as file:
        if "tried/value" not in file or "tried/parameters" not in file:
            raise InputError(Fault(path, "tried/value", "absent", "a file of `attrito optimise`"))
        names = list(file["parameters"])
        tried = np.array([file[f"tried/parameters/{name}"][()] for name in names])
        value = file["tried/value"][()]
    best = int(np.nanargmin(value)) if np.any(np.isfinite(value)) else -1
    least = ["true" if i == best else "false" for i in range(len(value))]
    lines = [",".join(["sample", *map(cell, names), "value", "least"])]
    columns = [[str(i) for i in range(len(value))], *map(numbers, tried), numbers(value), least]
    lines += [",".join(row) for row in zip(*columns, strict=True)]
    return "\n".join(lines) + "\n"
