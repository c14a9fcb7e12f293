"""One reduction of a big model, as many ranks as it is run on: wall time and memory of each step.

    mpirun -n 2 .venv/bin/python benchmarks/reduction.py out/blade_300k --modes 100 > reduction.json

The folder holds the model.h5 of `blade_solid.py`. Boundary: its node set `flanks`; loads: a force along y and a
monitor along x at the tip. Prints JSON: the report of the reduction, ranks and threads, beside the rate of a dense
product, which nothing here can exceed; and the processor's seconds of rank 0 in the eigensolver. rom.h5 is removed
unless `--keep`.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from mpi4py import MPI

from attrito.library.names import EIGENSOLVERS, ORDERINGS
from attrito.library.reduction import BLOCK_VECTORS, Options, reduce_model


def boundary_and_vectors(path: Path, nodes: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Dofs of the flanks, or of so many of their nodes, and two vectors `[2, n]` at the tip."""
    with h5py.File(path) as file:
        node, direction = file["dofs/node"][:], file["dofs/direction"][:]
        flanks, tip = file["node_sets/flanks"][:], file["node_sets/tip"][0]
    if nodes is not None:
        flanks = flanks[np.linspace(0, len(flanks) - 1, nodes).astype(int)]
    vectors = np.stack([(node == tip) & (direction == axis) for axis in (2, 1)]).astype(float)
    return np.flatnonzero(np.isin(node, flanks)), vectors


@dataclass
class ProcessorClock:
    """Processor seconds of rank 0 at the eigensolver's start and end, which other work on the machine hardly moves."""

    start: float = 0.0
    end: float = 0.0

    def hear(self, text: str, done: int, total: int) -> None:
        """Progress of the reduction: note the time, and tell."""
        if text == "fixed-interface modes":
            self.end = time.process_time()
            if done == 0 and self.start == 0.0:
                self.start = self.end
        tell(text, done, total)


def tell(text: str, done: int, total: int) -> None:
    """Progress with the time of day."""
    part = f" {done} of {total}" if total else ""
    print(f"{time.strftime('%H:%M:%S')} {text}{part}", file=sys.stderr, flush=True)


def main() -> None:
    """Reduce and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--modes", type=int, default=100)
    parser.add_argument("--eigensolver", choices=EIGENSOLVERS, default=EIGENSOLVERS[0])
    parser.add_argument("--ordering", choices=ORDERINGS, default="scotch")
    parser.add_argument("--out-of-core", choices=("auto", "yes", "no"), default="auto")
    parser.add_argument("--block-size", type=int, default=0)
    parser.add_argument("--block-vectors", type=int, default=BLOCK_VECTORS)
    parser.add_argument("--boundary-nodes", type=int, help="of the flanks; few leave little to do but the modes")
    parser.add_argument("--rom", type=Path, help="absent: rom.h5 in the folder")
    parser.add_argument("--keep", action="store_true", help="keep rom.h5")
    arguments = parser.parse_args()
    model, rom = arguments.folder / "model.h5", arguments.rom or arguments.folder / "rom.h5"
    boundary, vectors = boundary_and_vectors(model, arguments.boundary_nodes)
    options = Options(
        modes=arguments.modes,
        eigensolver=arguments.eigensolver,
        ordering=arguments.ordering,
        out_of_core={"auto": None, "yes": True, "no": False}[arguments.out_of_core],
        block_size=arguments.block_size,
        block_vectors=arguments.block_vectors,
    )
    clock = ProcessorClock()
    started = time.perf_counter()
    report = reduce_model(
        MPI.COMM_WORLD,
        model,
        rom,
        boundary,
        options,
        vectors,
        listener=clock.hear,
    )
    seconds = time.perf_counter() - started
    if MPI.COMM_WORLD.rank == 0:
        if not arguments.keep:
            rom.unlink()
        ranks, threads = MPI.COMM_WORLD.size, int(os.environ["OPENBLAS_NUM_THREADS"])
        result = {
            "ranks": ranks,
            "threads": threads,
            "wall_seconds": seconds,
            "eigensolver": arguments.eigensolver,
            "modes_processor_seconds": clock.end - clock.start,
            **asdict(report),
        }
        common.report(result | {"flops_per_second_of_a_product": common.machine()["flops_per_second"]})


if __name__ == "__main__":
    main()
