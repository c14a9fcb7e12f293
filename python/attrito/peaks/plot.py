"""The picture of `attrito peak`: the optimisation curve, and the frequency of the peak along it."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.library.names import OUTCOMES
from attrito.peaks.curve import KINDS
from attrito.peaks.file import read_backbone, read_peaks, smooth_curve
from attrito.plots.style import BRANCH_COLOURS, Look, plain_text, with_unit
from attrito.support.units import axis_unit

STUCK_COLOUR = "#8a8a8a"
BACKBONE_COLOUR = BRANCH_COLOURS[2]


def peak_curve(path: str, look: Look | None = None) -> Figure:
    """Amplitude of the peak (by level, where that is followed) and its frequency against the parameter.

    With a backbone also what that expects, dashed, and how far it is from the peaks.
    """
    look = look or Look()
    data, attributes = read_peaks(path)
    backbone = read_backbone(path)
    parameter = str(attributes["parameter"])
    good = data["outcome"] != OUTCOMES.index("not_converged")
    data = {name: values[good] for name, values in data.items()}
    value = data[parameter]
    height = data["response"] if parameter == "level" else data["amplitude"]
    sticks = data["states"][:, 2:].sum(axis=1) == 0
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 5.6 if backbone is None else 7.0))
        heights = (2, 1) if backbone is None else (2, 1, 1)
        upper, lower, *differences = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
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
        if backbone is not None and len(value):
            _draw_backbone(upper, lower, backbone, value)
            _draw_differences(differences[0], value, data)
        upper.set_xscale("log")
        upper.set_ylim(bottom=0.0)
        name = plain_text(str(attributes["monitor"]))
        peak = f"Peak of {name} by level" if parameter == "level" else f"Peak of {name}"
        upper.set_ylabel(with_unit(peak, axis_unit("user length", str(attributes.get("units", "")))))
        lower.set_ylabel("Frequency (Hz)")
        figure.axes[-1].set_xlabel(f"{parameter.capitalize()} factor")
        if upper.get_legend_handles_labels()[0]:
            upper.legend(loc="best")
    return figure


def _draw_backbone(upper: Axes, lower: Axes, backbone: dict[str, np.ndarray], value: np.ndarray) -> None:
    """The backbone over the peaks' levels."""
    here = (backbone["level"] >= 0.95 * value.min()) & (backbone["level"] <= 1.05 * value.max())
    for axes, name in ((upper, "response"), (lower, "frequency_hz")):
        label = "backbone" if name == "response" else None
        for number in np.unique(backbone["stretch"][here]):
            run = here & (backbone["stretch"] == number)
            axes.plot(backbone["level"][run], backbone[name][run], "--", color=BACKBONE_COLOUR, label=label, zorder=3)
            label = None


def _draw_differences(axes: Axes, value: np.ndarray, data: dict[str, np.ndarray]) -> None:
    """How far the backbone is from the peaks, relative."""
    for name, expected, marker, label in (
        ("response", "backbone_response", "o", "response"),
        ("frequency_hz", "backbone_frequency_hz", "s", "frequency"),
    ):
        difference = 100.0 * (data[expected] / data[name] - 1.0)
        axes.plot(value, difference, marker + "-", color=BACKBONE_COLOUR, markersize=3.5, linewidth=0.9, label=label,
                  markerfacecolor="w" if marker == "s" else None)  # fmt: skip
    axes.axhline(0.0, color="k", linewidth=0.6)
    axes.set_ylabel("Backbone over\npeak (%)")
    axes.legend(loc="best")


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
