"""The page of a report: HTML without network or fonts, figures as inline SVG, one script where something moves.

Everything that comes from a file is escaped here, and only here.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import matplotlib
from matplotlib.figure import Figure

from attrito.plots.ticks import plain_ticks

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
ul.labelled li { display: grid; grid-template-columns: 7rem 1fr; gap: .8rem; }
ul.labelled b { font-weight: 600; color: var(--faint); }
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
.motion .live, .motion.is-live .still { display: none; }
.motion.is-live .live { display: block; }
.motion canvas { display: block; width: 100%; aspect-ratio: 5 / 4; cursor: grab; touch-action: pan-y; }
.steer { display: flex; gap: .8rem; align-items: center; font-size: .92rem; }
.steer button { font: inherit; padding: .15rem .7rem; min-width: 2rem; }
.steer label { display: flex; gap: .4rem; align-items: center; }
.steer input { width: 8rem; }
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
  ul.labelled li { grid-template-columns: 1fr; gap: 0; }
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
  .panels svg { max-height: 6.4cm; }
  figcaption { font-size: 8pt; }
  .motion.is-live .live { display: none; }
  .motion.is-live .still { display: block; }
  .wide { overflow: visible; }
  table { font-size: 7.5pt; }
  th, td { padding-right: .5rem; }
  a { color: inherit; text-decoration: none; }
}
"""


# What a browser may load: nothing but what is in the page itself
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


@dataclass(frozen=True)
class Animation:
    """A figure that moves where scripts run.

    Parameters
    ----------
    still : what is printed, or shown without scripts
    numbers : what `viewer.js` draws it from, JSON
    """

    still: Figure
    numbers: str


def viewer() -> str:
    """The script that draws animations."""
    return files("attrito.report").joinpath("viewer.js").read_text(encoding="utf-8")


class Page:
    """An HTML page that is written from top to bottom."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._body: list[str] = []
        self._sections: list[tuple[str, str]] = []
        self._figures = self._tables = self._animations = 0

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

    def labelled(self, lines: Sequence[tuple[str, str, bool]]) -> None:
        """Sentences, each with what it is about, which is said once, and whether it is a warning."""
        items, before = "", None
        for about, line, warn in lines:
            label = f"<b>{escape(about)}</b>" if about != before else "<b></b>"
            items += f"<li{' class=warn' if warn else ''}>{label}<span>{escape(line)}</span></li>"
            before = about
        self._body.append(f'<ul class="glance labelled">{items}</ul>')

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

    def figures(self, figures: Sequence[tuple[Figure | Animation, str]], small: bool = False) -> None:
        """Figures side by side where there is room, each with what it shows."""
        alone = len(figures) == 1 and not small
        shown = "".join(self._figure(figure, caption, alone) for figure, caption in figures)
        self._body.append(shown if alone else f'<div class="panels{" small" if small else ""}">{shown}</div>')

    def html(self) -> str:
        """The page."""
        links = "".join(f'<a href="#{anchor}">{escape(title)}</a>' for anchor, title in self._sections)
        body = "\n".join(self._body).replace("<!--nav-->", f"<nav>{links}</nav>", 1)
        script = f"<script>\n{viewer()}</script>\n" if self._animations else ""
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
            f"<title>{escape(self._title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n{script}</body>\n</html>\n"
        )

    def _figure(self, figure: Figure | Animation, caption: str, alone: bool) -> str:
        self._figures += 1
        if isinstance(figure, Animation):
            self._animations += 1
            still = inline_svg(figure.still, f"f{self._figures}", caption)
            numbers = figure.numbers.replace("<", "\\u003c")
            return (
                f'<figure class="motion"><div class="still">{still}</div>{_stage(caption)}'
                f'<script type="application/json">{numbers}</script>'
                f"<figcaption>{escape(caption)}</figcaption></figure>"
            )
        kind = ' class="alone"' if alone else ""
        drawn = inline_svg(figure, f"f{self._figures}", caption)
        return f"<figure{kind}>{drawn}<figcaption>{escape(caption)}</figcaption></figure>"


def _stage(caption: str) -> str:
    """Where an animation is drawn, and what steers it."""
    return (
        f'<div class="live"><canvas tabindex="0" role="img" aria-label="{escape(caption)}"></canvas>'
        '<p class="steer"><button type="button">Play</button> '
        '<label>Size <input type="range" min="0" max="3" step="0.05" value="1"></label> '
        '<button type="button" class="nearer" aria-label="nearer">+</button>'
        '<button type="button" class="farther" aria-label="farther">&minus;</button></p></div>'
    )


def inline_svg(figure: Figure, prefix: str, label: str) -> str:
    """A figure as an SVG element that scales with the page; its ids begin with the prefix, so that no two are equal."""
    stream = io.StringIO()
    plain_ticks(figure)
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
    # Hundredths of a point cannot be seen; all digits would be half of the page.
    text = re.sub(r' (d|x|y|x1|y1|x2|y2|points)="([^"]*)"', _rounded, text)
    opening = re.match(r"<svg[^>]*>", text).group(0)
    box = re.search(r'viewBox="[^"]+"', opening).group(0)
    start = f'<svg {box} role="img" aria-label="{escape(label)}" style="stroke-linejoin:round;stroke-linecap:butt">'
    return re.sub(r"\n\s*", "\n", start + text[len(opening) :]).strip()


def _rounded(attribute: re.Match[str]) -> str:
    numbers = re.sub(r"-?\d+\.\d{3,}", lambda found: f"{float(found[0]):.2f}", attribute[2])
    return f' {attribute[1]}="{numbers}"'
