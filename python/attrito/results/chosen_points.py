"""The point of a result that is meant: the one asked for, or that of the largest amplitude."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from attrito.results.result import CAMPBELL, LINEAR_MODES, MODE, Result
from attrito.support.errors import Fault, InputError


def chosen_point(result: Result, point: int | None, monitor: str, levels: Sequence[float] | None = None) -> int:
    """A point that holds a solution: the one asked for, or that of the largest amplitude (among some levels)."""
    if point is not None:
        result.check_point(point)
        if not result.converged[point]:
            outcome = result.outcome[point]
            raise InputError(Fault(result.path, "--point", f"{point}, {outcome}", "a point with a solution"))
        return point
    if not result.monitors and result.attribute("format") == MODE:
        return _last_solved(result)
    amplitude = result.monitor(monitor, "amplitude")
    if levels:
        level = result.array("/points/level")
        own = np.isclose(level[:, None], np.asarray(levels, dtype=float), rtol=1e-6, atol=0.0).any(axis=1)
        if not own.any():
            known = ", ".join(f"{one:.6g}" for one in np.unique(level))
            raise InputError(Fault(result.path, "level", list(levels), f"one of {known}"))
        amplitude = np.where(own, amplitude, np.nan)
    if not np.any(np.isfinite(amplitude)):
        raise InputError(Fault(result.path, "points", len(amplitude), "at least one converged point"))
    return int(np.nanargmax(amplitude))


def chosen_points(
    result: Result, points: Sequence[int] | None = None, mode: int | None = None, monitor: str | None = None
) -> list[int]:
    """The points asked for, or that of the largest amplitude; of modes the one asked for.

    Parameters
    ----------
    result : of a run, of linear modes or of a nonlinear mode
    points : counted from 0
    mode : of linear modes, counted from 1, which have no points; of a nonlinear mode the number of a point
    monitor : whose largest amplitude is meant; None: the first
    """
    form = result.attribute("format")
    if form == CAMPBELL:
        raise InputError(Fault(result.path, "format", form, "a result of `attrito run`, `mode` or `linear-modes`"))
    if form == LINEAR_MODES:
        count = result.points
        if points is not None or mode is None or not 1 <= mode <= count:
            shown = "not given" if mode is None else mode
            key, given = ("--points", _listed(points)) if points is not None else ("--mode", shown)
            raise InputError(Fault(result.path, key, given, f"--mode and a number from 1 to {count}"))
        return [mode - 1]
    if form == MODE and mode is not None:
        return [chosen_point(result, mode, "")]
    if mode is not None:
        raise InputError(Fault(result.path, "--mode", mode, "a file of `attrito linear-modes` or `attrito mode`"))
    if form == MODE and points is None:
        return [_last_solved(result)]
    if monitor is not None and monitor not in result.monitors:
        raise InputError(Fault(result.path, "--monitor", monitor, "one of " + ", ".join(result.monitors)))
    if points is None:
        return [chosen_point(result, None, monitor or result.monitors[0])]
    return [chosen_point(result, point, "") for point in points]


def _last_solved(result: Result) -> int:
    """Of a nonlinear mode the point of the largest amplitude, since amplitudes rise along its points."""
    solved = np.flatnonzero(result.converged)
    if not len(solved):
        raise InputError(Fault(result.path, "points", result.points, "at least one converged point"))
    return int(solved[-1])


def _listed(points: Sequence[int]) -> str:
    return ", ".join(map(str, points))
