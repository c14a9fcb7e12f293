"""A library whose guesses are variables: built once, from a copy of the sources, and varied as it runs.

A declaration `real(wp), parameter :: jump = 0.01_wp ! guess` becomes, in the copy,

    real(wp), bind(c, name="guess_continuation_sweep_jump") :: jump = 0.01_wp

which is a variable of the shared library that `vary` multiplies. Numbers of a procedure move to its module's head.
What sizes an array, or stands in the declaration of another constant, has to stay a parameter: it is not varied.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
from constants_reference import NUMBER, Constant, collect  # noqa: E402 (a folder of scripts, not a package)

# What no solution of a reduced scene passes through
SKIPPED = ("reduce", "api")
# Above any count that a constant could have
LARGEST_COUNT = 2**30


def symbol(constant: Constant) -> str:
    """The variable's name in the library."""
    return "guess_" + re.sub(r"\W", "_", constant.file.rsplit(".", 1)[0]) + "_" + constant.name


def vary(library: ctypes.CDLL, constant: Constant, factor: float) -> None:
    """Multiply a guess; whole numbers stay whole, and 1 at least."""
    kind = ctypes.c_double if constant.is_real else ctypes.c_int
    count = constant.value.count(",") + 1 if constant.value.startswith("[") else 1
    numbers = (kind * count).in_dll(library, symbol(constant))
    for index, number in enumerate(numbers):
        numbers[index] = number * factor if constant.is_real else min(max(1, int(number * factor)), LARGEST_COUNT)


def guesses() -> list[Constant]:
    """All guesses that solutions of reduced scenes may depend on."""
    return [one for one in collect() if one.kind == "guess" and one.file.partition("/")[0] not in SKIPPED]


def build(place: Path) -> tuple[Path, list[Constant]]:
    """The library and the guesses that are variables in it.

    Raises
    ------
    RuntimeError : the copy can't be configured, or not be compiled with any choice of variables
    """
    tree = place / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns("build", ".git", ".venv"))
    _run(tree, "cmake", "--preset", "release")
    fixed: set[str] = set()
    while True:
        chosen = [one for one in guesses() if symbol(one) not in fixed]
        for file in sorted({one.file for one in chosen}):
            text = instrumented((ROOT / "src" / file).read_text(), [one for one in chosen if one.file == file])
            path = tree / "src" / file
            if path.read_text() != text:
                path.write_text(text)
        done = _run(
            tree, "cmake", "--build", "--preset", "release", "--target", "attrito", "--", "-k", "0", check=False
        )
        if done.returncode == 0:
            return tree / "build" / "release" / "libattrito.so", chosen
        refused = _refused(done.stdout + done.stderr, chosen)
        if not refused:
            raise RuntimeError(done.stdout[-3000:] + done.stderr[-3000:])
        fixed |= refused


def instrumented(text: str, constants: list[Constant]) -> str:
    """The source with variables for its constants."""
    lines = text.split("\n")
    implicit = next(number for number, line in enumerate(lines) if line.strip() == "implicit none")
    head = []
    for line in sorted({one.line for one in constants}):
        group = [one for one in constants if one.line == line]
        declared, _, kind = lines[line].partition("::")
        head += [_variable(declared, kind, one, text) for one in group]
        kept = [one for one in _declared(text, line) if one.name not in {other.name for other in group}]
        lines[line] = "\n".join(f"{declared}:: {one.name}{_shape(kind, one)} = {one.value}" for one in kept)
    return "\n".join([*lines[: implicit + 1], *head, *lines[implicit + 1 :]])


def _variable(declared: str, numbers: str, constant: Constant, text: str) -> str:
    """The declaration of a variable; a private one would be no symbol of the library."""
    attributes = declared.strip().replace("parameter", f'bind(c, name="{symbol(constant)}")')
    if not re.search(rf"^\s*public ::.*\b{constant.name}\b", text, re.MULTILINE):
        attributes += ", public"
    return f"  {attributes} :: {constant.name}{_shape(numbers, constant)} = {constant.value}"


def _shape(numbers: str, constant: Constant) -> str:
    """Of an array, as its declaration gives it."""
    found = re.search(rf"\b{constant.name}(\([^)]*\)) =", numbers)
    return found[1] if found else ""


def _declared(text: str, line: int) -> list[Constant]:
    """All constants that a line declares."""
    numbers = text.split("\n")[line].partition("::")[2].partition("!")[0]
    return [Constant("", name, value.strip(), True, line, "", "") for name, value in NUMBER.findall(numbers)]


def _refused(said: str, chosen: list[Constant]) -> set[str]:
    """Variables that the compiler wants to be constants; all of a file where its first error does not name any."""
    refused: dict[str, set[str]] = {}
    for place, report in re.findall(r"src/(\S+):\d+:\d+:\n\n(.*?Error:[^\n]*)", said, re.DOTALL):
        here = {one.name: symbol(one) for one in chosen if one.file == place}
        named = {here[name] for name in re.findall(r"‘(\w+)’", report.rpartition("Error:")[2]) if name in here}
        if place not in refused:
            refused[place] = named or set(here.values())
        elif "constant" in report:
            refused[place] |= named
    return set().union(*refused.values())


def _run(tree: Path, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    quiet = os.environ | {"FFLAGS": "-w"}
    done = subprocess.run(command, cwd=tree, env=quiet, capture_output=True, text=True, check=False)
    if check and done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done
