"""Kernels of the library by themselves: a contact over a period, and extrema of series."""

from __future__ import annotations

import ctypes

import numpy as np

from attrito.library import loading
from attrito.library.structures import RawLaw, make_laws, pointer


def contact_at_instants(
    law: RawLaw, coefficients: np.ndarray, slider: np.ndarray, instants: int
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and force of one contact at so many instants of a period, `[tangents + 1, instants]` each.

    Parameters
    ----------
    law : see `make_law`
    coefficients : of its relative displacement, `[tangents + 1, nk]`, normal last
    slider : at the start of the period, a pair an element, `[at least 2 elements]`
    """
    coefficients = np.ascontiguousarray(coefficients, dtype=float)
    displacement, force = np.zeros((2, len(coefficients), instants))
    loading.load().attrito_contact_at_instants(
        ctypes.byref(law),
        coefficients.shape[1],
        instants,
        pointer(coefficients),
        pointer(np.ascontiguousarray(slider, dtype=float)),
        pointer(displacement),
        pointer(force),
    )
    return displacement, force


def follow_path(law: RawLaw, displacement: np.ndarray, normal: np.ndarray, steady: bool) -> np.ndarray:
    """Tangential force of one contact along a path, one tangent, `[samples]`.

    Parameters
    ----------
    law : see `make_law`; its normal spring, gap and preload are not asked
    displacement, normal : relative displacement and normal force, `[samples]`
    steady : whether the path is whole cycles of a steady loop; else it begins without tangential force
    """
    displacement, normal = (np.ascontiguousarray(values, dtype=float) for values in (displacement, normal))
    force = np.zeros(len(displacement))
    places = pointer(displacement), pointer(normal), 2 if steady else 1, pointer(force)
    loading.load().attrito_follow_path(ctypes.byref(law), len(force), *places)
    return force


def slider_width(laws: dict[str, np.ndarray]) -> int:
    """How many numbers the sliders of a contact take in results: a pair for each element that any of the laws has."""
    raw = make_laws(laws)
    return int(loading.load().attrito_slider_width(len(raw), raw))


def extrema(coefficients: np.ndarray) -> np.ndarray:
    """Smallest and largest value over the period, located: `[..., 2]` of polynomials `[..., 2 H + 1]`."""
    rows = np.ascontiguousarray(coefficients, dtype=float).reshape(-1, np.shape(coefficients)[-1])
    lowest, highest = np.zeros((2, len(rows)))
    loading.load().attrito_extrema(*rows.shape, pointer(rows), pointer(lowest), pointer(highest))
    ends: np.ndarray = np.stack([lowest, highest], axis=-1)
    return ends.reshape(*np.shape(coefficients)[:-1], 2)
