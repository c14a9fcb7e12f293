"""What rank 0 does alone, all ranks learn: results and failures alike, so that no rank is left waiting."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from attrito.support.errors import InputError, NumericsError, unforeseen, unusable_file

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

Value = TypeVar("Value")


def on_root(comm: Comm, work: Callable[[], Value]) -> Value:
    """Do `work` on rank 0 and return its value on every rank; a fault is raised on every rank."""
    return _told_by_root(comm, *_attempt(work) if comm.rank == 0 else (None, None))


def on_root_in_its_time(comm: Comm, work: Callable[[], Value]) -> Value:
    """The same as `on_root` for work that may wait long for other processes: ranks sleep meanwhile, MPI would spin."""
    value, failure = _attempt(work) if comm.rank == 0 else (None, None)
    ready = comm.Ibarrier()
    while not ready.Test():
        time.sleep(0.02)
    return _told_by_root(comm, value, failure)


def on_root_only(comm: Comm, work: Callable[[], Value]) -> Value | None:
    """Do `work` on rank 0, where its value stays, None on the others; a fault is raised on every rank."""
    kept: list[Value] = []
    on_root(comm, lambda: kept.append(work()))
    return kept[0] if kept else None


def everywhere(comm: Comm, work: Callable[[], Value]) -> Value:
    """Do `work` on every rank and return each its own value; a fault of any rank is raised on all of them.

    `work` must not wait for other ranks once it can fail.
    """
    value, failure = _attempt(work)
    failure = next((error for error in comm.allgather(failure) if error is not None), None)
    if failure is not None:
        raise failure
    return value


def _told_by_root(comm: Comm, value: Value | None, failure: Exception | None) -> Value:
    """The root's value on every rank, or its failure; the root's own failure keeps its cause."""
    value, reported = comm.bcast((value, failure))
    if reported is not None:
        raise failure if comm.rank == 0 else reported
    return value


def _attempt(work: Callable[[], Value]) -> tuple[Value | None, Exception | None]:
    """The value of `work`, or what failed as all ranks are to raise it."""
    try:
        return work(), None
    except (InputError, NumericsError) as error:
        return None, error
    except OSError as error:
        return None, unusable_file(error)
    except Exception as error:
        failure = unforeseen(error)
        failure.__cause__ = error
        return None, failure
