"""docs/evidence/coverage.md, which `script/coverage` writes: lines that tests run, from gcovr and coverage.py."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path, PurePosixPath

# Files of which less is run are named.
FEW = 80.0
# Files with fewer lines are not.
SHORT = 20


def fortran(report: Path) -> dict[str, tuple[int, int]]:
    """Lines that are run, and all that could be, of each file below src/."""
    files = json.loads(report.read_text())["files"]
    return {file["filename"].removeprefix("src/"): (file["line_covered"], file["line_total"]) for file in files}


def python(report: Path) -> dict[str, tuple[int, int]]:
    """The same of each file of the packages."""
    files = json.loads(report.read_text())["files"]
    return {
        name.partition("python/")[2]: (file["summary"]["covered_lines"], file["summary"]["num_statements"])
        for name, file in files.items()
    }


def table(files: dict[str, tuple[int, int]]) -> str:
    """A row a folder, the whole last, then files of which few lines are run."""
    covered: Counter[str] = Counter()
    total: Counter[str] = Counter()
    for name, (run, lines) in files.items():
        folder = str(PurePosixPath(name).parent)
        covered[folder] += run
        total[folder] += lines
    rows = [(folder, covered[folder], total[folder]) for folder in sorted(total) if total[folder]]
    rows.append(("**all**", sum(covered.values()), sum(total.values())))
    lines = ["| folder | lines | run |", "|---|---|---|"]
    lines += [f"| {folder} | {count} | {100.0 * run / count:.1f} % |" for folder, run, count in rows]
    few = sorted(
        (100.0 * run / count, name)
        for name, (run, count) in files.items()
        if count >= SHORT and 100.0 * run < FEW * count
    )
    if few:
        named = ", ".join(f"`{name}` {percent:.0f} %" for percent, name in few)
        lines.append(f"\nLess than {FEW:.0f} % of: {named}.")
    return "\n".join(lines)


def page(fortran_report: Path, python_report: Path) -> str:
    """The page."""
    return "\n".join(
        [
            "# Coverage",
            "Lines that the tests run, by folder: `script/coverage` measures both languages and writes this page;",
            "pages of files are then in `build/coverage/html`. Slow studies (`script/test --all`) are left out,",
            "and processes that a test kills report nothing. A line that is run is not yet one that is tested:",
            "tests compare with closed forms, differences and invariances ([Verification](verification.md)).\n",
            "## Fortran\n" + table(fortran(fortran_report)) + "\n",
            "## Python\n" + table(python(python_report)),
        ]
    )


if __name__ == "__main__":
    print(page(*map(Path, sys.argv[1:])))
