"""What MkDocs is asked to do besides: equations as pictures, which need no script, and anchors as GitHub makes them."""

from __future__ import annotations

import html
import io
import re
from functools import lru_cache

import matplotlib
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

# Blocks between fences, lines that are code since they are indented, and code within a line have no equations.
CODE = re.compile(r"(```.*?```|^(?: {4}|\t)[^\n]*$|`[^`\n]+`)", flags=re.DOTALL | re.MULTILINE)
MATHEMATICS = re.compile(r"\$\$(.*?)\$\$|\$([^$\s](?:[^$\n]*[^$\s])?)\$", flags=re.DOTALL)
STYLE = {"mathtext.fontset": "cm", "svg.fonttype": "path"}


def anchor(title: str, separator: str = "-") -> str:
    """The anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", separator)


def equation(tex: str) -> str:
    """An equation as SVG, a line for each that the source has."""
    lines = [f"${line.strip()}$" for line in re.split(r"\n|\\\\", _known(tex).strip()) if line.strip()]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(0.1, 0.1))
        figure.text(0.0, 0.0, "\n".join(lines), fontsize=13, linespacing=1.8)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", bbox_inches="tight", transparent=True)
    return f'<p role="img" aria-label="{html.escape(tex)}">{_svg(drawn)}</p>'


@lru_cache
def formula(tex: str) -> str:
    """A formula within a line as SVG, on the line's base."""
    drawn = io.BytesIO()
    with matplotlib.rc_context(STYLE | {"savefig.transparent": True}):
        depth = math_to_image(f"${_known(tex)}$", drawn, prop=FontProperties(size=12), dpi=72, format="svg")
    style = f'style="vertical-align: {-depth:.1f}pt"'
    return f'<span role="img" aria-label="{html.escape(tex)}">{_svg(drawn).replace("<svg", f"<svg {style}", 1)}</span>'


def on_page_markdown(markdown: str, **_: object) -> str:
    """MkDocs' hook: equations between `$$` and formulas between `$`, outside of code, are kept apart from Markdown."""
    parts = CODE.split(markdown)
    parts[::2] = [MATHEMATICS.sub(_kept, part) for part in parts[::2]]
    return "".join(parts)


def on_page_content(content: str, **_: object) -> str:
    """MkDocs' hook: the HTML of a page, its mathematics drawn."""
    return re.sub(r'<(p|span) data-tex="([0-9a-f]*)"></\1>', _drawn, content)


def _kept(found: re.Match[str]) -> str:
    if found[1] is None:
        return f'<span data-tex="{found[2].encode().hex()}"></span>'
    return f'\n\n<p data-tex="{found[1].encode().hex()}"></p>\n\n'


def _drawn(found: re.Match[str]) -> str:
    tex = bytes.fromhex(found[2]).decode()
    return formula(tex) if found[1] == "span" else equation(tex)


def _known(tex: str) -> str:
    """What matplotlib calls otherwise."""
    return re.sub(r"\\le\b", r"\\leq", re.sub(r"\\ge\b", r"\\geq", tex))


def _svg(drawn: io.BytesIO) -> str:
    """The picture in the colour of the text."""
    picture = drawn.getvalue().decode()
    return picture[picture.index("<svg") :].replace("<svg", '<svg fill="currentColor"', 1)
