"""The page of a report: HTML without network, fonts or scripts, figures as inline SVG.

Everything that comes from a file is escaped here, and only here.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from html import escape

import matplotlib
from matplotlib.figure import Figure

CSS = """
:root { color-scheme: light; --ink: #1c2733; --faint: #5c6b7a; --line: #d8dee5; --wash: #f4f6f8; --warn: #9a3d00; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.2rem clamp(.8rem, 3vw, 2.2rem) 3rem; max-width: 76rem; color: var(--ink);
  background: #fff; font: 16px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.55rem; line-height: 1.2; margin: 0 0 .2rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .5rem; padding-top: .7rem; border-top: 2px solid var(--ink); }
h3 { font-size: 1rem; margin: 1.2rem 0 .2rem; }
p { margin: .4rem 0; max-width: 48rem; }
nav { margin: .8rem 0 0; font-size: .92rem; }
nav a { display: inline-block; margin-right: .9rem; }
a { color: #0b5cad; }
.faint, figcaption { color: var(--faint); font-size: .92rem; }
ul.glance { list-style: none; margin: 1rem 0; padding: .7rem 1rem; background: var(--wash);
  border-left: 4px solid #0072B2; }
ul.glance li { margin: .15rem 0; }
li.warn, p.warn { color: var(--warn); font-weight: 600; }
.panels { display: grid; gap: .6rem 1.6rem; }
.panels { grid-template-columns: repeat(auto-fit, minmax(min(100%, 25rem), 1fr)); }
.panels.small { grid-template-columns: repeat(auto-fill, minmax(min(100%, 17rem), 1fr)); }
figure { margin: .5rem 0; min-width: 0; }
figure svg { display: block; width: 100%; height: auto; }
@media (min-width: 56rem) {
  figure.alone { display: grid; grid-template-columns: minmax(0, 36rem) minmax(14rem, 1fr); gap: 2rem; }
  figure.alone figcaption { align-self: center; }
}
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem 1rem .22rem 0; text-align: right; border-bottom: 1px solid var(--line); }
th, td { overflow-wrap: normal; }
td + td { white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
dl { display: grid; grid-template-columns: minmax(9rem, max-content) 1fr; gap: .15rem 1rem; margin: .5rem 0; }
dt { color: var(--faint); }
dd { margin: 0; }
pre { background: var(--wash); padding: .8rem; white-space: pre-wrap; }
pre { font: 13px/1.45 ui-monospace, "DejaVu Sans Mono", monospace; }
@media (max-width: 34rem) {
  body { font-size: 15px; }
  th, td { padding-right: .6rem; }
  dl { grid-template-columns: 1fr; }
  dd { margin-bottom: .4rem; }
}
@media print {
  @page { margin: 14mm; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav { display: none; }
  h2 { border-top-width: 1px; }
  h2, h3 { break-after: avoid; }
  figure, tr, ul.glance { break-inside: avoid; }
  .panels { grid-template-columns: 1fr 1fr; }
  .panels.small { grid-template-columns: 1fr 1fr 1fr; }
  figure.alone svg { max-width: 12cm; }
  .wide { overflow: visible; }
  table { font-size: 7.5pt; }
  th, td { padding-right: .5rem; }
  a { color: inherit; text-decoration: none; }
}
"""


class Page:
    """An HTML page that is written from top to bottom."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._body: list[str] = []
        self._sections: list[tuple[str, str]] = []
        self._figures = self._tables = 0

    def head(self, line: str) -> None:
        """Title and a line below it."""
        self._body.append(f"<h1>{escape(self._title)}</h1><p class=faint>{escape(line)}</p>")
        self._body.append("<!--nav-->")

    def section(self, title: str) -> None:
        """A heading, which the contents link to."""
        anchor = re.sub(r"[^a-z]+", "-", title.lower())
        self._sections.append((anchor, title))
        self._body.append(f'<h2 id="{anchor}">{escape(title)}</h2>')

    def subsection(self, title: str) -> None:
        """A smaller heading."""
        self._body.append(f"<h3>{escape(title)}</h3>")

    def text(self, *sentences: str, warn: bool = False) -> None:
        """A paragraph."""
        kind = " class=warn" if warn else ""
        self._body.append(f"<p{kind}>{escape(' '.join(sentences))}</p>")

    def glance(self, lines: Sequence[tuple[str, bool]]) -> None:
        """A list of sentences, each with whether it is a warning."""
        items = "".join(f"<li{' class=warn' if warn else ''}>{escape(line)}</li>" for line, warn in lines)
        self._body.append(f'<ul class="glance">{items}</ul>')

    def table(self, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """A table; the first column is text."""
        head = "".join(f"<th>{escape(name)}</th>" for name in header)
        lines = ("".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows)
        body = "".join(f"<tr>{line}</tr>" for line in lines)
        # What scrolls can be reached by keys.
        self._tables += 1
        label = f"Table {self._tables}: {', '.join(header)}"
        whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        self._body.append(f'<div class="wide" tabindex="0" role="region" aria-label="{escape(label)}">{whole}</div>')

    def pairs(self, pairs: Iterable[tuple[str, object]]) -> None:
        """Names and what they are."""
        items = "".join(f"<dt>{escape(name)}</dt><dd>{escape(str(value))}</dd>" for name, value in pairs)
        self._body.append(f"<dl>{items}</dl>")

    def code(self, text: str) -> None:
        """Text as it is."""
        self._body.append(f"<pre>{escape(text)}</pre>")

    def figures(self, figures: Sequence[tuple[Figure, str]], small: bool = False) -> None:
        """Figures side by side where there is room, each with what it shows."""
        alone = len(figures) == 1 and not small
        shown = "".join(self._figure(figure, caption, alone) for figure, caption in figures)
        self._body.append(shown if alone else f'<div class="panels{" small" if small else ""}">{shown}</div>')

    def html(self) -> str:
        """The page."""
        links = "".join(f'<a href="#{anchor}">{escape(title)}</a>' for anchor, title in self._sections)
        body = "\n".join(self._body).replace("<!--nav-->", f"<nav>{links}</nav>", 1)
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(self._title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
        )

    def _figure(self, figure: Figure, caption: str, alone: bool) -> str:
        self._figures += 1
        kind = ' class="alone"' if alone else ""
        drawn = inline_svg(figure, f"f{self._figures}", caption)
        return f"<figure{kind}>{drawn}<figcaption>{escape(caption)}</figcaption></figure>"


def inline_svg(figure: Figure, prefix: str, label: str) -> str:
    """A figure as an SVG element that scales with the page; its ids begin with the prefix, so that no two are equal."""
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{prefix}-\1"', text)
    # A style for all of the page belongs to nobody; here it is the one matplotlib means for its own lines.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    opening = re.match(r"<svg[^>]*>", text).group(0)
    box = re.search(r'viewBox="[^"]+"', opening).group(0)
    start = f'<svg {box} role="img" aria-label="{escape(label)}" style="stroke-linejoin:round;stroke-linecap:butt">'
    return re.sub(r"\n\s*", "\n", start + text[len(opening) :]).strip()
