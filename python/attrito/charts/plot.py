"""The picture of `attrito chart`: error against processor time, counted work, and the number of patches."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.charts.file import SERIES, Chart, Way
from attrito.charts.labels import label_marks
from attrito.plots.style import BRANCH_COLOURS, STYLE

MARKERS = dict(zip(SERIES, ("o", "s", "^", "v", "D", "h", "p", "x", "+", "P", "s", "D", "o", "s"), strict=True))
HUES = (
    "#000000",
    *BRANCH_COLOURS[:4],
    "#8a5a2b",
    "#000000",
    *BRANCH_COLOURS[4:],
    "#000000",
    *BRANCH_COLOURS[:2],
    *BRANCH_COLOURS[:2],
)
COLOURS = dict(zip(SERIES, HUES, strict=True))
# Ways of these are few, and each has its label beside its mark
LABELLED = ("points", "meshes")
# Errors are drawn down to here; what is nearer cannot be distinguished from the reference
LEAST_ERROR = 1e-9
# Diameters of marks in points: of ways, of those by tolerance, of the one that the job asks for
SIZE, TOLERANCE_SIZE, STAR_SIZE = 4.5, 5.5, 15.0


def picture(chart: Chart) -> Figure:
    """A panel a cost; the efficient front is a line, the way that the job asks for a star.

    Patches have a panel of their own beside these.

    The dotted line is the reference's own estimated error: errors below it mean nothing.
    """
    with matplotlib.rc_context(STYLE):
        patches = [way for way in chart.ways if way.series == "patches" and np.isfinite(way.error)]
        costs = ("seconds", "work", "contacts") if patches else ("seconds", "work")
        figure = Figure(figsize=(12.4 if not patches else 15.6, 4.6), constrained_layout=True)
        panels = figure.subplots(1, len(costs), sharey=True)
        for axes, cost in zip(panels, costs, strict=True):
            if cost == "contacts":
                _draw(axes, patches, cost, "patches", SERIES["patches"])
                axes.set(xscale="log", xlabel="Number of patches")
                continue
            for series, label in SERIES.items():
                _draw(axes, [way for way in chart.ways if way.series == series], cost, series, label)
            _mark(axes, chart, cost)
            if np.isfinite(chart.reference.estimate):
                axes.axhline(chart.reference.estimate, color="#8a8a8a", linestyle=":", linewidth=1.0, label="reference")
            axes.set(xscale="log", yscale="log", xlabel="Processor time (s)" if cost == "seconds" else "Counted work")
        panels[0].set_ylabel(chart.quantity)
        errors = [error for error in (*(way.error for way in chart.ways), chart.reference.estimate) if error == error]
        few = all(way.series in LABELLED for way in chart.ways)
        panels[0].set_ylim(bottom=max(min(errors), LEAST_ERROR) / 3, top=3.0 * max(errors) if few else 2.0)
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
        for axes, cost in zip(panels[:2], costs[:2], strict=True):
            _label(figure, axes, chart, cost)
    return figure


def _title(chart: Chart) -> str:
    """Where ways were compared, and with what, where the title of the chart leaves that open."""
    reference = chart.reference
    if np.isnan(reference.estimate):
        return chart.title
    return f"{chart.title}; reference: {reference.harmonics} harmonics, error {reference.estimate:.0e}"


def _draw(axes: Axes, ways: list[Way], cost: str, series: str, label: str) -> None:
    x, y = (np.array([getattr(way, name) for way in ways]) for name in (cost, "error"))
    shown = np.isfinite(x) & np.isfinite(y)
    if not shown.any():
        return
    size = TOLERANCE_SIZE if series == "tolerance" else SIZE
    axes.plot(
        x[shown],
        np.maximum(y[shown], LEAST_ERROR),
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
        own = chart.ways[chart.chosen()]
        places = [(getattr(way, cost), max(way.error, LEAST_ERROR)) for way in ways]
        sizes = [STAR_SIZE if way is own else SIZE for way in ways]
        label_marks(figure, axes, places, sizes, [f"{way.label}: {way.contacts}" for way in ways])


def _mark(axes: Axes, chart: Chart, cost: str) -> None:
    """The front by time, drawn in its panel only, and the way that the job asks for."""
    if cost == "seconds":
        front = sorted((way.seconds, way.error) for way, on in zip(chart.ways, chart.efficient(), strict=True) if on)
        seconds, error = np.array(front).T
        nearest = np.maximum(error, LEAST_ERROR)
        axes.step(seconds, nearest, where="post", color="#8a8a8a", linewidth=1.0, label="efficient front")
    way = chart.ways[chart.chosen()]
    if np.isfinite(way.error):
        label = f"tolerance = {way.label}" if way.tolerance else f"the job's own: {way.label}"
        axes.plot(
            getattr(way, cost), max(way.error, LEAST_ERROR), "*", color="#D55E00", markersize=STAR_SIZE, label=label
        )
