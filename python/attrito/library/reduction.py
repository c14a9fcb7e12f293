"""Craig-Bampton reduction of model.h5 to rom.h5 by the Fortran library. The call is collective over all ranks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.library import loading
from attrito.library.names import EIGENSOLVERS, ORDERINGS, REDUCTION_STEPS
from attrito.library.signatures import LISTENER
from attrito.library.structures import RawReduction, RawReductionReport, pointer
from attrito.support.own_folders import remove_folder, take_folder
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm
    from numpy.typing import ArrayLike

# Raised when the steps leave their results in another form.
STEPS_VERSION = 4
TOLERANCE = 1e-12
BLOCK_VECTORS = 16
Listener = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Report:
    """What a reduction found; wall time and largest memory (all ranks, megabytes) of its `REDUCTION_STEPS`.

    `coordinates` = `boundary` + `modes` + `corrections`. `condensed` is 1 where the boundary was condensed, and no
    constraint modes were computed. One mode or two more than asked for are kept where the last
    has twins. `modes_below_shift` is the count by inertia below `shift_hz`, which agrees with the eigensolver's; -1
    where nothing was counted. `mode_solves` vectors were solved for to find the modes. `mode_residual` bounds the
    relative error of the eigenvalues; `constraint_residual` is that of K_ii Psi = -K_ib as solved, 0 without Psi.
    `factor_megabytes` and `factor_flops` are foreseen by the analysis, in core and with the factors on disk, which is
    where they went if `out_of_core`. `worst_error` is the largest estimated relative error of a natural frequency or of
    a point receptance of the reduced model; -1 where nothing was examined.
    """

    dofs: int
    coordinates: int
    boundary: int
    modes: int
    corrections: int
    condensed: int
    negative_pivots: int
    modes_below_shift: int
    mode_solves: int
    factor_megabytes: int
    factor_megabytes_out_of_core: int
    out_of_core: int
    ordering: str
    factor_flops: float
    analysis_seconds: float
    shift_hz: float
    mode_residual: float
    constraint_residual: float
    worst_error: float
    seconds: dict[str, float]
    megabytes: dict[str, float]


@dataclass(frozen=True)
class Options:
    """What is asked of a reduction; one of the first three says how many fixed-interface modes there are.

    Parameters
    ----------
    modes : their number, or
    max_frequency_hz : keep all up to this one, or
    error_target : double their number until natural frequencies and point receptances are estimated to be this near
    top_frequency_hz : where that is looked at, from 0; 0: up to two thirds of the highest mode's frequency
    eigensolver : who finds the modes, one of `EIGENSOLVERS`
    check_inertia : prove by a second factorisation that no mode was missed
    ordering : of the rows for the factorisation, one of `ORDERINGS`
    out_of_core : factors on disk; None: where memory is short. They go to the folder MUMPS_OOC_TMPDIR, or /tmp.
    memory_gb : that the ranks of a machine may take together for the factors and beside them; None: what is free
    block_size : columns of the basis treated at a time, 0: by the size of the model
    block_vectors : vectors solved for at once, where the eigensolver has blocks
    condense : the boundary, without constraint modes; None: where that takes fewer operations. Only with dofs to be
        recovered given, and without damping and Coriolis forces in the model
    """

    modes: int | None = None
    max_frequency_hz: float | None = None
    error_target: float | None = None
    top_frequency_hz: float = 0.0
    eigensolver: str = EIGENSOLVERS[0]
    check_inertia: bool = True
    ordering: str = ORDERINGS[0]
    out_of_core: bool | None = None
    memory_gb: float | None = None
    block_size: int = 0
    block_vectors: int = BLOCK_VECTORS
    condense: bool | None = None

    def __post_init__(self) -> None:
        if sum(given is not None for given in (self.modes, self.max_frequency_hz, self.error_target)) != 1:
            raise TypeError("give one of modes, max_frequency_hz and error_target")

    @property
    def raw(self) -> RawReduction:
        """As the library takes them."""
        return RawReduction(
            modes=-1 if self.modes is None else self.modes,
            block_size=self.block_size,
            block_vectors=self.block_vectors,
            check_inertia=int(self.check_inertia),
            max_frequency_hz=self.max_frequency_hz or 0.0,
            error_target=self.error_target or 0.0,
            top_frequency_hz=self.top_frequency_hz,
            tolerance=TOLERANCE,
            memory_megabytes=1024.0 * (self.memory_gb or 0.0),
            ordering=self.ordering.encode(),
            out_of_core={None: b"auto", True: b"yes", False: b"no"}[self.out_of_core],
            eigensolver=self.eigensolver.encode(),
            condense={None: b"auto", True: b"yes", False: b"no"}[self.condense],
        )


def reduce_model(
    comm: Comm,
    model_path: str | Path,
    rom_path: str | Path,
    boundary: ArrayLike,
    options: Options,
    vectors: ArrayLike | None = None,
    *,
    recovered: ArrayLike | None = None,
    fingerprint: str = "",
    listener: Listener | None = None,
) -> Report:
    """Reduce a model onto its boundary dofs and a number of modes.

    What the steps have done is kept in the folder `<rom_path>.steps` until the end. A reduction that was interrupted
    goes on from there when it is asked for with the same fingerprint, on any number of ranks.

    Parameters
    ----------
    comm : the ranks that do it together
    model_path, rom_path : docs/reference/files.md; `rom_path` is written over
    boundary : dofs to keep, from 0, the same on every rank; in any order
    options : how many modes, and how they are found
    vectors : `[nv, n]`, loads and monitors; rank 0's are taken. Those that act inside get a static correction each.
    recovered : dofs whose motion can be had from that of the reduced model, from 0, the same on every rank; None: all
    fingerprint : of the matrices and all that is asked; empty: an interrupted reduction starts again
    listener : called with progress on rank 0: a step, how much of it is done, of how much; or a sentence, and 0, 0

    Raises
    ------
    InputError : a motion stays free with the boundary held, the file is no model, or there is no room on the disk
    NumericsError : no memory for the factors, or modes were missed
    """
    dofs = np.unique(np.asarray(boundary, dtype=np.intc))
    kept = np.zeros(0, dtype=np.intc) if recovered is None else np.unique(np.asarray(recovered, dtype=np.intc))
    block = np.zeros((0, 0)) if vectors is None or comm.rank else np.atleast_2d(np.asarray(vectors, dtype=float))
    block = np.ascontiguousarray(block)
    count = comm.bcast(len(block))
    raw = options.raw
    steps = Path(f"{rom_path}.steps")
    on_root(comm, lambda: take_folder(steps, fingerprint and f"{STEPS_VERSION} {fingerprint}"))
    listen = (
        LISTENER(lambda text, done, total: listener(text.decode(), done, total))
        if listener and not comm.rank
        else LISTENER()
    )
    report, message = RawReductionReport(), loading.message_buffer()
    status = loading.load().attrito_reduce(
        comm.py2f(),
        str(model_path).encode(),
        str(rom_path).encode(),
        str(steps).encode(),
        len(dofs),
        pointer(dofs),
        block.shape[1],
        count,
        pointer(block),
        -1 if recovered is None else len(kept),
        pointer(kept),
        ctypes.byref(raw),
        listen,
        ctypes.byref(report),
        len(message),
        message,
    )
    # What is at fault stays so; what ran out of memory, or of room on the disk, may go on another time.
    if status == 2 or not fingerprint or status == 0:
        on_root(comm, lambda: remove_folder(steps))
    loading.check(status, message)
    return _report_of(report)


def _report_of(raw: RawReductionReport) -> Report:
    """What the library reports, with names."""
    values = {field.name: getattr(raw, field.name) for field in fields(Report)}
    values["ordering"] = raw.ordering.decode().strip()
    for name in ("seconds", "megabytes"):
        values[name] = dict(zip(REDUCTION_STEPS, values[name], strict=True))
    return Report(**values)
