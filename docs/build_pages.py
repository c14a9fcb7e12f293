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


def stage(folder: Path) -> None:
    """Links to the pages, and to what they link to, where their own links lead there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in STAGED:
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)


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


if __name__ == "__main__":
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "docs"
    build(place, ROOT / "build" / "docs-source")
    print(f"{len(list(place.rglob('*.html')))} pages in {place}")
