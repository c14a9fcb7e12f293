"""Runs cut short and gone on with, and results compared bit for bit."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np

from attrito.runs.run import run_job
from attrito.support.errors import NumericsError


def run_to_the_end(job: Path) -> str:
    """A run of its own; returns its complaint, empty if there is none."""
    from mpi4py import MPI

    try:
        run_job(MPI.COMM_WORLD, str(job))
    except NumericsError as error:
        return str(error)
    return ""


def run_in_pieces(job: Path) -> tuple[int, str]:
    """One run a point, each with a solver that knows only what is on disk; returns how many runs, and the complaint."""
    from mpi4py import MPI

    for runs in range(1, 10000):
        try:
            run_job(MPI.COMM_WORLD, str(job), resume=True, max_seconds=1e-9)
        except NumericsError as error:
            if str(error).startswith("stopped"):
                continue
            return runs, str(error)
        return runs, ""
    raise AssertionError("no end")


def differences(a: Path, b: Path) -> list[str]:
    """Datasets and attributes of two HDF5 files that are not the same, bit for bit."""
    with h5py.File(a) as left, h5py.File(b) as right:
        return [name for name in sorted({*_contents(left), *_contents(right)}) if _differ(left, right, name)]


def _contents(file: h5py.File) -> list[str]:
    names = ["/"]
    file.visit(names.append)
    return names


def _differ(left: h5py.File, right: h5py.File, name: str) -> bool:
    if name not in left or name not in right:
        return True
    pairs = [(left[name].attrs.get(key), right[name].attrs.get(key)) for key in {*left[name].attrs, *right[name].attrs}]
    if isinstance(left[name], h5py.Dataset):
        pairs.append((left[name][()], right[name][()]))
    return not all(_same(*pair) for pair in pairs)


def _same(a: object, b: object) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype == object or b.dtype == object:
        return bool(np.array_equal(a, b))
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


if __name__ == "__main__":
    # Under mpirun: whole, then in pieces, both into the job's result file, the first of them renamed.
    from mpi4py import MPI

    job_file, result = map(Path, sys.argv[1:])
    run_to_the_end(job_file)
    if MPI.COMM_WORLD.rank == 0:
        result.rename(result.with_suffix(".whole"))
    MPI.COMM_WORLD.barrier()
    run_in_pieces(job_file)
