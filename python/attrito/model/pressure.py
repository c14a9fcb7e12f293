"""Pressure on element faces as forces at nodes, consistent with the elements' own shape functions:

    f_i = -int p N_i n dA = -p sum_g w_g N_i(r_g, s_g) (dx/dr x dx/ds)(r_g, s_g)

with n outward, so that a positive pressure pushes inward, as in CalculiX. Quadrature is exact for flat faces and for
curved second-order triangles.
"""

from __future__ import annotations

import numpy as np

from attrito.model.surfaces import MONOMIALS, REFERENCE_NODES


def pressure_forces(points: np.ndarray, faces: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Forces at the nodes of faces of one kind.

    Parameters
    ----------
    points : `[N, 3]`, user length
    faces : rows of `points`, `[F, 3, 4, 6 or 8]`, corners anticlockwise from outside, then mid-side nodes
    pressure : `[F]`, user force per area

    Returns
    -------
    forces `[N, 3]`, user force
    """
    count = faces.shape[1]
    place, weight = _quadrature(count)
    shape, along_r, along_s = _shapes(count, *place.T)
    x = points[faces]
    area = np.cross(np.einsum("gi,fid->fgd", along_r, x), np.einsum("gi,fid->fgd", along_s, x))
    forces = np.zeros_like(points)
    np.add.at(forces, faces, -np.einsum("f,g,gi,fgd->fid", pressure, weight, shape, area))
    return forces


def _shapes(count: int, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions and their derivatives along r and s at points, `[points, count]` each."""
    node_r, node_s = np.array(REFERENCE_NODES[count], dtype=float).T
    p, q = np.array(MONOMIALS[count]).T
    to_shape = np.linalg.inv(node_r[:, None] ** p * node_s[:, None] ** q)
    r, s = r[:, None], s[:, None]
    value = r**p * s**q
    along_r = p * r ** np.maximum(p - 1, 0) * s**q
    along_s = q * r**p * s ** np.maximum(q - 1, 0)
    return value @ to_shape, along_r @ to_shape, along_s @ to_shape


def _quadrature(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points `[points, 2]` and weights: degree 4 on triangles (the square's rule collapsed), 5 on quadrilaterals."""
    x, w = np.polynomial.legendre.leggauss(3)
    if count in (4, 8):
        r, s = np.meshgrid(x, x)
        return np.column_stack([r.ravel(), s.ravel()]), np.outer(w, w).ravel()
    # r = a, s = (1 - a) b on 0..1 in a and b; the Jacobian 1 - a takes one degree.
    a, b = np.meshgrid((x + 1) / 2, (x + 1) / 2)
    weight = np.outer(w, w) / 4 * (1 - a)
    return np.column_stack([a.ravel(), ((1 - a) * b).ravel()]), weight.ravel()
