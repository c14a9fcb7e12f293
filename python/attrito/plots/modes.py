"""The picture of a nonlinear mode: frequency and damping against amplitude."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, LIMIT_COLOUR, Look, with_unit
from attrito.plots.ticks import label_short_log
from attrito.results.result import Result

# Of the largest damping ratio: what is drawn of others
LEAST = 1e-9


def mode_curve(result: Result, look: Look | None = None) -> Figure:
    """Frequency above, damping ratios below: of the contacts, of the structure, and both; dashed the tangent mode.

    Where the structure's is negative what it feeds is drawn instead, and limit cycles are marked: filled ones attract.
    """
    look = look or Look()
    amplitude, frequency, contacts, structure = (
        result.array(f"/points/{name}")
        for name in ("amplitude", "frequency_hz", "damping_ratio", "damping_ratio_structure")
    )
    solved = result.converged
    amplitude, frequency, contacts, structure = (
        values[solved] for values in (amplitude, frequency, contacts, structure)
    )
    is_fed = bool(np.any(structure < 0.0))
    of_structure = (-structure, "fed by the structure") if is_fed else (structure, "structure")
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 5.6))
        upper, lower = figure.subplots(2, 1, sharex=True)
        # A mode that is not finished does not say it.
        if tangent := result.attribute("tangent_hz"):
            upper.axhline(float(tangent), color=LIMIT_COLOUR, linestyle="--", label="tangent")
        upper.plot(amplitude, frequency, ".-", color=BRANCH_COLOURS[0], label="mode")
        upper.set_ylabel("Frequency (Hz)")
        upper.ticklabel_format(axis="y", useOffset=False)
        least = LEAST * np.nanmax(contacts + abs(structure), initial=0.0)
        for values, colour, style, label in (
            (contacts, BRANCH_COLOURS[1], ".-", "contacts"),
            (of_structure[0], BRANCH_COLOURS[2], "-", of_structure[1]),
            *(() if is_fed else ((contacts + structure, "k", ":", "both"),)),
        ):
            # Where nothing slips rounding is left.
            shown = np.where(values > least, values, np.nan)
            if np.any(np.isfinite(shown)):
                lower.loglog(amplitude, shown, style, color=colour, label=label)
        for name, place in _limit_cycles(result, solved).items():
            face = "k" if name == "attracts" else "w"
            look_of_marks = {"marker": "o", "color": "k", "markerfacecolor": face, "linestyle": "none", "zorder": 3}
            upper.plot(amplitude[place], frequency[place], label=f"limit cycle, {name}", **look_of_marks)
            lower.plot(amplitude[place], contacts[place], **look_of_marks)
        upper.legend(loc="best")
        if lower.get_legend_handles_labels()[0]:
            lower.legend(loc="best")
        upper.set_xscale("log")
        label_short_log(lower.xaxis)
        lower.set_ylabel("Damping ratio")
        lower.set_xlabel(with_unit("Amplitude Q", result.unit("/points/amplitude")))
    return figure


def _limit_cycles(result: Result, solved: np.ndarray) -> dict[str, np.ndarray]:
    """Places among the solved points of the limit cycles that attract, and of those that repel."""
    # Files of earlier releases do not have them.
    if not result.has("/points/limit_cycle"):
        return {}
    names = np.array(result.named("/points/limit_cycle"))[solved]
    return {name: np.flatnonzero(names == name) for name in ("attracts", "repels") if np.any(names == name)}
