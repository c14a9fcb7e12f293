"""What every entry of the Fortran library takes and returns, as src/api/attrito.h has it; a test compares them."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_char_p, c_double, c_int, c_void_p
from typing import Any

from attrito.library.structures import (
    Doubles,
    Integers,
    Longs,
    RawBackbone,
    RawBifurcation,
    RawExamination,
    RawLaw,
    RawOptions,
    RawOrbit,
    RawPeak,
    RawPoint,
    RawQuasiStatic,
    RawRates,
    RawReduction,
    RawReductionReport,
    RawRun,
    RawScene,
)

# A series of a point: path, kind, dimensions, extent, values, description, unit, names
SERIES_CALLBACK = ctypes.CFUNCTYPE(
    None, c_char_p, c_char_p, c_int, POINTER(c_int), POINTER(c_double), c_char_p, c_char_p, c_char_p
)
# Progress of a reduction: a sentence or a step, how much of it is done, of how much
LISTENER = ctypes.CFUNCTYPE(None, c_char_p, c_int, c_int)
# Bytes that were asked for in vain
EXHAUSTED = ctypes.CFUNCTYPE(None, ctypes.c_int64)

# Room for a message, and its length
MESSAGE = (c_char_p, c_int)
# A session of the solver, or of the integrator
HANDLE = c_void_p

# By name: what is returned, what is taken.
SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    # The library as a whole
    "attrito_describe": (c_int, (c_int, c_char_p)),
    "attrito_start": (c_int, (c_int, *MESSAGE)),
    "attrito_stop": (None, ()),
    "attrito_when_exhausted": (None, (EXHAUSTED,)),
    # Sessions of the solver
    "attrito_create": (HANDLE, (c_int, c_int, Doubles, Doubles, c_int, c_double, c_void_p)),
    "attrito_set_loads": (None, (HANDLE, c_int, Doubles, c_int, Doubles, c_int, Doubles)),
    "attrito_set_contacts": (None, (HANDLE, c_int, POINTER(RawLaw), c_int, Doubles)),
    "attrito_set_damping_ratios": (None, (HANDLE, c_int, Doubles)),
    "attrito_set_gyroscopic": (None, (HANDLE, c_int, Doubles)),
    "attrito_set_sector": (None, (HANDLE, *[c_int] * 3, Integers, Integers, *[c_int, Integers] * 2, c_int, Doubles)),
    "attrito_change_laws": (None, (HANDLE, c_int, POINTER(RawLaw))),
    "attrito_prepare": (c_int, (HANDLE, POINTER(RawOptions), *MESSAGE)),
    "attrito_destroy": (None, (HANDLE,)),
    # Points
    "attrito_follow_static_path": (
        c_int,
        (HANDLE, c_int, c_int, Doubles, c_int, c_double, POINTER(RawPoint), *MESSAGE),
    ),
    "attrito_begin_sweep": (None, (HANDLE, c_double, c_double, c_double, c_int, c_int)),
    "attrito_scale_sweep": (None, (HANDLE, c_double, c_double)),
    "attrito_next_point": (None, (HANDLE, POINTER(RawPoint))),
    "attrito_solve_at": (None, (HANDLE, c_double, c_int, POINTER(RawPoint))),
    "attrito_solve_by_strategy": (c_int, (HANDLE, c_char_p, c_double, POINTER(RawPoint))),
    "attrito_monitors": (None, (HANDLE, Doubles, Doubles, Doubles)),
    "attrito_coordinates": (None, (HANDLE, c_int, Doubles)),
    "attrito_linear_response": (c_int, (HANDLE, c_int, c_int, Doubles, Doubles, c_int, Doubles, Integers, *MESSAGE)),
    "attrito_linear_modes": (c_int, (HANDLE, c_int, c_int, Doubles, Doubles, Doubles, Integers, *MESSAGE)),
    "attrito_diameter_modes": (
        c_int,
        (HANDLE, c_int, c_int, c_int, Doubles, Doubles, Doubles, Doubles, Integers, *MESSAGE),
    ),
    "attrito_closed_contacts": (None, (HANDLE, Integers)),
    "attrito_report_point": (None, (HANDLE, c_char_p, SERIES_CALLBACK)),
    "attrito_outcome": (c_int, (HANDLE,)),
    "attrito_set_period_in_time": (None, (HANDLE, c_int)),
    "attrito_save_state": (c_int, (HANDLE,)),
    "attrito_fetch_state": (None, (HANDLE, Doubles)),
    "attrito_load_state": (c_int, (HANDLE, c_int, Doubles)),
    # Branches
    "attrito_keep_point": (None, (HANDLE, c_int)),
    "attrito_remove_points": (None, (HANDLE, c_int)),
    "attrito_start_from_point": (None, (HANDLE, c_int)),
    "attrito_lies_on_branch": (c_int, (HANDLE, c_int)),
    "attrito_seek": (c_int, (HANDLE, c_int, c_double, c_double)),
    "attrito_begin_branch": (None, (HANDLE, c_double, c_double, c_int, c_int, c_int)),
    "attrito_start_from_motion": (c_int, (HANDLE, c_int, Doubles, Doubles, c_double, c_double)),
    # Members of a family
    "attrito_take_sliders": (None, (HANDLE, Doubles)),
    "attrito_enter_family": (None, (HANDLE,)),
    "attrito_leave_family": (None, (HANDLE,)),
    "attrito_family_work": (c_double, (HANDLE,)),
    "attrito_keep_member": (None, (HANDLE, c_int)),
    "attrito_return_to_member": (None, (HANDLE, c_int)),
    "attrito_solve_member": (c_int, (HANDLE, Doubles, c_double)),
    "attrito_solve_member_at": (c_int, (HANDLE, c_double)),
    "attrito_describe_member": (c_int, (HANDLE, Doubles, Doubles, Doubles, Doubles, Doubles)),
    "attrito_ask_derivatives": (
        None,
        (HANDLE, c_int, Integers, c_int, Doubles, c_int, POINTER(RawLaw), c_int, c_int),
    ),
    "attrito_scale_friction": (None, (HANDLE, c_double)),
    "attrito_find_onsets": (c_int, (HANDLE, c_double, Doubles)),
    "attrito_differentiate_by_frequency": (c_int, (HANDLE, Doubles)),
    "attrito_differentiate_by_adjoint": (c_int, (HANDLE, POINTER(RawRates))),
    "attrito_differentiate_directly": (c_int, (HANDLE, POINTER(RawRates), Doubles)),
    "attrito_differentiate_peak_frequency": (c_int, (HANDLE, c_int, POINTER(RawRates), Doubles)),
    "attrito_differentiate_mode": (c_int, (HANDLE, POINTER(RawRates), *[Doubles] * 5)),
    "attrito_differentiate_member": (c_int, (HANDLE, c_int, c_int, Doubles, Doubles)),
    # Stability and bifurcations
    "attrito_examine": (c_int, (HANDLE, c_int, c_int, c_int, POINTER(RawExamination), *MESSAGE)),
    "attrito_multipliers": (None, (HANDLE, c_int, Doubles, Doubles, Integers)),
    "attrito_wavenumbers": (None, (HANDLE, c_int, Integers)),
    "attrito_find_bifurcations": (c_int, (HANDLE, c_int, c_int)),
    "attrito_bifurcation": (None, (HANDLE, c_int, POINTER(RawBifurcation), Doubles)),
    # Peaks
    "attrito_begin_peak": (
        None,
        (HANDLE, c_int, c_int, c_int, Doubles, *[c_double] * 4, c_int, POINTER(RawPeak)),
    ),
    "attrito_begin_peak_near": (
        None,
        (HANDLE, c_int, c_int, c_int, Doubles, *[c_double] * 5, c_int, Doubles, c_int, POINTER(RawPeak)),
    ),
    "attrito_follow_peak_in": (None, (HANDLE, c_int, c_int, POINTER(RawPeak))),
    "attrito_next_peak": (None, (HANDLE, c_double, c_int, POINTER(RawPeak))),
    "attrito_peak_at": (None, (HANDLE, c_double, c_int, POINTER(RawPeak))),
    "attrito_begin_mode": (None, (HANDLE, c_int, Doubles, Doubles, c_double, c_double, c_int, POINTER(RawBackbone))),
    "attrito_prepare_mode": (None, (HANDLE, c_int, Doubles, Doubles, c_double)),
    "attrito_backbone_at": (None, (HANDLE, c_double, c_int, POINTER(RawBackbone))),
    "attrito_mode_errors": (None, (HANDLE, Doubles)),
    "attrito_begin_quasi_static": (None, (HANDLE, Doubles, c_double)),
    "attrito_quasi_static_at": (None, (HANDLE, c_double, c_int, c_int, c_int, POINTER(RawQuasiStatic))),
    "attrito_try_quasi_static": (None, (HANDLE, c_double, c_int, c_int, Doubles, Integers, Integers)),
    "attrito_quasi_static_work": (None, (HANDLE, Doubles)),
    # Integration in time
    "attrito_integrator_create": (c_int, (POINTER(RawScene), POINTER(HANDLE), *MESSAGE)),
    "attrito_integrator_start_static": (c_int, (HANDLE, c_int, c_int, Doubles, c_int, c_void_p, *MESSAGE)),
    "attrito_integrator_start": (None, (HANDLE, c_int, Doubles, Doubles, Doubles)),
    "attrito_integrator_state": (None, (HANDLE, c_int, Doubles, Doubles, Doubles)),
    "attrito_integrator_run": (c_int, (HANDLE, POINTER(RawRun), POINTER(RawOrbit), *MESSAGE)),
    "attrito_integrator_measures": (None, (HANDLE, Doubles, Doubles, Doubles)),
    "attrito_integrator_samples": (None, (HANDLE, Doubles, Doubles, Doubles, Doubles, Integers)),
    "attrito_integrator_touching": (c_int, (HANDLE,)),
    "attrito_integrator_destroy": (None, (HANDLE,)),
    # Reduction
    "attrito_reduce": (
        c_int,
        (
            c_int,
            *[c_char_p] * 3,
            *(c_int, Integers),
            *(c_int, c_int, Doubles),
            *(c_int, Integers),
            POINTER(RawReduction),
            LISTENER,
            POINTER(RawReductionReport),
            *reversed(MESSAGE),
        ),
    ),
    # Kernels without a session
    "attrito_slider_width": (c_int, (c_int, POINTER(RawLaw))),
    "attrito_contact_at_instants": (None, (POINTER(RawLaw), c_int, c_int, Doubles, Doubles, Doubles, Doubles)),
    "attrito_follow_path": (None, (POINTER(RawLaw), c_int, Doubles, Doubles, c_int, Doubles)),
    "attrito_extrema": (None, (c_int, c_int, Doubles, Doubles, Doubles)),
    "attrito_read_numbers": (c_int, (c_char_p, c_int, Longs, Longs, c_int, Integers, Integers, Doubles)),
    "attrito_read_entries": (c_int, (c_char_p, c_int, Longs, Longs, c_int, Integers, Doubles)),
}


def declare(library: ctypes.CDLL, signatures: dict[str, tuple[Any, tuple[Any, ...]]] = SIGNATURES) -> None:
    """Give every entry of a loaded library its types; `AttributeError` where one is missing."""
    for name, (returned, taken) in signatures.items():
        entry = getattr(library, name)
        entry.restype, entry.argtypes = returned, list(taken)
