"""Second-order models of what is located for each sample, from few solved ones.

Of p quantities that lie uniformly between bounds, x_i = -1 ... 1 about their middle,

    f(x) = f_0 + sum_i g_i x_i + 1/2 sum_ij h_ij x_i x_j

goes through (p + 1)(p + 2)/2 solved nodes: the middle, two on each axis at +-sqrt(3/5), the nodes of Gauss's rule of
three points, which give f's mean exactly to the fifth degree along each axis, and one for each pair of quantities.
Further samples are solved to see how far the model is from them: kinks, as at the onset of slip, and peaks that change
places are what it cannot have.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

NODE = np.sqrt(3.0 / 5.0)
# Samples that are solved beside the nodes
MOST_CHECKED = 4
# Relative difference from these beyond which the model is said not to hold
ACCEPTED = 0.05


def nodes(count: int) -> np.ndarray:
    """Places of the solved nodes for so many quantities, `[nodes, count]`, from -1 to 1."""
    axes = np.eye(count)
    pairs = [axes[i] + axes[j] for i, j in combinations(range(count), 2)]
    return NODE * np.array([np.zeros(count), *axes, *-axes, *pairs]).reshape(-1, count)


def model(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The model through values at the nodes `[nodes, ...]`, at other places `[n, count]`: `[n, ...]`."""
    count = places.shape[1]
    middle, above, below = values[0], values[1 : count + 1], values[count + 1 : 2 * count + 1]
    at = np.asarray(places)
    found = np.broadcast_to(middle, (len(at), *middle.shape)).copy()
    for i in range(count):
        slope, bend = (above[i] - below[i]) / (2.0 * NODE), (above[i] + below[i] - 2.0 * middle) / NODE**2
        found += np.multiply.outer(at[:, i], slope) + np.multiply.outer(0.5 * at[:, i] ** 2, bend)
    for k, (i, j) in enumerate(combinations(range(count), 2), 2 * count + 1):
        mixed = (values[k] - above[i] - above[j] + middle) / NODE**2
        found += np.multiply.outer(at[:, i] * at[:, j], mixed)
    return found


def rows_of(solved: list[list[dict[str, Any]]], places: np.ndarray) -> list[list[dict[str, Any]]]:
    """What a file has of samples at some places `[n, count]`, from the rows of the nodes, `[nodes][stops]`.

    Numbers come from the model; contacts' states are not known, -1.
    """
    first = solved[0]
    names = [name for name, value in first[0].items() if isinstance(value, float)]
    numbers = {
        name: model(np.array([[one[name] for one in row] for row in solved], dtype=float), places) for name in names
    }
    # What is wrong with one node may be so with all that go through it.
    outcomes = [
        next((row[stop]["outcome"] for row in solved if row[stop]["outcome"] != "converged"), "converged")
        for stop in range(len(first))
    ]
    rows = []
    for sample in range(len(places)):
        row = []
        for stop, one in enumerate(first):
            own = {name: float(numbers[name][sample, stop]) for name in names}
            row.append(one | own | {"states": [-1] * 4, "method": "second_order", "outcome": outcomes[stop]})
        rows.append(row)
    return rows


def largest_difference(solved: list[list[dict[str, Any]]], modelled: list[list[dict[str, Any]]], name: str) -> float:
    """Of a number over samples `[samples][stops]`, relative; infinite where one has not been solved."""
    pairs = [
        (one[name], other[name])
        for row, beside in zip(solved, modelled, strict=True)
        for one, other in zip(row, beside, strict=True)
    ]
    if any(one is None for one, _ in pairs):
        return float("inf")
    return max(abs(other / one - 1.0) for one, other in pairs)
