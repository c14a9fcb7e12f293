"""Locks between processes, so that of several that write one file all but one wait, or are refused.

A lock is an open file that `flock` holds: it is gone with the process that held it, however that ended, and on NFS it
holds between hosts. The file beside, `<path>.lock`, is removed by its holder; what a killed one leaves is taken over.
Where a file system has no locks nothing waits, and `shared` is False: files then need names of their process's own.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from attrito.support.atomic_files import remove_left_overs, target
from attrito.support.errors import NO_ROOM, Fault, InputError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# What the system says where locks are not to be had.
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
NO_LOCKS = (
    "the file system of {} has no locks, so that nothing keeps other processes from writing the same files:"
    " start jobs that share a folder or an output one after another"
)


class Lock:
    """The lock that stands for a file; by one process, and one object of it, at a time.

    Parameters
    ----------
    path : the file; of a link what it leads to

    Attributes
    ----------
    shared : whether other processes see it
    """

    def __init__(self, path: str | os.PathLike[str]):
        self.path = f"{target(path)}.lock"
        self.shared = True
        self._descriptor = -1

    def take(self, note: str = "") -> bool:
        """Take the lock if it is free, and leave a note for those who wait; whether it was.

        Raises
        ------
        OSError : the lock's file cannot be made, or is a symbolic link
        """
        while True:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(descriptor)
                return False
            except OSError as error:
                if error.errno not in WITHOUT_LOCKS:
                    os.close(descriptor)
                    raise OSError(error.errno, f"{error.strerror} (lock)", self.path) from error
                self.shared = False
            if not self.shared or _is_at(descriptor, self.path):
                self._descriptor = descriptor
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, note.encode(), 0)
                return True
            # Its holder had removed it in the meantime.
            os.close(descriptor)

    def note(self) -> str:
        """What the holder wrote; empty where there is none, or it has not written yet."""
        try:
            return Path(self.path).read_text()
        except (OSError, ValueError):
            return ""

    def is_held(self) -> bool:
        """Whether another process holds it."""
        if not os.path.exists(self.path):
            return False
        probe = Lock(self.path.removesuffix(".lock"))
        if not probe.take():
            return True
        probe.release()
        return False

    def release(self) -> None:
        """Give it back; twice does no harm."""
        if self._descriptor < 0:
            return
        if _is_at(self._descriptor, self.path):
            with contextlib.suppress(OSError):
                os.unlink(self.path)
        os.close(self._descriptor)
        self._descriptor = -1


@contextlib.contextmanager
def writing_alone(comm: Comm, path: str | os.PathLike[str], makes_folder: bool = True) -> Iterator[None]:
    """Keep an output from other processes in the block; collective.

    Parameters
    ----------
    comm : the ranks
    path : the file that is written in the end
    makes_folder : make its folder if there is none

    Raises
    ------
    InputError : another process writes it, or it cannot be written there
    """
    lock = Lock(path)

    def begin() -> None:
        if makes_folder:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
        try:
            free = lock.take()
        except OSError as error:
            if error.errno in NO_ROOM:
                raise
            expected = "a place where a file can be written and locked"
            raise InputError(Fault(str(path), "file", error.strerror, expected)) from error
        if not free:
            expected = "that no other process writes it: wait for that one, or give this output another name"
            raise InputError(Fault(str(path), "file", "in use", expected))
        if not lock.shared:
            print(f"warning: {NO_LOCKS.format(Path(path).parent.resolve())}", flush=True)
        remove_left_overs(path)

    on_root(comm, begin)
    try:
        yield
    finally:
        lock.release()


def _is_at(descriptor: int, path: str) -> bool:
    """Whether an open file is the one of that name."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except OSError:
        return False
