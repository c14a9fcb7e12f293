"""The picture of stresses: alternating stress on the outer faces of the mesh, and every node in a Goodman diagram.

Faces are seen without perspective, light coming from the viewer, from that of four sides on which the largest stress
shows.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from attrito.model.model import Model
from attrito.model.pairs import node_rows
from attrito.model.surfaces import FACETS, set_faces
from attrito.plots.solid import Seen, seen_faces
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


def stress_picture(model: Model, found: Stresses) -> Figure:
    """The figure: the mesh coloured by the alternating von Mises stress, and the Goodman diagram of the nodes."""
    values = np.full(len(model.node_ids), np.nan)
    np.fmax.at(values, found.row, found.cycle.alternating_von_mises)
    faces, value = facets(model, values)
    views = [seen_faces(model.coordinates, faces, direction) for direction in DIRECTIONS]
    highest = [np.nanmax(value[view.face], initial=-1.0) for view in views]
    view = views[int(np.argmax(highest))]
    extent = np.ptp(np.concatenate(view.polygons), axis=0) if view.polygons else np.ones(2)
    # The colour bar stands beside the mesh, as wide as a third of the figure's height.
    width = float(np.clip(extent[0] / max(extent[1], 1e-12), 0.3, 1.2)) + 0.35
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.4 + 3.6 * width, 3.9), constrained_layout=True)
        body, diagram = figure.subplots(1, 2, width_ratios=[3.6 * width, 4.4])
        _draw_body(figure, body, view, value[view.face], found)
        _draw_diagram(diagram, found)
    return figure


def facets(model: Model, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Facets of the outer faces, `[F, 4]`, rows of nodes, a triangle's last -1; and means of values at nodes, `[F]`.

    NaN where a node has none.
    """
    found, means = [np.empty((0, 4), dtype=int)], [np.empty(0)]
    for block in set_faces(model.elements, model.node_ids):
        rows = node_rows(model, block)
        for facet in FACETS[rows.shape[1]]:
            own = rows[:, facet]
            found.append(np.pad(own, ((0, 0), (0, 4 - own.shape[1])), constant_values=-1))
            means.append(values[own].mean(axis=1))
    return np.concatenate(found), np.concatenate(means)


def _draw_body(figure: Figure, axes: Axes, view: Seen, value: np.ndarray, found: Stresses) -> None:
    scale = Normalize(0.0, found.cycle.alternating_von_mises.max() or 1.0)
    colours = matplotlib.colormaps[MAP](scale(np.nan_to_num(value)))[:, :3]
    colours[np.isnan(value)] = UNKNOWN
    colours *= (DARKEST + (1.0 - DARKEST) * view.light)[:, None]
    # Edges of the same colour, lest the background shows between facets
    drawn = PolyCollection(view.polygons, facecolors=colours, edgecolors=colours, linewidths=0.2)
    drawn.set_rasterized(len(view.polygons) > MOST_FACETS)
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
