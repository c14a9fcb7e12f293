"""Pictures of the paper's figures, from the columns that go into their CSV files."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.plots.style import DASHES, LIMIT_COLOUR, STYLE
from attrito_verification.paper.figures import Columns, select
from attrito_verification.paper.wedge import FRICTION, PRELOAD

COLOURS = {"C": "#0072B2", "U1": "#D55E00", "U2": "#009E73", "DTI": "#222222"}
NAMES = {"C": "coupled (C)", "U1": "uncoupled (U1)", "U2": "uncoupled (U2)", "DTI": "time integration"}
STYLES = {"C": "-", "U1": DASHES, "U2": (0, (5, 1.5, 1, 1.5))}
FREQUENCY = "Frequency (Hz)"
RESPONSE = "Amplitude of x / F_exc (µm/N)".replace("F_exc", "$F_{exc}$")
RATIO = "$F_{pl}/F_{exc}$"
RATIO_TICKS = (7, 10, 14, 20, 30, 50, 84, 105, 200, 420)
MICRO = 1e6
LOOP_MARKERS = 40


def picture(number: str, columns: Columns) -> Figure:
    """The picture of a figure of the paper, by its number."""
    with matplotlib.rc_context(STYLE):
        return DRAWINGS[number](columns)


def _responses_on_level_wall(columns: Columns) -> Figure:
    figure, (axes,) = _panels(1, (7.2, 4.0))
    forces = np.unique(columns["force"])
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(forces)))
    for force, colour in zip(forces, colours, strict=True):
        coupled, uncoupled = (select(columns, name, force) for name in ("C", "U1"))
        axes.plot(coupled["frequency_hz"], MICRO * coupled["x_per_force"], color=colour, label=f"{force:g} N")
        every = slice(int(force) % 7, None, max(1, len(uncoupled["force"]) // 24))
        axes.plot(
            uncoupled["frequency_hz"][every],
            MICRO * uncoupled["x_per_force"][every],
            "o",
            color=colour,
            markersize=3.2,
            markerfacecolor="w",
            markeredgewidth=0.8,
        )
    axes.plot([], [], "o", color="#555555", markersize=3.2, markerfacecolor="w", label="uncoupled")
    axes.set(xlabel=FREQUENCY, ylabel=RESPONSE, ylim=(0, None), xlim=_span(columns["frequency_hz"]))
    axes.legend(title="$F_{exc}$, coupled", loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
    return figure


def _responses_on_inclined_wall(columns: Columns) -> Figure:
    figure, panels = _panels(2, (8.4, 3.6), sharey=True)
    for axes, force in zip(panels, np.unique(columns["force"]), strict=True):
        for name, style in STYLES.items():
            part = select(columns, name, force)
            axes.plot(
                part["frequency_hz"],
                MICRO * part["x_per_force"],
                color=COLOURS[name],
                linestyle=style,
                label=NAMES[name],
            )
        axes.set(xlabel=FREQUENCY, title=f"{RATIO} = {PRELOAD / force:g}", xlim=_span(columns["frequency_hz"]))
    panels[0].set(ylabel=RESPONSE, ylim=(0, None))
    panels[0].legend(loc="upper left")
    return figure


def _optimisation(columns: Columns) -> Figure:
    figure, (axes,) = _panels(1, (6.6, 4.0))
    for name, style in STYLES.items():
        part = select(columns, name)
        if len(part["force"]) == 0:
            continue
        axes.plot(
            PRELOAD / part["force"],
            MICRO * part["x_per_force"],
            color=COLOURS[name],
            linestyle=style,
            label=NAMES[name],
        )
    part = select(columns, "DTI")
    axes.plot(PRELOAD / part["force"], MICRO * part["x_per_force"], "o", label=NAMES["DTI"], **_hollow(5.5))
    axes.set(xscale="log", xlabel=RATIO, ylabel="Peak of " + RESPONSE[0].lower() + RESPONSE[1:], ylim=(0, None))
    axes.set_xticks(RATIO_TICKS, [str(tick) for tick in RATIO_TICKS])
    axes.minorticks_off()
    axes.legend(loc="lower right")
    return figure


def _loops(columns: Columns) -> Figure:
    forces = np.unique(columns["force"])
    figure, panels = _panels(len(forces), (2.9 * len(forces) + 2.0, 3.3))
    inclined = np.any(columns["approach"] == "U2")
    for axes, force in zip(panels, forces, strict=True):
        for name, style in STYLES.items():
            part = select(columns, name, force)
            if len(part["force"]) == 0:
                continue
            closed = {key: np.append(part[key], part[key][0]) for key in ("u", "t", "n")}
            axes.plot(MICRO * closed["u"], closed["t"], color=COLOURS[name], linestyle=style, label=NAMES[name])
            if name == "C":
                for side in (-1.0, 1.0):
                    axes.plot(
                        MICRO * closed["u"], side * FRICTION * closed["n"], color=LIMIT_COLOUR, linewidth=0.7, zorder=1
                    )
        part = select(columns, "DTI", force)
        every = slice(None, None, max(1, len(part["u"]) // LOOP_MARKERS))
        axes.plot(MICRO * part["u"][every], part["t"][every], "o", label=NAMES["DTI"], **_hollow(3.6))
        hertz = select(columns, "C", force)["frequency_hz"][0]
        kind = f"{RATIO} = {PRELOAD / force:g}" if inclined else f"$F_{{exc}}$ = {force:g} N"
        axes.set(title=f"{kind}, C at {hertz:.1f} Hz", xlabel="u (µm)")
    panels[-1].plot([], [], color=LIMIT_COLOUR, linewidth=0.7, label="± µN of C")
    panels[0].set_ylabel("T (N)")
    panels[-1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)
    return figure


def _preloading(columns: Columns) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.6, 6.2), constrained_layout=True)
        grid = figure.subplots(3, 2, sharex="col", sharey="row")
    for column, start in zip(grid.T, ("U1", "U2"), strict=True):
        part = select(columns, start)
        column[0].plot(part["time"], part["preload"], color="#222222")
        column[0].set_title(start)
        for axes, names, factor, unit in ((column[1], "tn", 1.0, "N"), (column[2], "xy", MICRO, "µm")):
            for name, colour in zip(names, ("#0072B2", "#D55E00"), strict=True):
                values = factor * part[name]
                axes.plot(part["time"], values, color=colour, label=_label(name))
                axes.annotate(
                    f"{values[-1]:.1f} {unit}",
                    (part["time"][-1], values[-1]),
                    xytext=(-2, 4),
                    textcoords="offset points",
                    ha="right",
                    color=colour,
                    fontsize=8.5,
                )
        column[2].set_xlabel("Time (s)")
    for axes, label in zip(grid[:, 0], ("$F_{pl}$ (N)", "Contact force (N)", "Displacement (µm)"), strict=True):
        axes.set_ylabel(label)
    for axes in grid[1:, 0]:
        axes.legend(loc="upper left")
    return figure


def _transients(columns: Columns) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.4, 5.6), constrained_layout=True)
        grid = figure.subplots(2, 2, sharex=True)
    shown = (("t", 1.0, "N"), ("n", 1.0, "N"), ("x", MICRO, "µm"), ("y", MICRO, "µm"))
    looks = {"U1": ("#D55E00", 1), "U2": ("#222222", 2)}
    for axes, (name, factor, unit) in zip(grid.flat, shown, strict=True):
        for start, (colour, order) in looks.items():
            part = select(columns, start)
            values = factor * part[name]
            axes.plot(part["time"], values, color=colour, linewidth=0.7, alpha=0.45, zorder=order)
            # Means over a period, which is what the two histories share in the end.
            centres, means = period_means(part["time"], values)
            axes.plot(centres, means, color=colour, linewidth=1.8, label=f"after {start}", zorder=order + 2)
        axes.annotate(
            f"{means[-1]:.2f} {unit}",
            (centres[-1], means[-1]),
            xytext=(0, 5),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
            bbox={"facecolor": "w", "alpha": 0.8, "edgecolor": "none", "pad": 0.8},
            zorder=6,
        )
        axes.set_ylabel(f"{_label(name)} ({unit})")
    for axes in grid[-1]:
        axes.set_xlabel("Time (s)")
    grid[0, 0].legend(loc="upper right", title="mean over a period")
    return figure


def period_means(time: np.ndarray, values: np.ndarray, samples: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Middle and mean of each period of a history with so many samples a period; the trapezoid rule."""
    starts = np.arange(0, len(values) - samples, samples)
    weights = np.ones(samples + 1)
    weights[[0, -1]] = 0.5
    windows = starts[:, None] + np.arange(samples + 1)
    return time[starts + samples // 2], values[windows] @ weights / samples


def _panels(count: int, size: tuple[float, float], sharey: bool = False) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=size, constrained_layout=True)
    return figure, list(figure.subplots(1, count, squeeze=False, sharey=sharey)[0])


def _span(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _label(name: str) -> str:
    return name.upper() if name in "tn" else name


def _hollow(size: float) -> dict[str, object]:
    return {
        "color": COLOURS["DTI"],
        "markersize": size,
        "markerfacecolor": "none",
        "markeredgewidth": 0.9,
        "linestyle": "none",
        "zorder": 5,
    }


DRAWINGS = {
    "5": _responses_on_level_wall,
    "6": _loops,
    "7": _optimisation,
    "9": _preloading,
    "10": _optimisation,
    "11": _responses_on_inclined_wall,
    "12": _loops,
    "13": _transients,
}
