"""Numbers of axes in plain letters: 10⁻³ and ×10⁻⁵ as text, which takes a tenth of the time of set mathematics."""

from __future__ import annotations

import re
from typing import Any

import matplotlib
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter, LogFormatterSciNotation, LogLocator, NullFormatter, ScalarFormatter

MINUS = "\N{MINUS SIGN}"
RAISED = str.maketrans(f"0123456789-{MINUS}+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻ ")
# Numbers that are as short without a power of ten
PLAIN = (1e-3, 1e5)


class Numbers(ScalarFormatter):
    """Numbers of a linear axis, whose power of ten is at its end."""

    def get_offset(self) -> str:
        """What numbers are multiplied by, and what is added to them."""
        return with_power(str(super().get_offset()))


class Powers(LogFormatterSciNotation):
    """Powers of ten of a logarithmic axis."""

    def __call__(self, value: Any, place: Any = None) -> str:
        """As matplotlib has it, as text."""
        text = str(super().__call__(value, place)).replace(r"\times", "×")
        text = re.sub(r"\^\{([^}]*)\}", lambda found: raised(found[1]), text)
        return re.sub(r"\$|\\mathdefault|[{}]", "", text).replace("-", MINUS)


def raised(number: str) -> str:
    """An exponent."""
    return number.translate(RAISED).strip()


def with_power(text: str) -> str:
    """The offset of an axis with its powers of ten raised: `1e-07` is ×10⁻⁷, `+2.5e9` is +2.5×10⁹."""
    multiplier = re.fullmatch(rf"1e([-+{MINUS}]?)0*(\d+)(.*)", text)
    if multiplier:
        return f"×10{raised(multiplier[1] + multiplier[2])}{with_power(multiplier[3])}"
    return re.sub(rf"e([-+{MINUS}]?)0*(\d+)", lambda found: f"×10{raised(found[1] + found[2])}", text)


def plain_ticks(figure: Figure | SubFigure) -> None:
    """Let all axes of a figure have such numbers if nothing else was asked for; limits and offsets stay as they are."""
    if matplotlib.rcParams["text.usetex"]:
        return
    kinds: dict[type, type] = {ScalarFormatter: Numbers, LogFormatterSciNotation: Powers}
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            for formatter in (axis.get_major_formatter(), axis.get_minor_formatter()):
                if type(formatter) in kinds:
                    formatter.__class__ = kinds[type(formatter)]
                if isinstance(formatter, Numbers):
                    formatter.set_useMathText(False)


def label_short_log(axis: Axis) -> None:
    """Numbers on a logarithmic axis of less than two decades: at 1, 2 and 5, or more within a single decade.

    To be called when the curves are drawn.
    """
    low, high = axis.get_view_interval()
    if 0.0 < high < 100.0 * low:
        digits = 3 if high > 1.2 * low else 6
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: _number(value, digits)))
        axis.set_minor_formatter(NullFormatter())


def _number(value: float, digits: int) -> str:
    if PLAIN[0] <= abs(value) < PLAIN[1]:
        return f"{float(f'{value:.{digits}g}'):g}"
    digit, _, power = f"{value:.{digits - 1}e}".partition("e")
    digit = digit.rstrip("0").rstrip(".") if "." in digit else digit
    return f"{'' if digit == '1' else digit + '×'}10{raised(str(int(power)))}"
