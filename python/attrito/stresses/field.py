"""Stress cycles as a field on the mesh, in a VTU file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI

from attrito.export.export import mesh_cells
from attrito.export.mesh_pieces import Snapshot, write_vtu
from attrito.export.wheel import wheel_of
from attrito.model.model import Model
from attrito.results.periodic_vectors import fourier
from attrito.results.result import Result
from attrito.stresses.stresses import Stresses

SCALARS = (
    "alternating_von_mises",
    "mean_signed_von_mises",
    "alternating_principal",
    "mean_principal",
    "peak_von_mises",
)


def write_field(path: str, model: Model, found: Stresses, motion: np.ndarray, wheel: Result | None = None) -> None:
    """Write `SCALARS` at the nodes, NaN where there is none, and a displacement to warp by.

    Of nodes between materials that of the larger alternating stress counts. `displacement` is half the difference
    between the two instants of the cycle of the node with the largest alternating stress.

    Parameters
    ----------
    path : ending .vtu
    model : with a mesh
    found : stresses of some nodes
    motion : coefficients of the motion of all nodes, `[nk, N, 3]`; NaN: not known
    wheel : the result, of whose wheel all sectors are drawn; None: the model alone
    """
    cells, points = mesh_cells(model)[0], model.coordinates
    # The last of several values of a node stays.
    order = np.argsort(found.cycle.alternating_von_mises, kind="stable")
    fields = {name: np.full(len(points), np.nan) for name in SCALARS}
    for name, values in fields.items():
        values[found.row[order]] = getattr(found.cycle, name)[order]
    harmonics = np.nan_to_num(motion)
    if wheel is not None:
        whole = wheel_of(wheel, found.point)
        cells, points, harmonics = whole.cells(cells, len(points)), whole.points(points), whole.harmonics(harmonics)
        fields = {name: np.tile(values, whole.sectors) for name, values in fields.items()}
    first, second = (fourier(phase, len(harmonics)) for phase in found.cycle.phases[order[-1]])
    shape = np.tensordot(0.5 * (first - second), harmonics, axes=1)
    write_vtu(
        MPI.COMM_SELF, str(Path(path).with_suffix("")), cells, Snapshot(0.0, points, fields | {"displacement": shape})
    )
