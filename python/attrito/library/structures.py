"""What crosses to the Fortran library, as C has it: structures, numbers, pointers to arrays."""

from __future__ import annotations

import ctypes

import numpy as np

# Parts of a point's estimated error
ERRORS = ("error_harmonics", "error_samples", "error_modes")

# void f(path, kind, dimensions, extent, values, description, unit, names)
LISTENER = ctypes.CFUNCTYPE(
    None,
    ctypes.c_char_p,
    ctypes.c_char_p,
    ctypes.c_int,
    ctypes.POINTER(ctypes.c_int),
    ctypes.POINTER(ctypes.c_double),
    *[ctypes.c_char_p] * 3,
)


class RawOptions(ctypes.Structure):
    """`attrito.library.session.Options`."""

    _fields_ = [
        *((name, ctypes.c_int) for name in ("harmonics", "samples", "rounds", "max_iterations")),
        ("reset_slider", ctypes.c_int),
        ("uncoupled", ctypes.c_int),
        *((name, ctypes.c_int) for name in ("by_events", "choose_harmonics", "choose_samples", "fewest_samples")),
        *((name, ctypes.c_double) for name in ("tolerance", "accepted_error", "mode_error")),
    ]


class RawLaw(ctypes.Structure):
    """A contact's law."""

    _fields_ = [
        ("tangents", ctypes.c_int),
        *(
            (name, ctypes.c_double)
            for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
        ),
    ]


class RawPoint(ctypes.Structure):
    """What is one number of a point."""

    _fields_ = [
        *(
            (name, ctypes.c_int)
            for name in ("branch", "iterations", "linear_iterations", "outcome", "unique", "finished", "reached_stop")
        ),
        ("states", ctypes.c_int * 4),
        *((name, ctypes.c_int) for name in ("harmonic_count", "samples", "petsc_error")),
        *((name, ctypes.c_double) for name in ("frequency_hz", "level", "residual", "estimate", *ERRORS, "work")),
    ]


def make_law(laws: dict[str, np.ndarray], contact: int) -> RawLaw:
    """The law of one contact out of arrays `[nc]` by key."""
    numbers = (float(laws[name][contact]) for name, _ in RawLaw._fields_[1:])
    return RawLaw(int(laws["tangents"][contact]), *numbers)


def make_laws(laws: dict[str, np.ndarray]) -> ctypes.Array:
    """The laws of all contacts."""
    count = len(laws["tangents"])
    return (RawLaw * count)(*(make_law(laws, i) for i in range(count)))


def omega(frequency_hz: float) -> ctypes.c_double:
    """Angular frequency, rad/s."""
    return ctypes.c_double(2.0 * np.pi * frequency_hz)


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Where an array's numbers begin; it lives as long as the pointer."""
    if array.dtype != np.float64 or not array.flags.c_contiguous:
        raise TypeError("expected a contiguous array of float64")
    place = ctypes.c_void_p(array.ctypes.data)
    place.array = array  # cheaper than `data_as`
    return place
