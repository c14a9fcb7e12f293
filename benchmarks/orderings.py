"""Orderings for the factorisation of a big model's interior stiffness, and block low-rank factors: MUMPS by itself.

    .venv/bin/python benchmarks/orderings.py out/blade_300k --low-rank 0 1e-8 > orderings.json

Every case runs in a process of its own, so that one that crashes is told and no more. Prints JSON: numbers in the
factors and operations as the analysis foresees them, wall times of analysis, factorisation and one solve, memory.
`--analyse` leaves the factorisation out.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from scipy.sparse import csr_matrix

from attrito.library import loading
from attrito.library.names import ORDERINGS

NUMBERS = {"amd": 0, "amf": 2, "scotch": 3, "pord": 4, "qamd": 6}
NAMES = {number: name for name, number in NUMBERS.items()}


def interior_stiffness(path: Path) -> csr_matrix:
    """K_ii with the flanks held."""
    with h5py.File(path) as file:
        parts = (file[f"stiffness/{part}"][:] for part in ("values", "columns", "row_offsets"))
        stiffness = csr_matrix(tuple(parts))
        inside = np.flatnonzero(~np.isin(file["dofs/node"][:], file["node_sets/flanks"][:]))
    return stiffness[inside][:, inside]


def measure(folder: Path, ordering: str, low_rank: float, analyse: bool) -> dict:
    """One case, in this process."""
    loading.load()  # brings the MUMPS that has SCOTCH, before PETSc's own
    import petsc4py

    petsc4py.init([])
    from petsc4py import PETSc

    stiffness = interior_stiffness(folder / "model.h5")
    matrix = PETSc.Mat().createAIJ(stiffness.shape, csr=(stiffness.indptr, stiffness.indices, stiffness.data))
    del stiffness
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver = PETSc.PC().create()
    solver.setOperators(matrix)
    solver.setType(PETSc.PC.Type.CHOLESKY)
    solver.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    solver.setFactorSetUpSolverType()
    factor = solver.getFactorMatrix()
    # PETSc 3.18 forgets an ordering that is set otherwise.
    PETSc.Options().setValue("mat_mumps_icntl_7", NUMBERS[ordering])
    for control, value in ((14, 30), (24, 1)):
        factor.setMumpsIcntl(control, value)
    if low_rank > 0.0:
        factor.setMumpsIcntl(35, 2)
        factor.setMumpsCntl(7, low_rank)
    started = time.perf_counter()
    # petsc4py has no analysis by itself; the set-up finds it done.
    handles = (ctypes.c_void_p(factor.handle), ctypes.c_void_p(matrix.handle), None, (ctypes.c_double * 11)())
    if ctypes.CDLL(None).MatCholeskyFactorSymbolic(*handles) != 0:
        raise RuntimeError("the analysis failed")
    found = {"analysis_seconds": time.perf_counter() - started, "ordering": NAMES.get(factor.getMumpsInfog(7), "other")}
    entries = factor.getMumpsInfog(3)
    found |= {"entries": entries if entries >= 0 else -1e6 * entries, "flops": factor.getMumpsRinfog(1)}
    found |= {"foreseen_megabytes": factor.getMumpsInfog(17), "foreseen_out_of_core": factor.getMumpsInfog(27)}
    if analyse:
        return found
    started, cpu = time.perf_counter(), time.process_time()
    solver.setUp()
    found |= {"factor_seconds": time.perf_counter() - started, "factor_cpu_seconds": time.process_time() - cpu}
    if factor.getMumpsInfog(1) < 0:
        return found | {"error": f"MUMPS {factor.getMumpsInfog(1)}, {factor.getMumpsInfog(2)}"}
    x, y = matrix.createVecs()
    y.setRandom()
    started = time.perf_counter()
    solver.apply(y, x)
    found["solve_seconds"] = time.perf_counter() - started
    residual = y.copy()
    matrix.multAdd(-x, y, residual)
    found["residual"] = residual.norm() / y.norm()
    return found | {"peak_megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def main() -> None:
    """Run every case in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--orderings", nargs="+", choices=ORDERINGS, default=ORDERINGS)
    parser.add_argument("--low-rank", type=float, nargs="+", default=[0.0])
    parser.add_argument("--analyse", action="store_true")
    parser.add_argument("--alone", action="store_true", help="one case, in this process")
    arguments = parser.parse_args()
    cases = [(ordering, low_rank) for ordering in arguments.orderings for low_rank in arguments.low_rank]
    if arguments.alone:
        print(json.dumps(measure(arguments.folder, *cases[0], arguments.analyse)))
        return
    rows = []
    for ordering, low_rank in cases:
        command = [sys.executable, __file__, str(arguments.folder), "--alone", "--orderings", ordering]
        command += ["--low-rank", str(low_rank), *(["--analyse"] if arguments.analyse else [])]
        ran = subprocess.run(command, capture_output=True, text=True)
        asked = {"asked": ordering, "low_rank": low_rank}
        if ran.returncode == 0:
            rows.append(asked | json.loads(ran.stdout))
        else:
            rows.append(asked | {"crashed": ran.returncode, "words": ran.stderr.strip().splitlines()[-1:]})
        common.progress(json.dumps(rows[-1]))
    common.report(rows)


if __name__ == "__main__":
    main()
