"""A record of what the program finds, replayed before a change of its inside lands: which numbers does it move?

    benchmarks/record.py keep /tmp/record          # at the commit to compare with
    benchmarks/record.py replay /tmp/record        # at the commit to land

Random scenes, sweeps, peaks, modes and paths in time are run by the command line, some of them on 1, 2 and 4 ranks, and
their files kept. A replay prints a line for each that differs: how many numbers, the largest difference of a dataset
relative to its largest number, points, outcomes and counted work. It ends with exit code 1 if there is any: a
difference has its reason in the commit.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import no_folds
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "python"))

from jobs import ENVIRONMENT, blocks, chain, swept, toml, wedge, write_blocks  # noqa: E402 (a folder of scripts)

# What is a clock's, a machine's, or the program's version's
APART = ("seconds", "memory", "host", "version", "date", "text", "resident")


def jobs() -> Iterator[tuple[str, str, dict[str, Any], int]]:
    """Name, command, job and ranks of each case."""
    inputs = {
        "wedge": "run",
        "wedge_horizontal": "run",
        "wedge_isola": "run",
        "wedge_flutter": "mode",
        "wedge_peak": "peak",
    }
    for name, command in inputs.items():
        yield name, command, tomllib.loads((ROOT / "input" / f"{name}.toml").read_text(encoding="utf-8")), 1
    light = wedge()
    light["model"]["damping"] = (2 * np.pi * np.eye(2)).tolist()
    yield "mode", "mode", light | {"balance": {"harmonics": 7}, "mode": {"start": 1e-6, "stop": 3e-3, "points": 18}}, 1
    quasi = {"start": 1e-6, "stop": 3e-3, "points": 12, "method": "quasi_static"}
    yield "quasi_static", "mode", light | {"mode": quasi}, 1
    in_time = {"frequency_hz": 132.0, "steps_per_period": 100, "cycles": 20}
    yield "in_time", "integrate", wedge() | {"integrate": in_time}, 1
    for tangents in (1, 2):
        for number in range(12):
            yield f"scene_{tangents}_{number}", "run", no_folds.make(77, number, tangents), 1
        for ranks in (1, 2, 4):
            for kind, job in (("chain", swept(chain(6, tangents), 140.0, 60.0)), ("levels", with_levels(tangents))):
                yield f"{kind}_{tangents}_on_{ranks}", "run", job, ranks
    for ranks in (1, 2, 4):
        yield f"blocks_on_{ranks}", "run", swept(blocks(), 90.0, 40.0), ranks


def with_levels(tangents: int) -> dict[str, Any]:
    """Listed frequencies at three levels, with verdicts and derivatives."""
    job = chain(4, tangents)
    job["sweep"] = {"frequencies_hz": [60.0, 80.0, 100.0], "levels": [0.5, 1.0, 2.0]}
    return job | {"stability": {"method": "both"}}


def run(folder: Path, name: str, command: str, job: dict[str, Any], ranks: int) -> Path:
    """The file that a case leaves."""
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    if "file" in job["model"]:
        write_blocks(place / "model.h5")
    job = job | {"output": job["output"] | {"file": "result.h5"}}
    for table in ("peak", "mode"):
        if "file" in job.get(table, {}):
            job[table] = job[table] | {"file": "result.h5"}
    (place / "job.toml").write_text(toml(job))
    line = [sys.executable, "-m", "attrito.cli", command, "job.toml", "-q"]
    if ranks > 1:
        line = ["mpirun", "--oversubscribe", "--allow-run-as-root", "-n", str(ranks), *line]
    environment = os.environ | ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(line, cwd=place, env=environment, capture_output=True, text=True)
    (place / "exit.json").write_text(json.dumps(done.returncode))
    files = sorted(place.glob("result*.h5"))
    if not files:
        raise SystemExit(f"{name}: exit code {done.returncode}, no file\n{done.stdout}{done.stderr}")
    return files[0]


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Datasets of a file that are the program's findings."""
    found: dict[str, np.ndarray] = {}

    def take(name: str, node: h5py.Dataset | h5py.Group) -> None:
        if isinstance(node, h5py.Dataset) and not any(part in name for part in APART) and node.dtype.kind in "fiuc":
            found[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(take)
    return found


def compare(before: dict[str, np.ndarray], now: dict[str, np.ndarray]) -> str:
    """What differs, in a line; empty: not a bit."""
    names = sorted(before.keys() | now.keys())
    lost = [name for name in names if name not in before or name not in now]
    shared = [name for name in names if name not in lost]
    changed = [name for name in shared if before[name].tobytes() != now[name].tobytes()]
    if not (lost or changed):
        return ""
    words = [f"{len(changed)} of {len(shared)} datasets differ"] + ([f"not in both: {', '.join(lost)}"] if lost else [])
    sizes = [name for name in changed if before[name].shape != now[name].shape]
    if sizes:
        words.append(f"sizes of {len(sizes)}, as {sizes[0]} {before[sizes[0]].shape} -> {now[sizes[0]].shape}")
    worst = max(((distance(before[name], now[name]), name) for name in changed if name not in sizes), default=None)
    if worst:
        words.append(f"by up to {worst[0]:.1e} ({worst[1]})")
    if "points/work" in shared and before["points/work"].size and now["points/work"].size:
        words.append(f"work times {now['points/work'].ravel()[-1] / max(before['points/work'].ravel()[-1], 1.0):.4f}")
    return "; ".join(words)


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference by the largest number; infinite if one is not a number and the other is."""
    if np.any(np.isnan(a) != np.isnan(b)):
        return float("inf")
    scale = float(np.nanmax(np.abs(a), initial=0.0))
    apart = float(np.nanmax(np.abs(np.subtract(a, b, dtype=complex)), initial=0.0))
    return apart / scale if scale > 0.0 else apart


def main() -> int:
    """Keep the record, or replay it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("keep", "replay"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="cases whose name begins so")
    options = parser.parse_args()
    cases = [case for case in jobs() if case[0].startswith(options.only)]
    different = 0
    for name, *case in cases:
        file = run(options.folder / ("kept" if options.what == "keep" else "now"), name, *case)
        if options.what == "keep":
            continue
        kept = options.folder / "kept" / name
        words = compare(numbers(kept / file.name), numbers(file))
        codes = [json.loads((place / "exit.json").read_text()) for place in (kept, file.parent)]
        if codes[0] != codes[1]:
            words = f"exit code {codes[0]} -> {codes[1]}; {words}"
        if words:
            different += 1
            print(f"{name}: {words}", flush=True)
    print(f"{len(cases)} cases, {different} of them differ" if options.what == "replay" else f"{len(cases)} cases kept")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
