"""A sector in the coordinates that are solved: those of a reduced model, its boundary dofs first, or the dofs."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_matrix, identity

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
    beside = (axes - identity(axes.shape[0])).tocoo()
    whose = "of an entry of A - 1, q = A p: p the coordinates, whose upper boundary is along the next sector's axes"
    return {
        "cyclic/axes/row": (beside.row.astype(np.int32), f"row {whose}"),
        "cyclic/axes/column": (beside.col.astype(np.int32), f"column {whose}"),
        "cyclic/axes/value": (beside.data, f"value {whose}"),
    }


def sector_of(scene: Scene, size: int, boundary: np.ndarray | None, axes: csr_matrix | None) -> Sector | None:
    """The scene's sector on the coordinates; None where the model is whole."""
    if scene.sector is None:
        return None
    lower, upper = scene.sector.lower, scene.sector.upper
    if boundary is not None:
        lower, upper = np.searchsorted(boundary, lower), np.searchsorted(boundary, upper)
    beyond = on_coordinates(scene.contacts.next_rows, size, boundary)
    return Sector(
        scene.sector.sectors,
        scene.sector.engine_order,
        lower.astype(np.int32),
        upper.astype(np.int32),
        np.ascontiguousarray(beyond if axes is None else beyond @ axes),
        axes,
    )
