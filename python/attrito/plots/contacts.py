"""Figures of the contacts at a point: hysteresis loops, and maps of what they do on their surface.

Every function returns a matplotlib figure, like those of `response.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, Look, legend_below, plain_text, with_unit
from attrito.results.loops import Loop
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError

# States by colour and by mark, so that they differ in grey, too.
STATE_LOOKS = {
    "stuck": {"marker": "o", "facecolor": "#0072B2", "edgecolor": "k"},
    "shaken_down": {"marker": "s", "facecolor": "#56B4E9", "edgecolor": "k"},
    "slipping": {"marker": "D", "facecolor": "#E69F00", "edgecolor": "k"},
    "open": {"marker": "o", "facecolor": "none", "edgecolor": "#D55E00"},
}
QUANTITIES = {
    "slip": "Fraction of the period slipping",
    "state": "State over the period",
    "energy": "Dissipated energy a period",
    "pressure": "Mean normal force",
}


@dataclass(frozen=True)
class Surface:
    """The contacts of one contact set, seen along the normal of their best plane.

    Parameters
    ----------
    name : of the contact set
    contacts : their numbers, [k]
    seen : places in the plane, [k, 2], user length
    axes : what the plane's two directions are in space, [2, 3]
    """

    name: str
    contacts: np.ndarray
    seen: np.ndarray
    axes: np.ndarray


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
        size = look.size((max(2.4 * columns, 3.6) + 0.6, 2.3 * rows + 0.7))
        figure = Figure(figsize=size, constrained_layout=True)
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


def place_in_words(result: Result, point: int) -> str:
    """Frequency and level of a point, or amplitude of a mode's."""
    hertz, level = (result.dataset(f"/points/{name}")[point] for name in ("frequency_hz", "level"))
    return f"{hertz:.6g} Hz, level {level:.4g} (point {point})"


def surfaces(result: Result) -> list[Surface]:
    """The surfaces of a result's contacts that have a place in space, one a contact set; empty without any.

    The plane is the one nearest to the contacts (least squares of the distances), seen against the mean normal of
    side b; its first direction is that in which the contacts extend most.
    """
    if not (result.contacts and result.has("/contacts/parameters/position")):
        return []
    position, frame = (result.array(f"/contacts/parameters/{name}") for name in ("position", "frame"))
    sets = np.array([text.decode(errors="replace").strip() for text in result.array("/contacts/parameters/set")])
    found = []
    for name in dict.fromkeys(sets):
        contacts = np.flatnonzero((sets == name) & np.isfinite(position).all(axis=1))
        if len(contacts):
            axes = _best_plane(position[contacts], frame[contacts, 2])
            seen = (position[contacts] - position[contacts].mean(axis=0)) @ axes.T
            found.append(Surface(name, contacts, seen, axes))
    return found


def contact_map(
    result: Result, point: int, quantity: str = "slip", look: Look | None = None, titled: bool = True
) -> Figure:
    """The contacts of a point on their surfaces, one panel a contact set.

    Colour is the quantity: `slip` (fraction of the period), `state`, `energy` (per area where areas are known) or
    `pressure` (mean normal force, likewise). Diamonds part for some of the period, hollow contacts never touch; of
    states each has its colour and mark.
    """
    result.check_point(point)
    if not result.has("/contacts/parameters/frame"):
        raise InputError(Fault(result.path, "/contacts/parameters/frame", "absent", "contacts between node sets"))
    panels = surfaces(result)
    if not panels:
        key = "/contacts/parameters/position"
        raise InputError(Fault(result.path, key, "unknown", "contacts between node sets, which have a place"))
    shapes = [np.ptp(panel.seen, axis=0) for panel in panels]
    longest = max(shape.max() for shape in shapes) or 1.0
    aspects = np.clip([shape[0] / max(shape[1], 1e-3 * longest) for shape in shapes], 1.0, 8.0)
    look = look or Look()
    with matplotlib.rc_context(look.style()):
        heights = 5.0 / aspects + 1.3
        figure = Figure(figsize=look.size((6.8, heights.sum() + 0.8)), constrained_layout=True)
        grid = figure.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        for axes, panel in zip(grid, panels, strict=True):
            draw_surface(axes, result, point, panel, quantity)
        if titled:
            figure.suptitle(place_in_words(result, point), fontsize=matplotlib.rcParams["axes.titlesize"])
        finish_map(figure, list(grid), result, point, quantity)
    return figure


