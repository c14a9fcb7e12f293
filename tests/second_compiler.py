"""Numerics built and tested with a second Fortran compiler; `script/second-compiler` calls it.

Those are the files `.f90` of src/ that depend on no library's modules, themselves or through others; of the shells
around libraries that of FFTW, whose interface is a text that any compiler reads. Suites are those that need no more.

    tests/second_compiler.py COMPILER FOLDER
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UNITS = ROOT / "tests" / "unit"
FLAGS = ["-std=f2018", "-O2", "-g", "-fPIC", f"-I{ROOT / 'src' / 'core'}", "-I/usr/include"]
LIBRARIES = ["-lfftw3", "-lopenblas"]
# Shells whose library's interface is no module of another compiler
INCLUDED = ("contact/fourier.F90",)
INTRINSIC = ("iso_c_binding", "iso_fortran_env", "ieee_arithmetic", "ieee_exceptions")


@dataclass(frozen=True)
class Source:
    """A file, the modules that it has and those that it needs of others; `program` of a suite."""

    path: Path
    modules: frozenset[str]
    needs: frozenset[str]
    program: str


def read(path: Path) -> Source:
    """What a file says of itself."""
    text = path.read_text()
    modules = frozenset(re.findall(r"^module (?!procedure)(\w+)", text, flags=re.MULTILINE))
    used = re.findall(r"^\s*use\b(?:, intrinsic ::| ::)?\s+(\w+)", text, flags=re.MULTILINE)
    program = re.search(r"^program (\w+)", text, flags=re.MULTILINE)
    return Source(path, modules, frozenset(used) - modules - set(INTRINSIC), program[1] if program else "")


def closed(sources: list[Source]) -> list[Source]:
    """Those whose needs are met by one another."""
    while True:
        there = {module for source in sources for module in source.modules}
        kept = [source for source in sources if source.needs <= there]
        if len(kept) == len(sources):
            return kept
        sources = kept


def chosen() -> list[Source]:
    """Numerics and suites that the second compiler gets."""
    shells = [ROOT / "src" / name for name in INCLUDED]
    return closed([read(path) for path in [*(ROOT / "src").rglob("*.f90"), *shells, *UNITS.glob("*.f90")]])


class Build:
    """Objects and modules of a compiler in a folder."""

    def __init__(self, compiler: str, folder: Path):
        self._compiler, self._folder = compiler, folder.resolve()
        self._folder.mkdir(parents=True, exist_ok=True)

    def object_of(self, source: Source) -> Path:
        """Named after the whole path."""
        return self._folder / ("_".join(source.path.relative_to(ROOT).with_suffix("").parts) + ".o")

    def compile(self, source: Source) -> str:
        """What the compiler says of a file that it refuses; empty: it is built."""
        words = [self._compiler, *FLAGS, "-c", str(source.path), "-o", str(self.object_of(source))]
        done = subprocess.run(words, cwd=self._folder, capture_output=True, text=True, check=False)
        return done.stderr if done.returncode else ""

    def run(self, suite: Source, needed: list[Source]) -> tuple[bool, str]:
        """Link a suite and run it: whether it passes, and what it prints."""
        program = self._folder / suite.program
        objects = [str(self.object_of(source)) for source in [*needed, suite]]
        words = [self._compiler, *objects, *LIBRARIES, "-o", str(program)]
        linked = subprocess.run(words, capture_output=True, text=True, check=False)
        if linked.returncode:
            return False, linked.stderr
        done = subprocess.run([program], env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, capture_output=True, text=True)
        return done.returncode == 0, done.stdout + done.stderr


def build_all(build: Build, sources: list[Source]) -> dict[Path, str]:
    """Compile files as soon as what they need is there; those refused, with what the compiler says."""
    owner = {module: source for source in sources for module in source.modules}
    order = TopologicalSorter({source: {owner[module] for module in source.needs} for source in sources})
    order.prepare()
    refused: dict[Path, str] = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        while order.is_active():
            ready = order.get_ready()
            for source, said in zip(ready, pool.map(build.compile, ready), strict=True):
                if said:
                    refused[source.path] = said
                order.done(source)
    return refused


def needs_of(suite: Source, sources: list[Source]) -> list[Source]:
    """All files that a suite depends on."""
    owner = {module: source for source in sources for module in source.modules}
    found: dict[Path, Source] = {}
    rest = [suite]
    while rest:
        for module in rest.pop().needs:
            source = owner[module]
            if source.path not in found:
                found[source.path] = source
                rest.append(source)
    return list(found.values())


def main(compiler: str, folder: Path) -> int:
    """Build and run all; 1 if a file is refused or a suite fails."""
    sources, build = chosen(), Build(compiler, folder)
    refused = build_all(build, sources)
    for path, said in refused.items():
        print(f"{path.relative_to(ROOT)}:\n{said}")
    suites = [source for source in sources if source.program]
    failed = []
    for suite in suites if not refused else []:
        ended_well, said = build.run(suite, needs_of(suite, sources))
        if not ended_well:
            failed.append(suite.program)
            print(said)
    numerics, passed = len(sources) - len(suites), len(suites) - len(failed) if not refused else 0
    print(f"{numerics - len(refused)} of {numerics} files built, {passed} of {len(suites)} suites passed")
    return 1 if refused or failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2])))
