"""The parts of the documentation that come out of the code: `script/reference` writes them, a test compares them.

A page has them between two marks, `<!-- made by ... -->` and `<!-- end of what is made -->`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import api_reference
import strategies_reference

from attrito.job import json_schema
from attrito.job import reference as job_reference

DOCS = Path(__file__).resolve().parent
BEGIN, END = "<!-- made by script/reference", "<!-- end of what is made -->"
MADE = {
    "reference/job.md": job_reference.as_markdown,
    "reference/python.md": api_reference.as_markdown,
    "explanation/strategies.md": strategies_reference.as_markdown,
}
# Files that are made as a whole
WHOLE = {"reference/job.schema.json": json_schema.as_json_schema}


def page(name: str) -> str:
    """A page as it should be: what is made put between its marks, or all of it."""
    if name in WHOLE:
        return WHOLE[name]()
    text = (DOCS / name).read_text()
    begin = text.index("\n", text.index(BEGIN)) + 1
    return f"{text[:begin]}{MADE[name]()}\n{text[text.index(END) :]}"


def main() -> int:
    """Write the pages; with --check only say which are out of date."""
    stale = [name for name in (*MADE, *WHOLE) if not (DOCS / name).exists() or (DOCS / name).read_text() != page(name)]
    for name in stale:
        if "--check" in sys.argv:
            print(f"docs/{name} is not what the code says: script/reference mends it", file=sys.stderr)
        else:
            (DOCS / name).write_text(page(name))
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
