"""The documentation as HTML by MkDocs (mkdocs.yml): contents, search; a link that leads nowhere is an error.

.venv/bin/python docs/build_pages.py [folder: build/docs]
"""

from __future__ import annotations

import sys
from pathlib import Path

from mkdocs.commands.build import build as build_site
from mkdocs.config import load_config

ROOT = Path(__file__).resolve().parents[1]
# What pages link to, by its place in the source tree
STAGED = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "docs", "input")

# Pages of 0.2.0, which its messages and files name, and where they are now
MOVED = {
    "accuracy": "evidence/accuracy",
    "building": "how-to/install",
    "cyclic": "how-to/cyclic",
    "files": "reference/files",
    "first-run": "tutorials/first-run",
    "fits": "how-to/fits",
    "job": "reference/job",
    "looking": "how-to/look",
    "method": "explanation/condensation",
    "models": "how-to/import",
    "modes": "how-to/modes",
    "optima": "how-to/optima",
    "peaks": "how-to/peaks",
    "performance": "evidence/performance",
    "python": "reference/python",
    "running": "how-to/run",
    "sensitivity": "how-to/sensitivity",
    "stress": "how-to/stress",
    "studies": "how-to/studies",
    "theory": "explanation/theory",
    "troubleshooting": "reference/messages",
    "verification": "evidence/verification",
    "where-methods-fail": "explanation/limits",
}


def stage(folder: Path) -> None:
    """Links to the pages, and to what they link to, where their own links lead there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in STAGED:
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)


def redirect(site: Path) -> None:
    """Pages at earlier addresses, which lead to where these are now."""
    (site / "docs").mkdir(parents=True, exist_ok=True)
    for old, new in MOVED.items():
        page = f'<!doctype html><meta http-equiv="refresh" content="0; url={new}.html"><a href="{new}.html">moved</a>\n'
        (site / "docs" / f"{old}.html").write_text(page)


def build(site: Path, source: Path) -> None:
    """Make all pages; `mkdocs.exceptions.Abort` where a link leads nowhere.

    Parameters
    ----------
    site : gets the pages
    source : is made of links to the pages
    """
    stage(source)
    sys.path.insert(0, str(ROOT / "docs"))
    build_site(load_config(str(ROOT / "mkdocs.yml"), docs_dir=str(source), site_dir=str(site), strict=True))
    redirect(site)


if __name__ == "__main__":
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "docs"
    build(place, ROOT / "build" / "docs-source")
    print(f"{len(list(place.rglob('*.html')))} pages in {place}")
