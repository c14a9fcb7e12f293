"""One period at a point: a monitor's motion and its harmonics, and the forces of a contact.

q(t) = q_0 + sum_h (c_h cos h omega t + s_h sin h omega t),    amplitude of harmonic h: sqrt(c_h^2 + s_h^2)
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, Look, legend_below, with_unit
from attrito.report.figures import LOOK
from attrito.results.loops import Loop
from attrito.results.result import Result

# Instants of a drawn period
INSTANTS = 241
# Part of the largest harmonic below which one is rounding
NOTHING = 1e-12


def amplitudes(coefficients: np.ndarray) -> np.ndarray:
    """Amplitude of each harmonic, from 1, `[H]`, of coefficients `[2 H + 1]`."""
    return np.hypot(coefficients[1::2], coefficients[2::2])


def motion(coefficients: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """q at some instants, parts of the period `[nt]`."""
    phase = 2.0 * np.pi * np.outer(instants, np.arange(1, len(coefficients) // 2 + 1))
    found: np.ndarray = coefficients[0] + np.cos(phase) @ coefficients[1::2] + np.sin(phase) @ coefficients[2::2]
    return found


def content(result: Result, monitor: str, point: int, look: Look = LOOK) -> Figure:
    """A monitor's motion about its mean over a period, beside that of its first harmonic; amplitudes of harmonics."""
    coefficients = result.monitor(monitor, "harmonics")[point]
    unit = result.unit(f"/monitors/{monitor}/harmonics")
    instants = np.linspace(0.0, 1.0, INSTANTS)
    with matplotlib.rc_context(look.style()):
        figure = look.figure((5.1, 4.4))
        upper, lower = figure.subplots(2, 1)
        first = np.where(np.arange(len(coefficients)) < 3, coefficients, 0.0)
        for values, colour, dashes, label in (
            (first, LIMIT_COLOUR, "--", "first harmonic"),
            (coefficients, BRANCH_COLOURS[0], "-", "motion"),
        ):
            upper.plot(instants, motion(values, instants) - values[0], color=colour, linestyle=dashes, label=label)
        upper.set(xlabel="Time / period", xlim=(0, 1), ylabel=with_unit(f"Motion of {monitor}", unit, 1.6))
        upper.legend(loc="upper right", ncols=2)
        low, high = upper.get_ylim()
        upper.set_ylim(low, high + 0.22 * (high - low))
        found = amplitudes(coefficients)
        largest = found.max(initial=0.0)
        shown = np.where(found > NOTHING * largest, found, 0.0)
        harmonic = np.arange(1, len(found) + 1)
        lower.bar(harmonic, shown, color=BRANCH_COLOURS[0], width=0.6)
        if largest > 0:
            lower.set_yscale("log")
            least = shown[shown > 0].min()
            lower.set_ylim(0.3 * least, 3.0 * largest)
        lower.set(xlabel="Harmonic", ylabel=with_unit("Amplitude", unit, 1.6))
        lower.xaxis.get_major_locator().set_params(integer=True)
    return figure


def contact_forces(loop: Loop, unit: str, look: Look = LOOK) -> Figure:
    """Normal and tangential force of a contact over a period, and the limits of friction."""
    with matplotlib.rc_context(look.style()):
        figure = look.figure((5.1, 3.4))
        axes = figure.subplots()
        time = np.linspace(0.0, 1.0, len(loop.normal) + 1)

        def closed(values: np.ndarray) -> np.ndarray:
            return np.append(values, values[0])

        if loop.friction_coefficient is not None:
            limit = closed(loop.friction_coefficient * loop.normal)
            axes.fill_between(time, -limit, limit, color=LIMIT_COLOUR, alpha=0.18, linewidth=0, label="within friction")
        axes.plot(time, closed(loop.normal), color=BRANCH_COLOURS[2], linestyle="--", label="normal")
        axes.plot(time, closed(loop.tangential), color=BRANCH_COLOURS[0], label="tangential")
        axes.set(xlabel="Time / period", xlim=(0, 1), ylabel=with_unit("Force", unit, 2.6))
        legend_below(axes, 3)
    return figure
