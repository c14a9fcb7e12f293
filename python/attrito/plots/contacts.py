"""Hysteresis loops of contacts. Every function returns a matplotlib figure, like those of `response.py`."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, Look, plain_text, with_unit
from attrito.results.loops import Loop
from attrito.support.errors import Fault, InputError


def hysteresis(
    loops: Sequence[Loop],
    unit_length: str = "",
    unit_force: str = "",
    look: Look | None = None,
    legend: bool = True,
    title: str = "",
) -> Figure:
    """Tangential force against relative displacement, one panel a contact.

    The friction limits +- mu N are thin lines over the same displacement: where N varies they are loops themselves,
    and the force runs along them where the contact slips. Two tangents are two lines.
    """
    if not loops:
        raise InputError(Fault("plot", "contacts", "none", "at least one contact"))
    look = look or Look()
    columns = min(int(np.ceil(np.sqrt(len(loops)))), 4)
    rows = -(-len(loops) // columns)
    with matplotlib.rc_context(look.style()):
        usual = max(2.4 * columns, 3.6) + 0.6, 2.3 * rows + 0.7
        figure, size = look.figure(usual), look.size(usual)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, loop in zip(grid.flat, loops, strict=False):
            _draw_loop(axes, loop)
        for axes in grid.flat[len(loops) :]:
            axes.set_axis_off()
        labels = matplotlib.rcParams["axes.labelsize"]
        room = 0.8 * np.array(size)
        figure.supxlabel(with_unit("Relative displacement", unit_length, room[0]), fontsize=labels)
        figure.supylabel(with_unit("Tangential force", unit_force, room[1]), fontsize=labels)
        entries = {label: handle for handle, label in zip(*grid[0, 0].get_legend_handles_labels(), strict=True)}
        if legend and len(entries) > 1:
            grid[0, 0].legend(entries.values(), entries.keys(), loc="best", handlelength=1.4)
        if title:
            figure.suptitle(title, fontsize=matplotlib.rcParams["axes.titlesize"])
    return figure


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
    axes.set_title(plain_text(loop.name))
