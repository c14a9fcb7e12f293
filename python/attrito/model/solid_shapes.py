"""Shape functions of solid elements at their integration points, and values at their nodes from those at the points.

The points are those at which CalculiX and Abaqus give stresses: one in a C3D4, four in a C3D10, 2 x 2 x 2 in a C3D8,
C3D8I and C3D20R, 3 x 3 x 3 in a C3D20. A C3D8R has one strain, the mean over its volume. Values at the nodes are those
of the polynomial through the points (constant, linear, trilinear); in a C3D20, with more points than nodes, those of
the combination of its shape functions that fits best in the sense of least squares.

A C3D8I has the gradients of three functions more, 1 - r^2, 1 - s^2, 1 - t^2, which no node moves with; taken as
(det J_0 / det J) J_0^-T grad, J_0 that of the centre, they vanish in the mean over the volume, so that constant strains
are exact (Taylor, Beresford and Wilson, Int. J. Numer. Meth. Engng. 10 (1976) 1211, doi:10.1002/nme.1620100602).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

# Corners of the reference elements, and the edges that mid-side nodes stand on, in CalculiX's order
_TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_HEXA = np.array([[r, s, t] for t in (-1, 1) for r, s in ((-1, -1), (1, -1), (1, 1), (-1, 1))], dtype=float)
_TETRA_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_HEXA_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
# Powers of r, s, t that shape functions and polynomials through points are made of
_CONSTANT = [(0, 0, 0)]
_LINEAR = [powers for powers in product(range(2), repeat=3) if sum(powers) <= 1]
_TRILINEAR = list(product(range(2), repeat=3))
_QUADRATIC = [powers for powers in product(range(3), repeat=3) if sum(powers) <= 2]
# At most one square
_SERENDIPITY = [powers for powers in product(range(3), repeat=3) if powers.count(2) <= 1]


@dataclass(frozen=True)
class SolidShapes:
    """An element's shape functions, on its reference element.

    Parameters
    ----------
    values : at each point, `[points, nodes]`
    gradients : along r, s, t at each point, `[points, nodes, 3]`
    weights : of the points in integrals over the reference element, `[points]`
    to_nodes : values at the nodes from those at the points, `[nodes, points]`
    is_uniform : whether the strain is the mean over the volume
    centre : gradients at the centre of the element, `[nodes, 3]`
    incompatible : gradients of the modes without nodes at each point, `[points, modes, 3]`; no modes in most elements
    """

    values: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray
    to_nodes: np.ndarray
    is_uniform: bool
    centre: np.ndarray
    incompatible: np.ndarray


# Corners, edges with mid-side nodes, powers of the shape functions, number of points, powers of what goes through them
_KINDS = {
    "C3D4": (_TETRA, (), _LINEAR, 1, _CONSTANT),
    "C3D10": (_TETRA, _TETRA_EDGES, _QUADRATIC, 4, _LINEAR),
    "C3D8": (_HEXA, (), _TRILINEAR, 8, _TRILINEAR),
    "C3D8I": (_HEXA, (), _TRILINEAR, 8, _TRILINEAR),
    "C3D8R": (_HEXA, (), _TRILINEAR, 8, _TRILINEAR),
    "C3D20": (_HEXA, _HEXA_EDGES, _SERENDIPITY, 27, _SERENDIPITY),
    "C3D20R": (_HEXA, _HEXA_EDGES, _SERENDIPITY, 8, _TRILINEAR),
}
KINDS = tuple(_KINDS)


@cache
def solid_shapes(kind: str) -> SolidShapes:
    """Those of one of `KINDS`."""
    corners, edges, powers, count, through = _KINDS[kind]
    nodes = np.vstack([corners, *(0.5 * (corners[a] + corners[b])[None] for a, b in edges)])
    points, weights = _tetra_points(count) if corners is _TETRA else _gauss_points(round(count ** (1 / 3)))
    to_shape = np.linalg.inv(_monomials(nodes, powers))
    centre = corners.mean(axis=0, keepdims=True)
    # The pseudo-inverse is the inverse where there are as many points as powers, else the fit by least squares.
    to_nodes = _monomials(nodes, through) @ np.linalg.pinv(_monomials(points, through))
    bubbles = -2.0 * points[:, :, None] * np.eye(3)
    return SolidShapes(
        values=_monomials(points, powers) @ to_shape,
        gradients=_slopes(points, powers, to_shape),
        weights=weights,
        to_nodes=to_nodes,
        is_uniform=kind == "C3D8R",
        centre=_slopes(centre, powers, to_shape)[0],
        incompatible=bubbles if kind == "C3D8I" else bubbles[:, :0],
    )


@cache
def mass_shapes(kind: str, rule: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions and gradients of one of `KINDS` where products of two are integrated, and weights of the points.

    By rule 0 they are exact on straight elements; by rule 1 points are those of stresses, and one in a C3D8R.
    """
    corners, edges, powers, count, _ = _KINDS[kind]
    nodes = np.vstack([corners, *(0.5 * (corners[a] + corners[b])[None] for a, b in edges)])
    if corners is _TETRA:
        points, weights = _tetra_points(count) if rule else _collapsed(*_gauss_points(4))
    else:
        fewer = 1 if kind == "C3D8R" else round(count ** (1 / 3))
        points, weights = _gauss_points(fewer if rule else 3 if edges else 2)
    to_shape = np.linalg.inv(_monomials(nodes, powers))
    return _monomials(points, powers) @ to_shape, _slopes(points, powers, to_shape), weights


def _collapsed(points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A rule of the cube on the tetrahedron, r = x, s = (1 - x) y, t = (1 - x) (1 - y) z, each from 0 to 1."""
    x, y, z = 0.5 * (1.0 + points.T)
    places = np.stack([x, (1.0 - x) * y, (1.0 - x) * (1.0 - y) * z], axis=1)
    return places, weights / 8.0 * (1.0 - x) ** 2 * (1.0 - y)


def _tetra_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of the rules of degree 1 and 2."""
    weights = np.full(count, 1.0 / 6.0 / count)
    if count == 1:
        return np.full((1, 3), 0.25), weights
    near, far = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0
    return np.full((4, 3), far) + (near - far) * _TETRA, weights


def _gauss_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of Gauss's rule, as many along each edge of the cube."""
    line, weight = np.polynomial.legendre.leggauss(count)
    return np.array(list(product(line, repeat=3))), np.prod(list(product(weight, repeat=3)), axis=1)


def _monomials(places: np.ndarray, powers: list[tuple[int, ...]]) -> np.ndarray:
    """`[places, powers]`."""
    return np.asarray(np.prod(places[:, None, :] ** np.array(powers)[None], axis=2))


def _slopes(places: np.ndarray, powers: list[tuple[int, ...]], to_shape: np.ndarray) -> np.ndarray:
    """Gradients of the shape functions, `[places, nodes, 3]`."""
    along = []
    for axis in range(3):
        lower = [tuple(max(p - (k == axis), 0) for k, p in enumerate(row)) for row in powers]
        along.append(np.array(powers)[:, axis] * _monomials(places, lower) @ to_shape)
    return np.stack(along, axis=2)
