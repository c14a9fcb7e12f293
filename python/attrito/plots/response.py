"""Figures of frequency responses.

Every function returns a matplotlib figure; `style.save` writes it.
Colours stay apart for colour-blind readers (Okabe-Ito for branches, viridis for levels).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from attrito.library.names import NO_SOLUTION, REFERENCES
from attrito.plots.labels import names_of
from attrito.plots.style import DASHES, Look, legend_below, plain_text, with_unit
from attrito.plots.ticks import label_short_log
from attrito.results.curve import Curve
from attrito.results.motion import DERIVATIVES, QUANTITIES, curve_of_quantity, unit_of
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError

# Quantities that linear responses are drawn of
LINEAR_QUANTITIES = ("amplitude", "first_harmonic", "velocity", "acceleration")
# Of the largest amplitude: lines that differ by less are drawn once.
ALIKE = 2e-3
LINEAR_STYLE = {"stuck": "-", "frictionless": (0, (1, 1.2)), "tangent": (0, (6, 1.5, 1, 1.5))}
BIFURCATION_MARKER = {"fold": "^", "contact_fold": "v", "flip": "s", "neimark_sacker": "P", "branch_point": "*"}
BIFURCATION_MARKER["contact_crossing"] = "d"
FAILURE_MARKER = dict(zip(NO_SOLUTION, ("D", "x"), strict=True))
# Of the cubic between two points
PIECES = 16
# Of a curve, about
ERROR_BARS = 40
# Points of the page: bars shorter than a line is wide are not seen.
SEEN = 2.0
# Ticks of a phase: 15, 30, 45, 90 degrees
PHASE_STEPS = (1.0, 1.5, 3.0, 4.5, 9.0, 10.0)
# More levels than this are read off a colour bar.
LEGEND_LEVELS = 8


@dataclass(frozen=True)
class Drawing:
    """What of results is drawn, and on which axes.

    Parameters
    ----------
    quantity : one of `attrito.results.motion.QUANTITIES`, or `nyquist`, the first harmonic in the complex plane
    levels : these alone; empty: all
    xlim : frequencies in Hz, of `nyquist` nothing
    log : logarithmic amplitudes; None: if they span more than a factor of 50
    references : of the linear responses, all stuck, frictionless, tangent
    """

    quantity: str = "amplitude"
    levels: tuple[float, ...] = ()
    xlim: tuple[float, float] | None = None
    log: bool | None = None
    references: tuple[str, ...] = REFERENCES


def frequency_response(
    result: Result, monitor: str, log: bool | None = None, look: Look | None = None, drawing: Drawing | None = None
) -> Figure:
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
    drawing : what is drawn; None: amplitudes of all levels
    """
    drawing = drawing or Drawing()
    return responses([result], monitor, look, drawing if log is None else replace(drawing, log=log))


def responses(
    results: Sequence[Result], monitor: str, look: Look | None = None, drawing: Drawing | None = None
) -> Figure:
    """A quantity of a monitor of several results in one figure, each by what differs between their jobs."""
    look, drawing = look or Look(), drawing or Drawing()
    named = zip(results, names_of(results), strict=True)
    parts = [_Part(result, name, _chosen_levels(result, drawing)) for result, name in named]
    levels = np.unique(np.concatenate([part.levels for part in parts]))
    quantity = drawing.quantity
    several = len(levels) > 1 and quantity != "phase"
    with matplotlib.rc_context(look.style()):
        usual = (5.4, 5.0) if quantity == "nyquist" else (6.6, 4.0 if look.width is None else 5.3)
        figure = look.figure(usual)
        axes = figure.add_subplot()
        # The linear responses are stored at level 1, which is also what amplitude / level compares with.
        factor = 1.0 if several or not len(levels) else float(levels[0])
        spans = _draw_linear(axes, [part.result for part in parts], monitor, factor, drawing)
        colours = _Colours(parts, look)
        for number, part in enumerate(parts):
            spans += _draw_levels(axes, part, monitor, several, partial(colours.of, number), drawing)
            if quantity in ("amplitude", "first_harmonic"):
                _mark_bifurcations(axes, part, monitor, several)
        name = f"{QUANTITIES.get(quantity, '')} of {monitor}" + (" / level" if several else "")
        unit = unit_of(parts[0].result, monitor, "first_harmonic" if quantity == "nyquist" else quantity)
        if quantity == "nyquist":
            by_level = " / level" if several else ""
            sides = [with_unit(f"{side} part of {monitor}{by_level}", unit, 4.0) for side in ("Real", "Imaginary")]
            axes.set(xlabel=sides[0], ylabel=sides[1], aspect="equal", adjustable="datalim")
        else:
            axes.set(xlabel="Frequency (Hz)", ylabel=with_unit(name, unit, 0.8 * figure.bbox.height / figure.dpi))
            _span_frequencies(axes, [part.result for part in parts], drawing.xlim)
            if quantity == "phase":
                axes.yaxis.set_major_locator(MaxNLocator(steps=PHASE_STEPS))
            else:
                _scale_amplitudes(axes, np.concatenate(spans) if spans else np.empty(0), drawing.log)
        _explain_errors(axes)
        if len(results) == 1 and len(levels) > LEGEND_LEVELS:
            scale_of = ScalarMappable(Normalize(levels[0], levels[-1]), level_map())
            figure.colorbar(scale_of, ax=axes, label="Level", pad=0.02)
        _place_legend(axes, narrow=look.width is not None)
    return figure


