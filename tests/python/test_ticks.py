"""Numbers of axes are plain text: powers raised, minus signs, nothing set as mathematics."""

from __future__ import annotations

import io
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

from attrito.plots.style import Look
from attrito.plots.ticks import label_short_log, plain_ticks, with_power


def drawn(figure: Figure) -> str:
    plain_ticks(figure)
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(stream, format="svg")
    return re.sub("<!--.*?-->", "", stream.getvalue(), flags=re.DOTALL)


def axes_of(x, y, **keys):
    with matplotlib.rc_context(Look().style()):
        axes = Figure().subplots()
        axes.plot(x, y, **keys)
    return axes


def test_powers_of_both_kinds_of_axes_are_letters():
    text = drawn(axes_of([0.0, 1.0], [-2e-5, 4e-5]).figure)
    assert "×10⁻⁵" in text and "\N{MINUS SIGN}2" in text
    with matplotlib.rc_context(Look().style()):
        axes = Figure().subplots()
        axes.loglog([1.0, 1e3], [1e-12, 1e-3])
    text = drawn(axes.figure)
    assert re.search("10⁻¹[⁰¹²³]", text) and "10³" in text
    assert "mathdefault" not in text


@pytest.mark.parametrize(
    ("said", "written"),
    [
        ("1e-05", "×10⁻⁵"),
        ("1e\N{MINUS SIGN}5", "×10⁻⁵"),
        ("+2.1e9", "+2.1×10⁹"),
        ("+1.23451e5", "+1.23451×10⁵"),
        ("1e-6+1.00001e5", "×10⁻⁶+1.00001×10⁵"),
        ("", ""),
    ],
)
def test_an_offset_keeps_its_digits(said, written):
    assert with_power(said) == written


def test_limits_of_the_style_and_offsets_that_were_refused_stay():
    # Below 1e-3 numbers have a power of ten, as the style has it, drawn in a context without it.
    text = drawn(axes_of([0.0, 1.0], [0.0, 2e-4]).figure)
    assert "×10⁻⁴" in text and "0.0001" not in text
    axes = axes_of([0.0, 1.0], [8123.45598, 8123.45602])
    axes.ticklabel_format(axis="y", useOffset=False)
    assert "8123.456" in drawn(axes.figure)


def test_what_was_asked_for_stays():
    axes = axes_of([0.0, 1.0], [0.0, 1.0])
    axes.xaxis.set_major_formatter("{x:.1f} V")
    assert "0.4 V" in drawn(axes.figure)


@pytest.mark.parametrize(
    ("ends", "numbers"),
    [
        ((18.0, 43.0), {"20", "40"}),
        ((0.7, 30.0), {"1", "2", "5", "10", "20"}),
        ((1e-6, 2e-5), {"10⁻⁶", "2×10⁻⁶", "5×10⁻⁶", "10⁻⁵"}),
        ((2e6, 9e7), {"5×10⁶", "10⁷"}),
    ],
)
def test_a_short_logarithmic_axis_has_plain_numbers(ends, numbers):
    axes = Figure().add_subplot()
    axes.semilogx(ends, [1.0, 1.0])
    label_short_log(axes.xaxis)
    shown = [text.get_text() for text in axes.get_xticklabels()]
    assert numbers <= set(shown) and not any("e" in text for text in shown)


def test_numbers_of_a_very_short_axis_differ():
    axes = Figure().add_subplot()
    axes.semilogx(1.2345e-6 * np.array([1.0, 1.0001]), [1.0, 1.0])
    label_short_log(axes.xaxis)
    low, high = axes.get_xlim()
    shown = [text.get_text() for text in axes.get_xticklabels() if low <= text.get_position()[0] <= high]
    assert len(set(shown)) == len(shown)
