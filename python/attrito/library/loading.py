"""The Fortran library: finding it, loading it, calling it.

mpi4py initialises MPI before; the library is handed `comm.py2f()`.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from attrito.library.description import differing_sizes
from attrito.library.signatures import EXHAUSTED, declare
from attrito.support.errors import Fault, InputError, NumericsError, unforeseen
from attrito.support.locks import release_all
from attrito.support.memory_limit import ROWS, take_buffers
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

NAME = "libattrito.so"
MESSAGE_LENGTH = 2000


def places() -> list[Path]:
    """Where the library may be: ATTRITO_LIBRARY alone; or the package, its source tree's builds, Debian's package.

    A wheel has no library of its own: it takes that of Debian's package of attrito, of its own version.
    """
    if chosen := os.environ.get("ATTRITO_LIBRARY"):
        return [Path(chosen)]
    package = Path(__file__).resolve().parents[1]
    builds = [package.parents[1] / "build" / preset / NAME for preset in ("release", "debug")]
    # What `sysconfig` says, too, which reads a file of some thousand settings for it.
    multiarch = getattr(sys.implementation, "_multiarch", "")
    debian = Path("/usr/lib") / multiarch / "attrito" / f"{NAME}.{__version__}"
    return [package / NAME, *builds, debian]


@functools.cache
def load() -> ctypes.CDLL:
    """Load the library from the first of its places where it is."""
    looked = places()
    for place in looked:
        if place.is_file():
            loaded = _loaded(place)
            _check_interface(loaded, place)
            take_buffers(functools.partial(_multiply, loaded))
            loaded.attrito_when_exhausted(_ENDING)
            atexit.register(loaded.attrito_stop)
            return loaded
    expected = f"the built library in {', '.join(map(str, looked))} (run script/bootstrap, or install attrito_*.deb)"
    raise InputError(Fault("attrito", NAME, "not found", expected))


def _loaded(place: Path) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(str(place), mode=ctypes.RTLD_GLOBAL)
    except OSError as error:
        expected = "a library that can be loaded: those that it needs, and memory for them (ulimit -v)"
        raise InputError(Fault(str(place), "file", str(error), expected)) from error


def _multiply(loaded: ctypes.CDLL) -> None:
    """Two matrices, by the BLAS of the library."""
    size, one, matrix = ctypes.c_int(ROWS), ctypes.c_double(1.0), (ctypes.c_double * ROWS**2)()
    rows, factor = ctypes.byref(size), ctypes.byref(one)
    loaded.dgemm_(b"N", b"N", rows, rows, rows, factor, matrix, rows, matrix, rows, factor, matrix, rows)


def _end_exhausted(size: int) -> None:
    """End all ranks with a message: Fortran has no way back from an allocation that fails."""
    from mpi4py import MPI

    release_all()
    print(f"attrito: {unforeseen(MemoryError(f'{size} bytes more'))}", file=sys.stderr, flush=True)
    if MPI.COMM_WORLD.size > 1:
        MPI.COMM_WORLD.Abort(2)
    os._exit(2)


# Kept for as long as the library may call it.
_ENDING = EXHAUSTED(_end_exhausted)


def start(comm: Comm) -> None:
    """Start what the library uses on all ranks, before the root alone solves something. Collective."""
    message = message_buffer()
    check(load().attrito_start(comm.py2f(), message, len(message)), message)


def _check_interface(loaded: ctypes.CDLL, place: Path) -> None:
    """Give the entries their types; raise `InputError` where the library is not of this version of the package."""
    expected = "the library of this version of attrito (run script/bootstrap)"
    try:
        declare(loaded)
    except AttributeError as error:
        raise InputError(Fault(str(place), "entry", str(error), expected)) from None
    if names := differing_sizes(loaded):
        raise InputError(Fault(str(place), "structures", f"of other sizes: {', '.join(names)}", expected))


def check(status: int, message: ctypes.Array) -> None:
    """Raise the error that the library reported: status 1 numerics, 2 input, 3 a file that cannot be used."""
    text = message.value.decode(errors="replace")
    if status in (2, 3):
        error = InputError()
        error.args = (text,)
        raise error
    if status != 0:
        raise NumericsError(text)


def message_buffer() -> ctypes.Array:
    """Room for a message."""
    return ctypes.create_string_buffer(MESSAGE_LENGTH)