@dataclass(frozen=True)
class _Part:
    """One of the results of a figure: its name in the legend, empty where it is alone, and levels `[n]` drawn."""

    result: Result
    name: str
    levels: np.ndarray


class _Colours:
    """Colour and legend entry of every curve: of one result's levels by viridis, else by hue."""

    def __init__(self, parts: Sequence[_Part], look: Look) -> None:
        self._parts, self._hues = parts, look.hues()
        self._before = np.cumsum([0, *(len(part.levels) for part in parts)])

    def of(self, number: int, branches: np.ndarray, level: float, branch: int) -> tuple[object, str]:
        """Of a branch of a level of a result."""
        part = self._parts[number]
        if len(self._parts) == 1:
            return _identity(part.levels, branches, level, branch, self._hues)
        place = int(self._before[number] + np.searchsorted(part.levels, level))
        label = part.name + (f", level {level:.4g}" if len(part.levels) > 1 else "")
        curves = int(self._before[-1])
        if curves > len(self._hues):
            return level_map()(place / (curves - 1)), plain_text(label)
        return self._hues[place], plain_text(label)


def _chosen_levels(result: Result, drawing: Drawing) -> np.ndarray:
    """Levels of a result that are drawn; `InputError` where one that was asked for is not there."""
    levels = np.unique(result.array("/points/level"))
    if not drawing.levels:
        return levels
    chosen = [levels[np.isclose(levels, level, rtol=1e-6, atol=0.0)] for level in drawing.levels]
    for level, found in zip(drawing.levels, chosen, strict=True):
        if not len(found):
            known = ", ".join(f"{one:.6g}" for one in levels)
            raise InputError(Fault(result.path, "level", level, f"one of {known}"))
    return np.unique(np.concatenate(chosen))


def _span_frequencies(axes: Axes, results: Sequence[Result], xlim: tuple[float, float] | None) -> None:
    if xlim is not None:
        axes.set_xlim(*xlim)
        return
    frequency = np.concatenate([result.array("/points/frequency_hz") for result in results])
    if len(frequency) and np.ptp(frequency) > 0:
        margin = 0.02 * np.ptp(frequency)
        axes.set_xlim(frequency.min() - margin, frequency.max() + margin)


