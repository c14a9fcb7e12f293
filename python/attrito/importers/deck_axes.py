"""Axes along which nodes of `*TRANSFORM` take the forces of `*CLOAD`.

*TRANSFORM, NSET=rim, TYPE=R      x' along the point a, y' in the plane of a and b, z' = a x b
*TRANSFORM, NSET=rim, TYPE=C      z' along the axis from a to b, x' away from it, y' = z' x x'
a1, a2, a3, b1, b2, b3
"""

from __future__ import annotations

import numpy as np

from attrito.importers.deck import Block
from attrito.importers.deck_ids import fields
from attrito.importers.mesh_data import is_id
from attrito.support.errors import InputError

# Length of a cross product, relative to its factors, below which there is no such direction
PARALLEL = 1e-9


def axes_of_nodes(
    blocks: list[Block], node_sets: dict[str, np.ndarray], node_ids: np.ndarray, coordinates: np.ndarray
) -> dict[int, np.ndarray]:
    """Directions 1, 2, 3 as rows `[3, 3]` by node, NaN on an axis; the last `*TRANSFORM` of a node counts."""
    sets = {name.upper(): ids for name, ids in node_sets.items()}
    order = np.argsort(node_ids)
    found: dict[int, np.ndarray] = {}
    for block in blocks:
        if block.keyword != "TRANSFORM":
            continue
        name = block.parameters.get("NSET", "")
        nodes = sets.get(name.upper(), np.array([int(name)] if is_id(name) else [], np.int64))
        nodes = nodes[np.isin(nodes, node_ids)]
        places = coordinates[order[np.searchsorted(node_ids, nodes, sorter=order)]]
        found |= dict(zip(nodes.tolist(), _axes(block, places), strict=True))
    return found


def _axes(block: Block, places: np.ndarray) -> np.ndarray:
    """Axes `[k, 3, 3]` of one `*TRANSFORM` at places `[k, 3]`."""
    # What is left out is zero, as in CalculiX.
    words = [*(word for line in block.data for word in fields(line)), *[""] * 6][:6]
    kind = block.parameters.get("TYPE", "R").upper()
    if kind not in ("R", "C") or not block.data:
        raise InputError(block.fault(f"TYPE={kind}, {', '.join(words)}", "TYPE=R or TYPE=C, and two points"))
    a, b = np.reshape(block.numbers(0, words), (2, 3))
    if kind == "R":
        z = np.broadcast_to(_unit(np.cross(a, b), np.linalg.norm(a) * np.linalg.norm(b), block), places.shape)
        x = np.broadcast_to(_unit(a, np.linalg.norm(a), block), places.shape)
    else:
        axis = _unit(b - a, np.linalg.norm(b - a), block)
        away = places - a - np.outer((places - a) @ axis, axis)
        length = np.linalg.norm(away, axis=1, keepdims=True)
        x = away / np.where(length > PARALLEL * np.linalg.norm(b - a), length, np.nan)
        z = np.broadcast_to(axis, places.shape)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _unit(vector: np.ndarray, scale: float, block: Block) -> np.ndarray:
    """A vector of length one; one that is nothing in a scale of length is refused."""
    length = np.linalg.norm(vector)
    if not length > PARALLEL * scale:
        raise InputError(block.fault("no axes", "points that differ, and for TYPE=R not on a line with the origin"))
    return np.asarray(vector / length)
