"""Limits on the memory of a process (`ulimit -v`, the h_vmem of batch systems) that OpenBLAS does not notice.

It maps a buffer for each of its threads when it is first used, and tries for ever where the system has no room. So it
is used once where there is a limit, after a look whether there is room.
"""

from __future__ import annotations

import mmap
import os
import resource
from collections.abc import Callable

# Bytes of a thread's buffer, and a little more
_BUFFER = (1 << 27) + (1 << 22)
# Rows of matrices whose product takes all threads
ROWS = 256


def take_buffers(multiply: Callable[[], object]) -> None:
    """Have a BLAS take its buffers now, if the memory of this process is limited.

    Parameters
    ----------
    multiply : multiplies two matrices of `ROWS` rows by it

    Raises
    ------
    MemoryError : there is no room for them
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "")
    room = _BUFFER * (int(threads) if threads.isdigit() and int(threads) else len(os.sched_getaffinity(0)))
    try:
        mmap.mmap(-1, room).close()
    except OSError as error:
        raise MemoryError(f"{room} bytes for OpenBLAS within ulimit -v {limit // 1024}") from error
    multiply()
