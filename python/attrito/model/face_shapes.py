"""Shape functions of element faces (tri3, tri6, quad4, quad8), their derivatives, and quadrature on the reference face.

Faces are known by their number of nodes. Triangles lie on r, s >= 0, r + s <= 1; quadrilaterals on -1 <= r, s <= 1.
Corners come first, anticlockwise seen from outside, then the mid-side nodes of the edges 0-1, 1-2, ...
"""

from __future__ import annotations

import numpy as np

# Where the nodes of a face stand in (r, s), and the powers of r and s its shape functions are made of.
REFERENCE_NODES: dict[int, tuple[tuple[float, float], ...]] = {
    3: ((0, 0), (1, 0), (0, 1)),
    4: ((-1, -1), (1, -1), (1, 1), (-1, 1)),
    6: ((0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)),
    8: ((-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)),
}
MONOMIALS: dict[int, tuple[tuple[int, int], ...]] = {
    3: ((0, 0), (1, 0), (0, 1)),
    4: ((0, 0), (1, 0), (0, 1), (1, 1)),
    6: ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)),
    8: ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (2, 1), (1, 2)),
}


def corners(count: int) -> int:
    """Number of corners of a face of `count` nodes."""
    return 3 if count in (3, 6) else 4


def shapes(count: int, r: np.ndarray, s: np.ndarray, along_r: int = 0, along_s: int = 0) -> np.ndarray:
    """Shape functions at points, or their derivatives.

    Parameters
    ----------
    count : nodes of the face
    r, s : `[points]`
    along_r, along_s : how often to differentiate along r and s

    Returns
    -------
    `[points, count]`
    """
    node_r, node_s = np.array(REFERENCE_NODES[count], dtype=float).T
    p, q = np.array(MONOMIALS[count]).T
    to_shape = np.linalg.inv(node_r[:, None] ** p * node_s[:, None] ** q)
    return _power(np.asarray(r, dtype=float), p, along_r) * _power(np.asarray(s, dtype=float), q, along_s) @ to_shape


def _power(x: np.ndarray, exponents: np.ndarray, derivative: int) -> np.ndarray:
    """A derivative of x^p for several p, `[points, exponents]`."""
    factor = np.ones(len(exponents))
    for step in range(derivative):
        factor = factor * (exponents - step)
    # Products: powers of arrays to arrays take ten times as long.
    powers = np.stack([np.ones_like(x), x, x * x], axis=1)
    return factor * powers[:, np.maximum(exponents - derivative, 0)]


def quadrature(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points `[points, 2]` and weights: degree 4 on triangles (the square's rule collapsed), 5 on quadrilaterals."""
    if corners(count) == 4:
        return _on_square(3)
    x, w = np.polynomial.legendre.leggauss(3)
    # r = a, s = (1 - a) b on 0..1 in a and b; the Jacobian 1 - a takes one degree.
    a, b = np.meshgrid((x + 1) / 2, (x + 1) / 2)
    weight = np.outer(w, w) / 4 * (1 - a)
    return np.column_stack([a.ravel(), ((1 - a) * b).ravel()]), weight.ravel()


def gauss_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points `[points, 2]` and weights: 3 on triangles, degree 2; 2 x 2 on quadrilaterals, degree 3 in r and in s.

    They integrate every shape function of a face with straight sides, all weights positive.
    """
    return triangle_points(2) if corners(count) == 3 else _on_square(2)


def triangle_points(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points `[points, 2]` and positive weights on the reference triangle: 3 for degree 2, 4 for degree 3."""
    from scipy.special import roots_jacobi

    if degree == 2:
        return np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)
    # r = a, s = (1 - a) b; the rule along a has the Jacobian 1 - a as its weight (Gauss-Jacobi).
    a, weight_a = roots_jacobi(2, 1, 0)
    b, weight_b = roots_jacobi(2, 0, 0)
    r, t = np.repeat((a + 1) / 2, 2), np.tile((b + 1) / 2, 2)
    return np.column_stack([r, (1 - r) * t]), np.outer(weight_a / 4, weight_b / 2).ravel()


def _on_square(number: int) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(number)
    r, s = np.meshgrid(x, x)
    return np.column_stack([r.ravel(), s.ravel()]), np.outer(w, w).ravel()
