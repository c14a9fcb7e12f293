"""The surfaces of a result's contacts, laid flat: where each contact is on them, and which part is its own."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from attrito.model.closest_points import Faces
from attrito.model.contact_cells import Cells, contact_cells
from attrito.model.model import Model
from attrito.model.pairs import node_rows
from attrito.model.surfaces import set_faces
from attrito.results.result import Result


@dataclass(frozen=True)
class Surface:
    """The contacts of one contact set, seen along the normal of their best plane.

    Parameters
    ----------
    name : of the contact set
    contacts : their numbers, [k]
    seen : places in the plane, [k, 2], user length
    axes : what the plane's two directions are in space, [2, 3]
    cells : polygons of the mesh's faces in the plane, [corners, 2] each; none without a mesh
    owner : of each cell, its contact's place in `contacts`; -1: no contact's
    """

    name: str
    contacts: np.ndarray
    seen: np.ndarray
    axes: np.ndarray
    cells: list[np.ndarray] = field(default_factory=list)
    owner: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    @property
    def extent(self) -> np.ndarray:
        """All that is drawn, `[points, 2]`."""
        return np.concatenate([self.seen, *self.cells])


def surfaces(result: Result, model: Model | None = None) -> list[Surface]:
    """The surfaces of a result's contacts that have a place in space, one a contact set; empty without any.

    The plane is the one nearest to the contacts (least squares of the distances), seen against the mean normal of
    side b; its first direction is that in which the contacts extend most.

    Parameters
    ----------
    result : an open result
    model : its mesh, of whose faces the cells are made; None: no cells
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
            middle = position[contacts].mean(axis=0)
            cells = None if model is None else _cells_of(result, model, name, contacts)
            flat = [] if cells is None else [(outline - middle) @ axes.T for outline in cells.outlines]
            owner = np.empty(0, dtype=int) if cells is None else cells.contact
            found.append(Surface(name, contacts, (position[contacts] - middle) @ axes.T, axes, flat, owner))
    return found


def _cells_of(result: Result, model: Model, name: str, contacts: np.ndarray) -> Cells | None:
    """Cells of some contacts of a set `a - b`; None where the mesh is not that of the contacts."""
    set_a = max((one for one in model.node_sets if name.startswith(f"{one} - ")), key=len, default=None)
    if set_a is None or not result.has("/contacts/parameters/node_a"):
        return None
    node = result.array("/contacts/parameters/node_a")[contacts]
    if not np.isin(node, model.node_ids).all():
        return None
    blocks = [node_rows(model, block) for block in set_faces(model.elements, model.node_sets[set_a])]
    position, frame = (result.array(f"/contacts/parameters/{key}")[contacts] for key in ("position", "frame"))
    return contact_cells(Faces(model.coordinates, blocks), position, frame[:, 2], node_rows(model, node))


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
