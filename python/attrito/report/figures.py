"""Figures that only a report has: contacts over a sweep, harmonics, convergence, intervals, multipliers.

All are drawn 130 mm wide, so that their letters can still be read where a phone shows them at its own width.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, Look, legend_below, plain_text, with_unit
from attrito.results.result import Result
from attrito.results.tables import contact_sets

LOOK = Look(width=130.0, font_size=10.0)
SMALL = Look(width=75.0, height=62.0, font_size=9.0)
# Harmonics and contacts beyond these are left out of figures, which the caption says.
MOST_HARMONICS = 9
ERROR_LOOKS = {
    "residual": ("o", BRANCH_COLOURS[0], "relative residual"),
    "estimate": ("s", BRANCH_COLOURS[1], "estimated error"),
    "error_harmonics": ("^", BRANCH_COLOURS[2], "of it harmonics"),
    "error_samples": ("v", BRANCH_COLOURS[3], "samples"),
    "error_modes": ("D", BRANCH_COLOURS[5], "modes"),
}
KIND_LOOKS = {"floquet": ("o", "#0072B2"), "slip": ("s", "#E69F00"), "stuck": ("^", "#009E73")}


def _axes(height: float = 3.0, rows: int = 1, look: Look = LOOK) -> tuple[Figure, np.ndarray]:
    figure = look.figure((5.1, height))
    return figure, np.atleast_1d(figure.subplots(rows, 1, sharex=True))


def _runs(result: Result, own: np.ndarray) -> list[np.ndarray]:
    """Numbers of some points, branch by branch, so that no line joins two branches."""
    chosen = np.flatnonzero(own)
    return np.split(chosen, np.flatnonzero(np.diff(result.array("/points/branch")[chosen])) + 1)


def _lines(axes: Axes, result: Result, own: np.ndarray, values: np.ndarray, label: str | None, **look: object) -> None:
    """Values `[np]` over frequency at some points, one line a branch."""
    frequency = result.array("/points/frequency_hz")
    for run in _runs(result, own):
        axes.plot(frequency[run], values[run], label=label, **look)
        label = None


def contact_shares(result: Result, own: np.ndarray) -> Figure:
    """How much of the contacts' time is stick, slip and lift-off over some points."""
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(3.4)
        colours = {"stick": "#0072B2", "slip": "#E69F00", "open": "#D55E00"}
        dashes = {"stick": "-", "slip": (0, (4, 1.5)), "open": (0, (1, 1.2))}
        for name, colour in colours.items():
            share = _solved(result, f"/contacts/{name}").mean(axis=1)
            _lines(axes, result, own, share, name, color=colour, linestyle=dashes[name])
        axes.set(xlabel="Frequency (Hz)", ylabel="Share of time", ylim=(-0.03, 1.03))
        legend_below(axes, 3)
    return figure


def dissipation(result: Result, own: np.ndarray, look: Look = LOOK) -> Figure:
    """What all contacts dissipate a period over some points, and each contact set where there are several."""
    with matplotlib.rc_context(look.style()):
        figure, (axes,) = _axes(3.4, look=look)
        energy = _solved(result, "/contacts/dissipated_energy")
        sets = {name: contacts for name, contacts in contact_sets(result).items() if name}
        _lines(axes, result, own, energy.sum(axis=1), "all", color="k")
        if 1 < len(sets) <= len(BRANCH_COLOURS):
            for (name, contacts), colour in zip(sets.items(), BRANCH_COLOURS, strict=False):
                part = energy[:, contacts].sum(axis=1)
                _lines(axes, result, own, part, plain_text(name), color=colour, linestyle=(0, (4, 1.5)), linewidth=1.2)
        unit = result.unit("/contacts/dissipated_energy")
        axes.set(xlabel="Frequency (Hz)", ylabel=with_unit("Dissipated a period", unit, 2.6), ylim=(0, None))
        legend_below(axes, 3 if len(sets) < 2 else 1)
    return figure


