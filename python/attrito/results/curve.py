"""The drawn curve of a result: between neighbouring points of a sweep a cubic, by their values and tangents (Hermite).

Frequency and amplitudes are cubics of the length along the branch, `/points/path`, by which they change at rates of
`/points/tangent_hz` and `/monitors/<name>/tangent`. Where there are no tangents (listed frequencies) it is straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.results.result import Result
from attrito.support.errors import Fault, InputError


@dataclass(frozen=True)
class Curve:
    """What the curve of a result is made of; places on it are `point + part`, part from 0 to 1 towards the next point.

    Parameters
    ----------
    values : frequency in Hz, then the monitors' amplitudes in the job's order, `[1 + monitors, points]`
    rates : their changes along the curve
    path : length along the curve, `[points]`
    monitors : names
    floor : no value of a monitor is drawn below it
    """

    values: np.ndarray
    rates: np.ndarray
    path: np.ndarray
    monitors: list[str]
    floor: float = 0.0

    def is_bent(self, point: int) -> bool:
        """Whether a cubic leads from a point to the next one."""
        known = (
            np.isfinite(self.values[:, point : point + 2]).all() and np.isfinite(self.rates[:, point : point + 2]).all()
        )
        return bool(known and self.path[point + 1] > self.path[point])

    def at(self, places: np.ndarray) -> np.ndarray:
        """Frequency and amplitudes at places between points of one stretch, `[1 + monitors, places]`."""
        first = np.minimum(places.astype(int), max(len(self.path) - 2, 0))
        second = np.minimum(first + 1, len(self.path) - 1)
        t = places - first
        straight = (1 - t) * self.values[:, first] + t * self.values[:, second]
        straight = np.where(t == 0, self.values[:, first], np.where(t == 1, self.values[:, second], straight))
        length = self.path[second] - self.path[first]
        bent = (1 + 2 * t) * (1 - t) ** 2 * self.values[:, first] + t**2 * (3 - 2 * t) * self.values[:, second]
        bent += length * t * (1 - t) * ((1 - t) * self.rates[:, first] - t * self.rates[:, second])
        bent[1:] = np.maximum(bent[1:], self.floor)
        return np.where((length > 0) & np.isfinite(bent) & (t > 0) & (t < 1), bent, straight)


def curve_of(result: Result) -> Curve:
    """The curve of a result; blank where points have no solution."""
    points, monitors = result.points, result.monitors
    values = [result.array("/points/frequency_hz"), *(result.monitor(name, "amplitude") for name in monitors)]
    blank = np.full(points, np.nan)
    tangents = ["/points/tangent_hz", *(f"/monitors/{name}/tangent" for name in monitors)]
    rates = [result.array(path) if result.has(path) else blank for path in tangents]
    path = result.array("/points/path") if result.has("/points/path") else blank
    solved = np.where(result.converged, 1.0, np.nan)
    return Curve(np.array([values[0], *(solved * one for one in values[1:])]), np.array(rates), path, monitors)


def stretches(result: Result) -> list[np.ndarray]:
    """Numbers of the points of each connected stretch: one level and branch, one after another, all with a solution."""
    level, branch, solved = result.array("/points/level"), result.array("/points/branch"), result.converged
    joined = (level[1:] == level[:-1]) & (branch[1:] == branch[:-1]) & solved[1:] & solved[:-1]
    cuts = np.flatnonzero(~joined) + 1
    return [run for run in np.split(np.arange(result.points), cuts) if len(run) and solved[run[0]]]


def points_along(result: Result, count: int) -> np.ndarray:
    """So many places along the curves of a result, denser where points are, at least both ends of every stretch.

    Raises
    ------
    InputError : fewer than the ends of all stretches
    """
    runs = stretches(result)
    least = np.array([min(len(run), 2) for run in runs], dtype=int)
    if count < least.sum():
        raise InputError(Fault(result.path, "--curve", count, f"at least {least.sum()}, the ends of all stretches"))
    extra = np.array([len(run) - 1.0 for run in runs])
    share = (count - least.sum()) * extra / max(extra.sum(), 1.0)
    counts = least + np.floor(share).astype(int)
    if extra.sum() > 0:
        # What rounding has left goes to those that it took most from.
        counts[np.argsort(np.floor(share) - share, kind="stable")[: count - counts.sum()]] += 1
    return np.concatenate([np.linspace(run[0], run[-1], n) for run, n in zip(runs, counts, strict=True)] or [[]])
