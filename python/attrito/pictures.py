"""Pictures of files that attrito writes: what `attrito plot` draws, and `attrito.plot` in Python."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from matplotlib.figure import Figure

from attrito.charts.file import holds_chart
from attrito.charts.plot import picture_of_chart
from attrito.library.names import REFERENCES
from attrito.peaks.file import holds_peaks
from attrito.peaks.plot import peak_curve
from attrito.plots.campbell import campbell_diagram
from attrito.plots.contact_maps import contact_map, place_in_words
from attrito.plots.contacts import hysteresis
from attrito.plots.diameters import diameter_diagram
from attrito.plots.modes import mode_curve
from attrito.plots.response import Drawing, responses
from attrito.plots.style import Look, save
from attrito.plots.ticks import plain_ticks
from attrito.results.chosen_points import chosen_point
from attrito.results.loops import contact_loops, most_dissipating
from attrito.results.motion import QUANTITIES
from attrito.results.result import CAMPBELL, LINEAR_MODES, MODE, Result
from attrito.studies.picture import picture_of_file
from attrito.studies.table import holds_study
from attrito.support.errors import Fault, InputError


@dataclass(frozen=True)
class Wishes:
    """What a picture is to show; None, or False, where it is not said."""

    monitor: str | None = None
    quantity: str | None = None
    level: Sequence[float] | None = None
    xlim: Sequence[float] | None = None
    log: bool | None = None
    references: Sequence[str] | None = None
    speed_hz: float | None = None
    loops: bool = False
    map: str | None = None
    point: int | None = None
    contact: Sequence[int] | None = None

    def given(self) -> dict[str, object]:
        """Those that are said."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None and value is not False} | (
            {"log": self.log} if self.log is False else {}
        )


# What applies to which picture
APPLIES = {
    "frequency responses": ("monitor", "quantity", "level", "xlim", "log", "references"),
    "loops": ("loops", "monitor", "level", "point", "contact"),
    "a map of contacts": ("map", "monitor", "level", "point"),
    "a nonlinear mode": (),
    "a Campbell diagram": (),
    "modes of nodal diameters": ("speed_hz",),
}

# Of frequency responses: quantities that have no such axis, or no linear responses behind
NOT_OF = {"phase": ("log", "references"), "nyquist": ("log", "references", "xlim")}

# Files that are no results: what they are called, how to know them, how to draw them, what the picture is called
FILES = (
    ("peaks", holds_peaks, peak_curve, "peaks.png"),
    ("a study", holds_study, picture_of_file, "study.png"),
    ("a chart", holds_chart, picture_of_chart, "chart.png"),
)


