"""Pictures of studies: bands of quantiles over the samples, or lines of a grid."""

from __future__ import annotations

import json
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, Look, plain_text, with_unit
from attrito.studies.statistics import ACCEPTED, QUANTILES, quantiles_of, spans
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, stored
from attrito.support.units import axis_unit

# Parts of a quantity's range that quantiles are taken over, and the fewest samples in one.
MOST_PARTS, FEWEST = 15, 8
USUAL = Look()
# Lines of a grid
MOST_LINES = 6
# Of the largest damping ratio: what is drawn of it
LEAST = 1e-4


def picture_of_peaks(
    names: Sequence[str],
    stops: Sequence[float],
    values: np.ndarray,
    amplitude: np.ndarray,
    parameter: str,
    unit: str,
    is_grid: bool = False,
    look: Look = USUAL,
) -> Figure:
    """Quantile bands of the peak: over the parameter, if there are several values, else over each quantity.

    A grid whose other quantities have few values together is drawn as it is, a line each.
    """
    if is_grid and (lines := _grid_lines(values, len(stops))) is not None:
        return _picture_of_grid(names, stops, values, amplitude, f"{parameter.capitalize()} factor", unit, *lines, look)
    with matplotlib.rc_context(look.style()):
        label = with_unit("Amplitude of the peak", unit)
        if len(stops) > 1:
            figure = look.figure((6.4, 4.2))
            axes = figure.subplots()
            _bands(axes, np.array(stops), quantiles_of(amplitude))
            axes.set(xlabel=f"{parameter.capitalize()} factor", ylabel=label)
            axes.legend()
            return figure
        count = len(names)
        figure = look.figure((4.2 * count, 3.8))
        for axes, name, column in zip(figure.subplots(1, count, squeeze=False)[0], names, values.T, strict=True):
            axes.plot(column, amplitude[:, 0], ".", color="0.6", markersize=2.5)
            known = np.flatnonzero(np.isfinite(amplitude[:, 0]))
            order = known[np.argsort(column[known])]
            if not len(order):
                axes.set(xlabel=plain_text(name), ylabel=label)
                continue
            parts = np.array_split(order, min(max(1, len(order) // FEWEST), MOST_PARTS))
            middle = np.array([np.median(column[part]) for part in parts])
            _bands(axes, middle, np.array([np.quantile(amplitude[part, 0], QUANTILES) for part in parts]).T)
            axes.set(xlabel=plain_text(name), ylabel=label)
        if np.isfinite(amplitude[:, 0]).any():
            axes.legend()
    return figure


def _grid_lines(values: np.ndarray, stops: int) -> tuple[int, list[np.ndarray]] | None:
    """Column of a grid that is the axis, -1 for the parameter, and samples of each line; None where these are many."""
    longest = int(np.argmax([len(np.unique(column)) for column in values.T]))
    axis = -1 if stops > 1 else longest
    rest = np.delete(values, axis, axis=1) if axis >= 0 else values
    _, line = np.unique(rest, axis=0, return_inverse=True)
    line = np.asarray(line).ravel()
    count = int(line.max()) + 1
    if count > MOST_LINES:
        return None
    samples = [np.flatnonzero(line == number) for number in range(count)]
    return axis, [own[np.argsort(values[own, axis])] if axis >= 0 else own for own in samples]


def _picture_of_grid(
    names: Sequence[str],
    stops: Sequence[float],
    values: np.ndarray,
    amplitude: np.ndarray,
    parameter: str,
    unit: str,
    axis: int,
    lines: list[np.ndarray],
    look: Look,
) -> Figure:
    """One line for each of the values of all quantities but one."""
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 4.2))
        axes = figure.subplots()
        for number, own in enumerate(lines):
            others = [column for column in range(len(names)) if column != axis]
            label = ", ".join(f"{plain_text(names[column])} {values[own[0], column]:.4g}" for column in others)
            x, y = (np.array(stops), amplitude[own[0]]) if axis < 0 else (values[own, axis], amplitude[own, 0])
            axes.plot(x, y, "o-", markersize=3.0, color=look.hues()[number % len(look.hues())], label=label or None)
        axes.set(
            xlabel=parameter if axis < 0 else plain_text(names[axis]), ylabel=with_unit("Amplitude of the peak", unit)
        )
        if axes.get_legend_handles_labels()[1]:
            axes.legend()
    return figure


def picture_of_file(path: str, look: Look = USUAL) -> Figure:
    """The picture of the file of a study.

    Raises
    ------
    InputError : the file lacks what a study's has
    """
    with stored(path, "a file of `attrito study`") as file:
        study = json.loads(as_text(file.attrs.get("study", "{}")))
        units, parameter = (as_text(file.attrs.get(name, "")) for name in ("units", "parameter"))
        if "modes" in file:
            found = [file[f"modes/{name}"][()] for name in ("frequency_hz", "damping_ratio")]
            unit = axis_unit(as_text(file["parameter"].attrs.get("unit", "1")), units)
            return picture_of_modes(file["parameter"][()].tolist(), *found, unit, look)
        if "response" in file:
            unit = axis_unit(as_text(file["response/amplitude"].attrs.get("unit", "1")), units)
            at_hz, error = file["parameter"][()], file.get("response/model_error")
            failing = [] if error is None else spans(at_hz, ~(error[()] <= ACCEPTED))
            return picture_of_responses(
                at_hz, file["quantiles/amplitude"][()], file["mean/amplitude"][()], unit, failing, look
            )
        names = [vary["name"] for vary in study.get("vary", [])]
        missing = [
            name for name in ("parameter", "peaks/amplitude", *(f"values/{one}" for one in names)) if name not in file
        ]
        if missing or not names:
            raise InputError(Fault(path, missing[0] if missing else "study", "absent", "a file of `attrito study`"))
        values = np.array([file[f"values/{name}"][()] for name in names]).T
        amplitude = file["peaks/amplitude"]
        unit = axis_unit(as_text(amplitude.attrs.get("unit", "1")), units)
        stops, is_grid = file["parameter"][()].tolist(), study.get("design") == "grid"
        return picture_of_peaks(names, stops, values, amplitude[()], parameter, unit, is_grid, look)


def picture_of_modes(
    amplitudes: list[float], frequency_hz: np.ndarray, damping_ratio: np.ndarray, unit: str, look: Look = USUAL
) -> Figure:
    """Quantile bands of frequency and damping ratio of the contacts `[samples, amplitudes]` over the amplitude."""
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 5.6))
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


