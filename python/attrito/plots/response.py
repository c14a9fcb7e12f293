"""Figures of frequency responses.

Every function returns a matplotlib figure; `style.save` writes it.
Colours stay apart for colour-blind readers (Okabe-Ito for branches, viridis for levels).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from attrito.library.names import NO_SOLUTION
from attrito.plots.style import BRANCH_COLOURS, DASHES, Look, legend_below, plain_text, with_unit
from attrito.results.curve import Curve, curve_of
from attrito.results.result import Result

LINEAR_STYLE = {"stuck": "-", "frictionless": (0, (1, 1.2)), "tangent": (0, (6, 1.5, 1, 1.5))}
BIFURCATION_MARKER = {"fold": "^", "contact_fold": "v", "flip": "s", "neimark_sacker": "P", "branch_point": "*"}
BIFURCATION_MARKER["contact_crossing"] = "d"
FAILURE_MARKER = dict(zip(NO_SOLUTION, ("D", "x"), strict=True))
# Of the cubic between two points
PIECES = 16
# Of a curve, about
ERROR_BARS = 40
# More levels than this are read off a colour bar.
LEGEND_LEVELS = 8


def frequency_response(result: Result, monitor: str, log: bool | None = None, look: Look | None = None) -> Figure:
    """Amplitude of a monitor against frequency, one line a level and branch.

    Several levels are divided by the level: a linear structure would give one curve. One level is shown as it is.
    Unstable stretches are dashed, points without a solution and bifurcations are marked, bounds of points that are not
    unique are shaded, estimated errors are bars. The linear responses (all stuck, frictionless, tangent) are thin lines
    behind.

    Parameters
    ----------
    result : an open result
    monitor : name of the monitor
    log : logarithmic amplitudes; None: if they span more than a factor of 50
    look : size and letters; a figure of a given width has its legend below
    """
    look = look or Look()
    levels = np.unique(result.array("/points/level"))
    several = len(levels) > 1
    with matplotlib.rc_context(look.style()):
        figure = Figure(figsize=look.size((6.6, 4.0 if look.width is None else 5.3)), constrained_layout=True)
        axes = figure.add_subplot()
        # The linear responses are stored at level 1, which is also what amplitude / level compares with.
        factor = 1.0 if several or not len(levels) else float(levels[0])
        spans = _draw_linear(axes, result, monitor, factor)
        spans += _draw_levels(axes, result, monitor, levels)
        _scale_amplitudes(axes, np.concatenate(spans), log)
        _mark_bifurcations(axes, result, monitor, several)
        name = f"Amplitude of {monitor} / level" if several else f"Amplitude of {monitor}"
        label = with_unit(name, result.unit(f"/monitors/{monitor}/amplitude"), 0.8 * figure.get_figheight())
        axes.set(xlabel="Frequency (Hz)", ylabel=label)
        frequency = result.array("/points/frequency_hz")
        if len(frequency) and np.ptp(frequency) > 0:
            margin = 0.02 * np.ptp(frequency)
            axes.set_xlim(frequency.min() - margin, frequency.max() + margin)
        if len(levels) > LEGEND_LEVELS:
            scale_of = ScalarMappable(Normalize(levels[0], levels[-1]), level_map())
            figure.colorbar(scale_of, ax=axes, label="Level", pad=0.02)
        _place_legend(axes, narrow=look.width is not None)
    return figure


def _draw_levels(axes: Axes, result: Result, monitor: str, levels: np.ndarray) -> list[np.ndarray]:
    """A curve a level and branch with its bounds, errors and failures; amplitudes that the axis is to span."""
    frequency, level, branch, estimate = (
        result.array(f"/points/{name}") for name in ("frequency_hz", "level", "branch", "estimate")
    )
    unstable, loose = result.array("/points/stable") == 0, result.array("/points/unique") == 0
    several, branches = len(levels) > 1, np.unique(branch)
    scale = level if several else 1.0
    amplitude, low, high = (result.monitor(monitor, name) / scale for name in ("amplitude", "low", "high"))
    shown = np.where(result.converged, amplitude, np.nan)
    drawn = curve_of(result)
    spans = [shown]
    for one_level in levels:
        own_branches = np.unique(branch[level == one_level])
        for one_branch in own_branches:
            own = (level == one_level) & (branch == one_branch)
            colour, label = _identity(levels, branches, one_level, one_branch)
            if several and one_branch != own_branches[0]:
                label = ""
            line = _Line(drawn, 1 + drawn.monitors.index(monitor), np.flatnonzero(own), one_level if several else 1.0)
            spans.append(_draw_curve(axes, line, unstable[own], colour, label))
            _draw_errors(axes, frequency[own], shown[own], estimate[own], colour)
            if (bounded := own & loose & np.isfinite(low + high)).any():
                bounds = [np.where(bounded, bound, np.nan)[own] for bound in (low, high)]
                axes.fill_between(frequency[own], *bounds, color=colour, alpha=0.25, linewidth=0)
                spans += bounds
    if np.any(unstable & np.isfinite(shown)):
        axes.plot([], [], color="#444444", linestyle=DASHES, label="unstable")
    _mark_failures(axes, result, frequency, amplitude)
    return spans


def _scale_amplitudes(axes: Axes, span: np.ndarray, log: bool | None) -> None:
    """A logarithmic axis if that is asked for or amplitudes differ much; else one from zero."""
    span = span[span > 0]
    if log if log is not None else (len(span) > 0 and span.max() > 50 * span.min()):
        axes.set_yscale("log")
    elif len(span):
        axes.set_ylim(0, 1.05 * span.max())


def _place_legend(axes: Axes, narrow: bool) -> None:
    """Within the axes, or beside them where it is long; in a narrow figure below."""
    entries = len(axes.get_legend_handles_labels()[0])
    if entries > 4 and narrow:
        legend_below(axes, columns=2 + (entries > 6))
    elif entries > 4:
        axes.figure.set_figwidth(8.0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
    elif entries:
        axes.legend(loc="best")


def _draw_errors(
    axes: Axes, frequency: np.ndarray, amplitude: np.ndarray, estimate: np.ndarray, colour: object
) -> None:
    """Bars of the estimated errors at the largest amplitude and at some other points of a curve."""
    known = np.flatnonzero(np.isfinite(amplitude) & (estimate > 0.0))
    if not len(known):
        return
    chosen = known[:: -(-len(known) // ERROR_BARS)]
    chosen = np.union1d(chosen, known[np.argmax(amplitude[known])])
    half = amplitude[chosen] * np.minimum(estimate[chosen], 1.0)
    axes.errorbar(
        frequency[chosen], amplitude[chosen], half, fmt="none", ecolor=colour, elinewidth=0.9, capsize=1.8, alpha=0.9
    )


@dataclass(frozen=True)
class _Line:
    """A branch of the drawn curve: the row of its monitor, its points, and what amplitudes are divided by."""

    curve: Curve
    row: int
    points: np.ndarray
    level: float

    def between(self, begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and amplitudes from one of its points to another."""
        found = []
        for first, after in pairwise(self.points[begin : end + 1]):
            # Straight lines have no points between; neither have points that lie apart in the file.
            pieces = PIECES if after == first + 1 and self.curve.is_bent(first) else 1
            found.append(self.curve.at(first + np.arange(pieces) / pieces))
        line = np.concatenate([*found, self.curve.values[:, self.points[end] : self.points[end] + 1]], axis=1)
        return line[0], line[self.row] / self.level


