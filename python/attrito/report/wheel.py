"""The section of a report on a wheel: where its sectors are at one instant, from the motion of one of them.

q_j(t) = q_0(t - j EO T / N),    j = 0 ... N - 1
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.job.cyclic import nodal_diameter_in_words
from attrito.plots.style import BRANCH_COLOURS, legend_below, with_unit
from attrito.report.figures import LOOK
from attrito.report.page import Page
from attrito.report.view import View
from attrito.results.result import Result

# Instants of a period at which the largest displacement of a monitor is looked for
INSTANTS = 360


def wheel(page: Page, view: View) -> None:
    """Monitors round the wheel at the point that is shown; nothing where the model is whole."""
    sectors = int(view.result.attribute("sectors") or 0)
    if not sectors or view.point is None:
        return
    order = int(view.result.attribute("engine_order"))
    page.section("Round the wheel")
    page.text(
        f"One of {sectors} sectors, engine order {order}: {nodal_diameter_in_words(sectors, order)}. At "
        f"{view.place(view.point)}, without means, when the first sector moves farthest and an eighth of a period on:"
    )
    page.figures(
        [
            (round_the_wheel(view.result, name, view.point, sectors, order), f"{name} of every sector.")
            for name in view.monitors
        ]
    )


def displacements(coefficients: np.ndarray, sectors: int, order: int, instant: float) -> np.ndarray:
    """Of all sectors at omega t = `instant` `[sectors]`, without means, by coefficients of the first one `[nk]`."""
    phase = instant - 2.0 * np.pi * ((order * np.arange(sectors)) % sectors) / sectors
    harmonics = np.arange(1, (len(coefficients) - 1) // 2 + 1)
    found: np.ndarray = np.cos(np.outer(phase, harmonics)) @ coefficients[1::2]
    found += np.sin(np.outer(phase, harmonics)) @ coefficients[2::2]
    return found


def round_the_wheel(result: Result, monitor: str, point: int, sectors: int, order: int) -> Figure:
    """Displacement of a monitor in every sector at two instants."""
    coefficients = result.monitor(monitor, "harmonics")[point]
    instants = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    first = [displacements(coefficients, 1, 0, instant)[0] for instant in instants]
    peak = instants[np.argmax(np.abs(first))]
    with matplotlib.rc_context(LOOK.style()):
        figure = Figure(figsize=LOOK.size((5.1, 3.0)), constrained_layout=True)
        axes = figure.subplots()
        looks = {"first sector farthest": (0.0, BRANCH_COLOURS[0]), "T / 8 later": (0.25 * np.pi, BRANCH_COLOURS[1])}
        for label, (later, colour) in looks.items():
            values = displacements(coefficients, sectors, order, peak + later)
            axes.plot(np.arange(sectors), values, "o-", color=colour, markersize=3.5, linewidth=0.8, label=label)
        axes.axhline(0.0, color="#8a8a8a", linewidth=0.6)
        unit = result.unit(f"/monitors/{monitor}/harmonics")
        axes.set(xlabel="Sector", ylabel=with_unit(f"{monitor}", unit, 2.4))
        axes.xaxis.get_major_locator().set_params(integer=True)
        legend_below(axes, 2)
    return figure
