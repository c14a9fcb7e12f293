"""A small elastic block assembled here, eight-node bricks, so that its matrices are known without any reader."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sparse
import synthetic

from attrito.model.model import Model

YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7800.0
CORNERS = np.array([(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def elastic_block(
    counts: Sequence[int],
    size: Sequence[float],
    fixed: Callable[[np.ndarray], np.ndarray] = lambda points: np.zeros(len(points), bool),
) -> tuple[Model, np.ndarray]:
    """A model with stiffness, mass and Rayleigh damping, and the points of its nodes `[N, 3]`.

    `fixed` picks the nodes that are held for good: their dofs are not in the matrices. The other nodes keep their
    order, three dofs each.
    """
    body = synthetic.block("C3D8", counts, size)
    stiffness, mass = assemble_bricks(body.points, body.connectivity)
    free = np.repeat(~fixed(body.points), 3)
    stiffness, mass = (matrix[free][:, free] for matrix in (stiffness, mass))
    return Model(stiffness, mass, 3.0 * mass + 1e-6 * stiffness), body.points[free[::3]]


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """The six rigid motions `[3 N, 6]`."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for axis in range(3):
        motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], points)
    return motions.reshape(-1, 6)


def assemble_bricks(points: np.ndarray, connectivity: np.ndarray) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Stiffness and consistent mass of eight-node bricks, `[3 N, 3 N]`."""
    dofs = (3 * connectivity[:, :, None] + np.arange(3)).reshape(len(connectivity), 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    blocks = [_element(points[nodes]) for nodes in connectivity]
    values = (np.concatenate([block[i].ravel() for block in blocks]) for i in (0, 1))
    stiffness, mass = (sparse.csr_matrix((entries, (rows, columns)), (3 * len(points),) * 2) for entries in values)
    return stiffness, mass


def _element(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and consistent mass `[24, 24]`, two Gauss points a direction."""
    shear = YOUNG / (2 * (1 + POISSON))
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    elasticity = np.diag([2 * shear] * 3 + [shear] * 3)
    elasticity[:3, :3] += lame
    stiffness, mass = np.zeros((24, 24)), np.zeros((24, 24))
    for point in CORNERS / np.sqrt(3):
        factors = (1 + CORNERS * point) / 2
        shapes = factors.prod(axis=1)
        slopes = np.array([CORNERS[:, i] / 2 * np.delete(factors, i, axis=1).prod(axis=1) for i in range(3)])
        jacobian = slopes @ corners
        x, y, z = np.linalg.solve(jacobian, slopes)
        none = np.zeros(8)
        strain = np.array([[x, none, none], [none, y, none], [none, none, z], [y, x, none], [none, z, y], [z, none, x]])
        strain = strain.transpose(0, 2, 1).reshape(6, 24)
        volume = np.linalg.det(jacobian)
        stiffness += volume * strain.T @ elasticity @ strain
        mass += volume * DENSITY * np.kron(np.outer(shapes, shapes), np.eye(3))
    return (stiffness + stiffness.T) / 2, mass
