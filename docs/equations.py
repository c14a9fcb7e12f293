"""What MkDocs is asked to do besides: equations as pictures, which need no script, and anchors as GitHub makes them."""

from __future__ import annotations

import html
import io
import re

import matplotlib
from matplotlib.figure import Figure


def anchor(title: str, separator: str = "-") -> str:
    """The anchor of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", separator)


def equation(tex: str) -> str:
    """An equation as SVG, a line for each that the source has."""
    # What matplotlib calls otherwise.
    tex = re.sub(r"\\le\b", r"\\leq", tex)
    lines = [f"${line.strip()}$" for line in re.split(r"\n|\\\\", tex.strip()) if line.strip()]
    with matplotlib.rc_context({"mathtext.fontset": "cm", "svg.fonttype": "path"}):
        figure = Figure(figsize=(0.1, 0.1))
        figure.text(0.0, 0.0, "\n".join(lines), fontsize=13, linespacing=1.8)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", bbox_inches="tight", transparent=True)
    picture = drawn.getvalue().decode()
    return f'<p role="img" aria-label="{html.escape(tex)}">{picture[picture.index("<svg") :]}</p>'


def on_page_markdown(markdown: str, **_: object) -> str:
    """MkDocs' hook: equations between `$$` outside of code."""
    parts = re.split(r"(```.*?```)", markdown, flags=re.DOTALL)
    parts[::2] = [re.sub(r"\$\$(.*?)\$\$", _drawn, part, flags=re.DOTALL) for part in parts[::2]]
    return "".join(parts)


def _drawn(found: re.Match[str]) -> str:
    # In one line: Markdown leaves a block of HTML without blank lines as it is.
    return "\n\n" + " ".join(equation(found[1]).split()) + "\n\n"
