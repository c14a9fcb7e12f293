"""Numbers of axes are plain text: powers raised, minus signs, nothing set as mathematics."""

from __future__ import annotations

import io
import re

from matplotlib.figure import Figure

from attrito.plots.style import Look
from attrito.plots.ticks import plain_ticks


def drawn(figure: Figure) -> str:
    plain_ticks(figure)
    stream = io.StringIO()
    figure.savefig(stream, format="svg")
    return stream.getvalue()


def test_powers_of_both_kinds_of_axes_are_letters():
    with_style = Look().style()
    import matplotlib

    with matplotlib.rc_context(with_style | {"svg.fonttype": "none"}):
        figure = Figure()
        linear, logarithmic = figure.subplots(1, 2)
        linear.plot([0.0, 1.0], [-2e-5, 4e-5])
        logarithmic.loglog([1.0, 1e3], [1e-12, 1e-3])
        text = drawn(figure)
    assert "×10⁻⁵" in text and "\N{MINUS SIGN}2" in text
    assert re.search("10⁻¹[⁰¹²³]", text) and "10³" in text
    assert "mathdefault" not in text


def test_what_was_asked_for_stays():
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0])
    axes.xaxis.set_major_formatter("{x:.1f} V")
    assert "0.5 V" in drawn(figure).replace("-->", "") or "0.4 V" in drawn(figure)
