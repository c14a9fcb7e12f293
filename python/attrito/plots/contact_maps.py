"""Maps of what contacts do, on their surfaces: the parts of the mesh's faces that belong to each contact, coloured.

Where the mesh is not at hand every contact is a dot. Functions return matplotlib figures, like those of `response.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from attrito.plots.contact_surfaces import Surface, surfaces
from attrito.plots.style import Look, legend_below, plain_text, with_unit
from attrito.results.mesh import mesh_of
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError

# States by colour, and by mark or hatch, so that they differ in grey, too.
STATE_LOOKS = {
    "stuck": {"marker": "o", "facecolor": "#0072B2", "edgecolor": "k"},
    "shaken_down": {"marker": "s", "facecolor": "#56B4E9", "edgecolor": "k"},
    "slipping": {"marker": "D", "facecolor": "#E69F00", "edgecolor": "k"},
    "open": {"marker": "o", "facecolor": "none", "edgecolor": "#D55E00"},
}
STATE_HATCHES = {"slipping": "///", "open": "..."}
QUANTITIES = {
    "slip": "Fraction of the period slipping",
    "state": "State over the period",
    "energy": "Dissipated energy a period",
    "pressure": "Mean normal force",
}
# Height beside its width below which a map has its colours below
FLAT = 0.62
# Edges between cells; cells of no contact, and of those that never touch
SEAM, BARE, PARTED = "#5c6b7a", "#eceff2", "#ffffff"


def place_in_words(result: Result, point: int) -> str:
    """Frequency and level of a point, or amplitude of a mode's."""
    hertz, level = (result.dataset(f"/points/{name}")[point] for name in ("frequency_hz", "level"))
    return f"{hertz:.6g} Hz, level {level:.4g} (point {point})"


def contact_map(
    result: Result,
    point: int,
    quantity: str = "slip",
    look: Look | None = None,
    titled: bool = True,
    panels: Sequence[Surface] | None = None,
) -> Figure:
    """The contacts of a point on their surfaces, one panel a contact set.

    Colour is the quantity: `slip` (fraction of the period), `state`, `energy` (per area where areas are known) or
    `pressure` (mean normal force, likewise). Hatched cells part for some of the period, or never touch; of states each
    has its colour and hatch. Where no mesh is at hand, dots: diamonds part, hollow ones never touch.

    Parameters
    ----------
    result, point : an open result and one of its points
    quantity : one of `QUANTITIES`
    look : size and letters
    titled : whether the figure says which point it is
    panels : what `surfaces` returned; None: that is asked here
    """
    result.check_point(point)
    if not result.has("/contacts/parameters/frame"):
        raise InputError(Fault(result.path, "/contacts/parameters/frame", "absent", "contacts between node sets"))
    panels = surfaces(result, mesh_of(result)) if panels is None else panels
    if not panels:
        key = "/contacts/parameters/position"
        raise InputError(Fault(result.path, key, "unknown", "contacts between node sets, which have a place"))
    shapes = [np.ptp(panel.extent, axis=0) for panel in panels]
    longest = max(shape.max() for shape in shapes) or 1.0
    aspects = np.clip([shape[0] / max(shape[1], 1e-3 * longest) for shape in shapes], 1.0, 8.0)
    look = look or Look()
    with matplotlib.rc_context(look.style()):
        heights = 5.0 / aspects + 1.3
        figure = look.figure((6.8, heights.sum() + 0.8))
        grid = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        for axes, panel in zip(grid, panels, strict=True):
            draw_surface(axes, result, point, panel, quantity)
        if len({axes.get_xlabel() for axes in grid}) == 1:
            for axes in grid[:-1]:
                axes.set_xlabel("")
        if titled:
            figure.suptitle(place_in_words(result, point), fontsize=matplotlib.rcParams["axes.titlesize"])
        finish_map(figure, list(grid), result, point, quantity)
    return figure


def finish_map(figure: Figure, axes: Sequence[Axes], result: Result, point: int, quantity: str) -> None:
    """The legend of the states, or the colour bar of another quantity."""
    if quantity == "state":
        # What is nowhere on the last surface may be on another.
        present = {label: handle for one in axes for handle, label in zip(*_entries(one), strict=True)}
        for name in STATE_LOOKS:
            if (label := name.replace("_", " ")) in present:
                _stand_for(axes[-1], present[label], label)
        for label in present.keys() - {name.replace("_", " ") for name in STATE_LOOKS}:
            _stand_for(axes[-1], present[label], label)
        legend_below(axes[-1], columns=len(present), lines=3.4)
        return
    _, colours, name, unit = _values(result, point, quantity)
    width, height = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    if height < FLAT * width:
        label = with_unit(name, unit, 0.8 * width)
        bar = figure.colorbar(colours, ax=list(axes), label=label, location="bottom", shrink=0.8, pad=0.04, aspect=30)
        # Below, a power of ten at the end of the numbers would lie on it.
        bar.ax.xaxis.set_label_position("top")
    else:
        figure.colorbar(colours, ax=list(axes), label=with_unit(name, unit, 0.8 * height), shrink=0.9, pad=0.02)


def _entries(axes: Axes) -> tuple[list, list[str]]:
    handles, labels = axes.get_legend_handles_labels()
    return handles, labels


