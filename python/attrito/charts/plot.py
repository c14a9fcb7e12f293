"""The picture of `attrito chart`: error against processor time, counted work and the number of points."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.charts.file import SERIES, Chart, read
from attrito.charts.labels import label_marks
from attrito.plots.style import BRANCH_COLOURS, Look
from attrito.plots.ticks import label_short_log

MARKERS = dict(zip(SERIES, ("o", "s", "^", "v", "D", "H", "p", "x", "+", "P", "s", "D", "o", "s"), strict=True))
HUES = (
    "#000000",
    *BRANCH_COLOURS[:4],
    BRANCH_COLOURS[0],
    "#000000",
    *BRANCH_COLOURS[4:],
    "#000000",
    *BRANCH_COLOURS[:2],
    *BRANCH_COLOURS[:2],
)
COLOURS = dict(zip(SERIES, HUES, strict=True))
# Ways of these are few, and each has its label beside its mark
LABELLED = ("points", "meshes")
# Series with a panel of their own, whose cost is a number of something; they are in no other
COUNTED = {"curve": ("points", "Points of the sweep")}
# Errors are drawn down to here if the reference has no estimate of its own
LEAST_ERROR = 1e-9
# Diameters of marks in points: of ways, of those by tolerance, of the one that the job asks for
SIZE, TOLERANCE_SIZE, STAR_SIZE = 4.5, 5.5, 15.0


def picture(chart: Chart, look: Look | None = None) -> Figure:
    """A panel a cost; the efficient front is a line, the way that the job asks for a star.

    Points of the drawn curve have a panel of their own beside these.

    The dotted line is the reference's own estimated error; marks below it would mean nothing and are left out.
    """
    look = look or Look()
    with matplotlib.rc_context(look.style()):
        solved = {way.series for way in chart.ways if np.isfinite(way.error)}
        counted = [series for series in COUNTED if series in solved]
        costs = ("seconds", "work")
        least = _least_error(chart)
        figure = look.figure((12.4 + 3.2 * len(counted), 4.6))
        panels = figure.subplots(1, len(costs) + len(counted), sharey=True)
        for axes, series in zip(panels[2:], counted, strict=True):
            cost, label = COUNTED[series]
            _draw(axes, chart, cost, series, SERIES[series])
            axes.set(xscale="log", xlabel=label)
            label_short_log(axes.xaxis)
        for axes, cost in zip(panels[:2], costs, strict=True):
            for series, label in SERIES.items():
                if series not in COUNTED:
                    _draw(axes, chart, cost, series, label)
            _mark(axes, chart, cost)
            if np.isfinite(chart.reference.estimate):
                axes.axhline(chart.reference.estimate, color="#8a8a8a", linestyle=":", linewidth=1.0, label="reference")
            axes.set(xscale="log", yscale="log", xlabel="Processor time (s)" if cost == "seconds" else "Counted work")
        panels[0].set_ylabel(chart.quantity)
        errors = [error for error in (*(way.error for way in chart.ways), chart.reference.estimate) if error == error]
        few = all(way.series in LABELLED for way in chart.ways)
        panels[0].set_ylim(bottom=max(min(errors), least) / 3, top=3.0 * max(errors) if few else 2.0)
        if few:
            # Room for the labels beside the marks
            for axes in panels:
                axes.set_xlim(right=5.0 * axes.get_xlim()[1])
        figure.suptitle(_title(chart), fontsize=9.5)
        entries: dict[str, object] = {}
        for axes in panels:
            entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
        panels[-1].legend(entries.values(), entries.keys(), loc="upper left", bbox_to_anchor=(1.01, 1.0))
        figure.draw_without_rendering()
        for axes, cost in zip(panels[:2], costs, strict=True):
            _label(figure, axes, chart, cost)
    return figure


def picture_of_chart(path: str, look: Look) -> Figure:
    """The picture of the chart that a file holds."""
    return picture(read(path), look)


def _title(chart: Chart) -> str:
    """Where ways were compared, and with what, where the title of the chart leaves that open."""
    reference = chart.reference
    if np.isnan(reference.estimate):
        return chart.title
    return f"{chart.title}; reference: {reference.harmonics} harmonics, error {reference.estimate:.0e}"


def _least_error(chart: Chart) -> float:
    """The reference's own error: what is nearer to it cannot be distinguished from it."""
    estimate = chart.reference.estimate
    return max(estimate, LEAST_ERROR) if np.isfinite(estimate) else LEAST_ERROR


def _draw(axes: Axes, chart: Chart, cost: str, series: str, label: str) -> None:
    ways = [way for way in chart.ways if way.series == series]
    x, y = (np.array([getattr(way, name) for way in ways]) for name in (cost, "error"))
    shown = np.isfinite(x) & (y >= (chart.reference.estimate if np.isfinite(chart.reference.estimate) else 0.0))
    if not shown.any():
        return
    size = TOLERANCE_SIZE if series == "tolerance" else SIZE
    axes.plot(
        x[shown],
        np.maximum(y[shown], _least_error(chart)),
        MARKERS[series],
        color=COLOURS[series],
        markersize=size,
        markerfacecolor="none" if series != "tolerance" else None,
        label=label,
    )


def _label(figure: Figure, axes: Axes, chart: Chart, cost: str) -> None:
    """Labels with the number of contacts beside the marks of series that have them."""
    ways = [way for series in SERIES if series in LABELLED for way in chart.ways if way.series == series]
    ways = [way for way in ways if np.isfinite((getattr(way, cost), way.error)).all()]
    if ways:
        chosen = chart.chosen()
        own = None if chosen is None else chart.ways[chosen]
        places = [(getattr(way, cost), max(way.error, _least_error(chart))) for way in ways]
        sizes = [STAR_SIZE if way is own else SIZE for way in ways]
        label_marks(figure, axes, places, sizes, [f"{way.label}: {way.contacts}" for way in ways])


def _mark(axes: Axes, chart: Chart, cost: str) -> None:
    """The front by time, drawn in its panel only, and the way that the job asks for."""
    if cost == "seconds":
        front = sorted((way.seconds, way.error) for way, on in zip(chart.ways, chart.efficient(), strict=True) if on)
        seconds, error = np.array(front).reshape(-1, 2).T
        nearest = np.maximum(error, _least_error(chart))
        axes.step(seconds, nearest, where="post", color="#8a8a8a", linewidth=1.0, label="efficient front")
    chosen = chart.chosen()
    if chosen is not None and np.isfinite((way := chart.ways[chosen]).error):
        label = f"tolerance = {way.label}" if way.tolerance else f"the job's own: {way.label}"
        axes.plot(
            getattr(way, cost),
            max(way.error, _least_error(chart)),
            "*",
            color="#D55E00",
            markersize=STAR_SIZE,
            label=label,
        )
