"""The picture of `attrito peak`: the optimisation curve, and the frequency of the peak along it."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.library.names import OUTCOMES
from attrito.peaks.curve import KINDS
from attrito.peaks.file import read_peaks, smooth_curve
from attrito.plots.style import BRANCH_COLOURS, Look, plain_text, with_unit
from attrito.plots.ticks import label_short_log
from attrito.support.units import axis_unit

STUCK_COLOUR = "#8a8a8a"


def peak_curve(path: str, look: Look | None = None) -> Figure:
    """Amplitude of the peak (by level, where that is followed) and its frequency against the parameter."""
    look = look or Look()
    data, attributes = read_peaks(path)
    parameter = str(attributes["parameter"])
    good = data["outcome"] != OUTCOMES.index("not_converged")
    data = {name: values[good] for name, values in data.items()}
    value = data[parameter]
    height = data["response"] if parameter == "level" else data["amplitude"]
    sticks = data["states"][:, 2:].sum(axis=1) == 0
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 5.6))
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for stuck, colour, label in (
            (True, STUCK_COLOUR, "all contacts stick"),
            (False, BRANCH_COLOURS[0], "contacts slip"),
        ):
            for run in _runs(sticks == stuck, data["jump"] == 1):
                power = data["elasticity"][run]
                x, y = smooth_curve(value[run], height[run], power)
                upper.plot(x, y, color=colour, label=label)
                lower.plot(value[run], data["frequency_hz"][run], color=colour)
                label = None
        for i in np.flatnonzero((np.diff(sticks.astype(int)) != 0) | (data["jump"][1:] == 1)):
            for axes, course in ((upper, height), (lower, data["frequency_hz"])):
                axes.plot(value[i : i + 2], course[i : i + 2], color=STUCK_COLOUR, linestyle=":", linewidth=1.2)
        _mark(upper, lower, value, height, data)
        _mark_higher(upper, lower, value, data, parameter == "level")
        if not len(value):
            upper.text(0.5, 0.5, "no peak was found", transform=upper.transAxes, ha="center", va="center")
        upper.set_xscale("log")
        label_short_log(figure.axes[-1].xaxis)
        upper.set_ylim(bottom=0.0)
        name = plain_text(str(attributes["monitor"]))
        peak = f"Peak of {name} by level" if parameter == "level" else f"Peak of {name}"
        upper.set_ylabel(with_unit(peak, axis_unit("user length", str(attributes.get("units", "")))))
        lower.set_ylabel("Frequency (Hz)")
        figure.axes[-1].set_xlabel(f"{parameter.capitalize()} factor")
        if upper.get_legend_handles_labels()[0]:
            upper.legend(loc="best")
    return figure


def _runs(chosen: np.ndarray, begins: np.ndarray) -> list[np.ndarray]:
    """Stretches of chosen neighbours, as indices, each of two and more; what `begins` one is not of the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    stretches = [np.arange(a, b) for a, b in edges.reshape(-1, 2)]
    parts = [part for one in stretches for part in np.split(one, np.flatnonzero(begins[one][1:]) + 1)]
    return [part for part in parts if len(part) > 1]


def _mark_higher(upper: Axes, lower: Axes, value: np.ndarray, data: dict[str, np.ndarray], by_level: bool) -> None:
    """Peaks that a sweep found to be higher than the one that is followed."""
    higher = np.isfinite(data.get("higher_amplitude", np.full(len(value), np.nan)))
    if not higher.any():
        return
    height = data["higher_amplitude"][higher] / (data["level"][higher] if by_level else 1.0)
    style = {"linestyle": "", "marker": "^", "color": BRANCH_COLOURS[1], "markersize": 6, "zorder": 4}
    upper.plot(value[higher], height, label="higher peak elsewhere", **style)
    lower.plot(value[higher], data["higher_frequency_hz"][higher], **style)


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
            for place in np.flatnonzero(here):
                x, y = value[place], height[place]
                beside = height[max(place - 1, 0) : place + 2]
                away = 7 if y >= np.nanmax(beside) else -14
                upper.annotate(f"{y:.4g} at {x:.4g}", (x, y), (0, away), textcoords="offset points", ha="center")
