"""Derivatives by the parameters of `[sensitivity]` in a result: as a table of their own, and as columns of others."""

from __future__ import annotations

import json

import numpy as np

from attrito.results.result import Result
from attrito.support.csv_text import cell, numbers

# Of monitors, and of a point as a whole
OF_MONITORS = ("amplitude", "mean")
OF_POINTS = ("frequency_hz", "damping_ratio", "damping_ratio_structure")
# Towards smaller and larger parameters, where contacts are at the onset of slip
SIDES = ("below", "above")


def parameters_of(result: Result) -> list[str]:
    """Names of the parameters that a result has derivatives by."""
    if not result.has("/sensitivity/value"):
        return []
    names: list[str] = json.loads(result.attribute("job"))["sensitivity"]["to"]
    return names


def quantities_of(result: Result) -> list[str]:
    """Names of the quantities beside monitors that a result has derivatives of."""
    names: list[str] = json.loads(result.attribute("job"))["sensitivity"]["of"]
    return names if result.has("/sensitivity/quantities") else []


def derivatives_of(result: Result, side: str = "") -> tuple[list[str], np.ndarray]:
    """Quantities, as `tip_amplitude` or `frequency_hz`, and their derivatives `[points, quantities, parameters]`.

    Parameters
    ----------
    result : with derivatives
    side : one of `SIDES`, NaN where no contact is at the onset of slip; empty: the point as it is
    """
    folder = f"/sensitivity/{side}".rstrip("/")
    names: list[str] = []
    found: list[np.ndarray] = []
    monitors = {name: result.array(path) for name in OF_MONITORS if result.has(path := f"{folder}/{name}")}
    for i, monitor in enumerate(result.monitors):
        names += [f"{monitor}_{name}" for name in monitors]
        found += [values[:, :, i] for values in monitors.values()]
    if result.has(f"{folder}/quantities"):
        others = result.array(f"{folder}/quantities")
        names += quantities_of(result)
        found += [others[:, :, i] for i in range(others.shape[2])]
    for name in OF_POINTS:
        if result.has(f"{folder}/{name}"):
            names.append(name)
            found.append(result.array(f"{folder}/{name}"))
    shape = result.points, 0, len(parameters_of(result))
    return names, np.stack(found, axis=1) if found else np.empty(shape)


def sensitivity_columns(result: Result) -> tuple[np.ndarray, dict[str, list[str]]]:
    """The point of each line, and columns: one line a point, quantity and parameter.

    `point, frequency_hz, quantity, parameter, value, derivative`. `value` is the parameter's; blank where its contacts
    differ. No line if the job asked for none. Of a run also `below, above`, the derivatives on both sides of an
    onset of slip; blank where there is none.
    """
    parameters = parameters_of(result)
    names, derivatives = derivatives_of(result)
    point, number, parameter = (axis.ravel() for axis in np.indices(derivatives.shape))
    value = result.array("/sensitivity/value")[point, parameter] if parameters else np.empty(0)
    columns = {
        "point": list(map(str, point)),
        "frequency_hz": numbers(result.array("/points/frequency_hz")[point]),
        "quantity": [cell(names[index]) for index in number],
        "parameter": [cell(parameters[index]) for index in parameter],
        "value": numbers(value),
        "derivative": numbers(derivatives.ravel()),
    }
    for side in SIDES:
        if result.has(f"/sensitivity/{side}"):
            columns[side] = numbers(derivatives_of(result, side)[1].ravel())
    return point, columns


def derivative_columns(result: Result, short: dict[str, str]) -> list[tuple[str, list[str]]]:
    """Columns `SHORT by NAME` of a point's quantities, named by what they are called in short; none without any."""
    return [
        (cell(f"{words} by {parameter}"), numbers(result.array(f"/sensitivity/{name}")[:, i]))
        for i, parameter in enumerate(parameters_of(result))
        for words, name in short.items()
    ]
