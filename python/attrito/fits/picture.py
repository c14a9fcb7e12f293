"""The picture of a fit: measurements with the solutions, and the profile of each parameter."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from attrito.fits.data import RANGE, Data
from attrito.fits.design import Parameter
from attrito.fits.estimate import Profile
from attrito.fits.found import Found
from attrito.fits.measured import COLUMNS, SIGNED
from attrito.plots.style import BRANCH_COLOURS, DASHES, LIMIT_COLOUR, STYLE, plain_text, with_unit
from attrito.plots.ticks import label_short_log
from attrito.support.units import axis_unit

LABELS = {
    "frequency_hz": "Frequency",
    "frequency_ratio": "Frequency over that of the tangent mode",
    "damping_ratio": "Damping ratio",
    "phase_deg": "Phase",
    "displacement": "Relative displacement",
    "tangential_force": "Tangential force",
}
MEASURED, SOLVED = LIMIT_COLOUR, BRANCH_COLOURS[0]


def picture_of_fit(found: Found, units: str) -> Figure:
    """Panels for the measurements, with residuals below, and one for each parameter's profile, if there are any.

    `units` : those that the job names, or nothing
    """
    pairs = zip(found.fit.data, found.solved, strict=True)
    # Of a loop the force alone, against displacements
    panels = [
        (one, name, solved)
        for one, solved in pairs
        for name in one.measured.values
        if not (one.of == "loop" and name == "displacement")
    ]
    profiles = list(zip(found.fit.parameters, found.profiles, strict=False))
    width = max(3.6 * max(len(panels), len(profiles)), 4.8)
    heights = [4.6, 2.8] if profiles else [4.6]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, sum(heights)), constrained_layout=True)
        parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
        grid = parts[0].subplots(2, len(panels), squeeze=False, sharex="col", height_ratios=[3, 1])
        for (above, below), (one, name, solved) in zip(grid.T, panels, strict=True):
            _draw(above, below, one, name, solved, units)
        if profiles:
            for i, axes in enumerate(parts[1].subplots(1, len(profiles), squeeze=False)[0]):
                _draw_profile(axes, found, i, *profiles[i])
        return figure


def _draw(above: Axes, below: Axes, one: Data, name: str, solved: dict[str, np.ndarray], units: str) -> None:
    measured, values = one.measured, one.measured.values[name]
    is_loop, shown = one.of == "loop", measured.shown(solved, name)
    # Bars of a loop's many points would hide it.
    bars = None if is_loop else 2.0 * measured.deviation(name)
    label = "measured" if is_loop else "measured, ± 2 standard deviations"
    above.errorbar(measured.at, values, bars, fmt="o", ms=3, lw=0.8, color=MEASURED, label=label)
    across = measured.shown(solved, "displacement") if "displacement" in measured.values else measured.at
    if is_loop and measured.centred:
        across, shown = np.append(across, across[0]), np.append(shown, shown[0])
    above.plot(across, shown, color=SOLVED, label="fitted")
    above.set(ylabel=_label(one, name, units), title=plain_text(one.name))
    below.plot(measured.at, measured.differences(solved, name), "o", ms=2 if is_loop else 3, color=SOLVED)
    below.axhline(0.0, color=LIMIT_COLOUR, lw=0.8)
    below.set(xlabel=_label(one, COLUMNS[one.of][0], units), ylabel="Residual / deviation")
    if one.of == "mode":
        below.set_xscale("log")
        label_short_log(below.xaxis)
    if name not in SIGNED and np.nanmax(values) > 10.0 * np.nanmin(values):
        above.set_yscale("log")
        label_short_log(above.yaxis)
    above.legend()


def _label(one: Data, name: str, units: str) -> str:
    is_modal = one.of == "mode" and one.keys["monitor"] is None
    words = LABELS.get(name, "Amplitude Q" if is_modal else "Amplitude")
    if name == "amplitude" and one.of != "loop" and one.keys["quantity"] != RANGE:
        words = one.keys["quantity"].capitalize()
    return with_unit(words, axis_unit(one.units[name], units))


def _draw_profile(axes: Axes, found: Found, i: int, parameter: Parameter, one: Profile) -> None:
    values = np.array([parameter.value(x) for x in one.x])
    variance = found.best.variance
    rise = (one.cost - float(found.best.residuals @ found.best.residuals)) / variance
    # The root of the rise, with the side as its sign, is nearly straight: it is taken between the values.
    root = np.sign(one.x - found.best.x[i]) * np.sqrt(np.maximum(rise, 0.0))
    fine = np.linspace(one.x[0], one.x[-1], 200)
    axes.plot([parameter.value(x) for x in fine], np.interp(fine, one.x, root) ** 2, color=SOLVED)
    axes.plot(values, rise, "o", ms=3, color=SOLVED)
    axes.axhline(found.best.quantile**2, color=LIMIT_COLOUR, ls=DASHES, lw=1.0)
    axes.axvline(found.values[i], color=LIMIT_COLOUR, lw=0.8)
    axes.set(xlabel=plain_text(parameter.name), ylabel="Rise of the sum of squares / s²")
    axes.set_ylim(0.0, 2.5 * found.best.quantile**2)