def harmonics(result: Result, monitor: str, own: np.ndarray, look: Look = LOOK) -> Figure:
    """Amplitude of each harmonic of a monitor over some points, and its mean."""
    coefficients = result.monitor(monitor, "harmonics")
    highest = (coefficients.shape[1] - 1) // 2
    with matplotlib.rc_context(look.style()):
        figure, (axes,) = _axes(4.4, look=look)
        lines = {"mean": np.abs(coefficients[:, 0])}
        for harmonic in range(1, min(highest, MOST_HARMONICS) + 1):
            lines[str(harmonic)] = np.hypot(coefficients[:, 2 * harmonic - 1], coefficients[:, 2 * harmonic])
        largest = np.nanmax(np.concatenate([[0.0], *(values[own] for values in lines.values())]))
        for index, (name, values) in enumerate(lines.items()):
            shown = np.where(values > 1e-12 * largest, values, np.nan)
            if np.isfinite(shown[own]).any():
                colour = (
                    "#555555" if index == 0 else matplotlib.colormaps["viridis"](0.9 * (index - 1) / max(highest, 1))
                )
                style = (0, (1, 1.2)) if index == 0 else "-"
                _lines(axes, result, own, shown, name, color=colour, linestyle=style)
        if largest > 0:
            axes.set_yscale("log")
        unit = result.unit(f"/monitors/{monitor}/harmonics")
        axes.set(xlabel="Frequency (Hz)", ylabel=with_unit(f"Harmonics of {monitor}", unit, 2.4))
        # Entries go down the columns: as many as fill the rows evenly.
        entries = len(axes.get_legend_handles_labels()[1])
        legend_below(axes, -(-entries // max(1, -(-entries // 5))))
    return figure


def iterations(result: Result) -> Figure:
    """Newton iterations of each point."""
    point, solved = np.arange(result.points), result.converged
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(3.4)
        count = result.array("/points/iterations")
        for part, colour, label in ((solved, BRANCH_COLOURS[0], "solved"), (~solved, "#D55E00", "without a solution")):
            if part.any():
                axes.vlines(point[part], 0, count[part], color=colour, linewidth=1.2, label=label)
        axes.set(xlabel="Point", ylabel="Newton iterations", ylim=(0, None))
        if not solved.all():
            legend_below(axes, 2)
    return figure


def errors(result: Result) -> Figure:
    """Relative residual of each point, and its estimated error with the parts that are known."""
    point = np.arange(result.points)
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(3.4)
        kept = {name: result.array(f"/points/{name}") for name in ERROR_LOOKS if result.has(f"/points/{name}")}
        known = {name: np.isfinite(values) & (values > 0) for name, values in kept.items()}
        # One part alone is the whole estimate, and would hide it.
        several = sum(known[name].any() for name in kept if name.startswith("error_")) > 1
        for name, values in kept.items():
            good, (marker, colour, label) = known[name], ERROR_LOOKS[name]
            if good.any() and (several or not name.startswith("error_")):
                axes.plot(point[good], values[good], marker, color=colour, markersize=2.6, label=label)
                axes.set_yscale("log")
        axes.set(xlabel="Point", ylabel="Part of the motion")
        if axes.get_legend_handles_labels()[0]:
            legend_below(axes, 3)
    return figure


def contact_intervals(result: Result, point: int) -> Figure | None:
    """Mean forces of every contact at a point with their intervals; None where no interval is known."""
    kinds = [name for name in ("n", "t1", "t2") if result.has(f"/contacts/{name}_low")]
    data = {
        name: [result.dataset(f"/contacts/{name}_{side}")[point] for side in ("mean", "low", "high")] for name in kinds
    }
    data = {name: rows for name, rows in data.items() if np.isfinite(rows[1] + rows[2]).any()}
    if not data:
        return None
    labels = {"n": "Mean normal force", "t1": "Mean T1", "t2": "Mean T2"}
    with matplotlib.rc_context(LOOK.style()):
        figure, rows = _axes(1.7 * len(data) + 0.5, rows=len(data))
        contact = np.arange(result.contacts)
        for axes, (name, (mean, low, high)) in zip(rows, data.items(), strict=True):
            axes.vlines(contact, low, high, color=BRANCH_COLOURS[0], linewidth=2.2, alpha=0.6)
            axes.plot(contact, mean, "o", color="k", markersize=2.8)
            axes.set_ylabel(with_unit(labels[name], result.unit(f"/contacts/{name}_mean"), 1.3))
        rows[-1].set_xlabel("Contact")
        rows[-1].xaxis.get_major_locator().set_params(integer=True)
    return figure


def interval_over_sweep(result: Result, own: np.ndarray, contact: int) -> Figure:
    """Mean forces of a contact with their intervals over some points."""
    frequency = result.array("/points/frequency_hz")
    kinds = {"n": ("N", BRANCH_COLOURS[0]), "t1": ("T1", BRANCH_COLOURS[1]), "t2": ("T2", BRANCH_COLOURS[2])}
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(3.4)
        for name, (label, colour) in kinds.items():
            if not result.has(f"/contacts/{name}_low"):
                continue
            mean, low, high = (
                result.dataset(f"/contacts/{name}_{side}")[:, contact] for side in ("mean", "low", "high")
            )
            if not np.isfinite(mean[own]).any():
                continue
            _lines(axes, result, own, mean, f"mean {label}", color=colour)
            bounded = np.isfinite(low + high)
            low, high = (np.where(bounded, bound, np.nan) for bound in (low, high))
            for run in _runs(result, own):
                axes.fill_between(frequency[run], low[run], high[run], color=colour, alpha=0.25, linewidth=0)
        axes.set(xlabel="Frequency (Hz)", ylabel=with_unit("Mean force", result.unit("/contacts/n_mean"), 2.6))
        legend_below(axes, 3)
    return figure


def multipliers(result: Result) -> Figure:
    """All Floquet multipliers beside the unit circle, in the complex plane."""
    kinds, names = result.array("/multipliers/kind"), result.names("/multipliers/kind")
    real, imaginary = result.array("/multipliers/real"), result.array("/multipliers/imag")
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(4.6)
        angle = np.linspace(0, 2 * np.pi, 361)
        axes.plot(np.cos(angle), np.sin(angle), color="#8a8a8a", linewidth=1.0)
        for index, name in enumerate(names):
            part = kinds == index
            if part.any():
                marker, colour = KIND_LOOKS.get(name, ("o", "k"))
                look = {"marker": marker, "color": colour, "linestyle": "none", "markersize": 3.4, "alpha": 0.6}
                axes.plot(real[part], imaginary[part], label=plain_text(name), **look)
        axes.set(aspect="equal", xlabel="Real part", ylabel="Imaginary part")
        legend_below(axes, 3)
    return figure


def largest_multiplier(result: Result) -> Figure:
    """Largest modulus of the dynamic multipliers of each point over its frequency."""
    frequency, largest = (result.array(f"/{name}") for name in ("points/frequency_hz", "stability/largest_multiplier"))
    stable = result.array("/points/stable")
    with matplotlib.rc_context(LOOK.style()):
        figure, (axes,) = _axes(3.4)
        looks = {1: ("o", "#0072B2", "stable"), 0: ("x", "#D55E00", "unstable"), -1: ("s", "#777777", "no verdict")}
        for value, (marker, colour, label) in looks.items():
            part = (stable == value) & np.isfinite(largest)
            if part.any():
                axes.plot(frequency[part], largest[part], marker, color=colour, markersize=3.4, label=label)
        axes.axhline(1.0, color="#8a8a8a", linewidth=1.0)
        axes.set(xlabel="Frequency (Hz)", ylabel="Largest modulus")
        if axes.get_legend_handles_labels()[0]:
            legend_below(axes, 3)
    return figure


def _solved(result: Result, path: str) -> np.ndarray:
    """A dataset `[np, nc]`, NaN where there is no solution."""
    values = np.array(result.array(path), dtype=float)
    values[~result.converged] = np.nan
    return values
