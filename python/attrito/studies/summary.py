"""What the file of a study says of all its samples together."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from attrito.studies.statistics import ACCEPTED
from attrito.studies.table import FORMAT
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, stored
from attrito.support.units import axis_unit

# What studies are of, as the files call it
KINDS = ("peaks", "response", "modes")


@dataclass(frozen=True)
class Bands:
    """A number over the samples, at each value of the parameter.

    Parameters
    ----------
    unit : of the number
    samples : `[samples, n]`
    mean, deviation : `[n]`
    quantiles : `[quantiles, n]`
    error : of a model, the largest of some solved samples, relative, `[n]`; None: not known, or all are solved
    """

    unit: str
    samples: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray
    quantiles: np.ndarray
    error: np.ndarray | None


@dataclass(frozen=True)
class Summary:
    """A study.

    Parameters
    ----------
    path : the file
    of : one of `KINDS`
    study : its keys
    attributes : texts at the root of the file
    parameter, at : what the samples are located at, and its values `[n]`
    values : of each quantity that is varied, `[samples]`
    probabilities : of the quantiles
    bands : by the names of the numbers
    outcomes, methods : how often samples ended, and were found, in each way
    """

    path: str
    of: str
    study: dict[str, Any]
    attributes: dict[str, str]
    parameter: str
    at: np.ndarray
    values: dict[str, np.ndarray]
    probabilities: np.ndarray
    bands: dict[str, Bands]
    outcomes: Counter[str]
    methods: Counter[str]

    def attribute(self, name: str) -> str:
        """A text at the root of the file; empty where it has none."""
        return self.attributes.get(name, "")

    @property
    def samples(self) -> int:
        """How many there are."""
        return len(next(iter(self.bands.values())).samples)

    @property
    def is_modelled(self) -> bool:
        """Whether most samples come from a model through few that are solved."""
        return str(self.study.get("design")) in ("first_order", "second_order")

    @property
    def design(self) -> str:
        """How samples were chosen, in words: `latin hypercube`."""
        return str(self.study.get("design", "study")).replace("_", " ")

    @property
    def holds(self) -> bool:
        """Whether a model, if there is one, is near the samples that were solved beside it."""
        errors = [bands.error for bands in self.bands.values() if bands.error is not None]
        return all(bool(np.all(error <= ACCEPTED)) for error in errors)


def read_summary(path: str) -> Summary:
    """Read the file of a study.

    Raises
    ------
    InputError : it is not there, or lacks what a study's file of this version has
    """
    expected = "a file of `attrito study`"
    with stored(path, expected) as file:
        if as_text(file.attrs.get("format", "")) != FORMAT:
            raise InputError(Fault(path, "format", as_text(file.attrs.get("format", "absent")), expected))
        of = next((name for name in KINDS if name in file), "peaks")
        for name in ("parameter", "mean", "quantiles/probability", f"{of}/outcome"):
            if name not in file:
                raise InputError(Fault(path, name, "absent", f"{expected} of this version"))
        attributes = {name: as_text(value) for name, value in file.attrs.items() if np.ndim(value) == 0}
        units = attributes.get("units", "")
        return Summary(
            path,
            of,
            json.loads(attributes.get("study", "{}")),
            attributes,
            attributes.get("parameter", "parameter"),
            file["parameter"][()],
            {name: dataset[()] for name, dataset in file.get("values", {}).items()},
            file["quantiles/probability"][()],
            {name: _bands(file, of, name, units) for name in file["mean"]},
            _counted(file[f"{of}/outcome"]),
            _counted(file[f"{of}/method"]) if f"{of}/method" in file else Counter(),
        )


def _bands(file: h5py.File, of: str, name: str, units: str) -> Bands:
    stated, error = file[f"{of}/{name}"], file.get("response/model_error", file.get(f"model_error/{name}"))
    return Bands(
        axis_unit(as_text(stated.attrs.get("unit", "1")), units),
        stated[()],
        *(file[f"{place}/{name}"][()] for place in ("mean", "deviation", "quantiles")),
        None if error is None else error[()],
    )


def _counted(dataset: h5py.Dataset) -> Counter[str]:
    """How often each of the names that numbers stand for occurs."""
    names = [as_text(name) for name in dataset.attrs.get("names", ())]
    return Counter(names[number] for number in dataset[()].ravel().tolist())
