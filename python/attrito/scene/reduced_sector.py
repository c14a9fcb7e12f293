"""A sector in the coordinates that are solved: those of a reduced model, its boundary dofs first, or the dofs."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_matrix, eye, hstack, identity

from attrito.job.cyclic import nodal_diameter
from attrito.library.reduced_scene import Sector
from attrito.scene.scene import CyclicSector, Scene


def on_coordinates(rows: csr_matrix, size: int, boundary: np.ndarray | None) -> np.ndarray:
    """Rows on dofs, as rows on coordinates `[rows, m]`.

    Parameters
    ----------
    rows : `[rows, n]`, on boundary dofs alone where there is a reduction
    size, boundary : m, and the dofs of the first coordinates; None: the coordinates are the dofs
    """
    if boundary is None:
        return rows.toarray()
    found = np.zeros((rows.shape[0], size))
    found[:, : len(boundary)] = rows[:, boundary].toarray()
    return found


def turned_axes(sector: CyclicSector | None, size: int, boundary: np.ndarray | None) -> csr_matrix | None:
    """A on the coordinates, `[m, m]`: the upper boundary along the next sector's axes; None where nothing is turned."""
    if sector is None or sector.axes is None:
        return None
    if boundary is None:
        return sector.axes
    inside = identity(size - len(boundary))
    return csr_matrix(block_diag([sector.axes[boundary][:, boundary], inside]))


def places_of(sector: CyclicSector, boundary: np.ndarray | None) -> tuple[np.ndarray, ...]:
    """Coordinates of the lower and the upper boundary, `[k]` each, and on the axis along `[a]` and across it `[c, 2]`.

    All dofs of both boundaries are kept.
    """
    dofs = sector.lower, sector.upper, sector.along, sector.across
    return dofs if boundary is None else tuple(np.searchsorted(boundary, places) for places in dofs)


def solved_axes(
    sector: CyclicSector | None, size: int, boundary: np.ndarray | None, interface: np.ndarray | None
) -> csr_matrix | None:
    """A, q = A p, with p what is solved: turned axes, and interface modes W `[k, r]` at the end, lower before upper."""
    axes = turned_axes(sector, size, boundary)
    if interface is None or sector is None:
        return axes
    lower, upper, _, _ = places_of(sector, boundary)
    shapes = eye(size, format="csc")
    others = np.delete(np.arange(size), np.concatenate([lower, upper]))
    of_boundary = [csr_matrix(shapes[:, side] @ interface) for side in (lower, upper)]
    chosen = csr_matrix(hstack([shapes[:, others], *of_boundary]))
    return chosen if axes is None else csr_matrix(axes @ chosen)


def attributes_of_sector(sector: Sector | None) -> dict[str, int]:
    """What the root of a result says of its sector."""
    if sector is None:
        return {}
    number = nodal_diameter(sector.sectors, sector.engine_order)
    return {"sectors": sector.sectors, "engine_order": sector.engine_order, "nodal_diameter": number}


def axes_of_sector(sector: Sector | None) -> dict[str, tuple[np.ndarray, str]]:
    """What a result says of the axes: values and descriptions of datasets by name; none where nothing is turned."""
    axes = None if sector is None else sector.axes
    if axes is None:
        return {}
    entries = axes.tocoo()
    whose = "of an entry of A, q = A p: p the coordinates, with the upper boundary along the next sector's axes"
    return {
        "cyclic/axes/row": (entries.row.astype(np.int32), f"row {whose}"),
        "cyclic/axes/column": (entries.col.astype(np.int32), f"column {whose}"),
        "cyclic/axes/value": (entries.data, f"value {whose}"),
    }


def sector_of(
    scene: Scene, size: int, boundary: np.ndarray | None, interface: np.ndarray | None, axes: csr_matrix | None
) -> Sector | None:
    """The scene's sector on the coordinates; None where the model is whole."""
    if scene.sector is None:
        return None
    lower, upper, along, across = places_of(scene.sector, boundary)
    if interface is not None and axes is not None:
        shapes = interface.shape[1]
        others = np.delete(np.arange(size), np.concatenate([lower, upper]))
        along, across = np.searchsorted(others, along), np.searchsorted(others, across)
        lower, upper = np.split(np.arange(axes.shape[1] - 2 * shapes, axes.shape[1]), 2)
    beyond = on_coordinates(scene.contacts.next_rows, size, boundary)
    return Sector(
        scene.sector.sectors,
        scene.sector.engine_order,
        lower.astype(np.int32),
        upper.astype(np.int32),
        np.ascontiguousarray(beyond if axes is None else beyond @ axes),
        axes,
        along.astype(np.int32),
        across.astype(np.int32),
    )
