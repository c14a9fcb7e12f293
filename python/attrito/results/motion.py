"""Quantities of a monitor's motion over a period, from its Fourier coefficients.

q(t) = q_0 + sum_h (c_h cos h omega t + s_h sin h omega t),    c_1 - i s_1 = A exp(i phi)

A is the first harmonic, phi its phase: that of a load of cosines alone is 0, and a motion that lags is negative.
Velocity and acceleration are half the range of q' and q'' over the period, as the amplitude is of q.
"""

from __future__ import annotations

import numpy as np

from attrito.results.curve import Curve, curve_of, stretches
from attrito.results.motion_names import QUANTITIES as QUANTITIES
from attrito.results.result import Result

# Times that a quantity is differentiated in time
DERIVATIVES = {"velocity": 1, "acceleration": 2}
# Samples of the period a harmonic, from which Newton's method finds extremes
SAMPLES = 16


def quantity_of(result: Result, monitor: str, quantity: str) -> np.ndarray:
    """One of `QUANTITIES` of a monitor at every point `[np]`; phases in degrees, from -180 to 180.

    Raises
    ------
    InputError : no such monitor
    """
    if quantity == "amplitude":
        return result.monitor(monitor, "amplitude")
    first = first_harmonic(result, monitor)
    if quantity == "first_harmonic":
        return np.asarray(np.abs(first))
    if quantity == "phase":
        return np.asarray(np.degrees(np.angle(first)))
    order = DERIVATIVES[quantity]
    omega = 2.0 * np.pi * result.array("/points/frequency_hz")
    return np.asarray(omega**order * half_range(differentiated(result.monitor(monitor, "harmonics"), order)))


def first_harmonic(result: Result, monitor: str) -> np.ndarray:
    """A exp(i phi) at every point, complex `[np]`."""
    coefficients = result.monitor(monitor, "harmonics")
    if coefficients.shape[1] < 3:
        return np.zeros(len(coefficients), dtype=complex)
    found: np.ndarray = coefficients[:, 1] - 1j * coefficients[:, 2]
    return found


def unit_of(result: Result, monitor: str, quantity: str) -> str:
    """Unit of a quantity for an axis label."""
    if quantity == "phase":
        return "degrees"
    unit, order = result.unit(f"/monitors/{monitor}/amplitude"), DERIVATIVES.get(quantity, 0)
    name, comma, owner = unit.partition(",")
    return f"{name or '1'}{('', '/s', '/s^2')[order]}{comma}{owner}" if order else unit


def differentiated(coefficients: np.ndarray, order: int) -> np.ndarray:
    """Coefficients `[n, nk]` of the derivative by omega t."""
    found = coefficients.astype(float)
    harmonic = np.arange(1, (coefficients.shape[1] + 1) // 2)
    for _ in range(order):
        cosines, sines = harmonic * found[:, 2::2], -harmonic * found[:, 1::2]
        found[:, 0], found[:, 1::2], found[:, 2::2] = 0.0, cosines, sines
    return found


def half_range(coefficients: np.ndarray) -> np.ndarray:
    """Half the range over the period of motions with coefficients `[n, nk]`; NaN where one is."""
    highest = max((coefficients.shape[1] - 1) // 2, 1)
    instants = 2.0 * np.pi * np.arange(SAMPLES * highest) / (SAMPLES * highest)
    sampled = coefficients @ _basis(instants, coefficients.shape[1]).T
    rates = [differentiated(coefficients, order) for order in (1, 2)]
    ends = []
    for sign in (1.0, -1.0):
        place = np.argmax(np.where(np.isfinite(sampled), sign * sampled, -np.inf), axis=1)
        time, best = instants[place], sign * sampled[np.arange(len(place)), place]
        for _ in range(4):
            first, second = (_at(rate, time) for rate in rates)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.where(second != 0.0, -first / second, 0.0)
            time = time + np.clip(np.nan_to_num(step), -instants[1], instants[1])
            best = np.fmax(best, sign * _at(coefficients, time))
        ends.append(best)
    return np.where(np.isfinite(coefficients).all(axis=1), 0.5 * (ends[0] + ends[1]), np.nan)


def _basis(instants: np.ndarray, count: int) -> np.ndarray:
    """1, cos, sin, cos 2, ... at instants, `[n, count]`."""
    angle = np.outer(instants, np.arange(1, (count + 1) // 2))
    found = np.ones((len(instants), count))
    found[:, 1::2], found[:, 2::2] = np.cos(angle), np.sin(angle)
    return found


def _at(coefficients: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Motions `[n, nk]`, each at an instant of its own `[n]`."""
    found: np.ndarray = (coefficients * _basis(instants, coefficients.shape[1])).sum(axis=1)
    return found


def curve_of_quantity(result: Result, monitor: str, quantity: str) -> Curve:
    """The drawn curve: frequency and one of `QUANTITIES`, or real and imaginary part of the first harmonic (`nyquist`).

    Amplitudes change along it at the rates that the solver has found. Of other quantities none are stored: they are
    drawn by monotone cubics of the length along the branch (PCHIP). A phase is continued along each stretch.
    """
    whole = curve_of(result)
    if quantity == "amplitude":
        rows = [0, 1 + whole.monitors.index(monitor)]
        return Curve(whole.values[rows], whole.rates[rows], whole.path, [monitor])
    solved = np.where(result.converged, 1.0, np.nan)
    if quantity == "nyquist":
        first = first_harmonic(result, monitor)
        rows, floor = [first.real * solved, first.imag * solved], -np.inf
    else:
        rows = [whole.values[0], quantity_of(result, monitor, quantity) * solved]
        floor = -np.inf if quantity == "phase" else 0.0
    # Only where curves are drawn: loading it takes longer than most tables.
    from scipy.interpolate import PchipInterpolator

    values = np.array(rows)
    rates = np.full_like(values, np.nan)
    if quantity != "nyquist":
        rates[0] = whole.rates[0]
    for run in stretches(result):
        if quantity == "phase":
            values[1, run] = np.unwrap(values[1, run], period=360.0)
        path = whole.path[run]
        if len(run) > 1 and np.isfinite(path).all() and np.all(np.diff(path) > 0):
            for row in range(len(values)):
                if not np.isfinite(rates[row, run]).all() and np.isfinite(values[row, run]).all():
                    rates[row, run] = PchipInterpolator(path, values[row, run]).derivative()(path)
    return Curve(values, rates, whole.path, [monitor], floor)
