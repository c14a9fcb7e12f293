"""Bounded least squares with intervals: residuals as functions of scaled parameters, whatever they are.

With residuals r of n numbers, p parameters x and the Jacobian J at the least sum of squares,

    cov x = s^2 (J^T J)^-1,    s^2 = r^T r / (n - p), or 1 where the deviations are known,

and a parameter's interval of 95 % is t(0.975, n - p) times its deviation to both sides (Seber & Wild, Nonlinear
Regression, 1989, section 5.1). A profile holds one parameter at a value and fits the others: its interval is where the
sum of squares is at most s^2 t^2 above the least (section 5.8). Both agree where the model is nearly linear in x over
the interval.

A search that creeps, steps bringing it less than ten times nearer each, ends where the minimum of the linear model is
within a thousandth of the confidence region's radius (Bates & Watts, A relative offset orthogonality convergence
criterion for nonlinear least squares, 1981), with Q the directions that J spans:

    sqrt(|Q^T r|^2 / p) < 1e-3 sqrt((|r|^2 - |Q^T r|^2) / (n - p))

What is beyond has no meaning beside the noise, and where solutions have many small corners it is not to be had.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm, t

# Residuals [n] and their Jacobian [n, p]
Residuals = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

PROBABILITY = 0.95
# Values of a profile, in deviations of the parameter
PROFILE_AT = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
# Part of the width between bounds that an interval may take for the data to identify a parameter
IDENTIFIED = 0.5
# Part of the largest singular value of J, its columns scaled, that counts as none
SINGULAR = 1e-6
# Part of the confidence region's radius within which a search may end where steps bring less than QUICK of it
OFFSET, QUICK = 1e-3, 0.1
# Correlation from which the data do not separate two parameters
ALIKE = 0.99


@dataclass(frozen=True)
class Estimate:
    """Where the sum of squares is least.

    Parameters
    ----------
    x, residuals, jacobian : `[p]`, `[n]`, `[n, p]`
    variance : s^2
    covariance : `[p, p]`; infinite variances of parameters along whose directions residuals do not change
    quantile : t, deviations from the estimate to either end of an interval
    converged : whether the search ended at a minimum
    evaluations : of residuals
    """

    x: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    variance: float
    covariance: np.ndarray
    quantile: float
    converged: bool
    evaluations: int

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations `[p]`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def intervals(self) -> np.ndarray:
        """Lower and upper ends `[p, 2]`, linear in x."""
        reach = self.quantile * self.deviations
        return np.column_stack([self.x - reach, self.x + reach])

    @property
    def correlation(self) -> np.ndarray:
        """Of the parameters `[p, p]`."""
        known = np.where(np.isfinite(self.deviations) & (self.deviations > 0.0), self.deviations, np.nan)
        return self.covariance / np.outer(known, known)


@dataclass(frozen=True)
class Profile:
    """One parameter at values x `[k]`, the others fitted: sums of squares `[k]`, and its interval, NaN where open."""

    x: np.ndarray
    cost: np.ndarray
    interval: tuple[float, float]


def estimate(residuals: Residuals, start: np.ndarray, bounds: np.ndarray, known_deviations: bool) -> Estimate:
    """Search from a start.

    Parameters
    ----------
    residuals : with their Jacobian
    start, bounds : `[p]`, `[p, 2]`
    known_deviations : whether residuals are in deviations that are known, not only in ratio to each other
    """
    memory = _Memory(residuals, bounds)
    x, converged = memory.search(start, xtol=1e-8, ftol=1e-10, gtol=1e-10)
    values, jacobian = memory.at(x)
    free = max(len(values) - len(x), 0)
    variance = 1.0 if known_deviations else float(values @ values) / free if free else np.inf
    quantile = norm.ppf(0.5 + 0.5 * PROBABILITY) if known_deviations else t.ppf(0.5 + 0.5 * PROBABILITY, max(free, 1))
    covariance = variance * _inverse(jacobian)
    return Estimate(x, values, jacobian, variance, covariance, float(quantile), converged, memory.count)


def profile(residuals: Residuals, best: Estimate, bounds: np.ndarray, parameter: int) -> Profile:
    """The least sum of squares at values of one parameter about the best.

    Parameters
    ----------
    residuals, best : of `estimate`
    bounds : `[p, 2]`
    parameter : its place among the p
    """
    others = np.arange(len(best.x)) != parameter
    at, cost = [best.x[parameter]], [float(best.residuals @ best.residuals)]
    deviation = best.deviations[parameter]
    low, high = bounds[parameter]
    if not np.isfinite(deviation) or deviation <= 0.0:
        return Profile(np.array(at), np.array(cost), (np.nan, np.nan))
    for side in (-1.0, 1.0):
        start = best.x
        for step in sorted(abs(step) for step in PROFILE_AT if step * side > 0.0):
            value = best.x[parameter] + side * step * deviation
            if not low <= value <= high:
                break
            start = start.copy()
            start[parameter] = value
            start, least = _held(residuals, start, bounds, others)
            at.append(value)
            cost.append(least)
    order = np.argsort(at)
    x, values = np.array(at)[order], np.array(cost)[order]
    limit = float(best.residuals @ best.residuals) + best.variance * best.quantile**2
    return Profile(x, values, _crossings(x, values, best.x[parameter], limit))


def _held(residuals: Residuals, start: np.ndarray, bounds: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, float]:
    """The least sum of squares with some parameters held, and where it is."""

    def full(x: np.ndarray) -> np.ndarray:
        whole = start.copy()
        whole[free] = x
        return whole

    def part(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, jacobian = residuals(full(x))
        return values, jacobian[:, free]

    if not np.any(free):
        values = residuals(start)[0]
        return start, float(values @ values)
    memory = _Memory(part, bounds[free])
    x, _ = memory.search(start[free])
    values = memory.values(x)
    return full(x), float(values @ values)


def _crossings(x: np.ndarray, cost: np.ndarray, centre: float, limit: float) -> tuple[float, float]:
    """Where the square root of the rise, which is straight of a linear model, crosses its limit to both sides."""
    least = cost[np.argmin(np.abs(x - centre))]
    height = np.sqrt(max(limit - least, 0.0))
    ends = []
    for side in (-1.0, 1.0):
        there = side * (x - centre) >= 0.0
        away = side * (x[there] - centre)
        order = np.argsort(away)
        rise = np.sqrt(np.maximum(cost[there][order] - least, 0.0))
        above = np.flatnonzero(rise >= height)
        if len(above) == 0 or above[0] == 0:
            ends.append(np.nan)
            continue
        i = above[0]
        part = (height - rise[i - 1]) / (rise[i] - rise[i - 1])
        ends.append(centre + side * (away[order][i - 1] + part * (away[order][i] - away[order][i - 1])))
    return ends[0], ends[1]


def _offset(residuals: np.ndarray, jacobian: np.ndarray) -> float:
    """How far the minimum is away, a part of the confidence region's radius; infinite where there is no such region."""
    scale = np.linalg.norm(jacobian, axis=0)
    directions, sizes, _ = np.linalg.svd(jacobian[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    along = directions[:, sizes > SINGULAR * sizes.max(initial=0.0)].T @ residuals
    free = len(residuals) - len(along)
    across = float(residuals @ residuals - along @ along)
    if free <= 0 or across <= 0.0 or len(along) == 0:
        return np.inf
    return float(np.sqrt(along @ along / len(along)) / np.sqrt(across / free))


def _inverse(jacobian: np.ndarray) -> np.ndarray:
    """(J^T J)^-1, by the singular values of J with columns of unit length.

    Parameters with a part in a direction along which residuals do not change have an infinite variance; those of the
    others are what they would be if such directions were held.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    seen = scale > 0.0
    scale = np.where(seen, scale, 1.0)
    _, sizes, directions = np.linalg.svd(jacobian / scale, full_matrices=True)
    sizes = np.pad(sizes, (0, len(scale) - len(sizes)))
    free = sizes <= SINGULAR * sizes.max(initial=0.0)
    known = directions[~free]
    inverse = known.T @ (known / sizes[~free, np.newaxis] ** 2) / np.outer(scale, scale)
    lost = ~seen | np.any(np.abs(directions[free]) > np.sqrt(SINGULAR), axis=0)
    inverse[lost, :] = inverse[:, lost] = 0.0
    inverse[lost, lost] = np.inf
    return np.asarray(inverse)


class _SettledError(Exception):
    """The search is near enough to the minimum."""


class _Memory:
    """The last residuals and Jacobian, which scipy asks for apart; the search within bounds `[p, 2]`."""

    def __init__(self, residuals: Residuals, bounds: np.ndarray):
        self._residuals, self._bounds = residuals, bounds
        self._at, self._found, self.count = np.empty(0), (np.empty(0), np.empty((0, 0))), 0
        self._offset = np.inf

    def search(self, start: np.ndarray, **tolerances: float) -> tuple[np.ndarray, bool]:
        """Where the sum of squares is least, and whether that is a minimum."""
        low, high = self._bounds.T
        try:
            found = least_squares(
                self.values, np.clip(start, low, high), self.jacobian, bounds=(low, high), x_scale="jac", **tolerances
            )
        except _SettledError:
            return self._at, True
        return found.x, found.status > 0

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if not np.array_equal(x, self._at):
            self._at, self._found = np.array(x), self._residuals(np.array(x))
            self.count += 1
        return self._found

    def values(self, x: np.ndarray) -> np.ndarray:
        return self.at(x)[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Asked for where a step was taken, so the best place so far: ends the search where that is enough."""
        values, jacobian = self.at(x)
        before, self._offset = self._offset, _offset(values, jacobian)
        if QUICK * before < self._offset < OFFSET:
            raise _SettledError
        return jacobian
