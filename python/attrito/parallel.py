"""What rank 0 does alone, all ranks learn: results and failures alike, so that no rank is left waiting."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from attrito.faults import InputError, NumericsError, unusable_file

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

Value = TypeVar("Value")


def on_root(comm: Comm, work: Callable[[], Value]) -> Value:
    """Do `work` on rank 0 and return its value on every rank; a fault is raised on every rank."""
    value, failure = None, None
    if comm.rank == 0:
        try:
            value = work()
        except (InputError, NumericsError) as error:
            failure = error
        except OSError as error:
            failure = unusable_file(error)
    value, failure = comm.bcast((value, failure))
    if failure is not None:
        raise failure
    return value
