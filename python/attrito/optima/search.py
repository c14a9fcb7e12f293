"""Least values of a function within bounds, by few evaluations.

Of one variable by Brent's method on the interval (scipy `minimize_scalar`, bounded): it needs no slope, so plateaus
where all contacts stick, and corners where two levels change places, do not end it early. Of several variables the
largest of some functions is made least with their gradients (`minimize`, SLSQP), as the least t with f_i(x) <= t, from
the best of some points spread between the bounds. Gradients that are not known are differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.stats import qmc

# Step of a difference where there is no gradient
STEP = 1e-4
# Values [k] and their gradients [k, n] of the functions at a point [n] between 0 and 1; NaN: not known
Functions = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Least:
    """Where the largest of the functions is least.

    Parameters
    ----------
    x, value : `[n]`, and the largest of the functions there
    converged : whether the search ended by its tolerance, not by the number of evaluations
    tried : points and the largest values there, in the order of evaluation, `[evaluations, n + 1]`
    """

    x: np.ndarray
    value: float
    converged: bool
    tried: np.ndarray


class _OutOfEvaluationsError(Exception):
    """The number of evaluations is used up."""


def least(functions: Functions, variables: int, most: int, tolerance: float, seed: int) -> Least:
    """Search between 0 and 1.

    Parameters
    ----------
    functions : the largest of these counts
    variables : n
    most : evaluations
    tolerance : in x
    seed : of the points that several variables begin at
    """
    known = _Known(functions, most)
    converged = True
    try:
        if variables == 1:
            minimize_scalar(lambda x: known.largest(np.array([x])), bounds=(0.0, 1.0), method="bounded",
                            options={"xatol": tolerance})  # fmt: skip
        else:
            converged = _several(known, variables, tolerance, seed)
    except _OutOfEvaluationsError:
        converged = False
    tried = np.array(known.tried)
    best = tried[np.nanargmin(tried[:, -1])] if np.any(np.isfinite(tried[:, -1])) else tried[0]
    return Least(best[:-1], float(best[-1]), converged and bool(np.isfinite(best[-1])), tried)


def _several(known: _Known, variables: int, tolerance: float, seed: int) -> bool:
    """Several variables; whether the search came to its end."""
    spread = qmc.LatinHypercube(variables, seed=np.random.default_rng(seed)).random(2 * variables)
    starts = [np.full(variables, 0.5), *spread]
    start = min(starts, key=known.largest)
    size = known.largest(start)
    found = minimize(
        lambda z: z[-1],
        np.append(start, 1.0),
        jac=lambda z: np.append(np.zeros(variables), 1.0),
        bounds=[(0.0, 1.0)] * variables + [(None, None)],
        constraints={
            "type": "ineq",
            "fun": lambda z: z[-1] - known.at(z[:-1]) / size,
            "jac": lambda z: np.column_stack([-known.gradients(z[:-1]) / size, np.ones(len(known.at(z[:-1])))]),
        },
        method="SLSQP",
        options={"ftol": tolerance**2},
    )
    return bool(found.success)


class _Known:
    """Evaluations, each made once; where there is no value the functions count as very large."""

    def __init__(self, functions: Functions, most: int):
        self._functions, self._most = functions, most
        # Values, gradients, and which have no value
        self._found: dict[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self.tried: list[np.ndarray] = []

    def at(self, x: np.ndarray) -> np.ndarray:
        """Values, `[k]`."""
        return self._evaluated(x)[0]

    def gradients(self, x: np.ndarray) -> np.ndarray:
        """Gradients, `[k, n]`: differences where they are not known, zero where a function has no value."""
        x = np.clip(x, 0.0, 1.0)
        values, gradients, lost = self._evaluated(x)
        found = np.where(lost[:, np.newaxis], 0.0, gradients)
        for i in np.flatnonzero(~np.isfinite(found).all(axis=0)):
            beside = x.copy()
            beside[i] += STEP if x[i] + STEP <= 1.0 else -STEP
            there, _, lost_there = self._evaluated(beside)
            slope = np.where(lost_there, 0.0, (there - values) / (beside[i] - x[i]))
            found[:, i] = np.where(np.isfinite(found[:, i]), found[:, i], slope)
        return found

    def largest(self, x: np.ndarray) -> float:
        return float(self.at(x).max())

    def _evaluated(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        x = np.clip(x, 0.0, 1.0)
        key = x.tobytes()
        if key not in self._found:
            if len(self._found) >= self._most:
                raise _OutOfEvaluationsError
            values, gradients = self._functions(x)
            self.tried.append(np.append(x, values.max() if np.all(np.isfinite(values)) else np.nan))
            known = [row[-1] for row in self.tried if np.isfinite(row[-1])]
            lost = ~np.isfinite(values)
            self._found[key] = np.where(lost, 10.0 * max(known, default=1.0), values), gradients, lost
        return self._found[key]
