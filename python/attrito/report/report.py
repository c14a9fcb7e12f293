"""`attrito report`: a result as one page, without network or program: what was solved, how, and how far to trust it."""

from __future__ import annotations

import os
from datetime import date
from pathlib import Path

from attrito.report import sections
from attrito.report.campbell import campbell, campbell_glance
from attrito.report.essentials import campbell_essentials, essentials
from attrito.report.mode import mode, mode_glance
from attrito.report.outcome import outcome
from attrito.report.page import Page
from attrito.report.printout import Printout
from attrito.report.structure import structure
from attrito.report.trust import glance, trust
from attrito.report.view import View
from attrito.report.wheel import wheel
from attrito.results.result import CAMPBELL, Result, reading
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


@reading
def write_report(result: Result, path: str | os.PathLike[str], point: int | None = None) -> None:
    """Write the page of a result, or its essentials on two pages of A4.

    Parameters
    ----------
    result : what `attrito.run` returns, an open `Result`, or the name of its file
    path : the file to write, .html, or .pdf for the two pages
    point : whose contacts are shown; None: that of the largest amplitude of the first monitor

    Raises
    ------
    InputError : the file cannot be written, or the result lacks what every result has
    """
    check_spared("report", "-o", [path], [result.path])
    if is_printout(path):
        make_printout(result, point).write(path)
        return
    write_page(make_page(result, point), path)


def write_page(page: Page, path: str | os.PathLike[str]) -> None:
    """Write a page.

    Raises
    ------
    InputError : the file cannot be written
    """
    text = page.html()
    try:
        with whole_file(path) as new:
            Path(new).write_text(text, encoding="utf-8")
    except OSError as error:
        expected = "a file that can be written"
        raise InputError(Fault(str(path), "report", error.strerror or str(error), expected)) from error


def is_printout(path: str | os.PathLike[str]) -> bool:
    """Whether the ending of a file's name asks for the two pages."""
    return Path(path).suffix.lower() == ".pdf"


def make_printout(result: Result, point: int | None = None) -> Printout:
    """The two pages of a result; see `write_report`."""
    printout = Printout(title_of(result.path), _line(result))
    if result.attribute("format") == CAMPBELL:
        campbell_essentials(result, printout, campbell_glance(result))
        return printout
    view = View(result, point)
    lines = mode_glance(view) if view.is_mode else glance(view)
    essentials(view, printout, [] if view.is_mode else outcome(view), lines)
    return printout


def title_of(path: str) -> str:
    """A file's name with its folder's."""
    place = Path(path).resolve()
    return f"{place.parent.name}/{place.name}"


def made_by(what: str, path: str, version: str) -> str:
    """What a file is of, by what, and when it was written."""
    written = date.fromtimestamp(Path(path).stat().st_mtime).isoformat()
    return f"{what} with friction contacts, by attrito {version}, {written}"


def _line(result: Result) -> str:
    return made_by("Steady vibration", result.path, result.attribute("attrito_version"))


def make_page(result: Result, point: int | None = None) -> Page:
    """The page of a result; see `write_report`."""
    page = Page(title_of(result.path))
    page.head(_line(result))
    if result.attribute("format") == CAMPBELL:
        page.glance(campbell_glance(result))
        campbell(page, result)
        sections.job(page, result)
        sections.references(page, result)
        return page
    view = View(result, point)
    if view.is_mode:
        page.glance(mode_glance(view))
    else:
        if found := outcome(view):
            page.glance([(line, False) for line in found])
        page.section("How far to trust it")
        page.labelled(trust(view))
    for section in MODE_SECTIONS if view.is_mode else SECTIONS:
        section(page, view)
    sections.job(page, result)
    sections.references(page, result)
    return page