def _stand_for(axes: Axes, handle: object, label: str) -> None:
    """An entry of the legend, also where nothing of it is on these axes."""
    if label in axes.get_legend_handles_labels()[1]:
        return
    if isinstance(handle, PolyCollection):
        axes.add_patch(Patch(facecolor=handle.get_facecolor()[0], hatch=handle.get_hatch(), label=label))
    else:
        axes.scatter([], [], s=30.0, linewidth=0.6, label=label, **STATE_LOOKS[label.replace(" ", "_")])


def draw_surface(axes: Axes, result: Result, point: int, surface: Surface, quantity: str) -> None:
    """One surface on one pair of axes."""
    draw = _draw_cells if surface.cells else _draw_dots
    draw(axes, result, point, surface, quantity)
    unit = result.unit("/contacts/parameters/position")
    across, up = (_direction(axis) for axis in surface.axes)
    # Directions that lie across the axes are long: they stand where there is room.
    axes.set_title(plain_text(surface.name) + (f"\nup {up}" if "(" in up else ""))
    axes.set(xlabel=with_unit(across, unit), ylabel=plain_text(unit) if "(" in up else with_unit(up, unit))
    axes.set_aspect("equal")
    axes.margins(0.02 if surface.cells else 0.08, 0.04 if surface.cells else 0.2)


def _draw_cells(axes: Axes, result: Result, point: int, surface: Surface, quantity: str) -> None:
    owner = surface.owner
    contact = surface.contacts[owner]
    opened = np.where(owner >= 0, result.dataset("/contacts/open")[point][contact], np.nan)
    if quantity == "state":
        names = result.names("/contacts/state")
        state = np.where(owner >= 0, result.dataset("/contacts/state")[point][contact], -1)
        for name, mark in STATE_LOOKS.items():
            colour = PARTED if name == "open" else mark["facecolor"]
            if name in names:
                part = state == names.index(name)
                _fill(axes, surface, part, colour, STATE_HATCHES.get(name), name.replace("_", " "))
    else:
        values, colours, *_ = _values(result, point, quantity)
        face = colours.to_rgba(values[contact])
        _fill(axes, surface, opened <= 0, face[opened <= 0])
        parts = (opened > 0) & (opened < 1)
        _fill(axes, surface, parts, face[parts], "//")
        _fill(axes, surface, opened >= 1, PARTED, STATE_HATCHES["open"])
    _fill(axes, surface, owner < 0, BARE, None, "no contact")


def _fill(
    axes: Axes, surface: Surface, part: np.ndarray, colour: object, hatch: str | None = None, label: str | None = None
) -> None:
    """Some cells in a colour, or in one each `[part, 4]`."""
    if not part.any():
        return
    outlines = [surface.cells[index] for index in np.flatnonzero(part)]
    edge = SEAM if hatch is None else "#3a4550"
    axes.add_collection(
        PolyCollection(outlines, facecolors=colour, edgecolors=edge, linewidths=0.35, hatch=hatch, label=label)
    )


def _draw_dots(axes: Axes, result: Result, point: int, surface: Surface, quantity: str) -> None:
    opened = result.dataset("/contacts/open")[point][surface.contacts]
    area = float(np.clip(2600.0 / len(surface.contacts), 5.0, 46.0))
    if quantity == "state":
        names = result.names("/contacts/state")
        state = result.dataset("/contacts/state")[point][surface.contacts]
        for name, mark in STATE_LOOKS.items():
            part = state == names.index(name) if name in names else np.zeros(len(state), dtype=bool)
            if part.any():
                axes.scatter(*surface.seen[part].T, s=area, linewidth=0.6, label=name.replace("_", " "), **mark)
        return
    values, colours, *_ = _values(result, point, quantity)
    kinds = (("o", opened <= 0), ("D", (opened > 0) & (opened < 1)), ("o", opened >= 1))
    for index, (marker, part) in enumerate(kinds):
        face = "none" if index == 2 else colours.to_rgba(values[surface.contacts][part])
        axes.scatter(*surface.seen[part].T, color=face, marker=marker, edgecolor="k", s=area, linewidth=0.6)


def _values(result: Result, point: int, quantity: str) -> tuple[np.ndarray, ScalarMappable, str, str]:
    """What is drawn, `[nc]`, its colours, its name and unit; the same colours on every surface."""
    if quantity == "slip":
        values = result.dataset("/contacts/slip")[point]
        return values, ScalarMappable(Normalize(0, 1), "cividis"), QUANTITIES[quantity], ""
    name = {"energy": "dissipated_energy", "pressure": "n_mean"}[quantity]
    values, label = np.nan_to_num(result.dataset(f"/contacts/{name}")[point]), QUANTITIES[quantity]
    unit = result.unit(f"/contacts/{name}")
    area = result.array("/contacts/parameters/area") if result.has("/contacts/parameters/area") else np.full(1, np.nan)
    if np.all(np.isfinite(area)) and np.all(area > 0):
        values, label = values / area, f"{label}, per area"
        of_area = result.unit("/contacts/parameters/area")
        unit = unit.replace(",", "/area,", 1) if "," in unit else f"{unit}/{of_area}" if unit and of_area else unit
    largest = values.max(initial=0.0)
    return values, ScalarMappable(Normalize(0, largest if largest > 0 else 1.0), "magma_r"), label, unit


def _direction(axis: np.ndarray) -> str:
    """A direction in words: `x`, `-z`, or its components."""
    main = int(np.argmax(np.abs(axis)))
    if abs(axis[main]) > 0.9998:
        return f"{'-' if axis[main] < 0 else ''}{'xyz'[main]}"
    return "(" + ", ".join(f"{component + 0.0:.2f}" for component in np.round(axis, 2)) + ")"
