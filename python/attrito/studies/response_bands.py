"""Bands of a frequency response over samples: their drawn curves at common frequencies.

A sample's curve is the cubic through its points and tangents, as that of a run. With few solved samples, the nodes of a
model, amplitudes at the frequencies that follow the peak,

    A_k(x) = A(omega_k(x), x),     dA_k/dx = A_x + A_omega b_k domega_peak/dx,

are expanded in what is varied, and so is the peak's frequency, which says where they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from attrito.library.names import NO_SOLUTION
from attrito.studies import gradient_nodes, value_nodes
from attrito.studies.sample_responses import Reference

# Frequencies of the bands between neighbouring ones of the drawn curve
FINER = 4


@dataclass(frozen=True)
class Curves:
    """Points of samples' curves, `[samples, K]`: frequencies, Hz, amplitudes, derivatives by the frequency, per Hz."""

    frequency_hz: np.ndarray
    amplitude: np.ndarray
    by_frequency: np.ndarray

    def drawn(self, at_hz: np.ndarray) -> np.ndarray:
        """Amplitudes at frequencies `[F]`, `[samples, F]`; NaN beside points without a solution."""
        rows = zip(self.frequency_hz, self.amplitude, self.by_frequency, strict=True)
        return np.array([_drawn(*row, at_hz) for row in rows])


def _drawn(frequency: np.ndarray, amplitude: np.ndarray, slope: np.ndarray, at_hz: np.ndarray) -> np.ndarray:
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    solved = np.isfinite(amplitude)
    if solved.sum() < 2:
        return np.full(len(at_hz), np.nan)
    points = frequency[solved], amplitude[solved]
    if np.isfinite(slope[solved]).all():
        values = CubicHermiteSpline(*points, slope[solved])(at_hz)
    else:
        values = PchipInterpolator(*points)(at_hz)
    # Between points that are both solved
    left = np.clip(np.searchsorted(frequency, at_hz, side="right") - 1, 0, len(frequency) - 2)
    return np.where(solved[left] & solved[left + 1], np.maximum(values, 0.0), np.nan)


def fine(frequencies_hz: np.ndarray) -> np.ndarray:
    """Frequencies that bands are given at, `FINER` for each interval."""
    number = np.arange(len(frequencies_hz))
    return np.interp(np.arange(FINER * (len(number) - 1) + 1) / FINER, number, frequencies_hz)


def curves_of(rows: list[dict[str, Any]], count: int) -> Curves:
    """Of samples' rows; NaN of a sample without a peak. `count`: K."""
    nothing = {name: [np.nan] * count for name in ("frequency_hz", "amplitude", "by_frequency")}
    curves = [row.get("curve", nothing) for row in rows]
    return Curves(*(np.array([curve[name] for curve in curves], dtype=float) for name in nothing))


def modelled(
    reference: Reference,
    nodes: np.ndarray,
    rows: list[dict[str, Any]],
    half: np.ndarray | None,
    order: int,
    places: np.ndarray,
) -> Curves:
    """Curves at other places.

    Parameters
    ----------
    nodes : places of the nodes `[nodes, p]`
    rows : of the nodes
    half : what a change of 1 is of each quantity `[p]`; None: without gradients
    order : of the model
    places : `[n, p]`
    """
    known, peak = curves_of(rows, len(reference.share)), np.array([row["frequency_hz"] for row in rows], dtype=float)
    if half is None:
        shift = value_nodes.model(peak, places)
        amplitude, slope = (value_nodes.model(values, places) for values in (known.amplitude, known.by_frequency))
    else:
        slopes = np.array([row["curve"]["slopes"] for row in rows], dtype=float) * half
        peak_slopes = np.array([row["slopes"]["frequency_hz"] for row in rows], dtype=float) * half
        peaks = gradient_nodes.expand(nodes, peak, peak_slopes, order)
        shift = peaks.at(places)
        # The curve at the frequencies that the model of the peak's says
        along = known.by_frequency * reference.share
        there = known.amplitude + along * (peaks.at(nodes) - peak)[:, np.newaxis]
        total = slopes + along[:, :, np.newaxis] * peaks.slopes(nodes)[:, np.newaxis, :]
        amplitude = gradient_nodes.expand(nodes, there, total, order).at(places)
        # Of the logarithm: curves keep their shape where they grow.
        relative, unknown = known.by_frequency / known.amplitude, np.full_like(total, np.nan)
        slope = amplitude * gradient_nodes.expand(nodes, relative, unknown, order).at(places)
    frequency = reference.frequencies_hz + reference.share * (shift - reference.peak_hz)[:, np.newaxis]
    return Curves(frequency, amplitude, slope)


def changes_of_state(rows: list[dict[str, Any]]) -> np.ndarray:
    """Whether samples differ in how many contacts slip, or are open, at like places of their curves, `[K]`."""
    states = np.array([row["curve"]["states"] for row in rows])
    return np.asarray(np.any(np.ptp(states, axis=0) > 0, axis=1))


def outcome_of(row: dict[str, Any]) -> str:
    """The worst of a sample's curve."""
    if "curve" not in row:
        return "not_converged"
    outcomes = row["curve"]["outcome"]
    if any(one in NO_SOLUTION for one in outcomes):
        return "not_converged"
    return "above_tolerance" if "above_tolerance" in (*outcomes, row["outcome"]) else "converged"
