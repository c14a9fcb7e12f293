"""What the printout of a report has on its two pages, for a run, a nonlinear mode and a Campbell diagram."""

from __future__ import annotations

from functools import partial

from attrito.plots.campbell import campbell_diagram
from attrito.plots.contact_maps import contact_map
from attrito.plots.contacts import hysteresis
from attrito.plots.modes import mode_curve
from attrito.plots.response import Drawing, frequency_response
from attrito.report import figures, period
from attrito.report.motion import moving
from attrito.report.printout import Printout
from attrito.report.structure import model_picture, sizes
from attrito.report.view import View
from attrito.results.loops import contact_loops, most_dissipating
from attrito.results.result import Result

# Levels whose peaks, contacts whose loops, critical speeds that are printed
MOST_PEAKS, MOST_LOOPS, MOST_SPEEDS = 8, 4, 45


def essentials(view: View, printout: Printout, outcome: list[str], trust: list[tuple[str, bool]]) -> None:
    """A run, or a nonlinear mode.

    Parameters
    ----------
    view : what is shown
    printout : two empty pages
    outcome : sentences on what came out
    trust : sentences on how far to trust it, each with whether it is a warning
    """
    result, is_mode = view.result, view.is_mode
    for sentence in outcome:
        printout.text(0, sentence)
    printout.heading(0, "How far to trust it")
    for sentence, warn in trust:
        printout.text(0, sentence, warn)
    printout.heading(0, "Model")
    printout.text(0, "; ".join(f"{name}: {value}" for name, value in sizes(view)) + ".")
    if view.model is not None:
        printout.panel(0, "Model", partial(_picture, view))
    if (found := moving(view)) is not None:
        printout.panel(0, f"Motion, {found.scale:.3g} times as large", found.still)
    if is_mode:
        printout.panel(0, "Frequency and damping against amplitude", partial(mode_curve, result))
    else:
        for name in view.monitors:
            printout.panel(0, f"{name}: response", partial(_response, view, name, "amplitude"))
            if result.has(f"/monitors/{name}/harmonics"):
                printout.panel(0, f"{name}: phase", partial(_response, view, name, "phase"))
        _peaks(view, printout)
    if view.point is None or not result.contacts:
        return
    printout.heading(1, f"At {view.place(view.point)}")
    if view.surfaces:
        for kind, caption in (("state", "What contacts do"), ("energy", "What they dissipate")):
            printout.panel(1, caption, partial(_map, view, kind))
    printout.panel(1, "The contacts that dissipate most", partial(_loops, view))
    if not is_mode:
        own = view.sweep()
        printout.panel(1, "Dissipation over the sweep", lambda look: figures.dissipation(result, own, look))
    for name in view.monitors:
        if result.has(f"/monitors/{name}/harmonics"):
            printout.panel(1, f"{name} over a period, and harmonics", partial(_content, view, name))
            if not is_mode:
                printout.panel(1, f"Harmonics of {name}", partial(_harmonics, view, name))


def campbell_essentials(result: Result, printout: Printout, lines: list[tuple[str, bool]]) -> None:
    """A Campbell diagram; `lines` as in `essentials`."""
    for sentence, warn in lines:
        printout.text(0, sentence, warn)
    printout.panel(0, "Campbell diagram", lambda look: campbell_diagram(result, look))
    printout.heading(1, "Critical speeds")
    order, speed, frequency = (
        result.array(f"/crossings/{name}") for name in ("engine_order", "speed_hz", "frequency_hz")
    )
    for row in list(zip(order, speed, frequency, strict=True))[:MOST_SPEEDS]:
        printout.text(1, f"engine order {row[0]}: {row[1]:.6g} Hz, mode at {row[2]:.6g} Hz")
    if len(order) > MOST_SPEEDS:
        printout.text(1, f"and {len(order) - MOST_SPEEDS} more")


def _peaks(view: View, printout: Printout) -> None:
    name = next(iter(view.monitors), None)
    peaks = [point for point in view.peaks.values() if point is not None]
    if name is None or not peaks:
        return
    printout.heading(1, f"Peaks of {name}")
    amplitude, unit = view.result.monitor(name, "amplitude"), view.result.unit(f"/monitors/{name}/amplitude")
    for point in peaks[:MOST_PEAKS]:
        printout.text(
            1, f"level {view.level[point]:.4g}: {amplitude[point]:.5g} ({unit}) at {view.frequency[point]:.6g} Hz"
        )
    if len(peaks) > MOST_PEAKS:
        printout.text(1, f"and of {len(peaks) - MOST_PEAKS} more levels")


def _picture(view: View, look: figures.Look) -> None:
    if view.model is not None:
        model_picture(view, view.model, look)


def _response(view: View, monitor: str, quantity: str, look: figures.Look) -> None:
    frequency_response(view.result, monitor, look=look, drawing=Drawing(quantity))


def _map(view: View, kind: str, look: figures.Look) -> None:
    contact_map(view.result, view.point, kind, look, titled=False, panels=view.surfaces)


def _loops(view: View, look: figures.Look) -> None:
    units = [view.result.unit(f"/contacts/{name}") for name in ("displacement", "force")]
    busiest = most_dissipating(view.result, view.point, MOST_LOOPS)
    hysteresis(contact_loops(view.result, view.point, busiest), *units, look=look, legend=False)


def _content(view: View, monitor: str, look: figures.Look) -> None:
    period.content(view.result, monitor, view.point, look)


def _harmonics(view: View, monitor: str, look: figures.Look) -> None:
    figures.harmonics(view.result, monitor, view.sweep(), look)
