"""What rotation does to a structure: the centrifugal load, and the softening of its stiffness.

In the frame that turns with speed Omega about an axis a through a point p, small motions q about x feel

    f = Omega^2 M P (x - p),    K - Omega^2 P M P,    P = 1 - a a^T at every node,

P (x - p) being the vector from the axis: the mass times the acceleration of a point in a turning frame, which is
x'' + 2 Omega a x x' - Omega^2 P (x - p). The Coriolis term 2 Omega a x q' is in `coriolis`.

Held dofs have no row. What a node next to a support shares with it is in the load (`held_mass`); they do not move, and
so have no part in the softening.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from attrito.model.held_mass import inertia_of

if TYPE_CHECKING:
    from attrito.model.model import Model

# Part of a unit vector that counts as none.
NEGLIGIBLE = 1e-12


@dataclass(frozen=True)
class Spin:
    """Steady rotation: angular speed (rad/s), a point of the axis `[3]` (user length), its unit direction `[3]`."""

    omega: float
    point: np.ndarray
    direction: np.ndarray


def spin_of(load: dict[str, Any]) -> Spin:
    """The rotation of a `[[load]]` of kind centrifugal."""
    direction = np.array(load["axis_direction"])
    return Spin(2 * np.pi * load["speed_hz"], np.array(load["axis_point"]), direction / np.linalg.norm(direction))


def centrifugal_load(model: Model, spin: Spin) -> np.ndarray:
    """f = Omega^2 M P (x - p), `[n]`, user force."""
    offset = model.coordinates - spin.point
    radius = offset - np.outer(offset @ spin.direction, spin.direction)
    return inertia_of(model, spin.omega**2 * radius)


def softening(model: Model, spin: Spin) -> csr_matrix:
    """Omega^2 P M P, `[n, n]`, user force per length: what rotation takes from the stiffness."""
    across = projector(model, spin.direction)
    taken = csr_matrix(spin.omega**2 * (across @ model.mass @ across))
    # Sums of products round differently on the two sides of the diagonal.
    return ((taken + taken.T) / 2).tocsr()


def projector(model: Model, direction: np.ndarray) -> csr_matrix:
    """P on the model's dofs, `[n, n]`: at each node what is left of its motion without the part along `direction`."""
    dof = _translations(model)[1]
    block = np.eye(3) - np.outer(direction, direction)
    block[np.abs(block) < NEGLIGIBLE] = 0.0
    entries = []
    for i, j in zip(*np.nonzero(block), strict=True):
        both = (dof[:, i] >= 0) & (dof[:, j] >= 0)
        entries.append((np.full(both.sum(), block[i, j]), dof[both, i], dof[both, j]))
    values, rows, columns = (np.concatenate(part) for part in zip(*entries, strict=True))
    return coo_matrix((values, (rows, columns)), shape=(model.size, model.size)).tocsr()


def _translations(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Ids of the nodes with dofs, and the dofs of each along x, y, z, `[nodes, 3]`, -1 where held."""
    nodes, index = np.unique(model.dof_node, return_inverse=True)
    direction = np.asarray(model.dof_direction, dtype=int)
    moves = np.flatnonzero(model.translates)
    dof = np.full((len(nodes), 3), -1)
    dof[index[moves], direction[moves] - 1] = moves
    return nodes, dof


def partly_held(model: Model, direction: np.ndarray) -> np.ndarray:
    """Ids of nodes whose held directions the projector would mix with free ones: their mass there is not known."""
    nodes, dof = _translations(model)
    free = dof >= 0
    oblique = np.abs(direction) > NEGLIGIBLE
    return nodes[(free & oblique).any(axis=1) & (~free & oblique).any(axis=1)]


def softening_within(model: Model) -> float:
    """Speed in Hz of the softening that a model's stiffness already holds; 0 where there is none to be seen.

    A structure at rest resists no translation t: K t = 0 but beside supports. One whose stiffness is softened has
    K t = -Omega^2 P M t there, and the three directions have 2 Omega^2 of that together. Medians over the dofs pass
    over supports; a structure on springs everywhere hides its softening.
    """
    taken = 0.0
    for direction in (1, 2, 3):
        along = np.asarray(model.dof_direction) == direction
        push, inertia = model.stiffness @ along, model.mass @ along
        rows = along & (inertia > 0)
        taken -= np.median(push[rows] / inertia[rows]) if rows.any() else 0.0
    # Rounding of K t, whose terms are as large as the stiffness itself.
    heavy = model.mass.diagonal() > 0
    rounding = 1e-12 * np.median(model.stiffness.diagonal()[heavy] / model.mass.diagonal()[heavy])
    return float(np.sqrt(taken / 2) / (2 * np.pi)) if taken > rounding else 0.0
