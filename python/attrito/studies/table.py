"""Tables of a study: one row a sample and value of its parameter, or one row a value with the bands of all samples."""

from __future__ import annotations

import numpy as np

from attrito.support.csv_text import cell, numbers
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, is_of_format, stored

FORMAT = "attrito study"


def holds_study(path: str) -> bool:
    """Whether a file is that of a study."""
    return is_of_format(path, FORMAT)


def band_table(path: str) -> str:
    """CSV: `level`, `preload` or `amplitude`, then mean, deviation and quantiles over the samples of each number.

    Raises
    ------
    InputError : the file lacks what a study's has
    """
    with stored(path, "a file of `attrito study`") as file:
        if "parameter" not in file or "mean" not in file:
            raise InputError(Fault(path, "mean", "absent", "a file of `attrito study` of this version"))
        columns = {as_text(file.attrs.get("parameter", "parameter")): numbers(file["parameter"][()])}
        for name in file["mean"]:
            shown = f"peak_{name}" if name in columns else name
            for moment in ("mean", "deviation"):
                columns[f"{shown}_{moment}"] = numbers(file[f"{moment}/{name}"][()])
            for probability, row in zip(file["quantiles/probability"][()], file[f"quantiles/{name}"][()], strict=True):
                columns[f"{shown}_{100.0 * probability:02.0f}"] = numbers(row)
    lines = [",".join(map(cell, columns)), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    return "\n".join(lines) + "\n"


def table(path: str) -> str:
    """CSV: `sample`, what was varied, `level`, `preload` or `amplitude`, then what was found and its `outcome`.

    Raises
    ------
    InputError : the file lacks what a study's has
    """
    with stored(path, "a file of `attrito study`") as file:
        of = next((name for name in ("modes", "response") if name in file), "peaks")
        if of not in file or "parameter" not in file or "outcome" not in file[of]:
            raise InputError(Fault(path, of, "absent", "a file of `attrito study`"))
        samples, count = len(file[f"{of}/outcome"]), len(file["parameter"])
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
