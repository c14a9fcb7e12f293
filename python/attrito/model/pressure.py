"""Pressure on element faces as forces at nodes, consistent with the elements' own shape functions:

    f_i = -int p N_i n dA = -p sum_g w_g N_i(r_g, s_g) (dx/dr x dx/ds)(r_g, s_g)

with n outward, so that a positive pressure pushes inward, as in CalculiX. Quadrature is exact for flat faces and for
curved second-order triangles.
"""

from __future__ import annotations

import numpy as np

from attrito.model.face_shapes import quadrature, shapes


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
    place, weight = quadrature(count)
    shape, along_r, along_s = (shapes(count, *place.T, *derivative) for derivative in ((0, 0), (1, 0), (0, 1)))
    x = points[faces]
    area = np.cross(np.einsum("gi,fid->fgd", along_r, x), np.einsum("gi,fid->fgd", along_s, x))
    forces = np.zeros_like(points)
    np.add.at(forces, faces, -np.einsum("f,g,gi,fgd->fid", pressure, weight, shape, area))
    return forces
