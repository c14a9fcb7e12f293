"""Ending a run in good order: at a signal of a batch system, or before its limit of time.

A signal is only noted; the run asks after every point, when nothing is half done. All ranks answer alike, whichever of
them the signal reached.
"""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

SIGNALS = (signal.SIGTERM, signal.SIGUSR1, signal.SIGUSR2)


class Stop:
    """Notes signals while its `with` block lasts.

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
        # Python hands signals to the main thread alone; a run in another one heeds its limit of time.
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._signal = number

    def asked(self) -> str:
        """Why to stop after this point; empty: go on. Collective."""
        now = time.monotonic()
        self._longest, self._last = max(self._longest, now - self._last), now
        late = self._limit is not None and now - self._begun + self._longest > self._limit
        answers = self._comm.allgather((self._signal, late and self._comm.rank == 0))
        number = max(number for number, _ in answers)
        if number:
            return signal.Signals(number).name
        return f"--max-seconds {self._limit:g}" if any(late for _, late in answers) else ""
