"""`attrito report`: a result as one page, without network or program: what was solved, how, and how far to trust it."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import numpy as np

from attrito.library.names import NO_SOLUTION
from attrito.report import sections
from attrito.report.campbell import campbell, campbell_glance
from attrito.report.mode import mode, mode_glance
from attrito.report.outcome import outcome
from attrito.report.page import Page
from attrito.report.structure import structure
from attrito.report.view import View
from attrito.report.wheel import wheel
from attrito.results.result import CAMPBELL, MODE, Result
from attrito.support.atomic_files import whole_file
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared

SECTIONS = (
    structure,
    sections.responses,
    sections.contacts,
    sections.loops,
    sections.harmonics,
    wheel,
    sections.uniqueness,
    sections.stability,
    sections.convergence,
    sections.run,
)
# Of a nonlinear mode
MODE_SECTIONS = (mode, sections.loops, wheel, sections.run)
# An estimated error beyond this is reported as a warning.
LARGE_ERROR = 0.05
# Amplitudes that differ by less than this part of them are the same.
NO_WIDTH = 1e-9


def write_report(result: Result, path: str | os.PathLike[str], point: int | None = None) -> None:
    """Write the page of a result.

    Parameters
    ----------
    result : an open result
    path : the .html file to write
    point : whose contacts are shown; None: that of the largest amplitude of the first monitor

    Raises
    ------
    InputError : the file cannot be written, or the result lacks what every result has
    """
    check_spared("report", "-o", [path], [result.path])
    text = make_page(result, point).html()
    try:
        with whole_file(path) as new:
            Path(new).write_text(text, encoding="utf-8")
    except OSError as error:
        expected = "a file that can be written"
        raise InputError(Fault(str(path), "report", error.strerror or str(error), expected)) from error


def make_page(result: Result, point: int | None = None) -> Page:
    """The page of a result; see `write_report`."""
    place = Path(result.path).resolve()
    page = Page(f"{place.parent.name}/{place.name}")
    page.head(f"Steady vibration with friction contacts, by attrito {result.attribute('attrito_version')}")
    if result.attribute("format") == CAMPBELL:
        page.glance(campbell_glance(result))
        campbell(page, result)
        sections.job(page, result)
        sections.references(page, result)
        return page
    view = View(result, point)
    is_mode = result.attribute("format") == MODE
    if is_mode:
        page.glance(mode_glance(view))
    else:
        if found := outcome(view):
            page.glance([(line, False) for line in found])
        page.section("How far to trust it")
        page.glance(glance(view))
    for section in MODE_SECTIONS if is_mode else SECTIONS:
        section(page, view)
    sections.job(page, result)
    sections.references(page, result)
    return page


def glance(view: View) -> list[tuple[str, bool]]:
    """What to know first, one sentence each, and whether it is a warning."""
    count = view.result.points
    if count == 0:
        return [("No point was solved.", True)]
    levels = len(view.peaks)
    span = f"{view.frequency.min():.6g} to {view.frequency.max():.6g} Hz"
    warned = [(f"{line[:1].upper()}{line[1:]}.", True) for line in view.result.attribute("warnings").splitlines()]
    lines = [(f"{count} points, {levels} level{'s' * (levels > 1)}, {span}.", False), _solutions(view), *warned]
    lines += [*_verdicts(view), *_bifurcations(view), *_families(view)]
    estimate = np.where(view.solved, view.result.array("/points/estimate"), np.nan)
    if np.isfinite(estimate).any():
        worst = int(np.nanargmax(estimate))
        words = f"Estimated error of the amplitude: at most {estimate[worst]:.1e} of it ({view.place(worst)})."
        lines.append((words, estimate[worst] > LARGE_ERROR))
    if view.result.has("/points/error_modes"):
        parts = np.where(view.solved, view.result.array("/points/error_modes"), np.nan)
        if np.nanmax(parts, initial=0.0) > 0.0:
            lines.append((f"Of it, by modes that the reduction leaves out: at most {np.nanmax(parts):.1e}.", False))
    if view.approach() == "uncoupled":
        lines.append(
            ("Uncoupled: the mean is that of the static solution; no estimate includes what this leaves out.", True)
        )
    incomplete = view.result.attributes("/points").get("incomplete", "")
    return lines + ([(incomplete, True)] if incomplete else [])


def _solutions(view: View) -> tuple[str, bool]:
    missing = int((~view.solved).sum())
    if not missing:
        return "Every point has a solution.", False
    outcomes = Counter(view.result.outcome)
    names = ", ".join(f"{outcomes[name]} {name}" for name in NO_SOLUTION if outcomes[name])
    return f"{missing} points have no solution: {names}.", True


def _verdicts(view: View) -> list[tuple[str, bool]]:
    stable, undecided = view.result.array("/points/stable"), view.result.outcome.count("indeterminate")
    if not (stable >= 0).any() and not undecided:
        return [("Stability was not examined ([stability] method).", False)]
    where = view.ranges((stable == 0) & view.solved)
    verdict = f"Unstable: {where}." if where else "No point that was examined is unstable."
    lines = [(f"{(stable == 1).sum()} points are stable. {verdict}", bool(where))]
    return lines + ([(f"{undecided} points have no verdict on their stability.", True)] if undecided else [])


def _bifurcations(view: View) -> list[tuple[str, bool]]:
    if not view.result.has("/bifurcations/kind"):
        return []
    names = view.result.names("/bifurcations/kind")
    counts = Counter(names[kind].replace("_", " ") for kind in view.result.array("/bifurcations/kind"))
    words = ", ".join(f"{count} {name}" for name, count in counts.items())
    return [(f"Located along sweeps: {words}.", False)] if counts else []


def _families(view: View) -> list[tuple[str, bool]]:
    unique = view.result.array("/points/unique")
    if not (unique == 0).any():
        return [("Every point examined is unique.", False)] if (unique == 1).any() else []
    where, count = view.ranges(unique == 0), int((unique == 0).sum())
    words = f"mean contact forces are not unique at {count} of {view.result.points} points, each one of a family"
    words += f" of solutions ({where})"
    reach = _reach(view)
    # What matters of it goes first, where it is known.
    parts = (reach, words) if np.isfinite(view.amplitude_widths()).any() else (words, reach)
    line = "; ".join(parts)
    return [(f"{line[:1].upper()}{line[1:]}.", False)]


def _reach(view: View) -> str:
    """How far the families' amplitudes reach, as far as that was examined."""
    widths = view.amplitude_widths()
    unknown = int(((view.result.array("/points/unique") == 0) & ~np.isfinite(widths)).sum())
    if not np.isfinite(widths).any():
        return "what that changes in the amplitude was not examined"
    widest = widths[np.isfinite(widths)].max()
    # Only members that are visited differ in amplitude; others may differ more.
    if widest > NO_WIDTH:
        reach = f"amplitudes of the members that were visited differ by at most {100 * widest:.2g} %"
    else:
        reach = "the amplitude is that of all members that were visited"
    return f"{reach}, {unknown} points not examined" if unknown else reach