def plot(
    *files: str | os.PathLike[str],
    monitor: str | None = None,
    quantity: str | None = None,
    level: Sequence[float] | None = None,
    xlim: tuple[float, float] | None = None,
    log: bool | None = None,
    references: Sequence[str] | None = None,
    loops: bool = False,
    map: str | None = None,
    point: int | None = None,
    contact: Sequence[int] | None = None,
    speed_hz: float | None = None,
    look: Look | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw results as `attrito plot` does; several are compared in one figure.

    Parameters
    ----------
    files : results, or one file of modes, peaks, a study or a chart; what made one stands for it
    monitor : of the frequency response; None: the first
    quantity : `amplitude` (also None), `first_harmonic`, `phase`, `velocity`, `acceleration` or `nyquist`
    level : those that are drawn; None: all
    xlim : frequencies shown, Hz
    log : logarithmic amplitudes; None: if it suits
    references : linear responses drawn behind; None: all
    loops : hysteresis loops of a point
    map : `slip`, `state`, `energy` or `pressure` of a point's contacts on their surface
    point, contact : of loops and map; None: the largest amplitude, the contacts that dissipate most
    speed_hz : of a wheel's linear modes, whose engine orders are drawn
    look : size, letters and style
    output : picture to write, .png, .pdf or .svg; None: none

    Returns
    -------
    a figure of matplotlib

    Raises
    ------
    InputError : a file is not there or is of another kind, or an argument does not apply to it

    Examples
    --------
    >>> figure = attrito.plot("mu_03.h5", "mu_05.h5", quantity="phase", output="phases.pdf")
    """
    wishes = Wishes(monitor, quantity, level, xlim, log, references, speed_hz, loops, map, point, contact)
    figure, _ = draw([os.fspath(file) for file in files], wishes, look or Look())
    plain_ticks(figure)
    if output is not None:
        save(figure, output)
    return figure


def draw(files: Sequence[str], wishes: Wishes, look: Look) -> tuple[Figure, str]:
    """The picture of some files, and what its own is usually called."""
    if not files:
        raise InputError(Fault("plot", "files", "none", "at least one result"))
    for kind, holds, drawn, name in FILES:
        if holds(files[0]):
            if len(files) > 1:
                raise InputError(Fault(files[1], "file", "given", f"one file alone for {kind}"))
            if given := wishes.given():
                option = _option(*next(iter(given.items())))
                raise InputError(Fault(files[0], option, "given", f"none for {kind}"))
            return drawn(files[0], look), name
    with contextlib.ExitStack() as stack:
        results = [stack.enter_context(Result(file)) for file in files]
        kind = _kind(results[0], wishes)
        _check_wishes(results[0], kind, wishes)
        if kind != "frequency responses" and len(results) > 1:
            raise InputError(Fault(results[1].path, "file", "given", f"one file alone for {kind}"))
        for result in results[1:]:
            if (other := _kind(result, wishes)) != kind:
                raise InputError(Fault(result.path, "format", result.attribute("format"), f"{kind}, not {other}"))
        return _drawn(results, kind, wishes, look)


def _drawn(results: Sequence[Result], kind: str, wishes: Wishes, look: Look) -> tuple[Figure, str]:
    result = results[0]
    if kind == "a Campbell diagram":
        return campbell_diagram(result, look), "campbell.png"
    if kind == "modes of nodal diameters":
        return diameter_diagram(result, wishes.speed_hz, look), "diameters.png"
    if kind == "a nonlinear mode":
        return mode_curve(result, look), "mode.png"
    for one in results:
        if wishes.monitor is not None and wishes.monitor not in one.monitors:
            raise InputError(Fault(one.path, "--monitor", wishes.monitor, "one of " + ", ".join(one.monitors)))
    monitor = wishes.monitor or next(iter(result.monitors), "")
    if kind == "frequency responses":
        for one in results:
            # A file without it says so.
            one.monitor(monitor, "amplitude")
        xlim = None if wishes.xlim is None else (float(wishes.xlim[0]), float(wishes.xlim[1]))
        if xlim is not None and not xlim[0] < xlim[1]:
            raise InputError(Fault(result.path, "--xlim", xlim, "a frequency and a higher one"))
        solved = np.concatenate([one.array("/points/frequency_hz") for one in results])
        if xlim is not None and len(solved) and not (xlim[0] < solved.max() and solved.min() < xlim[1]):
            known = f"frequencies among {solved.min():.6g} to {solved.max():.6g} Hz"
            raise InputError(Fault(result.path, "--xlim", xlim, known))
        references = REFERENCES if wishes.references is None else tuple(wishes.references)
        quantity, levels = wishes.quantity or "amplitude", tuple(wishes.level or ())
        drawing = Drawing(quantity, levels, xlim, wishes.log, references)
        name = "frf.png" if quantity == "amplitude" else f"{quantity}.png"
        return responses(results, monitor, look, drawing), name
    point = chosen_point(result, wishes.point, monitor, wishes.level)
    if wishes.map:
        return contact_map(result, point, wishes.map, look), "contacts.png"
    chosen = wishes.contact or most_dissipating(result, point)
    units = [result.unit(f"/contacts/{name}") for name in ("displacement", "force")]
    title = place_in_words(result, point)
    return hysteresis(contact_loops(result, point, chosen), *units, look=look, title=title), "loops.png"


def _kind(result: Result, wishes: Wishes) -> str:
    """Which of `APPLIES` a file is drawn as; `InputError` where there is nothing to draw."""
    form, of_points = result.attribute("format"), bool(wishes.loops or wishes.map)
    is_wheel = form == LINEAR_MODES and result.has("/points/nodal_diameter")
    if wishes.speed_hz is not None and not is_wheel:
        expected = "a file of `attrito linear-modes` of a job with [cyclic]"
        raise InputError(Fault(result.path, "--speed-hz", wishes.speed_hz, expected))
    if form == CAMPBELL:
        if of_points:
            key = "--loops" if wishes.loops else "--map"
            raise InputError(Fault(result.path, key, "given", "a result of `attrito run` or `attrito mode`"))
        return "a Campbell diagram"
    if is_wheel and not of_points:
        return "modes of nodal diameters"
    refuse_linear_modes(result)
    if wishes.loops or wishes.map:
        return "loops" if wishes.loops else "a map of contacts"
    return "a nonlinear mode" if form == MODE else "frequency responses"


def _check_wishes(result: Result, kind: str, wishes: Wishes) -> None:
    """Raise `InputError` where something is said that does not apply to this picture."""
    faults = []
    for name, value in wishes.given().items():
        if name not in APPLIES[kind]:
            option = _option(name, value)
            of = " or ".join(other for other, names in APPLIES.items() if name in names)
            faults.append(
                Fault(result.path, option, "given" if isinstance(value, bool) else value, f"none but for {of}")
            )
    for name in NOT_OF.get(wishes.quantity or "", ()):
        if kind == "frequency responses" and name in wishes.given():
            option, others = _option(name, getattr(wishes, name)), [one for one in QUANTITIES if one not in NOT_OF]
            faults.append(Fault(result.path, option, "given", f"--quantity {', '.join(others)}"))
    if faults:
        raise InputError(*faults)


def _option(name: str, value: object) -> str:
    """What the command line calls a wish."""
    return "--linear" if name == "log" and value is False else f"--{name.replace('_', '-')}"


def refuse_linear_modes(result: Result) -> None:
    """Linear modes have no response to draw."""
    if (form := result.attribute("format")) == LINEAR_MODES:
        expected = "a result of `attrito run` or `attrito mode` (attrito table and export --mode show linear modes)"
        raise InputError(Fault(result.path, "format", form, expected))
