"""The picture of stresses: alternating stress on the outer faces of the mesh, and every node in a Goodman diagram.

Faces are seen without perspective, light coming from the viewer, from that of four sides on which the largest stress
shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from attrito.model.model import Model
from attrito.model.surfaces import FACETS, set_faces
from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, STYLE, legend_below, with_unit
from attrito.stresses.stresses import Stresses

# From where the model is seen, one of them; z is up
DIRECTIONS = np.array([[x, y, 0.6] for x in (1.0, -1.0) for y in (-1.6, 1.6)])
UNKNOWN = (0.85, 0.85, 0.85)
MAP = "viridis"
# Shade of a face that is looked at along its plane
DARKEST = 0.6
# More facets than this are drawn as an image within the figure.
MOST_FACETS = 6000


@dataclass(frozen=True)
class Facets:
    """Triangles and quadrilaterals of the outer faces that look at the viewer, far ones first.

    Parameters
    ----------
    outlines : in the plane of view, `[corners, 2]` each
    light, value : cosine of the angle to the viewer; mean of the nodes' values, NaN where one has none
    """

    outlines: list[np.ndarray]
    light: np.ndarray
    value: np.ndarray


def stress_picture(model: Model, found: Stresses) -> Figure:
    """The figure: the mesh coloured by the alternating von Mises stress, and the Goodman diagram of the nodes."""
    values = np.full(len(model.node_ids), np.nan)
    np.fmax.at(values, found.row, found.cycle.alternating_von_mises)
    views = [facets(model, values, direction) for direction in DIRECTIONS]
    highest = [np.nanmax(view.value, initial=-1.0) for view in views]
    view = views[int(np.argmax(highest))]
    extent = np.ptp(np.concatenate([np.empty((0, 2)), *view.outlines]), axis=0) if view.outlines else np.ones(2)
    # The colour bar stands beside the mesh, as wide as a third of the figure's height.
    width = float(np.clip(extent[0] / max(extent[1], 1e-12), 0.3, 1.2)) + 0.35
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.4 + 3.6 * width, 3.9), constrained_layout=True)
        body, diagram = figure.subplots(1, 2, width_ratios=[3.6 * width, 4.4])
        _draw_body(figure, body, view, found)
        _draw_diagram(diagram, found)
    return figure


def facets(model: Model, values: np.ndarray, direction: np.ndarray) -> Facets:
    """The facets seen from outside along a direction, with values at nodes `[N]`."""
    towards = direction / np.linalg.norm(direction)
    across = np.cross([0.0, 0.0, 1.0], towards)
    across /= np.linalg.norm(across)
    plane = np.stack([across, np.cross(towards, across)], axis=1)
    order = np.argsort(model.node_ids)
    outlines, depth, light, value = [], [np.empty(0)], [np.empty(0)], [np.empty(0)]
    for block in set_faces(model.elements, model.node_ids):
        rows = order[np.searchsorted(model.node_ids, block, sorter=order)]
        for facet in FACETS[rows.shape[1]]:
            own = rows[:, facet]
            points = model.coordinates[own]
            # The diagonals of a quadrilateral; of a triangle its sides
            normal = np.cross(points[:, 2] - points[:, 0], points[:, -1] - points[:, 1])
            size = np.linalg.norm(normal, axis=1)
            facing = normal @ towards / np.where(size > 0.0, size, 1.0)
            seen = facing > 1e-3
            outlines += list(points[seen] @ plane)
            depth.append((points[seen] @ towards).mean(axis=1))
            light.append(facing[seen])
            value.append(values[own[seen]].mean(axis=1))
    far_first = np.argsort(np.concatenate(depth), kind="stable")
    return Facets(
        [outlines[place] for place in far_first],
        np.concatenate(light)[far_first],
        np.concatenate(value)[far_first],
    )


def _draw_body(figure: Figure, axes: Axes, view: Facets, found: Stresses) -> None:
    scale = Normalize(0.0, found.cycle.alternating_von_mises.max() or 1.0)
    colours = matplotlib.colormaps[MAP](scale(np.nan_to_num(view.value)))[:, :3]
    colours[np.isnan(view.value)] = UNKNOWN
    colours *= (DARKEST + (1.0 - DARKEST) * view.light)[:, None]
    # Edges of the same colour, lest the background shows between facets
    drawn = PolyCollection(view.outlines, facecolors=colours, edgecolors=colours, linewidths=0.2)
    drawn.set_rasterized(len(view.outlines) > MOST_FACETS)
    axes.add_collection(drawn)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_axis_off()
    label = with_unit("alternating von Mises stress", found.stress_unit)
    figure.colorbar(ScalarMappable(scale, MAP), ax=axes, label=label, shrink=0.8)


def _draw_diagram(axes: Axes, found: Stresses) -> None:
    cycle = found.cycle
    mean, alternating = cycle.mean_signed_von_mises, cycle.alternating_von_mises
    worst = int(np.argmax(alternating if found.goodman is None else found.goodman))
    many = axes.plot(mean, alternating, ".", color=BRANCH_COLOURS[0], markersize=3, label="nodes")[0]
    many.set_rasterized(len(mean) > MOST_FACETS)
    label = f"node {found.node[worst]}"
    if found.goodman is not None and found.strengths is not None:
        fatigue, tensile = found.strengths
        corner = min(float(mean.min()), 0.0)
        axes.plot([corner, 0.0, tensile], [fatigue, fatigue, 0.0], color=LIMIT_COLOUR, label="Goodman's line")
        label += f": {found.goodman[worst]:.3g} of the strength"
    axes.plot(mean[worst], alternating[worst], "o", color=BRANCH_COLOURS[1], label=label)
    axes.set_xlabel(with_unit("mean von Mises stress, signed", found.stress_unit))
    axes.set_ylabel(with_unit("alternating von Mises stress", found.stress_unit))
    axes.set_ylim(bottom=0.0)
    legend_below(axes, 2)
    axes.set_title(found.title)
