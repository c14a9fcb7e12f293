"""Craig-Bampton reduction of model.h5 to rom.h5 by the Fortran library. The call is collective over all ranks."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito import library as foreign

if TYPE_CHECKING:
    from mpi4py.MPI import Comm
    from numpy.typing import ArrayLike

BLOCK_SIZE = 256
TOLERANCE = 1e-12


@dataclass(frozen=True)
class Report:
    """What a reduction found, and the wall time of its steps in seconds.

    `coordinates` = `boundary` + `modes` + `corrections`. One mode or two more than asked for are kept where the last
    has twins. `modes_below_shift` is the count by inertia below `shift_hz`, which agrees with the eigensolver's; -1
    where nothing was counted. `mode_residual` bounds the relative error of the eigenvalues; `constraint_residual` is
    that of K_ii Psi = -K_ib as solved.
    """

    dofs: int
    coordinates: int
    boundary: int
    modes: int
    corrections: int
    negative_pivots: int
    modes_below_shift: int
    factor_megabytes: int
    ordering: str
    shift_hz: float
    mode_residual: float
    constraint_residual: float
    read_seconds: float
    factor_seconds: float
    constraint_seconds: float
    modes_seconds: float
    inertia_seconds: float
    correction_seconds: float
    project_seconds: float
    write_seconds: float


_KINDS = {"int": ctypes.c_int, "float": ctypes.c_double, "str": ctypes.c_char * 8}


class _Report(ctypes.Structure):
    _fields_ = [(field.name, _KINDS[field.type]) for field in fields(Report)]


class _Options(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("modes", "block_size", "check_inertia")),
        *((name, ctypes.c_double) for name in ("max_frequency_hz", "tolerance")),
    ]


def reduce_model(
    comm: Comm,
    model_path: str | Path,
    rom_path: str | Path,
    boundary: ArrayLike,
    vectors: ArrayLike | None = None,
    *,
    modes: int | None = None,
    max_frequency_hz: float | None = None,
    check_inertia: bool = True,
    library: ctypes.CDLL | None = None,
) -> Report:
    """Reduce a model onto its boundary dofs and a number of modes.

    Parameters
    ----------
    comm : the ranks that do it together
    model_path, rom_path : docs/files.md; `rom_path` is written over
    boundary : dofs to keep, from 0, the same on every rank; in any order
    vectors : `[nv, n]`, loads and monitors; rank 0's are taken. Those that act inside get a static correction each.
    modes : number of fixed-interface modes, or
    max_frequency_hz : keep all up to this one
    check_inertia : prove by a second factorisation that no mode was missed

    Raises
    ------
    InputError : a motion stays free with the boundary held, or the file is no model
    NumericsError : no memory for the factors, or modes were missed
    """
    if (modes is None) == (max_frequency_hz is None):
        raise TypeError("give either modes or max_frequency_hz")
    dofs = np.unique(np.asarray(boundary, dtype=np.intc))
    block = np.zeros((0, 0)) if vectors is None or comm.rank else np.atleast_2d(np.asarray(vectors, dtype=float))
    block = np.ascontiguousarray(block)
    count = comm.bcast(len(block))
    options = _Options(
        modes=-1 if modes is None else modes,
        block_size=BLOCK_SIZE,
        check_inertia=int(check_inertia),
        max_frequency_hz=max_frequency_hz or 0.0,
        tolerance=TOLERANCE,
    )
    report, message = _Report(), foreign.message_buffer()
    status = (library or foreign.load()).attrito_reduce(
        ctypes.c_int(comm.py2f()),
        str(model_path).encode(),
        str(rom_path).encode(),
        ctypes.c_int(len(dofs)),
        dofs.ctypes.data_as(ctypes.POINTER(ctypes.c_int)),
        ctypes.c_int(block.shape[1]),
        ctypes.c_int(count),
        block.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        ctypes.byref(options),
        ctypes.byref(report),
        ctypes.c_int(len(message)),
        message,
    )
    foreign.check(status, message)
    values = {field.name: getattr(report, field.name) for field in fields(Report)}
    return Report(**values | {"ordering": report.ordering.decode().strip()})
