"""The picture of a model: its outer faces that look at the viewer, with contacts, loads and monitors on them.

Seen along a direction from outside, without perspective; light comes from the viewer, so that a face is the paler the
straighter it is looked at.
"""

from __future__ import annotations

import json
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from attrito.model.face_shapes import corners
from attrito.model.model import Model
from attrito.model.surfaces import set_faces
from attrito.plots.style import BRANCH_COLOURS, legend_below
from attrito.report.figures import LOOK
from attrito.report.page import Page
from attrito.report.view import View

# From where the model is seen
DIRECTION = np.array([1.0, -1.6, 0.9])
# More faces than this are drawn as an image within the figure.
MOST_FACES = 6000


def structure(page: Page, view: View) -> None:
    """What was solved: the picture of the model, where its file is there, and its sizes."""
    page.section("Model")
    model = view.model
    page.pairs(_sizes(view, model))
    if model is not None:
        words = "The model without perspective, z upwards. Contact faces are shown through the structure."
        if (figure := model_picture(view, model)) is not None:
            page.figures([(figure, words)])


def _sizes(view: View, model: Model | None) -> list[tuple[str, object]]:
    pairs: list[tuple[str, object]] = []
    if model is not None:
        count = sum(len(ids) for ids, _ in model.elements.values())
        pairs.append(("model", f"{model.size} dofs, {len(model.node_ids)} nodes, {count} elements"))
    job = _job(view)
    if view.result.has("/points/coordinates"):
        modes = job.get("reduction", {}).get("modes")
        of = f", {modes} of them fixed-interface modes" if isinstance(modes, int) else ""
        pairs.append(("solved in", f"{view.result.dataset('/points/coordinates').shape[1]} coordinates{of}"))
    pairs.append(("contacts", view.result.contacts))
    units = view.result.attribute("units")
    pairs.append(("units", units or "the user's own"))
    if view.result.points:
        levels = ", ".join(f"{level:.4g}" for level in list(view.peaks)[:8]) + (", ..." if len(view.peaks) > 8 else "")
        span = f"{view.frequency.min():.6g} to {view.frequency.max():.6g} Hz"
        asked = f"{span} at level{'s' * (len(view.peaks) > 1)} {levels}"
        pairs.append(("asked for", f"steady response, {asked}; {view.approach() or 'coupled'} balance"))
    return pairs


def model_picture(view: View, model: Model) -> Figure | None:
    """The figure; None where no element has faces that are known."""
    faces = set_faces(model.elements, model.node_ids)
    if not faces:
        return None
    seat = {int(node): place for place, node in enumerate(model.node_ids)}
    across, up, towards = axes_of_view(DIRECTION)
    polygons, depths, lights = [], [], []
    for block in faces:
        outline = block[:, : corners(block.shape[1])]
        points = model.coordinates[np.vectorize(seat.__getitem__)(outline)]
        if outline.shape[1] > 3:
            normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
        else:
            normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        length = np.linalg.norm(normal, axis=1)
        light = normal @ towards / np.where(length > 0, length, 1.0)
        seen = light > 1e-3
        polygons += list(points[seen] @ np.array([across, up]).T)
        depths.append((points[seen] @ towards).mean(axis=1))
        lights.append(light[seen])
    depth, light = np.concatenate(depths), np.concatenate(lights)
    order = np.argsort(depth)
    with matplotlib.rc_context(LOOK.style()):
        figure = Figure(figsize=LOOK.size((5.1, 4.2)), constrained_layout=True)
        axes = figure.subplots()
        grey = matplotlib.colormaps["Greys"](0.42 - 0.32 * light[order])
        drawn = PolyCollection(
            [polygons[place] for place in order], facecolors=grey, edgecolors="#7a858f", linewidths=0.2
        )
        drawn.set_rasterized(len(order) > MOST_FACES)
        axes.add_collection(drawn)
        _mark(axes, view, model, seat, np.array([across, up]))
        axes.autoscale()
        axes.set_aspect("equal")
        axes.set_axis_off()
        if axes.get_legend_handles_labels()[1]:
            legend_below(axes, 3, lines=0.8)
    return figure


def contact_faces(model: Model, job: dict[str, Any]) -> list[list[int]]:
    """Corners, as node ids, of the faces of both sides of all contact sets."""
    sides = [one.get(side) for one in job.get("contact_set") or [] for side in ("a", "b")]
    found: list[list[int]] = []
    for name in dict.fromkeys(side for side in sides if side in model.node_sets):
        for block in set_faces(model.elements, model.node_sets[name]):
            found += block[:, : corners(block.shape[1])].tolist()
    return found


def axes_of_view(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """To the right, up and towards the viewer, unit vectors; z is up."""
    towards = direction / np.linalg.norm(direction)
    across = np.cross([0.0, 0.0, 1.0], towards)
    across /= np.linalg.norm(across)
    return across, np.cross(towards, across), towards


def _mark(axes: Any, view: View, model: Model, seat: dict[int, int], plane: np.ndarray) -> None:
    result = view.result
    job = _job(view)
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


def _job(view: View) -> dict[str, Any]:
    try:
        tables = json.loads(view.result.attribute("job"))
    except ValueError:
        return {}
    return tables if isinstance(tables, dict) else {}
