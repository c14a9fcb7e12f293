"""How long each stage of a run took, and the most memory that it held."""

from __future__ import annotations

import resource
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


def peak_megabytes() -> float:
    """The most that this process has held in memory so far."""
    # Linux counts kilobytes.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


class Stages:
    """Wall time by stage on this rank, from now on; what is between two stages belongs to the second."""

    def __init__(self, comm: Comm):
        self._comm = comm
        self._begun = self._last = time.perf_counter()
        self.seconds: dict[str, float] = {}

    def end(self, stage: str) -> None:
        """A part of this stage is over."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    @property
    def total(self) -> float:
        """Seconds since the beginning."""
        return self._last - self._begun

    def peak_megabytes(self) -> list[float]:
        """The most that each rank held in memory. Collective."""
        return self._comm.allgather(peak_megabytes())
