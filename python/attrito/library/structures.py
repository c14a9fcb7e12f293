"""What crosses to the Fortran library, as C has it (src/api/attrito.h): structures, and pointers to arrays."""

from __future__ import annotations

import ctypes
from ctypes import c_char, c_double, c_int, c_void_p
from typing import Any

import numpy as np

from attrito.library.names import ENGINES, REDUCTION_STEPS

# Parts of a point's estimated error
ERRORS = ("error_harmonics", "error_samples", "error_modes")


def _all(kind: Any, *names: str) -> list[tuple[str, Any]]:
    """Fields of one type."""
    return [(name, kind) for name in names]


class RawLaw(ctypes.Structure):
    """A contact's law."""

    _fields_ = [
        *_all(c_int, "tangents", "law"),
        *_all(c_double, "tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload"),
        ("count", c_int),
        ("numbers", c_void_p),
    ]


class RawOptions(ctypes.Structure):
    """`attrito.library.session.Options`."""

    _fields_ = [
        *_all(c_int, "harmonics", "samples", "rounds", "max_iterations", "reset_slider", "uncoupled"),
        *_all(c_int, "choose_harmonics", "integrate_in_time"),
        *_all(c_double, "tolerance", "accepted_error", "mode_error", "curve_tolerance"),
    ]


class RawPoint(ctypes.Structure):
    """What is one number of a point."""

    _fields_ = [
        *_all(c_int, "branch", "iterations", "linear_iterations", "outcome", "unique", "finished", "reached_stop"),
        ("states", c_int * 4),
        *_all(c_int, "harmonic_count", "samples", "petsc_error"),
        *_all(c_double, "frequency_hz", "level", "residual", "estimate", *ERRORS, "work"),
    ]


class RawPeak(ctypes.Structure):
    """`attrito.library.peak_tracker.Peak`."""

    _fields_ = [
        ("point", RawPoint),
        *_all(c_double, "parameter", "amplitude", "slope", "curvature", "amplitude_error", "frequency_error"),
        *_all(c_int, "evaluations", "ending", "at_corner"),
    ]


class RawBackbone(ctypes.Structure):
    """A point of a mode by periodic motion: `attrito.modes.mode_point.ModePoint`."""

    _fields_ = [
        ("point", RawPoint),
        *_all(c_double, "modal_amplitude", "excitation", "kinetic", "structural_ratio", "drift"),
        ("folded", c_int),
    ]


class RawQuasiStatic(ctypes.Structure):
    """A cycle of a mode that is loaded quasi-statically: `attrito.modes.quasi_static`."""

    _fields_ = [
        ("point", RawPoint),
        *_all(c_double, "load", "amplitude", "structural_ratio", "area", "work", "coarse_work"),
        *_all(c_double, "masing_omega", "masing_ratio"),
    ]


class RawExamination(ctypes.Structure):
    """What an examination of stability found: the verdict, and how many multipliers each engine has."""

    _fields_ = [*_all(c_int, "verdict", *ENGINES), *_all(c_double, "distance", "change", "low", "high")]


class RawBifurcation(ctypes.Structure):
    """`attrito.runs.bifurcations.Bifurcation`."""

    _fields_ = [("kind", c_int), *_all(c_double, "frequency_hz", "uncertain_hz", "re", "im")]


class RawRates(ctypes.Structure):
    """`attrito.library.derivatives.Rates`."""

    _fields_ = [
        *_all(c_int, "count", "columns", "loads", "harmonics"),
        *_all(c_void_p, "laws", "static_factors", "level", "harmonic_factors", "damping"),
    ]


class RawScene(ctypes.Structure):
    """A scene for integration in time; the arrays are those of `ReducedScene`."""

    _fields_ = [
        *_all(c_int, "size", "contacts", "rows", "statics", "coefficients", "monitors", "damping_kind"),
        ("damping_value", c_double),
        *_all(c_void_p, "mass", "stiffness", "damping", "gyroscopic", "damping_ratios", "laws", "directions"),
        *_all(c_void_p, "static_loads", "harmonic_load", "monitor_rows"),
    ]