def _draw_curve(axes: Axes, line: _Line, unstable: np.ndarray, colour: object, label: str) -> np.ndarray:
    """One branch in the order of its points, dashed where an end of a segment is unstable. Returns its amplitudes."""
    frequency, amplitude = line.curve.values[0, line.points], line.curve.values[line.row, line.points] / line.level
    drawn = [amplitude]
    alone = len(frequency) < 2 or not np.isfinite(amplitude[1:] + amplitude[:-1]).any()
    axes.plot([], [], color=colour, label=label or None, marker="o" if alone else None, markersize=4)
    dashed = unstable[1:] | unstable[:-1]
    # One line for each run of equal segments: dashes restart otherwise at every point.
    cuts = [0, *(np.flatnonzero(np.diff(dashed)) + 1), len(frequency) - 1]
    for begin, end in pairwise(cuts):
        if end > begin:
            places = line.between(begin, end)
            axes.plot(*places, color=colour, linestyle=DASHES if dashed[begin] else "-")
            drawn.append(places[1])
    # A point between two failures has no segment and would be invisible.
    solved = np.concatenate([[False], np.isfinite(amplitude), [False]])
    single = solved[1:-1] & ~solved[:-2] & ~solved[2:]
    axes.plot(frequency[single], amplitude[single], "o", color=colour, markersize=4)
    return np.concatenate(drawn)


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


def _mark_bifurcations(axes: Axes, result: Result, monitor: str, per_level: bool) -> None:
    """Mark where branches turn and where multipliers cross the unit circle, by kind."""
    if not result.has("/bifurcations/kind"):
        return
    names = result.names("/bifurcations/kind")
    kind, frequency, level = (result.array(f"/bifurcations/{name}") for name in ("kind", "frequency_hz", "level"))
    amplitude = result.array(f"/bifurcations/amplitude/{monitor}") / (level if per_level else 1.0)
    for index in np.unique(kind):
        own = kind == index
        look = {"marker": BIFURCATION_MARKER[names[index]], "linestyle": "none", "color": "k", "markersize": 5}
        axes.plot(frequency[own], amplitude[own], **look, zorder=4, label=plain_text(names[index].replace("_", " ")))


def _identity(levels: np.ndarray, branches: np.ndarray, level: float, branch: int) -> tuple[object, str]:
    """Colour and legend entry of one curve: levels by viridis, else branches by hue."""
    if len(levels) == 1:
        label = f"branch {branch}" if len(branches) > 1 else "response"
        return BRANCH_COLOURS[int(np.searchsorted(branches, branch)) % len(BRANCH_COLOURS)], label
    if len(levels) > LEGEND_LEVELS:
        place, label = (level - levels[0]) / np.ptp(levels), ""
    else:
        place, label = np.searchsorted(levels, level) / (len(levels) - 1), f"level {level:.4g}"
    return level_map()(place), label


def level_map() -> object:
    """Viridis without its pale end, which does not show on white."""
    return matplotlib.colors.ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.88, 256)))
