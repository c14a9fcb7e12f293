"""The look of all figures, and how they are written.

Figures are made without pyplot, so no window system and no global state is involved."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.transforms import ScaledTranslation

from attrito.plots.ticks import plain_ticks
from attrito.support.atomic_files import whole_file
from attrito.support.errors import Fault, InputError

BRANCH_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LIMIT_COLOUR = "#8a8a8a"
DASHES = (0, (3, 1.8))
DPI = 220
PICTURES = (".png", ".pdf", ".svg")
STYLE = {
    "font.size": 9,
    "axes.labelsize": 10,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "figure.constrained_layout.w_pad": 0.07,
    "figure.constrained_layout.h_pad": 0.07,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


@dataclass(frozen=True)
class Look:
    """Size and letters of a figure.

    Parameters
    ----------
    width, height : millimetres; None: what suits the figure
    font : a font that is installed; None: matplotlib's own
    font_size : points, of tick labels; the others follow
    name : a style of matplotlib, or a file of one (.mplstyle), laid over attrito's own
    on : a part of a page (SubFigure) that is drawn on, in its own size; None: a figure by itself

    Raises
    ------
    InputError : no such font, or no such style
    """

    width: float | None = None
    height: float | None = None
    font: str | None = None
    font_size: float = 9.0
    name: str | None = None
    on: SubFigure | None = None

    def __post_init__(self) -> None:
        if self.name is not None:
            _style_called(self.name)
        if self.font is None:
            return
        try:
            font_manager.findfont(self.font, fallback_to_default=False)
        except ValueError:
            known = sorted({font.name for font in font_manager.fontManager.ttflist})
            raise InputError(Fault("plot", "font", self.font, "one of " + ", ".join(known))) from None

    def style(self) -> dict[str, object]:
        """Settings of matplotlib."""
        scale = self.font_size / STYLE["font.size"]
        sizes = {
            name: scale * value for name, value in STYLE.items() if name.endswith(("font.size", "size", "fontsize"))
        }
        family = {} if self.font is None else {"font.family": [self.font]}
        return STYLE | sizes | family | (_style_called(self.name) if self.name else {})

    def hues(self) -> tuple[str, ...]:
        """Colours that tell curves apart: those of the style, or attrito's own."""
        cycle = (_style_called(self.name) if self.name else {}).get("axes.prop_cycle")
        return BRANCH_COLOURS if cycle is None else tuple(cycle.by_key().get("color", BRANCH_COLOURS))

    def size(self, usual: tuple[float, float]) -> tuple[float, float]:
        """Inches of a figure that is usually so large; one measure given keeps its proportions."""
        if self.on is not None:
            return self.on.bbox.width / self.on.dpi, self.on.bbox.height / self.on.dpi
        given = [None if value is None else value / 25.4 for value in (self.width, self.height)]
        if given == [None, None]:
            return usual
        ratio = usual[1] / usual[0]
        return given[0] or given[1] / ratio, given[1] or given[0] * ratio

    def figure(self, usual: tuple[float, float]) -> Figure | SubFigure:
        """A figure that is usually so large, in inches, or the part of a page."""
        return self.on or Figure(figsize=self.size(usual), constrained_layout=True)


def _style_called(name: str) -> dict[str, object]:
    """Settings of a style of matplotlib, or of a file of one."""
    if name in matplotlib.style.library:
        return dict(matplotlib.style.library[name])
    try:
        return dict(matplotlib.rc_params_from_file(name, use_default_template=False))
    except OSError:
        known = ", ".join(style for style in matplotlib.style.available if not style.startswith("_"))
        raise InputError(Fault("plot", "style", name, f"a file of a style of matplotlib, or one of {known}")) from None


def check_picture(path: str | os.PathLike[str]) -> None:
    """Raise `InputError` unless a picture can be written in the format that its ending names."""
    if Path(path).suffix.lower() not in PICTURES:
        raise InputError(
            Fault(str(path), "figure", Path(path).suffix or "no ending", "a writable .png, .pdf or .svg file")
        )


def save(figure: Figure, path: str | os.PathLike[str], dpi: int = DPI) -> None:
    """Write a figure; the ending chooses the format (.png, .pdf, .svg). Letters stay letters in PDF and SVG."""
    check_picture(path)
    kind = Path(path).suffix.removeprefix(".").lower()
    try:
        # Into memory first: where a disk is full, matplotlib's writers fail in ways of their own.
        drawn = io.BytesIO()
        plain_ticks(figure)
        with matplotlib.rc_context(STYLE):
            figure.savefig(drawn, dpi=dpi, format=kind)
        with whole_file(path) as new:
            Path(new).write_bytes(drawn.getbuffer())
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(Fault(str(path), "figure", reason, "a writable .png, .pdf or .svg file")) from error


def legend_below(axes: Axes, columns: int, labelled: Axes | None = None, lines: float = 3.4) -> None:
    """A legend some lines below the axes (ticks, numbers and label take three), of other axes' entries if given.

    It has so many columns, or as many as the figure has room for.
    """
    drop = ScaledTranslation(0.0, -lines * _label_points() / 72.0, axes.figure.dpi_scale_trans)
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": axes.transAxes + drop}
    entries = (labelled or axes).get_legend_handles_labels()
    handles = {label: handle for handle, label in zip(*entries, strict=True)}
    letters = font_manager.FontProperties(size=matplotlib.rcParams["legend.fontsize"]).get_size_in_points()
    # A letter is half as wide as high; the line of an entry and the gap beside it are four letters high.
    widest = (0.5 * max(map(len, handles), default=0) + 3.8) * letters / 72.0
    columns = max(min(columns, int(axes.figure.bbox.width / axes.figure.dpi / widest)), 1)
    axes.legend(
        handles.values(), handles.keys(), **place, ncol=columns, columnspacing=1.2, handlelength=1.8, borderaxespad=0
    )


def _label_points() -> float:
    """Size of axis labels; a style may say it in words, as `large`."""
    return float(font_manager.FontProperties(size=matplotlib.rcParams["axes.labelsize"]).get_size_in_points())


def plain_text(text: str) -> str:
    """A text of the user's or of a file's, for matplotlib: no part of it is set as mathematics."""
    return text.replace("$", r"\$")


def with_unit(name: str, unit: str, room: float = np.inf) -> str:
    """An axis label, powers of the unit raised; in two lines where it is longer than some inches."""
    name, unit = plain_text(name), plain_text(unit).replace("^2", "\u00b2").replace("^3", "\u00b3")
    if not unit:
        return name
    # A letter is half as wide as high.
    width = 0.5 * _label_points() / 72.0 * len(f"{name} ({unit})")
    return f"{name}{' ' if width <= room else chr(10)}({unit})"
