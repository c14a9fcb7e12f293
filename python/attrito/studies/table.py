"""The table of a study: one row a sample and value of its parameter."""

from __future__ import annotations

import numpy as np

from attrito.support.csv_text import cell, numbers
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, is_of_format, stored

FORMAT = "attrito study"


def holds_study(path: str) -> bool:
    """Whether a file is that of a study."""
    return is_of_format(path, FORMAT)


def table(path: str) -> str:
    """CSV: `sample`, what was varied, `level`, `preload` or `amplitude`, then what was found and its `outcome`.

    Raises
    ------
    InputError : the file lacks what a study's has
    """
    with stored(path, "a file of `attrito study`") as file:
        of = "modes" if "modes" in file else "peaks"
        if of not in file or "parameter" not in file or "outcome" not in file[of]:
            raise InputError(Fault(path, of, "absent", "a file of `attrito study`"))
        samples, count = file[f"{of}/outcome"].shape
        parameter = as_text(file.attrs.get("parameter", "parameter"))
        columns = {"sample": [str(sample) for sample in np.repeat(np.arange(samples), count)]}
        for name, dataset in file.get("values", {}).items():
            columns[name] = numbers(np.repeat(dataset[()], count))
        columns[parameter] = numbers(np.tile(file["parameter"][()], samples))
        for name, dataset in file[of].items():
            names = [as_text(one) for one in dataset.attrs.get("names", ())]
            if dataset.shape == (samples, count) and not (name == parameter and of == "peaks"):
                values = dataset[()].ravel()
                shown = f"peak_{name}" if name in columns else name
                columns[shown] = [cell(names[value]) for value in values] if names else numbers(values)
            elif dataset.shape == (samples,):
                columns[name] = numbers(np.repeat(dataset[()], count))
    lines = [",".join(map(cell, columns)), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    return "\n".join(lines) + "\n"
