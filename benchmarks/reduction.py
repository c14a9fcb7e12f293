"""One reduction of a big model, as many ranks as it is run on: wall time and memory of each step.

    mpirun -n 2 .venv/bin/python benchmarks/reduction.py out/blade_300k --modes 100 > reduction.json

The folder holds the model.h5 of `blade_solid.py`. Boundary: its node set `flanks`; loads: a force along y and a
monitor along x at the tip. Prints JSON: the report of the reduction, ranks and threads, beside the rate of a dense
product, which nothing here can exceed. rom.h5 is removed unless `--keep`.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import asdict
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from mpi4py import MPI

from attrito.job_schema import ORDERINGS
from attrito.reduction import BLOCK_VECTORS, reduce_model


def boundary_and_vectors(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Dofs of the flanks, and two vectors `[2, n]` at the tip."""
    with h5py.File(path) as file:
        node, direction = file["dofs/node"][:], file["dofs/direction"][:]
        flanks, tip = file["node_sets/flanks"][:], file["node_sets/tip"][0]
    vectors = np.stack([(node == tip) & (direction == axis) for axis in (2, 1)]).astype(float)
    return np.flatnonzero(np.isin(node, flanks)), vectors


def tell(text: str, done: int, total: int) -> None:
    """Progress with the time of day."""
    part = f" {done} of {total}" if total else ""
    print(f"{time.strftime('%H:%M:%S')} {text}{part}", file=sys.stderr, flush=True)


def main() -> None:
    """Reduce and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--modes", type=int, default=100)
    parser.add_argument("--ordering", choices=ORDERINGS, default="scotch")
    parser.add_argument("--out-of-core", choices=("auto", "yes", "no"), default="auto")
    parser.add_argument("--low-rank", type=float, default=0.0, help="threshold of block low-rank factors")
    parser.add_argument("--block-size", type=int, default=0)
    parser.add_argument("--block-vectors", type=int, default=BLOCK_VECTORS)
    parser.add_argument("--keep", action="store_true", help="keep rom.h5")
    arguments = parser.parse_args()
    model, rom = arguments.folder / "model.h5", arguments.folder / "rom.h5"
    boundary, vectors = boundary_and_vectors(model)
    started = time.perf_counter()
    report = reduce_model(
        MPI.COMM_WORLD,
        model,
        rom,
        boundary,
        vectors,
        modes=arguments.modes,
        ordering=arguments.ordering,
        out_of_core={"auto": None, "yes": True, "no": False}[arguments.out_of_core],
        low_rank=arguments.low_rank,
        block_size=arguments.block_size,
        block_vectors=arguments.block_vectors,
        listener=tell,
    )
    seconds = time.perf_counter() - started
    if MPI.COMM_WORLD.rank == 0:
        if not arguments.keep:
            rom.unlink()
        ranks, threads = MPI.COMM_WORLD.size, int(os.environ["OPENBLAS_NUM_THREADS"])
        result = {"ranks": ranks, "threads": threads, "wall_seconds": seconds, **asdict(report)}
        common.report(result | {"flops_per_second_of_a_product": common.machine()["flops_per_second"]})


if __name__ == "__main__":
    main()
