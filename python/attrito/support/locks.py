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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from attrito.support.atomic_files import check_writable, remove_left_overs, target
from attrito.support.errors import NO_ROOM, Fault, InputError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

Value = TypeVar("Value")
# How the file of a lock begins
_MAGIC = b"attrito lock\n"
# What the system says where locks are not to be had.
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
NO_LOCKS = (
    "the file system of {} has no locks, so that nothing keeps other processes from writing the same files:"
    " start jobs that share a folder or an output one after another"
)


_held: set[Lock] = set()


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
        InputError : a file of its name is none of attrito
        """
        while True:
            descriptor = self._open()
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
            if self.shared and not _is_at(descriptor, self.path):
                # Its holder had removed it in the meantime.
                os.close(descriptor)
                continue
            if not _MAGIC.startswith(os.pread(descriptor, len(_MAGIC), 0)):
                os.close(descriptor)
                expected = "a lock of attrito, or no file of this name: rename it"
                raise InputError(Fault(self.path, "file", "in the way", expected))
            self._descriptor = descriptor
            _held.add(self)
            with contextlib.suppress(OSError):
                # Nothing can be written to one of another user, whose process is dead.
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, _MAGIC + note.encode(), 0)
            return True

    def _open(self) -> int:
        """The file; of another user, who may be gone, it is opened for reading, which is enough to lock it."""
        flags = os.O_NOFOLLOW | os.O_CLOEXEC
        while True:
            with contextlib.suppress(FileExistsError):
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL | flags, 0o666)
                with contextlib.suppress(PermissionError):
                    # Whatever the umask: others must see whether it is held. Of a file that was there the mode stays.
                    os.fchmod(descriptor, 0o666)
                return descriptor
            with contextlib.suppress(FileNotFoundError):
                # It may be removed in the meantime.
                try:
                    return os.open(self.path, os.O_RDWR | flags)
                except PermissionError:
                    return os.open(self.path, os.O_RDONLY | flags)

    def note(self) -> str:
        """What the holder wrote; empty where there is none, or it has not written yet."""
        try:
            return Path(self.path).read_text().removeprefix(_MAGIC.decode())
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
        _held.discard(self)


def release_all() -> None:
    """Give back what this process holds, before it ends without a way back."""
    for lock in list(_held):
        lock.release()


@contextlib.contextmanager
def writing_alone(
    comm: Comm, path: str | os.PathLike[str], *beside: str | os.PathLike[str], makes_folder: bool = True
) -> Iterator[None]:
    """Keep an output from other processes in the block; collective. Nothing is solved for what cannot be written.

    Parameters
    ----------
    comm : the ranks
    path, beside : the file that is written in the end, and others, as its picture
    makes_folder : make its folder if there is none

    Raises
    ------
    InputError : another process writes it, or one of the files cannot be written
    """
    lock = Lock(path)

    def begin() -> None:
        for output in (path, *beside) if makes_folder else ():
            if os.path.isdir(output):
                raise InputError(Fault(str(output), "file", "a folder", "the name of a file to write"))
            _try_to_write(output, lambda output=output: _make_place(output))
        free = _try_to_write(path, lock.take)
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


def _make_place(output: str | os.PathLike[str]) -> None:
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    check_writable(output)


def _try_to_write(path: str | os.PathLike[str], work: Callable[[], Value]) -> Value:
    """What some work returns; what the system says against it is a fault of the output."""
    try:
        return work()
    except OSError as error:
        if error.errno in NO_ROOM:
            raise
        expected = "a place where a file can be written and locked"
        raise InputError(Fault(str(path), "file", error.strerror, expected)) from error


def _is_at(descriptor: int, path: str) -> bool:
    """Whether an open file is the one of that name."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except OSError:
        return False
