"""Models of what is located for each sample, of first or second order, from values and gradients at few nodes.

Of p quantities that lie uniformly between bounds, x_i = -1 ... 1 about their middle,

    f(x) = f_0 + sum_i g_i x_i + 1/2 sum_ij h_ij x_i x_j,     df/dx_i = g_i + sum_j h_ij x_j

by least squares through f and df/dx at all nodes: the Hessian is that of differences of gradients. Nodes are those of
Stroud's rules for the mean over a cube, of equal weights, p + 1 of second degree or 2 p, in pairs about the middle, of
third degree (A. H. Stroud, Math. Tables Aids Comput. 11 (1957) 257-261, doi:10.2307/2001945): all lie inside, and their
mean square along each axis is that of the samples. With pairs, third derivatives change no number of the Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np


def gradient_nodes(count: int, central: bool = False) -> np.ndarray:
    """Places of the nodes for so many quantities, `[nodes, count]`, from -1 to 1; `central`: in pairs."""
    nodes = 2 * count if central else count + 1
    at = np.arange(1, nodes + 1)
    places = np.empty((nodes, count))
    for r in range(1, count // 2 + 1):
        angle = (2 * r - 1) * at * np.pi / count if central else 2 * r * at * np.pi / nodes
        places[:, 2 * r - 2], places[:, 2 * r - 1] = np.cos(angle), np.sin(angle)
    places *= np.sqrt(2.0 / 3.0)
    if count % 2:
        places[:, -1] = (-1.0) ** at / np.sqrt(3.0)
    return places


@dataclass(frozen=True)
class Expansion:
    """A model of some numbers.

    Parameters
    ----------
    order : 1 or 2
    terms : coefficients of 1, x_i and, of second order, x_i x_j, `[terms, ...]`
    """

    order: int
    terms: np.ndarray

    def at(self, places: np.ndarray) -> np.ndarray:
        """At places `[n, count]`: `[n, ...]`."""
        return np.tensordot(_basis(places, self.order), self.terms, 1)

    def slopes(self, places: np.ndarray) -> np.ndarray:
        """Derivatives there, `[n, ..., count]`."""
        return np.stack([np.tensordot(rows, self.terms, 1) for rows in _slopes(places, self.order)], axis=-1)


def expand(nodes: np.ndarray, values: np.ndarray, gradients: np.ndarray, order: int = 2) -> Expansion:
    """The model through values and gradients.

    Of numbers without gradients it is the plane through the values, of one node its value.

    Parameters
    ----------
    nodes : `[nodes, count]`
    values, gradients : there, `[nodes, ...]` and `[nodes, ..., count]`, by x; NaN: not known
    order : of the model
    """
    shape, count = values.shape[1:], nodes.shape[1]
    values, gradients = values.reshape(len(nodes), -1), gradients.reshape(len(nodes), -1, count)
    sloped = np.isfinite(gradients).all(axis=(0, 2))
    rows = np.vstack([_basis(nodes, order), *_slopes(nodes, order)])
    right = np.concatenate([values[:, sloped], *np.moveaxis(gradients[:, sloped], 2, 0)])
    terms = np.zeros((rows.shape[1], values.shape[1]))
    terms[:, sloped] = np.linalg.lstsq(rows, right, rcond=None)[0]
    terms[: count + 1, ~sloped] = np.linalg.lstsq(_basis(nodes, 1), values[:, ~sloped], rcond=None)[0]
    return Expansion(order, terms.reshape(-1, *shape))


def _basis(at: np.ndarray, order: int) -> np.ndarray:
    """1, x_i and, of second order, x_i x_j at places, `[n, terms]`."""
    pairs = combinations_with_replacement(range(at.shape[1]), 2) if order == 2 else ()
    return np.column_stack([np.ones(len(at)), at, *(at[:, i] * at[:, j] for i, j in pairs)])


def _slopes(at: np.ndarray, order: int) -> list[np.ndarray]:
    """Derivatives of these terms by each quantity, `[n, terms]`."""
    found = []
    for k in range(at.shape[1]):
        pairs = combinations_with_replacement(range(at.shape[1]), 2) if order == 2 else ()
        bends = [(i == k) * at[:, j] + (j == k) * at[:, i] for i, j in pairs]
        found.append(np.column_stack([np.zeros(len(at)), np.tile(np.eye(at.shape[1])[k], (len(at), 1)), *bends]))
    return found