def _draw_levels(
    axes: Axes, part: _Part, monitor: str, several: bool, identity: Callable[..., tuple[object, str]], drawing: Drawing
) -> list[np.ndarray]:
    """A curve a level and branch with its bounds, errors and failures; amplitudes that the axis is to span."""
    result, quantity = part.result, drawing.quantity
    frequency, level, branch, estimate = (
        result.array(f"/points/{name}") for name in ("frequency_hz", "level", "branch", "estimate")
    )
    unstable, loose = result.array("/points/stable") == 0, result.array("/points/unique") == 0
    among, branches = np.isin(level, part.levels), np.unique(branch)
    scale = level if several else 1.0
    drawn = curve_of_quantity(result, monitor, quantity)
    shown = drawn.values[1] / scale
    spans = [np.where(among, shown, np.nan)]
    for one_level in part.levels:
        own_branches = np.unique(branch[level == one_level])
        for one_branch in own_branches:
            own = (level == one_level) & (branch == one_branch)
            colour, label = identity(branches, one_level, one_branch)
            if (several or part.name) and one_branch != own_branches[0]:
                label = ""
            line = _Line(drawn, np.flatnonzero(own), one_level if several else 1.0)
            spans.append(_draw_curve(axes, line, unstable[own], colour, label))
            if quantity in ("amplitude", "first_harmonic"):
                _draw_errors(axes, frequency[own], shown[own], estimate[own], colour)
            if quantity != "amplitude":
                continue
            low, high = (result.monitor(monitor, name) / scale for name in ("low", "high"))
            if (bounded := own & loose & np.isfinite(low + high)).any():
                bounds = [np.where(bounded, bound, np.nan)[own] for bound in (low, high)]
                axes.fill_between(frequency[own], *bounds, color=colour, alpha=0.25, linewidth=0)
                spans += bounds
    if np.any(among & unstable & np.isfinite(shown)):
        axes.plot([], [], color="#444444", linestyle=DASHES, label="unstable")
    if quantity != "nyquist":
        stopped = (
            result.monitor(monitor, "amplitude") / scale if quantity == "amplitude" else np.full(len(level), np.nan)
        )
        _mark_failures(axes, result, among, frequency, stopped)
    return spans


def _scale_amplitudes(axes: Axes, span: np.ndarray, log: bool | None) -> None:
    """A logarithmic axis if that is asked for or amplitudes differ much; else one from zero."""
    span = span[span > 0]
    if log if log is not None else (len(span) > 0 and span.max() > 50 * span.min()):
        axes.set_yscale("log")
        label_short_log(axes.yaxis)
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
    look = {"elinewidth": 0.9, "capsize": 1.8, "alpha": 0.9, "ecolor": colour, "label": "_estimated error"}
    axes.errorbar(frequency[chosen], amplitude[chosen], half, fmt="none", **look)


def _explain_errors(axes: Axes) -> None:
    """One entry of the legend for all bars that can be seen, and none where all are too short for that."""
    bars = [one for one in axes.containers if one.get_label() == "_estimated error"]
    ends = [np.array(stem.get_segments())[:, :, 1] for one in bars for stem in one.lines[2]]
    if not ends:
        return
    ends = axes.transData.transform(np.column_stack([np.zeros(2 * sum(map(len, ends))), np.concatenate(ends).ravel()]))
    if np.max(np.abs(np.diff(ends[:, 1].reshape(-1, 2), axis=1))) * 72.0 / axes.figure.dpi < SEEN:
        for one in bars:
            one.remove()
        return
    bars[-1].set_label("estimated error")


@dataclass(frozen=True)
class _Line:
    """A branch of the drawn curve: its points, and what amplitudes are divided by."""

    curve: Curve
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
        return line[0], line[1] / self.level


def _draw_curve(axes: Axes, line: _Line, unstable: np.ndarray, colour: object, label: str) -> np.ndarray:
    """One branch in the order of its points, dashed where an end of a segment is unstable. Returns its amplitudes."""
    frequency, amplitude = line.curve.values[0, line.points], line.curve.values[1, line.points] / line.level
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


def _draw_linear(
    axes: Axes, results: Sequence[Result], monitor: str, factor: float, drawing: Drawing
) -> list[np.ndarray]:
    """The linear responses that all results share, times `factor`; returns the amplitudes within the swept band."""
    quantity = drawing.quantity
    if quantity not in LINEAR_QUANTITIES or not all(len(result.array("/points/level")) for result in results):
        return []
    # Amplitudes alone are stored; where all loads are of harmonic 1 the rest follows from them.
    if quantity != "amplitude" and not all(_is_of_first_harmonic(result) for result in results):
        return []
    frequency = np.concatenate([result.array("/points/frequency_hz") for result in results])
    lines: dict[tuple[str, ...], tuple[np.ndarray, np.ndarray]] = {}
    for kind in (kind for kind in LINEAR_STYLE if kind in drawing.references):
        found = [result.linear(kind, monitor) for result in results]
        if any(line is None for line in found) or not all(_alike(found[0], line) for line in found[1:]):
            continue
        same = next((kinds for kinds, line in lines.items() if _alike(line, found[0])), None)
        if same is not None:
            lines[(*same, kind)] = lines.pop(same)
        else:
            lines[(kind,)] = found[0]
    drawn = []
    for kinds, (hertz, amplitude) in lines.items():
        values = factor * amplitude * (2.0 * np.pi * hertz) ** DERIVATIVES.get(quantity, 0)
        look = {"color": "#555555", "linewidth": 0.9, "linestyle": LINEAR_STYLE[kinds[0]]}
        axes.plot(hertz, values, **look, label=f"linear, {' and '.join(kinds)}")
        drawn.append(values[(hertz >= frequency.min()) & (hertz <= frequency.max())])
    return drawn


