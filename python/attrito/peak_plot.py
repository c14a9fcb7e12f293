"""The picture of `attrito peak`: the optimisation curve, and the frequency of the peak along it."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.peak_file import KINDS, read_peaks, smooth_curve
from attrito.plots import BRANCH_COLOURS, STYLE
from attrito.solver import OUTCOMES

STUCK_COLOUR = "#8a8a8a"


def peak_curve(path: str) -> Figure:
    """Amplitude of the peak (by level, where that is followed) and its frequency against the parameter."""
    data, attributes = read_peaks(path)
    parameter = str(attributes["parameter"])
    good = data["outcome"] != OUTCOMES.index("not_converged")
    data = {name: values[good] for name, values in data.items()}
    value = data[parameter]
    height = data["response"] if parameter == "level" else data["amplitude"]
    sticks = data["states"][:, 2:].sum(axis=1) == 0
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.6), constrained_layout=True)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for stuck, colour, label in (
            (True, STUCK_COLOUR, "all contacts stick"),
            (False, BRANCH_COLOURS[0], "they slip"),
        ):
            for run in _runs(sticks == stuck):
                power = data["elasticity"][run]
                x, y = smooth_curve(value[run], height[run], power)
                upper.plot(x, y, color=colour, label=label)
                lower.plot(value[run], data["frequency_hz"][run], color=colour)
                label = None
        for i in np.flatnonzero(np.diff(sticks.astype(int))):
            for axes, heights in ((upper, height), (lower, data["frequency_hz"])):
                axes.plot(value[i : i + 2], heights[i : i + 2], color=STUCK_COLOUR, linestyle=":", linewidth=1.2)
        _mark(upper, lower, value, height, data)
        upper.set_xscale("log")
        upper.set_ylim(bottom=0.0)
        upper.set_ylabel(f"Peak of {attributes['monitor']}" + (" by level" if parameter == "level" else ""))
        lower.set(xlabel=f"{parameter.capitalize()} factor", ylabel="Frequency (Hz)")
        upper.legend(loc="best")
    return figure


def _runs(chosen: np.ndarray) -> list[np.ndarray]:
    """Stretches of neighbours that are chosen, as indices, each of two and more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    return [np.arange(a, b) for a, b in edges.reshape(-1, 2) if b - a > 1]


def _mark(upper: Axes, lower: Axes, value: np.ndarray, height: np.ndarray, data: dict[str, np.ndarray]) -> None:
    for kind, marker, size in (("step", ".", 4), ("value", "o", 4.5), ("optimum", "*", 11)):
        here = data["kind"] == KINDS.index(kind)
        if not here.any():
            continue
        label = {"value": "values asked for", "optimum": "optimum"}.get(kind)
        colour = BRANCH_COLOURS[1] if kind == "optimum" else "k"
        upper.plot(value[here], height[here], marker, color=colour, markersize=size, label=label, zorder=4)
        lower.plot(value[here], data["frequency_hz"][here], marker, color=colour, markersize=size, zorder=4)
        if kind == "optimum":
            for x, y in zip(value[here], height[here], strict=True):
                upper.annotate(f"{y:.4g} at {x:.4g}", (x, y), xytext=(0, -14), textcoords="offset points", ha="center")
