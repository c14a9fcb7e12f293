"""Pictures of studies: bands of quantiles over the samples."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, STYLE, plain_text, with_unit
from attrito.studies.design import Study

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
# Parts of a quantity's range that quantiles are taken over, and the fewest samples in one.
MOST_PARTS, FEWEST = 15, 8
# Of the largest damping ratio: what is drawn of it
LEAST = 1e-4


def quantiles_of(values: np.ndarray) -> np.ndarray:
    """`QUANTILES` over the samples `[samples, n]` that have a number, `[quantiles, n]`; NaN where none has."""
    found = np.full((len(QUANTILES), values.shape[1]), np.nan)
    known = np.isfinite(values).any(axis=0)
    found[:, known] = np.nanquantile(values[:, known], QUANTILES, axis=0)
    return found


def picture_of_peaks(
    study: Study, stops: list[float], values: np.ndarray, amplitude: np.ndarray, parameter: str, unit: str
) -> Figure:
    """Quantile bands of the peak: over the parameter, if there are several values, else over each quantity."""
    with matplotlib.rc_context(STYLE):
        label = with_unit("Amplitude of the peak", unit)
        if len(stops) > 1:
            figure = Figure(figsize=(6.4, 4.2), constrained_layout=True)
            axes = figure.subplots()
            _bands(axes, np.array(stops), quantiles_of(amplitude))
            axes.set(xlabel=f"{parameter.capitalize()} factor", ylabel=label)
            axes.legend()
            return figure
        count = len(study.vary)
        figure = Figure(figsize=(4.2 * count, 3.8), constrained_layout=True)
        for axes, vary, column in zip(figure.subplots(1, count, squeeze=False)[0], study.vary, values.T, strict=True):
            axes.plot(column, amplitude[:, 0], ".", color="0.6", markersize=2.5)
            known = np.flatnonzero(np.isfinite(amplitude[:, 0]))
            order = known[np.argsort(column[known])]
            if not len(order):
                axes.set(xlabel=plain_text(vary.name), ylabel=label)
                continue
            parts = np.array_split(order, min(max(1, len(order) // FEWEST), MOST_PARTS))
            middle = np.array([np.median(column[part]) for part in parts])
            _bands(axes, middle, np.array([np.quantile(amplitude[part, 0], QUANTILES) for part in parts]).T)
            axes.set(xlabel=plain_text(vary.name), ylabel=label)
        if np.isfinite(amplitude[:, 0]).any():
            axes.legend()
    return figure


def picture_of_modes(amplitudes: list[float], frequency_hz: np.ndarray, damping_ratio: np.ndarray, unit: str) -> Figure:
    """Quantile bands of frequency and damping ratio of the contacts `[samples, amplitudes]` over the amplitude."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.6), constrained_layout=True)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for axes, quantity in ((upper, frequency_hz), (lower, damping_ratio)):
            _bands(axes, np.array(amplitudes), quantiles_of(quantity))
        upper.set_ylabel("Frequency (Hz)")
        upper.ticklabel_format(axis="y", useOffset=False)
        upper.legend()
        lower.set(xscale="log", xlabel=with_unit("Amplitude Q", unit), ylabel="Damping ratio of the contacts")
        largest = np.nanmax(damping_ratio, initial=0.0)
        if largest > 0.0:
            lower.set_yscale("log", nonpositive="clip")
            # Where nothing slips rounding is left.
            lower.set_ylim(max(LEAST * largest, 0.5 * np.nanmin(damping_ratio, initial=largest)), 2.0 * largest)
    return figure


def _bands(axes, x: np.ndarray, quantiles: np.ndarray) -> None:
    colour = BRANCH_COLOURS[0]
    axes.fill_between(x, quantiles[0], quantiles[4], color=colour, alpha=0.18, linewidth=0, label="5 to 95 %")
    axes.fill_between(x, quantiles[1], quantiles[3], color=colour, alpha=0.35, linewidth=0, label="25 to 75 %")
    axes.plot(x, quantiles[2], color=colour, label="median")
