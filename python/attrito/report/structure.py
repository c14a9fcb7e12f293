"""The picture of a model: its outer faces that look at the viewer, with contacts, loads and monitors on them.

Seen along a direction from outside, without perspective; light comes from the viewer, so that a face is the paler the
straighter it is looked at.
"""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from attrito.model.face_shapes import corners
from attrito.model.model import Model
from attrito.model.outer_surface import outer_surface
from attrito.model.surfaces import set_faces
from attrito.plots.solid import DIRECTION, axes_of_view, seen_faces
from attrito.plots.style import BRANCH_COLOURS, Look, legend_below
from attrito.report.figures import LOOK
from attrito.report.motion import animation, moving
from attrito.report.page import Animation, Page
from attrito.report.view import View
from attrito.results.mesh import mass_of
from attrito.support.units import axis_unit

# Natural frequencies that are listed
MOST_MODES = 6
# More faces than this are drawn as an image within the figure.
MOST_FACES = 6000


def structure(page: Page, view: View) -> None:
    """What was solved: the picture of the model, where its file is there, and its sizes."""
    page.section("Model")
    model = view.model
    page.pairs(sizes(view))
    if model is None:
        return
    drawn: list[tuple[Figure | Animation, str]] = []
    if (figure := model_picture(view, model)) is not None:
        words = "The model without perspective, z upwards. Contact faces are shown through the structure."
        drawn.append((figure, words))
    if (found := moving(view)) is not None:
        drawn.append(animation(found, view.place(view.point)))
    if drawn:
        page.figures(drawn)


def sizes(view: View) -> list[tuple[str, object]]:
    """What was solved, and what was asked for: names and values."""
    model = view.model
    pairs: list[tuple[str, object]] = []
    if model is not None:
        count = sum(len(ids) for ids, _ in model.elements.values())
        pairs.append(("model", f"{model.size} dofs, {len(model.node_ids)} nodes, {count} elements"))
    job = view.job()
    if view.result.has("/points/coordinates"):
        modes = job.get("reduction", {}).get("modes")
        of = f", {modes} of them fixed-interface modes" if isinstance(modes, int) else ""
        pairs.append(("solved in", f"{view.result.dataset('/points/coordinates').shape[1]} coordinates{of}"))
    if (mass := mass_of(view.result)) is not None:
        unit = axis_unit("user mass", view.result.attribute("units"))
        pairs.append(("mass that moves", f"{mass:.5g}" + (f" {unit}" if "," not in unit else "")))
    pairs.append(("contacts", view.result.contacts))
    stuck = "/linear/stuck/natural_hz"
    if view.result.has(stuck) and len(view.result.array(stuck)):
        listed = ", ".join(f"{hertz:.5g}" for hertz in view.result.array(stuck)[:MOST_MODES])
        pairs.append(("natural frequencies, stuck", f"{listed} Hz"))
    units = view.result.attribute("units")
    pairs.append(("units", units or "the user's own"))
    if view.result.points and not view.is_mode:
        levels = ", ".join(f"{level:.4g}" for level in list(view.peaks)[:8]) + (", ..." if len(view.peaks) > 8 else "")
        span = f"{view.frequency.min():.6g} to {view.frequency.max():.6g} Hz"
        asked = f"{span} at level{'s' * (len(view.peaks) > 1)} {levels}"
        pairs.append(("asked for", f"steady response, {asked}; {view.approach() or 'coupled'} balance"))
    return pairs


def model_picture(view: View, model: Model, look: Look = LOOK) -> Figure | None:
    """The figure; None where no element has faces that are known."""
    surface = outer_surface(model, len(model.node_ids))
    if not len(surface.faces):
        return None
    seen = seen_faces(model.coordinates[surface.nodes], surface.faces)
    across, up, _ = axes_of_view(DIRECTION)
    with matplotlib.rc_context(look.style()):
        flat = np.ptp(np.concatenate(seen.polygons), axis=0)
        figure = look.figure((5.1, float(np.clip(5.1 * flat[1] / flat[0], 1.8, 4.0)) + 0.6))
        axes = figure.subplots()
        grey = matplotlib.colormaps["Greys"](0.42 - 0.32 * seen.light)
        drawn = PolyCollection(seen.polygons, facecolors=grey, edgecolors="#7a858f", linewidths=0.2)
        drawn.set_rasterized(len(seen.polygons) > MOST_FACES)
        axes.add_collection(drawn)
        _mark(axes, view, model, np.array([across, up]))
        axes.autoscale()
        axes.set_aspect("equal")
        axes.set_axis_off()
        if axes.get_legend_handles_labels()[1]:
            legend_below(axes, 2, lines=0.8)
    return figure


def contact_faces(model: Model, job: dict[str, Any]) -> list[list[int]]:
    """Corners, as node ids, of the faces of both sides of all contact sets."""
    sides = [one.get(side) for one in job.get("contact_set") or [] for side in ("a", "b")]
    found: list[list[int]] = []
    for name in dict.fromkeys(side for side in sides if side in model.node_sets):
        for block in set_faces(model.elements, model.node_sets[name]):
            found += block[:, : corners(block.shape[1])].tolist()
    return found


def _mark(axes: Any, view: View, model: Model, plane: np.ndarray) -> None:
    result = view.result
    job = view.job()
    seat = {int(node): place for place, node in enumerate(model.node_ids)}
    if faces := contact_faces(model, job):
        polygons = [model.coordinates[[seat[node] for node in face]] @ plane.T for face in faces]
        colour = BRANCH_COLOURS[1]
        axes.add_collection(
            PolyCollection(polygons, facecolors=colour, alpha=0.5, edgecolors="none", label="contact faces", zorder=3)
        )
    elif result.contacts and result.has("/contacts/parameters/position"):
        position = result.array("/contacts/parameters/position")
        position = position[np.isfinite(position).all(axis=1)]
        if len(position):
            axes.plot(
                *(position @ plane.T).T, "o", color=BRANCH_COLOURS[1], markersize=2.4, alpha=0.8, label="contacts"
            )
    harmonic = [load for load in job.get("load", []) if load.get("kind") == "harmonic"]
    static = [load for load in job.get("load", []) if load.get("kind") != "harmonic"]
    loaded = {
        "harmonic loads": [term for load in harmonic for key in ("cosine", "sine") for term in load.get(key) or []],
        "static loads": [term for load in static for term in load.get("dofs") or []],
        "monitors": [term for monitor in job.get("output", {}).get("monitors") or [] for term in monitor["dofs"]],
    }
    looks = {
        "harmonic loads": ("v", BRANCH_COLOURS[0]),
        "static loads": ("s", "#555555"),
        "monitors": ("*", BRANCH_COLOURS[2]),
    }
    for name, terms in loaded.items():
        places = [seat[node] for term in terms for node in _nodes(model, term) if node in seat]
        if places:
            marker, colour = looks[name]
            size = 9 if marker == "*" else 6
            points = model.coordinates[sorted(set(places))] @ plane.T
            axes.plot(*points.T, marker, color=colour, markersize=size, markeredgecolor="w", label=name, zorder=4)


def _nodes(model: Model, term: Any) -> list[int]:
    """Nodes of a term `[["node", number or set, direction], value]` of a job."""
    dof = term[0] if isinstance(term, list) and term else None
    if not (isinstance(dof, list) and len(dof) > 1 and dof[0] == "node"):
        return []
    if isinstance(dof[1], str):
        return [int(node) for node in model.node_sets.get(dof[1], ())]
    return [int(dof[1])] if isinstance(dof[1], int) else []
