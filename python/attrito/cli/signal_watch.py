"""Signals that end a command even where Python cannot answer them.

Python runs the handler of a signal when the library, or MPI, has returned to it: a rank that waits for the others may
never. Python's own C handler, however, writes the signal's number to a pipe at once. A thread reads it and, where the
program has not ended by itself within a time that depends on the signal, ends the process; mpirun then ends the others.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from types import TracebackType

# Seconds from a signal to the end. What batch systems send as a warning (SIGUSR1, SIGUSR2) has no such limit.
PATIENCE = {signal.SIGINT: 5.0, signal.SIGTERM: 12.0}
# What a process that a signal has ended exits with, by the convention of shells.
BY_SIGNAL = 128


class SignalWatch:
    """Ends the process at signals that stay unanswered, while its `with` block lasts; on the main thread alone."""

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._pipe = self._before = -1, -1

    def __enter__(self) -> SignalWatch:
        if threading.current_thread() is threading.main_thread():
            self._pipe = os.pipe()
            os.set_blocking(self._pipe[1], False)
            self._before = signal.set_wakeup_fd(self._pipe[1], warn_on_full_buffer=False)
            self._thread = threading.Thread(target=self._watch, name="signals", daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is None:
            return
        self._ended.set()
        signal.set_wakeup_fd(self._before)
        os.write(self._pipe[1], b"\0")
        self._thread.join()
        for end in self._pipe:
            os.close(end)

    def _watch(self) -> None:
        while (number := os.read(self._pipe[0], 1)[0]) and not self._ended.is_set():
            patience = PATIENCE.get(number)
            if patience is None or self._ended.wait(patience):
                continue
            with contextlib.suppress(OSError, ValueError):
                name = signal.Signals(number).name
                print(f"attrito: ended by {name}, in the midst of what it was doing", file=sys.stderr, flush=True)
            os._exit(BY_SIGNAL + number)
