"""The Fortran library: finding it, loading it, calling it.

mpi4py initialises MPI before; the library is handed `comm.py2f()`.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
from pathlib import Path

from attrito.library.description import differing_sizes
from attrito.library.signatures import declare
from attrito.support.errors import Fault, InputError, NumericsError

NAME = "libattrito.so"
MESSAGE_LENGTH = 2000


@functools.cache
def load() -> ctypes.CDLL:
    """Load the library from ATTRITO_LIBRARY, the folder of the package, or the build folder of the source tree."""
    package = Path(__file__).resolve().parents[1]
    places = [package / NAME, *(package.parents[1] / "build" / preset / NAME for preset in ("release", "debug"))]
    if chosen := os.environ.get("ATTRITO_LIBRARY"):
        places = [Path(chosen)]
    for place in places:
        if place.is_file():
            loaded = ctypes.CDLL(str(place), mode=ctypes.RTLD_GLOBAL)
            _check_interface(loaded, place)
            atexit.register(loaded.attrito_stop)
            return loaded
    looked = ", ".join(map(str, places))
    raise InputError(Fault("attrito", NAME, "not found", f"the built library in {looked} (run script/bootstrap)"))


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
