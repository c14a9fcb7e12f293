"""Which file a reduced model is kept in, where other processes make theirs in the same folder.

The first reduction of a folder is `rom.h5`, others beside it are `rom.<first 8 digits of the fingerprint>.h5`; a file
that the job names is that one. Whoever makes a file holds its lock, and the fingerprint is in it: those who ask for
the same wait, others go on to their own name. Another reduced model that is there stays, and so does what an
interrupted reduction of another has left; only a file that the job names is replaced, and one that cannot be read.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from attrito.support.errors import Fault, InputError
from attrito.support.locks import Lock
from attrito.support.own_folders import owner_of

# Seconds between looks at a lock that another process holds.
LOOK = 0.2
DIGITS = 8


@dataclass
class Claim:
    """A file of a reduced model that this process may use.

    Parameters
    ----------
    path : the file
    fresh : it is there already; nothing is to be made
    lock : what is held until the file has been read, if anything is
    """

    path: str
    fresh: bool
    lock: Lock | None = None

    @property
    def work(self) -> str:
        """What names of unfinished files begin with: of this process alone where no lock keeps others out."""
        if self.lock is None or self.lock.shared:
            return self.path
        return f"{self.path}.{socket.gethostname()}.{os.getpid()}"

    def release(self) -> None:
        """Let others have it; twice does no harm."""
        if self.lock is not None:
            self.lock.release()


def names_of(first: str, fingerprint: str, given: bool) -> list[str]:
    """Names that a reduced model may have, by preference; `first` is the only one where the job gives it."""
    path = Path(first)
    return [first] if given else [first, str(path.with_name(f"{path.stem}.{fingerprint[:DIGITS]}{path.suffix}"))]


def steps_of(work: str) -> Path:
    """Folder of the finished steps of an unfinished reduction."""
    return Path(f"{work}.partial.steps")


def claim(first: str, fingerprint: str, given: bool, found: Callable[[str], str], say: Callable[[str], None]) -> Claim:
    """The file to use, or to make under its lock; waits for other processes that make the same.

    Parameters
    ----------
    first : the file that the job names, or `rom.h5`
    fingerprint : of what is wanted
    given : the job names it
    found : fingerprint of the file of a name; empty where there is none that can be read
    say : receives what is waited for

    Raises
    ------
    InputError : a name is taken by something else
    """
    names = names_of(first, fingerprint, given)
    for path in names:
        if found(path) == fingerprint:
            return Claim(path, True)
    Path(first).parent.mkdir(parents=True, exist_ok=True)
    waited = ""
    while True:
        here, waits_for = _try(names, fingerprint, given, found)
        if here is not None:
            if here.fresh and waited:
                say(f"another process made {here.path}")
            return here
        if waits_for and waits_for != waited:
            say(f"waiting for another process, which makes {waits_for}")
            waited = waits_for
        time.sleep(LOOK)


def _try(names: list[str], fingerprint: str, given: bool, found: Callable[[str], str]) -> tuple[Claim | None, str]:
    """A claim, if there is one to be had now; else the file that another process holds, once it is known whose."""
    last = names[-1]
    for path in names:
        lock = Lock(path)
        if not lock.take(fingerprint):
            other = lock.note()
            if not other:
                # Its holder is about to say what it makes.
                return None, ""
            if path == last or other == fingerprint:
                return None, path
            continue
        try:
            here = _under(lock, path, fingerprint, given, found, last)
        except BaseException:
            lock.release()
            raise
        if here is not None:
            return here, ""
        lock.release()
    raise AssertionError("the last name is claimed, waited for or refused")


def _under(
    lock: Lock, path: str, fingerprint: str, given: bool, found: Callable[[str], str], last: str
) -> Claim | None:
    """What holding the lock of a name makes of it; None: it is for another reduction."""
    there = found(path)
    if there == fingerprint:
        return Claim(path, True, lock)
    if given:
        return Claim(path, False, lock)
    if path == last:
        if there:
            expected = "the reduced model of this job: delete the file, and it is made again"
            raise InputError(Fault(path, "fingerprint", there, expected))
        return Claim(path, False, lock)
    others = there or _interrupted(path) not in ("", fingerprint)
    return None if others or Lock(last).is_held() or steps_of(last).is_dir() else Claim(path, False, lock)


def _interrupted(path: str) -> str:
    """Fingerprint of an interrupted reduction that left its steps; empty where there is none."""
    return (owner_of(steps_of(path)) or "").rpartition(" ")[2]
