"""The series of a chart in which the sweep has ever more points: error of the drawn curve against their number.

Sweeps are made with one `curve_tolerance` after the other, harmonics and samples being the job's. Points of the finest
sweep are the truth, and the error is the distance of the curve that is drawn through the others' points from them,

    e = max over monitors and true points of min over the curve |((f - f_t) / (U f_t), (A - A_t) / max A_t)|,

U = 1e-3 being the unit of frequencies, as in the sweep's own control of its steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.file import LEAST_SHARE, SOLVED, Way
from attrito.charts.limited import within
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Options, Solver
from attrito.results.curve import Curve

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3)
FINEST = 1e-3
# Unit of frequencies across the curve; pieces of a line that a cubic between two points is drawn by
UNIT, PIECES = 1e-3, 64


@dataclass(frozen=True)
class _Sweep:
    """The curve of a sweep, whether each of its points is solved, seconds and counted work."""

    curve: Curve
    solved: np.ndarray
    seconds: float
    work: float


def curve_ways(
    comm: Comm,
    scene: ReducedScene,
    options: Options,
    points: Callable[[Solver], Iterator[Point]],
    limit: float = np.inf,
) -> Iterator[Way]:
    """Sweep with ever smaller tolerances of the drawn curve.

    Parameters
    ----------
    comm, scene, options : as of a `Solver`, on one process
    points : of the sweep, the static path before them
    limit : seconds after which a sweep is given up; the finest one, of which there are the most points, at three times
    """

    def swept(tolerance: float) -> _Sweep:
        return _swept(comm, scene, replace(options, curve_tolerance=tolerance), points)

    truth = within(3.0 * limit, lambda: swept(FINEST))
    if truth is None:
        yield Way("curve", f"{FINEST:g}", tolerance=FINEST, note=f"given up after {3.0 * limit:.0f} s", too_long=True)
        return
    for tolerance in TOLERANCES:
        one = within(limit, lambda tolerance=tolerance: swept(tolerance))
        if one is None:
            yield Way("curve", f"{tolerance:g}", tolerance=tolerance, note=f"given up after {limit:.0f} s")
            return
        way = Way("curve", f"{tolerance:g}", tolerance=tolerance, points=len(one.solved))
        yield replace(way, error=_distance(one, truth), seconds=one.seconds, work=one.work)


def _swept(comm: Comm, scene: ReducedScene, options: Options, points: Callable[[Solver], Iterator[Point]]) -> _Sweep:
    values, rates, path, solved = [], [], [], []
    heard: dict[str, float] = {}

    def hear(name: str, _: Series, value: np.ndarray) -> None:
        if value.ndim == 0:
            heard[name] = float(value)

    rates_of = ["/points/tangent_hz", *(f"/monitors/{name}/tangent" for name in scene.monitor_names)]
    with Solver(comm, scene, options) as solver:
        started = time.process_time()
        for point in points(solver):
            solver.report_point(hear)
            values.append([point.frequency_hz, *point.amplitude])
            rates.append([heard.get(name, np.nan) for name in rates_of])
            path.append(heard.get("/points/path", np.nan))
            solved.append(point.outcome in SOLVED)
        seconds, work = time.process_time() - started, point.work - solver.static_work
    curve = Curve(np.array(values).T, np.array(rates).T, np.array(path), scene.monitor_names)
    return _Sweep(curve, np.array(solved), seconds, work)


def _distance(one: _Sweep, truth: _Sweep) -> float:
    """Of the true points from the drawn curve: the largest, over all monitors."""
    joined = np.flatnonzero(one.solved[1:] & one.solved[:-1])
    if not len(joined) or not truth.solved.any():
        return np.nan
    drawn = np.stack([one.curve.at(np.linspace(i, i + 1, PIECES + 1)) for i in joined], axis=1)
    true = truth.curve.values[:, truth.solved]
    largest = true[1:].max(axis=1)
    largest = np.maximum(largest, LEAST_SHARE * largest.max())
    worst = 0.0
    for at in true.T:
        x = (drawn[0] - at[0]) / (UNIT * at[0])
        for monitor, scale in enumerate(largest, start=1):
            y = (drawn[monitor] - at[monitor]) / scale
            worst = max(worst, min(distance_to_line(*piece) for piece in zip(x, y, strict=True)))
    return worst


def distance_to_line(x: np.ndarray, y: np.ndarray) -> float:
    """Distance of the origin from a line through points `[n]`."""
    dx, dy = np.diff(x), np.diff(y)
    share = np.clip(-(x[:-1] * dx + y[:-1] * dy) / np.maximum(dx**2 + dy**2, 1e-300), 0, 1)
    return float(np.hypot(x[:-1] + share * dx, y[:-1] + share * dy).min())
