"""Figures: frequency responses, hysteresis loops, maps of the contact state.

Every function returns a matplotlib figure; `save` writes it. Figures are made without pyplot, so no window system and
no global state is involved. Colours stay apart for colour-blind readers (Okabe-Ito for branches, viridis for levels).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from attrito.faults import Fault, InputError
from attrito.results import NO_SOLUTION, Result

BRANCH_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LIMIT_COLOUR = "#8a8a8a"
DASHES = (0, (3, 1.8))
LINEAR_STYLE = {"stuck": "-", "frictionless": (0, (1, 1.2))}
FAILURE_MARKER = dict(zip(NO_SOLUTION, ("D", "x"), strict=True))
# More levels than this are read off a colour bar.
LEGEND_LEVELS = 8
STYLE = {
    "font.size": 9,
    "axes.labelsize": 10,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "figure.constrained_layout.w_pad": 0.07,
    "figure.constrained_layout.h_pad": 0.07,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure; the ending chooses the format (.png, .pdf, .svg)."""
    try:
        with matplotlib.rc_context(STYLE):
            figure.savefig(path, dpi=220)
    except (OSError, ValueError) as error:
        raise InputError(Fault(str(path), "figure", str(error), "a writable .png, .pdf or .svg file")) from error


def frequency_response(result: Result, monitor: str, log: bool | None = None) -> Figure:
    """Amplitude of a monitor against frequency, one line a level and branch.

    Several levels are divided by the level: a linear structure would give one curve. One level is shown as it is.
    Unstable stretches are dashed, points without a solution are marked, bounds of points that are not unique are
    shaded. The linear responses (all stuck, frictionless) are thin lines behind.

    Parameters
    ----------
    result : an open result
    monitor : name of the monitor
    log : logarithmic amplitudes; None: if they span more than a factor of 50
    """
    frequency, level, branch = (result.array(f"/points/{name}") for name in ("frequency_hz", "level", "branch"))
    unstable, loose = result.array("/points/stable") == 0, result.array("/points/unique") == 0
    levels, branches = np.unique(level), np.unique(branch)
    several = len(levels) > 1
    scale = level if several else 1.0
    amplitude, low, high = (result.monitor(monitor, name) / scale for name in ("amplitude", "low", "high"))
    shown = np.where(result.converged, amplitude, np.nan)

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.6, 4.0), constrained_layout=True)
        axes = figure.add_subplot()
        spans = [shown]
        # The linear responses are stored at level 1, which is also what amplitude / level compares with.
        factor = 1.0 if several or not len(levels) else float(levels[0])
        spans += _draw_linear(axes, result, monitor, factor)
        for one_level in levels:
            own_branches = np.unique(branch[level == one_level])
            for one_branch in own_branches:
                own = (level == one_level) & (branch == one_branch)
                colour, label = _identity(levels, branches, one_level, one_branch)
                if several and one_branch != own_branches[0]:
                    label = ""
                _draw_curve(axes, frequency[own], shown[own], unstable[own], colour, label)
                if (bounded := own & loose & np.isfinite(low + high)).any():
                    bounds = [np.where(bounded, bound, np.nan)[own] for bound in (low, high)]
                    axes.fill_between(frequency[own], *bounds, color=colour, alpha=0.25, linewidth=0)
                    spans += bounds
        if np.any(unstable & np.isfinite(shown)):
            axes.plot([], [], color="#444444", linestyle=DASHES, label="unstable")

        span = np.concatenate(spans)
        span = span[span > 0]
        if log if log is not None else (len(span) > 0 and span.max() > 50 * span.min()):
            axes.set_yscale("log")
        elif len(span):
            axes.set_ylim(0, 1.05 * span.max())
        _mark_failures(axes, result, frequency, amplitude)
        name = f"Amplitude of {monitor} / level" if several else f"Amplitude of {monitor}"
        axes.set(xlabel="Frequency (Hz)", ylabel=_with_unit(name, result.unit(f"/monitors/{monitor}/amplitude")))
        if len(frequency) and np.ptp(frequency) > 0:
            margin = 0.02 * np.ptp(frequency)
            axes.set_xlim(frequency.min() - margin, frequency.max() + margin)
        if len(levels) > LEGEND_LEVELS:
            scale_of = ScalarMappable(Normalize(levels[0], levels[-1]), _level_map())
            figure.colorbar(scale_of, ax=axes, label="Level", pad=0.02)
        entries = len(axes.get_legend_handles_labels()[0])
        if entries > 4:
            figure.set_figwidth(8.0)
            axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
        elif entries:
            axes.legend(loc="best")
    return figure


