"""Malformed input by the hundred: job files, every reader's files, HDF5 files and journals, spoilt by chance.

    .venv/bin/python tests/python/fuzz.py --cases 1000 --seed 7
    .venv/bin/python tests/python/fuzz.py --cases 600 --seed 7 --ways further
    .venv/bin/python tests/python/fuzz.py --cases 600 --seed 7 --ways contents

Each case is a command of its own on a spoilt copy of good files, the same for the same seed, in a process with limits
on memory and time. It must end by itself with exit code 0, 1 or 2, without a traceback, where it is refused within 5 s
of processor time; with code 2 it says what is at fault, each line naming place and remedy, once, and files that were
there are as they were. `--ways`: spoilt in the ways of `spoil_further.py` or `spoil_contents.py`. Prints JSON: how many
cases ended how, by kind, and those that broke a rule; `--all` lists those that were not refused, too.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import spoil_contents
import spoil_further
from good_input import Source, sources
from jobs import ENVIRONMENT, TIMEOUT
from spoil import spoil

from attrito.cli import main

SECONDS = 5.0
# Where the input was good in spite of all, as long as the work takes.
SECONDS_OF_WORK = 20.0
# Of the processor
PROCESSOR_SECONDS = 30
BYTES = 6 << 30
# Kinds by the name of a way; in the first, a file is spoilt by what it is.
WAYS = {"first": None, "further": spoil_further.kinds_for, "contents": spoil_contents.kinds_for}
# Files beyond are not looked at for changes.
LARGEST = 1 << 24


@dataclass(frozen=True)
class Case:
    """One spoilt input and how its command ended."""

    number: int
    name: str
    code: int | None
    seconds: float
    message: str
    kind: str = ""
    changed: tuple[str, ...] = ()

    @property
    def breaks(self) -> str:
        """The rule that it breaks, if any."""
        if self.code is None:
            return "does not end"
        if self.code not in (0, 1, 2):
            return f"ends with {self.code}"
        if "Traceback" in self.message:
            return "traceback"
        if self.seconds > (SECONDS if self.code == 2 else SECONDS_OF_WORK):
            return f"takes {self.seconds:.1f} s"
        if self.code == 2 and not told_well(self.message):
            return "does not say what is at fault"
        if self.code == 2 and self.changed:
            return f"changes {', '.join(self.changed)}"
        return ""


def told_well(message: str) -> bool:
    """One message: `attrito: place: ... expected ...`, or argparse's own; further lines are further faults.

    What no reader foresaw is said as Python said it, and tells nobody what to do.
    """
    if "contents = " in message and "ATTRITO_TRACEBACK" in message:
        return False
    lines = [line for line in message.splitlines() if line.strip() and not re.fullmatch(r"\d+ faults", line)]
    if any("usage: attrito" in line for line in lines):
        return True
    if sum(line.startswith("attrito: ") for line in lines) > 1:
        return False
    first = next((i for i, line in enumerate(lines) if line.startswith("attrito: ")), None)
    return first is not None and all("expected" in line or ": " in line for line in lines[first:])


def _quietly(folder: Path, arguments: tuple[str, ...], log: Path, spoil_it: Callable[[], None]) -> tuple:
    """Exit code (None: killed for time) and seconds of processor time of a command in a process with limits."""
    child = os.fork()
    if child == 0:
        os.setsid()
        with open(log, "wb") as out:
            os.dup2(out.fileno(), 1)
            os.dup2(out.fileno(), 2)
        # pytest has put others in their places.
        sys.stdout, sys.stderr = (open(number, "w", closefd=False) for number in (1, 2))  # noqa: SIM115
        try:
            spoil_it()
            os.chdir(folder)
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
            resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_SECONDS, PROCESSOR_SECONDS))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            code = main(arguments)
        except SystemExit as error:
            code = error.code
        except BaseException:
            traceback.print_exc()
            code = 70
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 71)
    end = time.monotonic() + TIMEOUT
    while True:
        found, status, used = os.wait4(child, os.WNOHANG)
        if found:
            code = os.waitstatus_to_exitcode(status)
            return code, used.ru_utime + used.ru_stime
        if time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
            os.wait4(child, 0)
            return None, TIMEOUT
        time.sleep(0.005)


def _contents(folder: Path) -> dict[str, str]:
    """What files hold, by their names."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.iterdir()
        if path.is_file() and not path.is_symlink() and path.stat().st_size < LARGEST
    }


def run_case(number: int, seed: int, good: list[Source], folder: Path, ways: str = "first") -> Case:
    """Spoil one input and run its command on it; the same for the same number and seed."""
    chance = random.Random(f"{seed}:{number}")
    source = good[number % len(good)]
    place = folder / "case"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(source.folder, place)
    log = folder / "log"

    arguments, how = source.arguments, source.kind
    kinds_for = WAYS[ways]
    if kinds_for:
        kind = chance.choice(kinds_for(place / source.spoilt, source.kind, arguments))
        how = kind.__name__
        arguments = kind(place, place / source.spoilt, arguments, chance) or arguments
    before = _contents(place)

    def spoil_it() -> None:
        if not kinds_for:
            spoil(place / source.spoilt, source.kind, chance)

    code, seconds = _quietly(place, arguments, log, spoil_it)
    name = f"{' '.join(arguments)} with {source.spoilt} spoilt as {how}"
    after = _contents(place)
    changed = tuple(one for one, sum_of in before.items() if after.get(one) != sum_of) if kinds_for else ()
    return Case(number, name, code, seconds, log.read_text(errors="replace"), how, changed)


def run_cases(cases: range, seed: int, ways: str = "first") -> list[Case]:
    """Run some cases in a folder of their own."""
    os.environ.update(ENVIRONMENT)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        good = sources(folder)
        return [run_case(number, seed, good, folder, ways) for number in cases]


def summary(done: list[Case], everything: bool = False) -> dict:
    """How many ended how, and those that broke a rule; with `everything` also those that were not refused."""
    refused = [case.seconds for case in done if case.code == 2]
    broken = [
        {"number": case.number, "case": case.name, "rule": case.breaks, "message": case.message[-600:]}
        for case in done
        if case.breaks or (everything and case.code != 2)
    ]
    codes = dict(Counter(str(case.code) for case in done))
    kinds = Counter(case.kind for case in done)
    return {
        "cases": len(done),
        "codes": codes,
        "kinds": kinds,
        "slowest_refusal_seconds": max(refused, default=0.0),
        "broken": broken,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--ways", choices=WAYS, default="first", help="further: spoil_further.py; contents: spoil_contents.py"
    )
    parser.add_argument("--all", action="store_true", help="list what was not refused, too")
    options = parser.parse_args()
    ended = run_cases(range(options.first, options.first + options.cases), options.seed, options.ways)
    print(json.dumps(summary(ended, options.all), indent=1))
