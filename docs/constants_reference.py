"""The numbers in the Fortran sources that somebody chose, for constants.md, and what halving and doubling them changes.

A declaration says of which kind its numbers are by a word at its end, `! guess`:

    !> Part of the range to go on by where the branch was lost
    real(wp), parameter :: jump = 0.01_wp ! guess
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CHANGES = ROOT / "benchmarks" / "constants.csv"
KINDS = {
    "guess": "steers what is found, and nobody has derived or measured the number",
    "measured": "follows from a measurement, which the comment or docs/performance.md names",
    "derived": "follows from a formula, an order of convergence, or the word length",
    "conventional": "bounds a cost or sets a unit; results do not depend on it",
}
DECLARATION = re.compile(
    r"\s*(?P<type>real\(\w+\)|integer|PetscInt), parameter :: (?P<numbers>[^!&]*?)\s*&?\s*(! (?P<kind>\w+))?$"
)
NUMBER = re.compile(r"(\w+)(?:\([^)]*\))? = (\[[^]]*\]|(?:[^,(]|\([^)]*\))+)")


@dataclass(frozen=True)
class Constant:
    """A number with a name.

    Parameters
    ----------
    file : below src/
    name, value : as they are written
    is_real : or an integer
    line : counted from 0
    kind : of `KINDS`; "" where the declaration names none
    comment : the `!>` lines above its group
    """

    file: str
    name: str
    value: str
    is_real: bool
    line: int
    kind: str
    comment: str

    @property
    def plain_value(self) -> str:
        """The number as a reader writes it."""
        return re.sub(r"_(wp|sp)\b", "", self.value).replace("*", " * ").replace("/", " / ")


def constants_of(path: Path, file: str) -> list[Constant]:
    """Numbers that a file declares."""
    found = []
    comment: list[str] = []
    in_comment = False
    for line, text in enumerate(path.read_text().split("\n")):
        declared = DECLARATION.match(text)
        if text.lstrip().startswith("!>"):
            comment = [*(comment if in_comment else []), text.strip().removeprefix("!>").strip()]
        elif declared:
            about = declared["type"].startswith("real"), line, declared["kind"] or "", " ".join(comment)
            numbers = NUMBER.findall(declared["numbers"])
            found += [Constant(file, name, value.strip(), *about) for name, value in numbers]
        else:
            comment = []
        in_comment = text.lstrip().startswith("!>")
    return found


def collect(root: Path = ROOT) -> list[Constant]:
    """All of them, file by file."""
    source = root / "src"
    files = sorted(path for path in source.rglob("*.[fF]90"))
    return [one for path in files for one in constants_of(path, str(path.relative_to(source)))]


def changes() -> dict[tuple[str, str, str], dict[str, str]]:
    """What `benchmarks/constants.py` has found, by file, name and factor."""
    if not CHANGES.exists():
        return {}
    with CHANGES.open() as file:
        return {(row["file"], row["name"], row["factor"]): row for row in csv.DictReader(file)}


def cell(row: dict[str, str] | None) -> str:
    """What a factor has changed, in a few words."""
    if row is None:
        return ""
    if row["note"]:
        return row["note"]
    parts = [f"{row[name]} {what}" for name, what in (("lost", "lost"), ("gained", "gained"), ("moved", "moved"))
             if row[name] != "0"]  # fmt: skip
    work = float(row["work"])
    if abs(work - 1.0) >= 0.005:
        parts.append(f"work {100.0 * (work - 1.0):+.0f} %")
    return ", ".join(parts) if parts else "nothing" if row["same"] == "1" else "rounding"


def as_markdown() -> str:
    """The tables of constants.md, a kind each."""
    found = [one for one in collect() if one.kind]
    tried = changes()
    lines: list[str] = []
    for kind, meaning in KINDS.items():
        lines += [f"## {kind.capitalize()}", f"A number that {meaning}.", ""]
        guess = kind == "guess"
        lines += ["| file | name | value | what |" + (" halved | doubled |" if guess else "")]
        lines += ["|---|---|---|---|" + ("---|---|" if guess else "")]
        for one in found:
            if one.kind != kind:
                continue
            row = f"| `{one.file}` | `{one.name}` | {one.plain_value} | {one.comment.replace('|', chr(92) + '|')} |"
            if guess:
                row += "".join(f" {cell(tried.get((one.file, one.name, factor)))} |" for factor in ("0.5", "2"))
            lines.append(row)
        lines.append("")
    return "\n".join(lines).rstrip()