def _alike(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether two lines over frequency look the same in a figure."""
    largest = max(np.max(line[1], initial=0.0) for line in (one, other))
    close = one[0].shape == other[0].shape and np.allclose(one[0], other[0], rtol=1e-9)
    return bool(close and np.allclose(one[1], other[1], rtol=0.0, atol=ALIKE * largest))


def _is_of_first_harmonic(result: Result) -> bool:
    """Whether all harmonic loads are of harmonic 1; False where the file does not tell its job."""
    try:
        loads = json.loads(result.attribute("job"))["load"]
        return all(load["kind"] != "harmonic" or load["harmonic"] == 1 for load in loads)
    except (ValueError, KeyError, TypeError):
        return False


def _mark_failures(axes: Axes, result: Result, among: np.ndarray, frequency: np.ndarray, amplitude: np.ndarray) -> None:
    """Mark the points without a solution where they stopped, or on the frequency axis if they have no amplitude."""
    outcome = np.array(result.outcome, dtype=object)
    known = axes.get_legend_handles_labels()[1]
    for name, marker in FAILURE_MARKER.items():
        failed = (outcome == name) & among
        if not failed.any():
            continue
        placed = failed & np.isfinite(amplitude) & (amplitude > 0)
        label = name.replace("_", " ")
        look = {"marker": marker, "linestyle": "none", "color": "k", "markersize": 5, "markerfacecolor": "w"}
        axes.plot(frequency[placed], amplitude[placed], **look, label=None if label in known else label)
        if (rest := failed & ~placed).any():
            floor = axes.get_xaxis_transform()
            axes.plot(frequency[rest], np.zeros(rest.sum()), **look, transform=floor, clip_on=False)


def _mark_bifurcations(axes: Axes, part: _Part, monitor: str, per_level: bool) -> None:
    """Mark where branches turn and where multipliers cross the unit circle, by kind."""
    result = part.result
    if not result.has("/bifurcations/kind"):
        return
    names = result.names("/bifurcations/kind")
    kind, frequency, level = (result.array(f"/bifurcations/{name}") for name in ("kind", "frequency_hz", "level"))
    amplitude = result.array(f"/bifurcations/amplitude/{monitor}") / (level if per_level else 1.0)
    for index in np.unique(kind):
        own = (kind == index) & np.isin(level, part.levels)
        look = {"marker": BIFURCATION_MARKER[names[index]], "linestyle": "none", "color": "k", "markersize": 5}
        axes.plot(frequency[own], amplitude[own], **look, zorder=4, label=plain_text(names[index].replace("_", " ")))


def _identity(
    levels: np.ndarray, branches: np.ndarray, level: float, branch: int, hues: Sequence[str]
) -> tuple[object, str]:
    """Colour and legend entry of one curve: levels by viridis, else branches by hue."""
    if len(levels) == 1:
        label = f"branch {branch}" if len(branches) > 1 else "response"
        return hues[int(np.searchsorted(branches, branch)) % len(hues)], label
    if len(levels) > LEGEND_LEVELS:
        place, label = (level - levels[0]) / np.ptp(levels), ""
    else:
        place, label = np.searchsorted(levels, level) / (len(levels) - 1), f"level {level:.4g}"
    return level_map()(place), label


def level_map() -> object:
    """Viridis without its pale end, which does not show on white."""
    return matplotlib.colors.ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.88, 256)))