class RawRun(ctypes.Structure):
    """`attrito.library.integrator.Run`."""

    _fields_ = [
        *_all(c_int, "scheme", "steps_per_period", "cycles", "fewest", "multiples", "samples"),
        *_all(c_int, "whole_run", "static_knots", "harmonic_knots"),
        *_all(c_double, "omega", "level", "dissipation", "tolerance"),
        *_all(c_void_p, "static_factors", "static_profile", "harmonic_profile"),
    ]


class RawOrbit(ctypes.Structure):
    """What is one number of `attrito.library.integrator.Orbit`."""

    _fields_ = [
        *_all(c_int, "outcome", "reason", "period", "cycles", "events", "chatter", "samples"),
        *_all(c_double, "defect", "contraction", "amplitude", "work", "damping", "seconds"),
    ]


class RawReduction(ctypes.Structure):
    """Choices of a reduction."""

    _fields_ = [
        *_all(c_int, "modes", "block_size", "block_vectors", "check_inertia"),
        *_all(c_double, "max_frequency_hz", "error_target", "top_frequency_hz"),
        *_all(c_double, "tolerance", "memory_megabytes"),
        ("ordering", c_char * 8),
        ("out_of_core", c_char * 4),
        ("eigensolver", c_char * 16),
        ("condense", c_char * 4),
    ]


class RawReductionReport(ctypes.Structure):
    """`attrito.library.reduction.Report`."""

    _fields_ = [
        *_all(c_int, "dofs", "coordinates", "boundary", "modes", "corrections", "condensed", "negative_pivots"),
        *_all(c_int, "modes_below_shift", "mode_solves", "factor_megabytes", "factor_megabytes_out_of_core"),
        ("out_of_core", c_int),
        ("ordering", c_char * 8),
        *_all(c_double, "factor_flops", "analysis_seconds", "shift_hz", "mode_residual", "constraint_residual"),
        ("worst_error", c_double),
        *_all(c_double * len(REDUCTION_STEPS), "seconds", "megabytes"),
    ]


# Each by the name that it has in attrito.h, after `attrito_`.
STRUCTURES: dict[str, type[ctypes.Structure]] = {
    "contact_law": RawLaw,
    "solver_options": RawOptions,
    "point": RawPoint,
    "peak": RawPeak,
    "backbone": RawBackbone,
    "quasi_static": RawQuasiStatic,
    "examination_report": RawExamination,
    "bifurcation_report": RawBifurcation,
    "rates": RawRates,
    "integrate_scene": RawScene,
    "integrate_options": RawRun,
    "integrate_report": RawOrbit,
    "reduce_options": RawReduction,
    "reduce_report": RawReductionReport,
}


class Doubles(c_void_p):
    """`double *`: an array, or one number by reference."""


class Integers(c_void_p):
    """`int *`."""


class Longs(c_void_p):
    """`long *`."""


_POINTERS = {
    np.dtype(np.float64): Doubles,
    np.dtype(np.int32): Integers,
    np.dtype(np.int64): Longs,
    np.dtype(np.uint8): ctypes.c_char_p,
}


def make_law(laws: dict[str, np.ndarray], contact: int) -> RawLaw:
    """The law of one contact out of arrays `[nc]` by key, whose own numbers (`attrito.library.laws`) stay there."""
    shared = (float(laws[field[0]][contact]) for field in RawLaw._fields_ if field[1] is c_double)
    law = RawLaw(int(laws["tangents"][contact]), 0, *shared, 0, None)
    if "law" in laws and laws["law"][contact]:
        own = laws["law_numbers"][contact]
        law.law, law.count, law.numbers = int(laws["law"][contact]), int(np.isfinite(own).sum()), own.ctypes.data
    return law


def make_laws(laws: dict[str, np.ndarray]) -> ctypes.Array[RawLaw]:
    """The laws of all contacts."""
    count = len(laws["tangents"])
    return (RawLaw * count)(*(make_law(laws, i) for i in range(count)))


def omega(frequency_hz: float) -> float:
    """Angular frequency, rad/s."""
    return float(2.0 * np.pi * frequency_hz)


def pointer(array: np.ndarray) -> Any:
    """Where an array's numbers begin, by their type; it lives as long as the pointer."""
    kind = _POINTERS.get(array.dtype)
    if kind is None or not array.flags.c_contiguous:
        raise TypeError(f"expected a contiguous array of {', '.join(map(str, _POINTERS))}")
    place: Any = kind(array.ctypes.data)
    place.array = array  # cheaper than `data_as`
    return place