def finish_map(figure: Figure, axes: Sequence[Axes], result: Result, point: int, quantity: str) -> None:
    """The legend of the states, or the colour bar of another quantity."""
    if quantity == "state":
        # What is nowhere on the last surface may be on another.
        present = {label for one in axes for label in one.get_legend_handles_labels()[1]}
        for name, mark in STATE_LOOKS.items():
            if (label := name.replace("_", " ")) in present:
                axes[-1].scatter([], [], s=30.0, linewidth=0.6, label=label, **mark)
        legend_below(axes[-1], columns=len(present), lines=2.2)
        return
    _, colours, name, unit = _values(result, point, quantity)
    label = with_unit(name, unit, 0.8 * figure.get_figheight())
    figure.colorbar(colours, ax=list(axes), label=label, shrink=0.9, pad=0.02)


def draw_surface(axes: Axes, result: Result, point: int, surface: Surface, quantity: str) -> None:
    """One surface on one pair of axes."""
    opened = result.dataset("/contacts/open")[point][surface.contacts]
    area = float(np.clip(2600.0 / len(surface.contacts), 5.0, 46.0))
    if quantity == "state":
        names = result.names("/contacts/state")
        state = result.dataset("/contacts/state")[point][surface.contacts]
        for name, mark in STATE_LOOKS.items():
            part = state == names.index(name) if name in names else np.zeros(len(state), dtype=bool)
            if part.any():
                axes.scatter(*surface.seen[part].T, s=area, linewidth=0.6, label=name.replace("_", " "), **mark)
    else:
        values, colours, *_ = _values(result, point, quantity)
        kinds = (("o", opened <= 0), ("D", (opened > 0) & (opened < 1)), ("o", opened >= 1))
        for index, (marker, part) in enumerate(kinds):
            face = "none" if index == 2 else colours.to_rgba(values[surface.contacts][part])
            axes.scatter(*surface.seen[part].T, color=face, marker=marker, edgecolor="k", s=area, linewidth=0.6)
    across, up = (_direction(axis) for axis in surface.axes)
    axes.set_title(f"{plain_text(surface.name)}\nto the right {across}, up {up}")
    axes.set_aspect("equal")
    axes.margins(0.08, 0.2)


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
        unit = unit.replace(",", "/area,", 1)
    largest = values.max(initial=0.0)
    return values, ScalarMappable(Normalize(0, largest if largest > 0 else 1.0), "magma_r"), label, unit


def _best_plane(position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The two directions `[2, 3]` of the plane nearest to some points; the mean normal says from where it is seen."""
    directions = np.linalg.svd(position - position.mean(axis=0), full_matrices=True)[2]
    first = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
    # Points on a line leave the plane open: it is then the one across their mean normal.
    spread = np.linalg.svd(position - position.mean(axis=0), compute_uv=False)
    mean = np.nan_to_num(normal).mean(axis=0)
    across = directions[2]
    if len(spread) < 2 or spread[1] < 1e-9 * max(spread[0], 1e-300):
        leftover = mean - (mean @ first) * first
        across = leftover / np.linalg.norm(leftover) if np.linalg.norm(leftover) > 1e-9 else directions[2]
    if across @ mean > 0:
        across = -across
    return np.array([first, np.cross(across, first)])


def _direction(axis: np.ndarray) -> str:
    """A direction in words: `x`, `-z`, or its components."""
    main = int(np.argmax(np.abs(axis)))
    if abs(axis[main]) > 0.9998:
        return f"{'-' if axis[main] < 0 else ''}{'xyz'[main]}"
    return "(" + ", ".join(f"{component + 0.0:.2f}" for component in np.round(axis, 2)) + ")"


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
