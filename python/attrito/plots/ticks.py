"""Numbers of axes in plain letters: 10⁻³ and ×10⁻⁵ as text, which takes a tenth of the time of set mathematics."""

from __future__ import annotations

import re
from typing import Any

from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter, ScalarFormatter, StrMethodFormatter

RAISED = str.maketrans("0123456789-\N{MINUS SIGN}+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻ ")


class Numbers(ScalarFormatter):
    """Numbers of a linear axis, whose power of ten is at its end."""

    def __init__(self) -> None:
        super().__init__(useMathText=False)

    def get_offset(self) -> str:
        """What numbers are multiplied by, and what is added to them."""
        return re.sub(r"1?e([-+\N{MINUS SIGN}]?\d+)", lambda found: f"×10{raised(found[1])}", str(super().get_offset()))


class Powers(LogFormatterSciNotation):
    """Powers of ten of a logarithmic axis."""

    def __call__(self, value: Any, place: Any = None) -> str:
        """As matplotlib has it, as text."""
        text = str(super().__call__(value, place)).replace(r"\times", "×")
        text = re.sub(r"\$|\\mathdefault|[{}]", "", re.sub(r"\^\{([^}]*)\}", lambda found: raised(found[1]), text))
        return text.replace("-", "\N{MINUS SIGN}")


def raised(number: str) -> str:
    """An exponent."""
    return number.translate(RAISED).strip()


def plain_ticks(figure: Figure | SubFigure) -> None:
    """Let all axes of a figure have such numbers, where nothing else was asked for."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(Numbers())
            elif type(axis.get_major_formatter()) is LogFormatterSciNotation:
                axis.set_major_formatter(Powers())
                if type(axis.get_minor_formatter()) is LogFormatterSciNotation:
                    minor = Powers(labelOnlyBase=False, minor_thresholds=(1.0, 0.4))
                    axis.set_minor_formatter(minor)


def label_short_log(axis: Axis) -> None:
    """Plain numbers on a logarithmic axis of less than two decades: at 1, 2 and 5, or more within a single decade.

    To be called when the curves are drawn.
    """
    low, high = axis.get_view_interval()
    if 0.0 < high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
