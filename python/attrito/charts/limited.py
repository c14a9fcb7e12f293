"""Work of a chart that is ended where it takes too long, whatever it is in the midst of.

A point at which Newton's method finds no solution may take minutes, and nothing can ask it to stop. So the work is done
in a process that is a copy of this one, which is ended when it has used the seconds of the processor that it may.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

Found = TypeVar("Found")
# Between two looks at what it has used, s
PATIENCE = 0.25


def processor_seconds() -> float:
    """What this process and those that it has ended have used."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def within(seconds: float, work: Callable[[], Found]) -> Found | None:
    """What some work returns; None where it takes longer than so many seconds of the processor.

    Raises
    ------
    what the work raises
    RuntimeError : its process has ended without a word
    """
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, work))
    process.start()
    sender.close()
    try:
        while not receiver.poll(PATIENCE):
            if _used(process.pid) > seconds:
                return None
        try:
            found, error = receiver.recv()
        except EOFError:
            process.join()
            raise RuntimeError(f"a process of the chart ended with code {process.exitcode}") from None
    finally:
        if process.is_alive():
            process.kill()
        process.join()
        receiver.close()
    if error is not None:
        raise error
    return found


def _send(sender: Connection, work: Callable[[], Found]) -> None:
    """In the copy: what was found, or the error."""
    try:
        answer = work(), None
    except Exception as error:
        answer = None, error
    sender.send(answer)
    sender.close()
    # The copy leaves without ending the libraries, whose connections are those of the process it was copied from.
    os._exit(0)


def _used(process: int | None) -> float:
    """Seconds of the processor that a process has used; 0 once it has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
