"""The last lines of a run: its peaks, each beside the linear one with stuck contacts, and how sure they are."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from attrito.results.result import Result

# Rows at most; the rest are counted
MOST_ROWS = 6
# The band to try reaches so far beyond the linear peaks, part of their frequencies
MARGIN = 0.15
# Per cent that are none
NEGLIGIBLE = 1e-3
HEADINGS = ("", "peak", "below stuck", "error", "")
BELOW_STUCK = '"below stuck": than the linear peak with all contacts stuck, at the same level'


@dataclass(frozen=True)
class Largest:
    """The largest amplitude of a monitor at a level.

    Parameters
    ----------
    monitor, level : where it is
    value, frequency_hz : half of the monitor's range, user length, and the frequency
    inside : are there solved points of the level at lower and at higher frequencies?
    alone : is it the only frequency of the level?
    below_stuck : part by which it is below the nearest linear peak with all contacts stuck; NaN: there is none
    error : its estimated relative error; NaN: none
    """

    monitor: str
    level: float
    value: float
    frequency_hz: float
    inside: bool
    alone: bool
    below_stuck: float
    error: float


def answer(result: Result) -> list[str]:
    """The lines; none without a monitor or a point that is solved."""
    found = [one for name in result.monitors for one in _of_monitor(result, name)]
    if not found:
        return []
    several = len({one.level for one in found}) > 1
    shown = found[:MOST_ROWS]
    rows = [_row(one, result.unit(f"/monitors/{one.monitor}/amplitude"), several) for one in shown]
    heading = list(HEADINGS) if all(one.inside for one in shown) else ["", "largest", *HEADINGS[2:]]
    # A column without anything in it says nothing.
    kept = [i for i in range(len(heading)) if i < 2 or any(row[i] for row in rows)]
    table = [[row[i] for i in kept] for row in (heading, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    align = ["<" if i in (0, 1, len(heading) - 1) else ">" for i in kept]
    lines = [
        "   ".join(f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True)).rstrip()
        for row in table
    ]
    if len(found) > MOST_ROWS:
        lines.append(f"and {len(found) - MOST_ROWS} more: attrito table {result.path}")
    if any(np.isfinite(one.below_stuck) for one in shown):
        lines.append(BELOW_STUCK)
    return lines + _band_to_try(result, found)


def _row(one: Largest, unit: str, several: bool) -> tuple[str, ...]:
    """Monitor, place, below stuck, error, level."""
    level = f"level {one.level:g}" if several or one.level != 1.0 else ""
    if one.value <= 0.0:
        return one.monitor, "does not move", "", "", level
    place = f"{_measured(one.value, unit)} at {one.frequency_hz:.5g} Hz"
    place += "" if one.inside or one.alone else ", the end"
    return one.monitor, place, _percent(one.below_stuck), _percent(one.error), level


def _of_monitor(result: Result, name: str) -> list[Largest]:
    """Of each level, in the order of the levels."""
    amplitude, solved = result.monitor(name, "amplitude"), result.converged
    levels, hertz = result.array("/points/level"), result.array("/points/frequency_hz")
    estimate = result.array("/points/estimate") if result.has("/points/estimate") else np.full(len(hertz), np.nan)
    found = []
    for level in dict.fromkeys(levels.tolist()):
        here = np.flatnonzero(solved & (levels == level) & np.isfinite(amplitude))
        if not len(here):
            continue
        top = here[np.argmax(amplitude[here])]
        at, low, high = float(hertz[top]), float(hertz[here].min()), float(hertz[here].max())
        peak = _stuck_peak(result, name, at) if low < at < high and level else np.nan
        below = 1.0 - float(amplitude[top]) / (level * peak)
        found.append(
            Largest(
                name, level, float(amplitude[top]), at, low < at < high, low == high, below, float(estimate[top])
            )
        )  # fmt: skip
    return found


def _stuck_peak(result: Result, name: str, at: float) -> float:
    """The linear peak with stuck contacts that is nearest to a frequency, at level 1; NaN if the band has none."""
    linear = result.linear("stuck", name)
    if linear is None:
        return float("nan")
    hertz, response = linear
    tops = 1 + np.flatnonzero((response[1:-1] > response[:-2]) & (response[1:-1] >= response[2:]))
    return float(response[tops[np.argmin(np.abs(hertz[tops] - at))]]) if len(tops) else float("nan")


def _band_to_try(result: Result, found: list[Largest]) -> list[str]:
    """Where the linear peaks are, if a sweep's band has no maximum inside and does not reach them."""
    sweep = json.loads(result.attribute("job")).get("sweep") or {}
    if any(one.inside or one.value <= 0.0 for one in found) or sweep.get("start_hz") is None:
        return []
    ends = sorted((sweep["start_hz"], sweep["stop_hz"]))
    nearest = {}
    for name in ("frictionless", "stuck"):
        path = f"/linear/{name}/natural_hz"
        natural = result.array(path) if result.has(path) else np.zeros(0)
        if natural.ndim == 1 and natural.size:
            nearest[name] = float(natural[np.argmin(np.abs(natural - found[0].frequency_hz))])
    if not nearest or all(ends[0] <= one <= ends[1] for one in nearest.values()):
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
    return f"{float(f'{hertz:.2g}'):.15g}" if hertz < 1e6 else f"{float(f'{hertz:.2g}'):.0f}"
