"""Stiffness and stress of solid elements (C3D4, C3D8, C3D10, C3D20) with fully integrated shape functions."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.sparse import csr_matrix
from scipy.special import roots_jacobi
from synthetic import HEX_EDGES, TET_EDGES

from attrito.model.model import Model

LAME, SHEAR = 1.2, 0.8
TET = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
HEX = np.array([(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
LINEAR = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
TRILINEAR = tuple(product((0, 1), repeat=3))


def _with_middles(corners: np.ndarray, edges: tuple[tuple[int, int], ...]) -> np.ndarray:
    return np.vstack([corners, [(corners[i] + corners[j]) / 2 for i, j in edges]])


# Serendipity: at most one exponent of 2, beside those of 0 and 1.
REFERENCE = {
    "C3D4": (TET, LINEAR),
    "C3D8": (HEX, TRILINEAR),
    "C3D10": (_with_middles(TET, TET_EDGES), tuple(p for p in product(range(3), repeat=3) if sum(p) <= 2)),
    "C3D20": (
        _with_middles(HEX, HEX_EDGES),
        tuple(p for p in product(range(3), repeat=3) if p.count(2) <= 1),
    ),
}


def _points(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Points `[g, 3]` and weights: degree 5 on tetrahedra, 7 in each direction on hexahedra."""
    if kind in ("C3D8", "C3D20"):
        x, w = np.polynomial.legendre.leggauss(4)
        return np.array(list(product(x, x, x))), np.array([a * b * c for a, b, c in product(w, w, w)])
    (a, wa), (b, wb), (c, wc) = (roots_jacobi(3, power, 0) for power in (2, 1, 0))
    place, weight = [], []
    for (i, wi), (j, wj), (k, wk) in product(zip(a, wa, strict=True), zip(b, wb, strict=True), zip(c, wc, strict=True)):
        r, s, t = (i + 1) / 2, (j + 1) / 2, (k + 1) / 2
        place.append((r, (1 - r) * s, (1 - r) * (1 - s) * t))
        weight.append(wi * wj * wk / 64)
    return np.array(place), np.array(weight)


def gradients(model: Model, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of all elements of a kind: nodes `[E, k]` (rows), gradients `[E, g, k, 3]`, volumes of the points `[E, g]`."""
    nodes, powers = (np.array(part) for part in REFERENCE[kind])
    to_shape = np.linalg.inv(np.prod(nodes[:, None] ** powers, axis=2))
    place, weight = _points(kind)
    slopes = []
    for axis in range(3):
        lower = powers.copy()
        lower[:, axis] = np.maximum(powers[:, axis] - 1, 0)
        slopes.append(powers[:, axis] * np.prod(place[:, None] ** lower, axis=2) @ to_shape)
    order = np.argsort(model.node_ids)
    rows = order[np.searchsorted(model.node_ids, model.elements[kind][1], sorter=order)]
    jacobian = np.einsum("agk,ekd->egad", np.array(slopes), model.coordinates[rows])
    volume = weight * np.linalg.det(jacobian)
    assert np.all(volume > 0)
    return rows, np.einsum("egda,agk->egkd", np.linalg.inv(jacobian), np.array(slopes)), volume


def stiffness(model: Model) -> csr_matrix:
    """Stiffness on x, y, z of all nodes, `[3 N, 3 N]`."""
    parts = []
    for kind in model.elements:
        rows, slope, volume = gradients(model, kind)
        along = np.einsum("eg,egid,egjc->eijdc", volume, slope, slope, optimize=True)
        block = LAME * along + SHEAR * along.transpose(0, 1, 2, 4, 3)
        block += SHEAR * np.einsum("eijdd,ac->eijac", along, np.eye(3))
        dofs = 3 * rows[:, :, None] + np.arange(3)
        i = np.broadcast_to(dofs[:, :, None, :, None], block.shape)
        j = np.broadcast_to(dofs[:, None, :, None, :], block.shape)
        parts.append((block.ravel(), i.ravel(), j.ravel()))
    values, i, j = (np.concatenate(part) for part in zip(*parts, strict=True))
    return csr_matrix((values, (i, j)), shape=(3 * len(model.coordinates),) * 2)


def stress(model: Model, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stress `[points, 3, 3]` and volume `[points]` at all integration points, from displacements `[N, 3]`."""
    found = []
    for kind in model.elements:
        rows, slope, volume = gradients(model, kind)
        gradient = np.einsum("ekc,egkd->egcd", displacement[rows], slope).reshape(-1, 3, 3)
        trace = np.trace(gradient, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        found.append((LAME * trace + SHEAR * (gradient + gradient.transpose(0, 2, 1)), volume.ravel()))
    return np.concatenate([part[0] for part in found]), np.concatenate([part[1] for part in found])
