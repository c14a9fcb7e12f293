"""The Campbell diagram: natural frequencies against the speed of rotation, engine orders, and where they meet."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, Look, legend_below
from attrito.results.result import Result

# Nodal diameters that a legend still lists; beyond, a colour bar
MOST_LISTED = 6
# Least distance of the numbers of engine orders, part of the height of the axes
APART = 0.033


def campbell_diagram(result: Result, look: Look | None = None) -> Figure:
    """Modes of a file of `attrito campbell`, coloured by nodal diameter; dashed engine orders; dots where they meet."""
    look = look or Look()
    speed, frequency = result.array("/points/speed_hz"), result.array("/points/frequency_hz")
    mode = result.array("/points/mode")
    is_wheel = result.has("/points/nodal_diameter")
    diameter = result.array("/points/nodal_diameter") if is_wheel else np.zeros(len(speed), dtype=int)
    known = np.unique(diameter)
    colours = _colours(len(known))
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 4.8))
        axes = figure.subplots()
        marker = "." if len(np.unique(speed)) > 1 else "o"
        for place, n in enumerate(known):
            for number in np.unique(mode[diameter == n]):
                own = (diameter == n) & (mode == number)
                label = None if number > 1 else f"nodal diameter {n}" if is_wheel else "modes"
                axes.plot(speed[own], frequency[own], f"{marker}-", color=colours[place], lw=1.0, ms=4, label=label)
        top = 1.05 * max(frequency.max(initial=0.0), 1e-300)
        axes.set_xlim(0.0, max(speed.max(initial=0.0) * 1.01, 1e-300))
        axes.set_ylim(0.0, top)
        _draw_orders(axes, result.array("/crossings/drawn").tolist())
        crossing = result.array("/crossings/speed_hz"), result.array("/crossings/frequency_hz")
        if len(crossing[0]):
            axes.plot(
                *crossing, "o", ms=4.5, mfc="none", mec="k", mew=0.9, label="an engine order meets a mode", zorder=4
            )
        axes.set_xlabel("Speed of rotation (Hz)")
        axes.set_ylabel("Frequency (Hz)")
        if len(known) > MOST_LISTED:
            bounds = np.arange(len(known) + 1) - 0.5
            scale = ScalarMappable(BoundaryNorm(bounds, len(known)), ListedColormap(colours))
            bar = figure.colorbar(scale, ax=axes, ticks=np.arange(len(known)), pad=0.08)
            bar.ax.set_yticklabels([str(n) for n in known])
            bar.ax.minorticks_off()
            bar.set_label("Nodal diameter")
            for line in axes.get_lines():
                if str(line.get_label()).startswith("nodal diameter"):
                    line.set_label("_")
        legend_below(axes, 3)
    return figure


def _colours(count: int) -> list:
    """One for each nodal diameter."""
    if count <= MOST_LISTED:
        return list(BRANCH_COLOURS[:count])
    return [matplotlib.colormaps["viridis"](0.92 * place / (count - 1)) for place in range(count)]


def _draw_orders(axes: Axes, orders: list[int]) -> None:
    """f = e Omega within the axes, its number where it leaves them; numbers that would lie on others are left out."""
    (_, right), (_, top) = axes.get_xlim(), axes.get_ylim()
    taken: list[np.ndarray] = []
    # The axes are wider than high: distances along the top count for more.
    shape = np.array([1.3, 1.0])
    for order in orders:
        end = np.array([min(right, top / order), min(top, order * right)])
        axes.plot([0.0, end[0]], [0.0, end[1]], "--", color=LIMIT_COLOUR, lw=0.8, zorder=1)
        at = shape * end / (right, top)
        if any(np.linalg.norm(at - other) < APART for other in taken):
            continue
        taken.append(at)
        leaves_right = end[1] < top
        axes.annotate(
            f"{order}",
            end,
            xytext=(4, 0) if leaves_right else (0, 3),
            textcoords="offset points",
            ha="left" if leaves_right else "center",
            va="center" if leaves_right else "bottom",
            color=LIMIT_COLOUR,
            fontsize=0.85 * matplotlib.rcParams["font.size"],
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
            annotation_clip=False,
        )
    axes.plot([], [], "--", color=LIMIT_COLOUR, lw=0.8, label="engine orders, numbered")