def picture_of_responses(
    at_hz: np.ndarray,
    quantiles: np.ndarray,
    mean: np.ndarray,
    unit: str,
    failing: Sequence[tuple[float, float]] = (),
    look: Look = USUAL,
) -> Figure:
    """Quantile bands of a response `[quantiles, F]` and its mean `[F]` over frequencies, Hz.

    `failing`: from where to where a model does not hold.
    """
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 4.2))
        axes = figure.subplots()
        for number, (low, high) in enumerate(failing):
            label = "the model does not hold" if number == 0 else None
            axes.axvspan(low, high, facecolor="0.85", edgecolor="0.6", linewidth=0.8, zorder=0, label=label)
        _bands(axes, at_hz, quantiles)
        axes.plot(at_hz, mean, "--", color="0.2", linewidth=1.0, label="mean")
        axes.set(xlabel="Frequency (Hz)", ylabel=with_unit("Amplitude", unit))
        axes.set_xlim(at_hz[0], at_hz[-1])
        axes.set_ylim(bottom=0.0)
        axes.legend()
    return figure


def _bands(axes, x: np.ndarray, quantiles: np.ndarray) -> None:
    colour = BRANCH_COLOURS[0]
    axes.fill_between(x, quantiles[0], quantiles[4], color=colour, alpha=0.18, linewidth=0, label="5 to 95 %")
    axes.fill_between(x, quantiles[1], quantiles[3], color=colour, alpha=0.35, linewidth=0, label="25 to 75 %")
    axes.plot(x, quantiles[2], color=colour, label="median")