@dataclass(frozen=True)
class Loop:
    """One contact over one period.

    Parameters
    ----------
    name : title of its panel
    displacement, tangential : [nt] or [nt, tangents], relative displacement and force along the tangents
    normal : [nt], normal force
    friction_coefficient : if given, the limits +- mu N are drawn
    """

    name: str
    displacement: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray
    friction_coefficient: float | None = None


def hysteresis(loops: Sequence[Loop], unit_length: str = "", unit_force: str = "") -> Figure:
    """Tangential force against relative displacement, one panel a contact.

    The friction limits +- mu N are thin lines over the same displacement: where N varies they are loops themselves,
    and the force runs along them where the contact slips. Two tangents are two lines.
    """
    if not loops:
        raise InputError(Fault("plot", "contacts", "none", "at least one contact"))
    columns = min(int(np.ceil(np.sqrt(len(loops)))), 4)
    rows = -(-len(loops) // columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(max(2.4 * columns, 3.6) + 0.6, 2.3 * rows + 0.7), constrained_layout=True)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, loop in zip(grid.flat, loops, strict=False):
            _draw_loop(axes, loop)
        for axes in grid.flat[len(loops) :]:
            axes.set_axis_off()
        figure.supxlabel(_with_unit("Relative displacement", unit_length), fontsize=10)
        figure.supylabel(_with_unit("Tangential force", unit_force), fontsize=10)
        entries = {label: handle for handle, label in zip(*grid[0, 0].get_legend_handles_labels(), strict=True)}
        if len(entries) > 1:
            grid[0, 0].legend(entries.values(), entries.keys(), loc="best", handlelength=1.4)
    return figure


def contact_map(result: Result, point: int) -> Figure:
    """The contacts of a point on their surfaces, one panel a contact set, each seen along its mean normal.

    Colour is the fraction of the period in slip. Diamonds part for some of the period, hollow contacts never touch.
    """
    result.check_point(point)
    if not result.has("/contacts/parameters/frame"):
        raise InputError(Fault(result.path, "/contacts/parameters/frame", "absent", "contacts between node sets"))
    position, frame = (result.array(f"/contacts/parameters/{name}") for name in ("position", "frame"))
    if not np.any(np.isfinite(frame)):
        key = "/contacts/parameters/position"
        raise InputError(Fault(result.path, key, "unknown", "contacts between node sets, which have a place"))
    sets = np.array([text.decode().strip() for text in result.array("/contacts/parameters/set")])
    slip, opened = (result.dataset(f"/contacts/{name}")[point] for name in ("slip", "open"))
    panels = {}
    for name in dict.fromkeys(sets):
        own = sets == name
        panels[name] = own, (position[own] - position[own].mean(axis=0)) @ frame[own].mean(axis=0)[:2].T
    kinds = (("o", opened <= 0), ("D", (opened > 0) & (opened < 1)), ("o", opened >= 1))
    shapes = [np.ptp(seen, axis=0) + 1e-9 for _, seen in panels.values()]
    aspects = np.clip([shape[0] / shape[1] for shape in shapes], 0.25, 8.0)
    with matplotlib.rc_context(STYLE):
        # Surfaces that are wider than high stand above each other, the others side by side.
        if np.median(aspects) > 1.0:
            heights = 5.0 / aspects + 0.6
            figure = Figure(figsize=(6.8, heights.sum() + 0.8), constrained_layout=True)
            grid = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        else:
            widths = 2.6 * aspects + 0.6
            figure = Figure(figsize=(widths.sum() + 1.6, 3.8), constrained_layout=True)
            grid = figure.subplots(1, len(panels), squeeze=False, gridspec_kw={"width_ratios": widths})[0]
        colours = ScalarMappable(Normalize(0, 1), "cividis")
        for axes, (name, (own, seen)) in zip(grid, panels.items(), strict=True):
            for index, (marker, among) in enumerate(kinds):
                part = among[own]
                face = "none" if index == 2 else colours.to_rgba(slip[own][part])
                axes.scatter(*seen[part].T, color=face, marker=marker, edgecolor="k", s=42, linewidth=0.6)
            axes.set(title=name, aspect="equal", xlabel="along t1", ylabel="along t2")
            axes.margins(0.08, 0.2)
        hertz = result.dataset("/points/frequency_hz")[point]
        key = "\u25cf touching   \u25c6 parting   \u25cb open"
        figure.suptitle(f"Point {point}, {hertz:.6g} Hz    {key}", fontsize=9.5)
        figure.colorbar(colours, ax=list(grid), label="Fraction of the period slipping", shrink=0.9)
    return figure


def _draw_curve(
    axes: Axes, frequency: np.ndarray, amplitude: np.ndarray, unstable: np.ndarray, colour: object, label: str
) -> None:
    """One branch in the order of its points; a segment is dashed if one of its ends is unstable."""
    alone = len(frequency) < 2 or not np.isfinite(amplitude[1:] + amplitude[:-1]).any()
    axes.plot([], [], color=colour, label=label or None, marker="o" if alone else None, markersize=4)
    dashed = unstable[1:] | unstable[:-1]
    # One line for each run of equal segments: dashes restart otherwise at every point.
    cuts = [0, *(np.flatnonzero(np.diff(dashed)) + 1), len(frequency) - 1]
    for begin, end in pairwise(cuts):
        if end > begin:
            run = slice(begin, end + 1)
            axes.plot(frequency[run], amplitude[run], color=colour, linestyle=DASHES if dashed[begin] else "-")
    # A point between two failures has no segment and would be invisible.
    solved = np.concatenate([[False], np.isfinite(amplitude), [False]])
    single = solved[1:-1] & ~solved[:-2] & ~solved[2:]
    axes.plot(frequency[single], amplitude[single], "o", color=colour, markersize=4)


def _draw_linear(axes: Axes, result: Result, monitor: str, factor: float) -> list[np.ndarray]:
    """The linear responses times `factor`; returns the amplitudes drawn within the swept band."""
    frequency = result.array("/points/frequency_hz")
    drawn = []
    for kind, style in LINEAR_STYLE.items():
        if (line := result.linear(kind, monitor)) is not None and len(frequency):
            inside = (line[0] >= frequency.min()) & (line[0] <= frequency.max())
            look = {"color": "#555555", "linewidth": 0.9, "linestyle": style}
            axes.plot(line[0], factor * line[1], **look, label=f"linear, {kind}")
            drawn.append(factor * line[1][inside])
    return drawn


def _mark_failures(axes: Axes, result: Result, frequency: np.ndarray, amplitude: np.ndarray) -> None:
    """Mark the points without a solution where they stopped, or on the frequency axis if they have no amplitude."""
    outcome = np.array(result.outcome, dtype=object)
    for name, marker in FAILURE_MARKER.items():
        failed = outcome == name
        if not failed.any():
            continue
        placed = failed & np.isfinite(amplitude) & (amplitude > 0)
        look = {"marker": marker, "linestyle": "none", "color": "k", "markersize": 5, "markerfacecolor": "w"}
        axes.plot(frequency[placed], amplitude[placed], **look, label=name.replace("_", " "))
        if (rest := failed & ~placed).any():
            floor = axes.get_xaxis_transform()
            axes.plot(frequency[rest], np.zeros(rest.sum()), **look, transform=floor, clip_on=False)


def _draw_loop(axes: Axes, loop: Loop) -> None:
    def closed(values: np.ndarray) -> np.ndarray:
        table = np.asarray(values, dtype=float).reshape(len(loop.normal), -1)
        return np.vstack([table, table[:1]])

    displacement, tangential, normal = closed(loop.displacement), closed(loop.tangential), closed(loop.normal)[:, 0]
    for index in range(displacement.shape[1]):
        label = f"T{index + 1}" if displacement.shape[1] > 1 else "T"
        if loop.friction_coefficient is not None:
            limit = loop.friction_coefficient * normal
            for side in (limit, -limit):
                axes.plot(displacement[:, index], side, color=LIMIT_COLOUR, linewidth=0.8, label="± µN")
        axes.plot(displacement[:, index], tangential[:, index], color=BRANCH_COLOURS[index], label=label)
    axes.set_title(loop.name)


def _identity(levels: np.ndarray, branches: np.ndarray, level: float, branch: int) -> tuple[object, str]:
    """Colour and legend entry of one curve: levels by viridis, else branches by hue."""
    if len(levels) == 1:
        label = f"branch {branch}" if len(branches) > 1 else "response"
        return BRANCH_COLOURS[int(np.searchsorted(branches, branch)) % len(BRANCH_COLOURS)], label
    if len(levels) > LEGEND_LEVELS:
        place, label = (level - levels[0]) / np.ptp(levels), ""
    else:
        place, label = np.searchsorted(levels, level) / (len(levels) - 1), f"level {level:.4g}"
    return _level_map()(place), label


def _level_map() -> object:
    """Viridis without its pale end, which does not show on white."""
    return matplotlib.colors.ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.88, 256)))


def _with_unit(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name
