"""The documentation as HTML: README.md and docs/*.md, with all that they link to, for a browser without a network.

    .venv/bin/python docs/build_pages.py [folder: build/docs]

The folder mirrors the source tree, so that links stay what they are but for their ending.
"""

from __future__ import annotations

import html
import io
import re
import shutil
import sys
from pathlib import Path

import markdown
import matplotlib
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\]\(([^)\s]+)\)")
STYLE = """
body { max-width: 54rem; margin: 1rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; }
nav { border-bottom: 1px solid #ccc; padding-bottom: .4rem; margin-bottom: 1.5rem; }
a { color: #0a5a9c; }
h1, h2, h3 { line-height: 1.25; margin-top: 1.6em; }
pre, table { overflow-x: auto; display: block; }
pre { background: #f4f4f4; padding: .7rem; border-radius: 4px; }
code { font-size: .88em; overflow-wrap: anywhere; }
pre code { overflow-wrap: normal; }
table { border-collapse: collapse; margin: 1rem 0; }
td, th { border: 1px solid #ccc; padding: .25rem .55rem; text-align: left; vertical-align: top; }
img, svg { max-width: 100%; height: auto; }
@media print { nav { display: none; } body { max-width: none; font-size: 10pt; } pre { white-space: pre-wrap; } }
"""


def sources() -> list[Path]:
    """The pages: README, and those of docs/."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


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


def page(source: Path) -> str:
    """One page as HTML."""
    text = source.read_text()
    equations: list[str] = []

    def keep(found: re.Match[str]) -> str:
        equations.append(equation(found.group(1)))
        return f"\n\nEQUATION-{len(equations) - 1}\n\n"

    parts = re.split(r"(```.*?```)", text, flags=re.DOTALL)
    parts[::2] = [re.sub(r"\$\$(.*?)\$\$", keep, part, flags=re.DOTALL) for part in parts[::2]]
    settings = {"toc": {"slugify": anchor}}
    body = markdown.markdown(
        "".join(parts), extensions=["tables", "fenced_code", "sane_lists", "toc"], extension_configs=settings
    )
    body = re.sub(r'(href="[^":]*)\.md(["#])', r"\1.html\2", body)
    for number, drawn in enumerate(equations):
        body = body.replace(f"<p>EQUATION-{number}</p>", drawn)
    up = "" if source.parent == ROOT else "../"
    title = re.search(r"^# (.*)$", text, flags=re.MULTILINE).group(1)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head><body>'
        f'<nav><a href="{up}README.html">attrito</a> · <a href="{up}docs/index.html">documentation</a></nav>\n{body}\n'
        "</body></html>\n"
    )


def build(folder: Path) -> list[Path]:
    """Write all pages and what they link to; returns the pages."""
    written = []
    for source in sources():
        target = folder / source.relative_to(ROOT).with_suffix(".html")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(page(source))
        written.append(target)
        for name in LINK.findall(source.read_text()):
            linked = (source.parent / name.partition("#")[0]).resolve()
            if ":" in name or linked.suffix == ".md" or not linked.is_file():
                continue
            copy = folder / linked.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(linked, copy)
    return written


if __name__ == "__main__":
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "docs"
    print(f"{len(build(place))} pages in {place}")
