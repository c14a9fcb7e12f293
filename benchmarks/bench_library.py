"""The library of the benchmarks, libattrito_bench.so: parts of a Newton iteration timed, evaluations counted.

It is built beside the library of the package, whose sessions its entries take, and is not installed.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Collection
from ctypes import POINTER, c_double, c_int
from pathlib import Path
from typing import Any

from attrito.library import loading
from attrito.library.names import STRATEGIES
from attrito.library.session import Solver
from attrito.library.signatures import HANDLE, declare
from attrito.library.structures import Doubles, Integers, RawLaw
from attrito.support.errors import Fault, InputError

NAME = "libattrito_bench.so"
# By name: what is returned, what is taken, as benchmarks/kernels.f90 has it; a test compares them.
SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "attrito_bench_set_stuck_response": (c_int, (HANDLE, c_double, c_double)),
    "attrito_bench_time_residual": (c_int, (HANDLE, c_int, Doubles, Doubles, Integers)),
    "attrito_bench_time_newton_step": (c_int, (HANDLE, c_int, Doubles, Integers)),
    "attrito_bench_time_linear_response": (c_int, (HANDLE, c_double, c_int, Doubles)),
    "attrito_bench_linear_response": (c_int, (HANDLE, c_double, Doubles, Doubles)),
    "attrito_bench_time_contact": (
        None,
        (POINTER(RawLaw), c_int, Doubles, c_int, c_int, Doubles, Doubles),
    ),
    "attrito_bench_evaluations": (c_int, (HANDLE,)),
    "attrito_bench_leave_out": (None, (HANDLE, c_int)),
}


@functools.cache
def load() -> ctypes.CDLL:
    """Load it from the folder of the package's library, whatever build that is of.

    Raises
    ------
    InputError : there is none, as beside an installed library
    """
    place = Path(loading.load()._name).resolve().with_name(NAME)
    if not place.is_file():
        raise InputError(Fault("attrito", str(place), "not found", "a build of the source tree (run script/bootstrap)"))
    library = ctypes.CDLL(str(place))
    declare(library, SIGNATURES)
    return library


def evaluations(solver: Solver) -> int:
    """Evaluations of the balance since a solver's session began: what solving costs, whatever the machine."""
    return load().attrito_bench_evaluations(solver.handle)


def leave_out(solver: Solver, strategies: Collection[str]) -> None:
    """Solve without these of `STRATEGIES` from now on."""
    load().attrito_bench_leave_out(solver.handle, sum(1 << (1 + STRATEGIES.index(name)) for name in strategies))
