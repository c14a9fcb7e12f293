"""The essentials of a report on two pages of A4, as PDF: text above, figures in two columns below.

Figures are those of the page, drawn on parts of a sheet (`Look.on`); letters stay letters.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from attrito.plots.style import STYLE, Look, plain_text
from attrito.plots.ticks import plain_ticks
from attrito.support.atomic_files import whole_file
from attrito.support.errors import Fault, InputError

# Millimetres: the sheet, and its margin
SHEET, MARGIN = (210.0, 297.0), 14.0
INCH = 25.4
# Points: letters of text, of headings, of figures; the height of a line, part of its letters'
TEXT, HEADING, TITLE, IN_FIGURES, LEADING = 8.5, 10.5, 15.0, 7.0, 1.42
PAGES, COLUMNS = 2, 2
# Rows of figures on a page, and their height beside their width at most
ROWS, TALLEST = 3, 1.05
# Lines of text on a page; what is beyond is in the page of `attrito report` alone
MOST_LINES = 36
WARNING = "#9a3d00"

Panel = tuple[str, Callable[[Look], object]]


class Printout:
    """Two pages that are filled from top to bottom.

    Parameters
    ----------
    title, line : above the first page
    """

    def __init__(self, title: str, line: str) -> None:
        self._texts: list[list[tuple[str, float, str, str]]] = [[], []]
        self._panels: list[list[Panel]] = [[], []]
        self._add(0, title, TITLE, "bold", "k")
        self._add(0, line, TEXT, "normal", "#5c6b7a")
        self._add(0, "", 0.4 * TEXT, "normal", "k")

    def heading(self, page: int, text: str) -> None:
        """A heading above the text that follows."""
        self._add(page, "", 0.4 * TEXT, "normal", "k")
        self._add(page, text, HEADING, "bold", "k")

    def text(self, page: int, text: str, warn: bool = False) -> None:
        """A sentence on a line of its own, or more of them where it is long."""
        self._add(page, text, TEXT, "normal", WARNING if warn else "k")

    def panel(self, page: int, caption: str, draw: Callable[[Look], object]) -> None:
        """A figure; those beyond what the page holds are left out."""
        if len(self._panels[page]) < ROWS * COLUMNS:
            self._panels[page].append((caption, draw))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the pages.

        Raises
        ------
        InputError : the file cannot be written
        """
        # Into memory first: where a disk is full, matplotlib's writers fail in ways of their own.
        drawn = io.BytesIO()
        with matplotlib.rc_context(STYLE), PdfPages(drawn, metadata={"Title": self._texts[0][0][0]}) as pages:
            for page in range(PAGES):
                pages.savefig(self._sheet(page))
        try:
            with whole_file(path) as new:
                Path(new).write_bytes(drawn.getbuffer())
        except OSError as error:
            expected = "a .pdf file that can be written"
            raise InputError(Fault(str(path), "report", error.strerror or str(error), expected)) from error

    def _add(self, page: int, text: str, size: float, weight: str, colour: str) -> None:
        width = (SHEET[0] - 2 * MARGIN) / INCH * 72.0
        self._texts[page] += [(line, size, weight, colour) for line in wrapped(text, width, size, weight)]

    def _sheet(self, page: int) -> Figure:
        figure = Figure(figsize=(SHEET[0] / INCH, SHEET[1] / INCH), constrained_layout=True)
        left, top = MARGIN / SHEET[0], 1.0 - MARGIN / SHEET[1]
        texts = self._texts[page]
        if len(texts) > MOST_LINES:
            left_out = f"and {len(texts) - MOST_LINES + 1} more lines, which the HTML page has"
            texts = [*texts[: MOST_LINES - 1], (left_out, TEXT, "normal", "k")]
        for line, size, weight, colour in texts:
            top -= LEADING * size * INCH / 72.0 / SHEET[1]
            figure.text(left, top, plain_text(line), fontsize=size, weight=weight, color=colour, va="baseline")
        panels = self._panels[page]
        rows = -(-len(panels) // COLUMNS)
        room = top - MARGIN / SHEET[1] - 0.01
        if rows and room > 0.1:
            width = 1.0 - 2 * left
            tallest = TALLEST * width * SHEET[0] / COLUMNS / SHEET[1]
            height = min(room, rows * tallest)
            # What is left over stays at the foot of the page.
            foot = MARGIN / SHEET[1] + room - height
            grid = figure.add_gridspec(
                3, 3, width_ratios=[left, width, left], height_ratios=[1.0 - foot - height, height, foot],
                hspace=0.0, wspace=0.0,
            )  # fmt: skip
            place_panels(figure.add_subfigure(grid[1, 1]), panels, rows)
        plain_ticks(figure)
        return figure


def place_panels(whole: SubFigure, panels: Sequence[Panel], rows: int) -> None:
    """Draw figures from left to right and from top to bottom; one alone in its row has all of it."""
    for row, band in enumerate(whole.subfigures(rows, 1, squeeze=False)[:, 0]):
        own = panels[COLUMNS * row : COLUMNS * (row + 1)]
        for (caption, draw), part in zip(own, band.subfigures(1, len(own), squeeze=False)[0], strict=True):
            draw(Look(font_size=IN_FIGURES, on=part))
            part.suptitle(plain_text(caption), fontsize=IN_FIGURES + 1.0, weight="bold")


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> list[str]:
    """Lines of a text that are no wider than some points; a longer word has a line by itself."""
    letters = FontProperties(size=size, weight=weight)

    def wide(line: str) -> float:
        return float(text_to_path.get_text_width_height_descent(plain_text(line), letters, False)[0])

    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and wide(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
