"""The C header of the library, src/api/attrito.h, out of the Fortran sources, as gfortran reads them.

`script/header` writes it; a test compares it with the sources, and the Python side with it.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEADER = ROOT / "src" / "api" / "attrito.h"
# Structures whose name says little without that of their module.
PLAIN = ("options", "report", "scene")
# Interfaces of procedures that are handed over, by where they are declared: their name there, and in the header.
LISTENERS = {
    "output/listener.f90": ("series_callback", "attrito_series_callback"),
    "reduce/progress.f90": ("listener", "attrito_listener"),
    "core/exhausted.f90": ("exhausted_callback", "attrito_exhausted_callback"),
}
# Arguments that are such procedures.
HANDED_OVER = {
    "attrito_report_point": "attrito_series_callback",
    "attrito_reduce": "attrito_listener",
    "attrito_when_exhausted": "attrito_exhausted_callback",
}
INTRODUCTION = """\
/* The C interface of attrito. Made by script/header from the Fortran sources; a test compares both.
 *
 * Arrays are C's: the last index runs fastest. A status is 0 (done), 1 (the numerics), 2 (the input) or 3 (a file); its
 * message is written to the room that the caller gives. A communicator is Fortran's handle (MPI_Comm_c2f), of MPI that
 * is initialised. A handle is made by attrito_create or attrito_integrator_create, and given back by attrito_destroy or
 * attrito_integrator_destroy.
 */
#ifndef ATTRITO_H
#define ATTRITO_H

#ifdef __cplusplus
extern "C" {
#endif
"""
END = """
#ifdef __cplusplus
}
#endif

#endif
"""


def header(modules: Path) -> str:
    """The text of the header.

    Parameters
    ----------
    modules : folder of a build's modules, one of its folders for each stage
    """
    sources = [
        *(ROOT / "src" / name for name in LISTENERS),
        ROOT / "src" / "api" / "session.f90",
        *_in_order(sorted((ROOT / "src" / "api").glob("*_api.f90"))),
    ]
    with ThreadPoolExecutor() as pool:
        parts = list(pool.map(lambda source: declarations(source, modules), sources))
    return INTRODUCTION + "".join(f"\n{part}" for part in parts if part) + END


def declarations(source: Path, modules: Path) -> str:
    """The structures and entries that a source declares itself, in its order, each with its comment; see `header`."""
    return _part(source, _prototypes(source, modules))


def _in_order(sources: list[Path]) -> list[Path]:
    """Sources whose structures others hold come before those."""
    return sorted(sources, key=lambda source: (source.name != "solver_api.f90", source.name))


def _prototypes(source: Path, modules: Path) -> str:
    """What gfortran makes of a source."""
    flags = ["-fc-prototypes", "-fsyntax-only", "-ffree-line-length-none", "-cpp", "-w"]
    includes = [f"-I{folder}" for folder in sorted(modules.iterdir())]
    with tempfile.TemporaryDirectory() as scratch:
        words = ["gfortran", *flags, f"-J{scratch}", *includes, str(source)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{source.relative_to(ROOT)}: {done.stderr}")
    return re.sub(r" */\*.*?\*/ *", "", done.stdout)


def _part(source: Path, prototypes: str) -> str:
    """The structures and entries that a source declares itself, in its order, with what it says of them."""
    text = source.read_text()
    structures = dict(re.findall(r"typedef struct (\w+) (\{.*?\}) \w+;", prototypes, flags=re.S))
    entries = {name: line for line in prototypes.splitlines() if (name := _named(line))}
    renamed = {name: _structure_name(name, text) for name in structures}
    found = []
    for match in re.finditer(r"^ *type, bind\(c\) :: (\w+)", text, flags=re.M):
        name = match[1]
        found.append(f"{_comment(text, match.start())}typedef struct {structures[name]} {renamed[name]};")
    for match in re.finditer(
        r"^[^!\n]*\b(?:subroutine|function) (\w+)\((?:[^!]*?)\)[^!\n]*bind\(c\)", text, flags=re.M
    ):
        name = match[1]
        if name in entries:
            end = text.index(f" {name}\n", match.end())
            found.append(_comment(text, match.start()) + _entry(name, entries[name], text[match.end() : end]))
    whole = "\n\n".join(found)
    for name, new in renamed.items():
        whole = re.sub(rf"\b{name}\b", new, whole)
    lines = [_wrapped(line) if line.endswith(");") else line for line in whole.splitlines()]
    return "\n".join(lines) + "\n" if lines else ""


def _named(line: str) -> str:
    match = re.match(r"\w[\w *]*?\b(\w+) \(.*\);$", line)
    return match[1] if match else ""


def _entry(name: str, line: str, body: str) -> str:
    """The prototype of an entry: as gfortran has it, but for procedures that are handed over and new handles."""
    for old, new in LISTENERS.values():
        if name == old:
            return "typedef " + re.sub(rf"\b{old} ", f"(*{new})", line)
    if name in HANDED_OVER:
        line = re.sub(r"\w+ \(\*(\w+)\)\(\)", rf"{HANDED_OVER[name]} \1", line)
    for made in re.findall(r"type\(c_ptr\), intent\(out\) :: (\w+)", body):
        line = line.replace(f"void *{made}", f"void **{made}")
    return line.replace(f"{name} (", f"{name}(").replace("()", "(void)")


def _wrapped(line: str) -> str:
    """A declaration in lines of moderate length, broken between its arguments."""
    lines = [""]
    for part in re.split(r"(?<=,) ", line):
        if lines[-1] and len(lines[-1]) + len(part) > 118:
            lines.append(f"    {part}")
        else:
            lines[-1] += f" {part}" if lines[-1] else part
    return "\n".join(lines)


def _structure_name(name: str, text: str) -> str:
    """`attrito_point` of `point_type`; `attrito_reduce_options` of `options_type` in the module of the reduction."""
    bare = name.removesuffix("_type")
    module = re.search(r"^module attrito_api_(\w+)", text, flags=re.M)
    return f"attrito_{module[1]}_{bare}" if bare in PLAIN and module else f"attrito_{bare}"


def _comment(text: str, place: int) -> str:
    """The `!>` lines above a place of a source, as a comment of C."""
    lines: list[str] = []
    for line in reversed(text[:place].splitlines()):
        if not line.lstrip().startswith("!>"):
            break
        lines.insert(0, line.strip().removeprefix("!>").strip())
    return "/* " + "\n * ".join(lines) + " */\n" if lines else ""


def main(words: list[str]) -> int:
    """Write the header, or with `--check` say whether it is up to date."""
    made = header(ROOT / "build" / "release" / "modules")
    if "--check" not in words:
        HEADER.write_text(made)
        return 0
    if made != HEADER.read_text():
        print(f"{HEADER.relative_to(ROOT)} is out of date: script/header makes it")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
