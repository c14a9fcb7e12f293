"""The last lines of a run: its peaks, each beside the linear one with stuck contacts, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.results.result import Result

# Rows at most; the rest are counted
MOST_ROWS = 6
# The band to try reaches so far beyond the linear peaks, part of their frequencies
MARGIN = 0.15
# Per cent that are none
NEGLIGIBLE = 1e-3


@dataclass(frozen=True)
class Largest:
    """The largest amplitude of a monitor at a level.

    Parameters
    ----------
    monitor, level : where it is
    value, frequency_hz : half of the monitor's range, user length, and the frequency
    inside : does the response fall on both sides, over the points of its branch?
    below_stuck : part by which it is below the linear peak with all contacts stuck; NaN: not known
    error : its estimated relative error; NaN: none
    """

    monitor: str
    level: float
    value: float
    frequency_hz: float
    inside: bool
    below_stuck: float
    error: float


def answer(result: Result) -> list[str]:
    """The lines; none without a monitor or a point that is solved."""
    found = [one for name in result.monitors for one in _of_monitor(result, name)]
    if not found:
        return []
    unit = {name: result.unit(f"/monitors/{name}/amplitude") for name in result.monitors}
    levels = {one.level for one in found}
    rows = [("", "peak" if all(one.inside for one in found) else "largest", "below stuck", "error", "")]
    for one in found[:MOST_ROWS]:
        level = f"level {one.level:g}" if len(levels) > 1 or one.level != 1.0 else ""
        place = f"{_measured(one.value, unit[one.monitor])} at {one.frequency_hz:.5g} Hz"
        place += "" if one.inside else ", the end"
        rows.append((one.monitor, place, _percent(one.below_stuck), _percent(one.error), level))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    align = ("<", "<", ">", ">", "<")
    lines = ["   ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True)).rstrip()
             for row in rows]  # fmt: skip
    if len(found) > MOST_ROWS:
        lines.append(f"and {len(found) - MOST_ROWS} more: attrito table {result.path}")
    if any(np.isfinite(one.below_stuck) for one in found[:MOST_ROWS]):
        lines.append('"below stuck": than the linear peak with all contacts stuck, at the same level')
    return lines + _band_to_try(result, found)


def _of_monitor(result: Result, name: str) -> list[Largest]:
    """Of each level, in the order of the levels."""
    amplitude, solved = result.monitor(name, "amplitude"), result.converged
    levels, hertz, branch = (result.array(f"/points/{what}") for what in ("level", "frequency_hz", "branch"))
    estimate = result.array("/points/estimate") if result.has("/points/estimate") else np.full(len(hertz), np.nan)
    linear = result.linear("stuck", name)
    found = []
    for level in dict.fromkeys(levels.tolist()):
        here = np.flatnonzero(solved & (levels == level) & np.isfinite(amplitude))
        if not len(here):
            continue
        top = here[np.argmax(amplitude[here])]
        along = here[branch[here] == branch[top]]
        inside = top not in (along[0], along[-1])
        below = np.nan
        if inside and linear is not None and level and 0 < np.argmax(linear[1]) < len(linear[1]) - 1:
            below = 1.0 - amplitude[top] / (level * linear[1].max())
        found.append(
            Largest(
                name, level, float(amplitude[top]), float(hertz[top]), bool(inside),
                float(below), float(estimate[top])
            )
        )  # fmt: skip
    return found


def _band_to_try(result: Result, found: list[Largest]) -> list[str]:
    """Where the linear peaks are, if no maximum lies inside the band of a sweep."""
    hertz = result.array("/points/frequency_hz")
    if any(one.inside for one in found) or len(np.unique(hertz)) < 3:
        return []
    at = found[0].frequency_hz
    nearest = {}
    for name in ("frictionless", "stuck"):
        path = f"/linear/{name}/natural_hz"
        natural = result.array(path) if result.has(path) else np.zeros(0)
        if natural.ndim == 1 and natural.size:
            nearest[name] = float(natural[np.argmin(np.abs(natural - at))])
    if not nearest:
        return []
    words = " and ".join(f"{value:.4g} Hz ({name})" for name, value in nearest.items())
    low, high = (1.0 - MARGIN) * min(nearest.values()), (1.0 + MARGIN) * max(nearest.values())
    return [f"The nearest linear peaks are at {words}. Sweep from {_round(low)} to {_round(high)} Hz."]


def _measured(value: float, unit: str) -> str:
    """`1.17 mm`; the user's own unit has no name."""
    return f"{value:.3g}" if "," in unit else f"{value:.3g} {unit}".rstrip()


def _percent(part: float) -> str:
    """`12 %`, `0.034 %`; empty if it is not known."""
    if not np.isfinite(part):
        return ""
    percent = 100.0 * abs(part)
    words = f"{percent:.0f}" if percent >= 10.0 else f"{percent:.2g}" if percent >= NEGLIGIBLE else "0"
    return f"{words} %" + (" above" if part < 0.0 and words != "0" else "")


def _round(hertz: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{hertz:.2g}'):g}"
