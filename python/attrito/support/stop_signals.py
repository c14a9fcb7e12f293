"""Ending a run in good order: at a signal of a batch system, or before its limit of time.

A signal is only noted; the run asks after every point, when nothing is half done, and between the visits that bounds
take, after which the point is not kept. All ranks answer alike, whichever of them the signal reached. SIGTERM is noted
while points are being solved alone: before and after, it ends the process, as it does where nothing is said of it.
"""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

WARNINGS = (signal.SIGUSR1, signal.SIGUSR2)


class Stop:
    """Notes SIGUSR1 and SIGUSR2 while its `with` block lasts, and SIGTERM within `solving`.

    Parameters
    ----------
    comm : the ranks that run together
    max_seconds : wall time after which there is no time for another point; None: no limit
    """

    def __init__(self, comm: Comm, max_seconds: float | None = None):
        self._comm, self._limit = comm, max_seconds
        self._begun = self._last = time.monotonic()
        self._longest = 0.0
        self._signal = 0
        self._before: dict[int, object] = {}

    def __enter__(self) -> Stop:
        self._take(*WARNINGS)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._give_back(*self._before)

    @contextlib.contextmanager
    def solving(self) -> Iterator[None]:
        """Points are solved in the block."""
        self._take(signal.SIGTERM)
        try:
            yield
        finally:
            self._give_back(signal.SIGTERM)

    def _take(self, *numbers: int) -> None:
        # Python hands signals to the main thread alone; a run in another one has its limit of time.
        if threading.current_thread() is threading.main_thread():
            self._before |= {number: signal.signal(number, self._note) for number in numbers}

    def _give_back(self, *numbers: int) -> None:
        for number in numbers:
            if number in self._before:
                signal.signal(number, self._before.pop(number))

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._signal = number

    def asked(self) -> str:
        """Why to stop after this point; empty: go on. Collective."""
        now = time.monotonic()
        self._longest, self._last = max(self._longest, now - self._last), now
        return self._answer(self._limit is not None and now - self._begun + self._longest > self._limit)

    def interrupted(self) -> str:
        """Why to stop at once, within a point that is then not kept; empty: go on. Collective."""
        return self._answer(self._limit is not None and time.monotonic() - self._begun > self._limit)

    def _answer(self, late: bool) -> str:
        answers = self._comm.allgather((self._signal, late and self._comm.rank == 0))
        number = max(number for number, _ in answers)
        if number:
            return signal.Signals(number).name
        return f"--max-seconds {self._limit:g}" if any(late for _, late in answers) else ""
