"""Second-order models of what is located for each sample, from values at few solved ones.

Of p quantities that lie uniformly between bounds, x_i = -1 ... 1 about their middle,

    f(x) = f_0 + sum_i g_i x_i + 1/2 sum_ij h_ij x_i x_j

goes through (p + 1)(p + 2)/2 solved nodes: the middle, two on each axis at +-sqrt(3/5), the nodes of Gauss's rule of
three points, which give f's mean exactly to the fifth degree along each axis, and one for each pair of quantities.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

NODE = np.sqrt(3.0 / 5.0)


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
