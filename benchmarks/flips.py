"""Flip bits in numbers of files that attrito has written: each is found on reading, or changes nothing that is shown.

    .venv/bin/python benchmarks/flips.py --flips 300 --seed 1

A file of each kind is made, a random bit of a random number in it is flipped, and a command reads it. `refused` counts
faults that name the file, `same` outputs that are those of the whole file, `cut` journals that end before the record
that the bit lies in, with what is before it unchanged; all else is `silent` and is to be zero. Prints JSON.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1] / "tests" / "python"
sys.path.insert(0, str(TESTS))

from jobs import blocks, chain, wedge, write_blocks, write_job  # noqa: E402 (a folder of scripts, not a package)
from mode_jobs import rubbing as mode_job  # noqa: E402
from rubbing_fit import measured, rubbing, write_fit  # noqa: E402
from test_file_sums import numbers  # noqa: E402

from attrito.cli.program import main as attrito  # noqa: E402
from attrito.results.journal import is_journal, read_journal  # noqa: E402

# Of a run that is killed
POINTS = 12
Made = tuple[str, tuple[str, ...]]


def command(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Exit code, what it prints, and what it says."""
    out, said = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
        code = attrito(arguments)
    return code, out.getvalue(), said.getvalue()


def _blocks(folder: Path, name: str) -> Made:
    write_blocks(folder / "model.h5")
    write_job(folder, blocks())
    command(folder, "run", "job.toml")
    return name, ("table", name) if name == "result.h5" else ("run", "job.toml")


def _of_job(folder: Path, what: str, name: str, job: dict) -> Made:
    write_job(folder, job)
    code, _, said = command(folder, what, "job.toml")
    if code == 2:
        raise RuntimeError(said)
    return name, ("table", name)


def _peaks(folder: Path) -> Made:
    job = wedge(force=1.0) | {"sweep": {"start_hz": 150.0, "stop_hz": 85.0}, "balance": {"harmonics": 3}}
    return _of_job(folder, "peak", "peaks.h5", job | {"peak": {"start": 10.0, "stop": 11.0, "file": "peaks.h5"}})


def _fit(folder: Path) -> Made:
    measured(folder, rubbing())
    write_fit(folder, file="fit.h5")
    command(folder, "fit", "fit.toml")
    return "fit.h5", ("table", "fit.h5")


def _study(folder: Path) -> Made:
    job = wedge(force=1.0) | {"sweep": {"start_hz": 150.0, "stop_hz": 85.0}, "balance": {"harmonics": 3}}
    write_job(folder, job | {"peak": {"start": 10.0, "stop": 10.5}})
    vary = [{"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.3, "high": 0.6}]
    write_job(folder, {"job": "job.toml", "file": "study.h5", "samples": 3, "vary": vary}, "study.toml")
    command(folder, "study", "study.toml")
    return "study.h5", ("table", "study.h5")


def _campbell(folder: Path) -> Made:
    write_blocks(folder / "model.h5")
    spin = {"kind": "centrifugal", "axis_point": [0.0, 0.0, 0.0], "axis_direction": [0.0, 0.0, 1.0], "speed_hz": 1.0}
    job = blocks()
    job["load"].append(spin | {"name": "spin"})
    job["campbell"] = {"speeds_hz": [0.0, 1.0], "modes": 3}
    return _of_job(folder, "campbell", "result.campbell.h5", job)


def _journal(folder: Path) -> Made:
    """What a run that was killed has left."""
    job = chain(contacts=5) | {"sweep": {"start_hz": 84.0, "stop_hz": 76.0}, "continuation": {"max_points": 60}}
    job["output"]["file"] = "result.h5"
    write_job(folder, job)
    left = folder / "result.h5.partial"
    run = subprocess.Popen([sys.executable, "-m", "attrito.cli", "run", "-q", "job.toml"], cwd=folder)
    while run.poll() is None and not (
        left.exists() and is_journal(left) and len(list(read_journal(str(left)))) > POINTS
    ):
        time.sleep(0.005)
    if run.poll() is not None:
        raise RuntimeError("the run has ended before it was killed: no journal is left")
    run.send_signal(signal.SIGKILL)
    run.wait()
    return "result.h5.partial", ("table", "result.h5.partial")


KINDS: dict[str, Callable[[Path], Made]] = {
    "model": lambda folder: _blocks(folder, "model.h5"),
    "rom": lambda folder: _blocks(folder, "rom.h5"),
    "result": lambda folder: _blocks(folder, "result.h5"),
    "peak": _peaks,
    "mode": lambda folder: _of_job(folder, "mode", "result.mode.h5", mode_job()),
    "linear modes": lambda folder: _of_job(folder, "linear-modes", "result.modes.h5", mode_job()),
    "fit": _fit,
    "study": _study,
    "campbell": _campbell,
    "journal": _journal,
}


def look_at(kind: str, flips: int, seed: int) -> dict[str, int]:
    """How flips in files of a kind end."""
    chance, ends = random.Random(f"{seed} {kind}"), Counter({"refused": 0, "same": 0, "silent": 0})
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        name, reader = KINDS[kind](folder)
        path = folder / name
        good = path.read_bytes()
        places = numbers(path) if name.endswith(".h5") else [("", 0, len(good))]
        code, whole, said = command(folder, *reader)
        if code == 2:
            raise RuntimeError(f"{kind}: {said}")
        for _ in range(flips):
            dataset, start, size = chance.choice(places)
            bad, at = bytearray(good), start + chance.randrange(size)
            bad[at] ^= 1 << chance.randrange(8)
            path.write_bytes(bad)
            code, found, said = command(folder, *reader)
            if code == 2 and name in said:
                ends["refused"] += 1
            elif code != 2 and found == whole and reader[0] == "table":
                ends["same"] += 1
            elif code != 2 and kind == "journal" and whole.startswith(found):
                ends["cut"] += 1
            else:
                ends["silent"] += 1
                print(f"{kind}: bit at byte {at} of {dataset}: exit {code}, {said}", file=sys.stderr, flush=True)
    print(f"{kind}: {dict(ends)}", file=sys.stderr, flush=True)
    return dict(ends)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flips", type=int, default=300, help="in files of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, action="append", help="these alone")
    options = parser.parse_args()
    ends = {kind: look_at(kind, options.flips, options.seed) for kind in options.kind or KINDS}
    print(json.dumps(ends | {"silent": sum(one["silent"] for one in ends.values())}, indent=1))
