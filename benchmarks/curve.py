"""Sweeps by the error of the drawn curve: how many points, how long, and how far the curve is from the truth.

    python benchmarks/curve.py [scene ...] [--points 1000] [--folder out/curve] [--before COMMAND] [--limit 600]

Scenes are the jobs `input/<scene>.toml` (wedge, strip, block, lap_joint, blade), whose models must be there. For each
level the truth is `--points` frequencies solved one by one, as dense along the curve as the sweep's own points are. Its
distance from the drawn curve is measured in the largest amplitude: at equal frequency (`worst_at_frequency`), and
across the curve (`worst_across`), frequencies then counting in thousandths of themselves. Where several solutions
coexist the listed point may be on another one; `other_branch` says how many differ by more than a fifth, which are
left out. `--before` is the command of another build of attrito, timed on the same jobs for at most `--limit` seconds.
JSON on standard output.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from attrito.results.curve import curve_of, points_along, stretches
from attrito.results.result import Result

ROOT = Path(__file__).parent.parent
SCENES = ("wedge", "strip", "block", "lap_joint", "blade")
# Pieces of the drawn curve between two points that distances are measured from
PIECES = 200
# Unit of frequencies across the curve, as the sweep's own; distance that is another solution
UNIT, ELSEWHERE = 1e-3, 0.2


def job_of(scene: str, folder: Path, output: str, sweep: str | None = None) -> Path:
    """The job of a scene with another output, without bounds, and with other lines in `[sweep]`."""
    text = (ROOT / f"input/{scene}.toml").read_text()
    lines, table = [], ""
    bounded = False
    for line in text.splitlines():
        table = line.strip() if line.startswith("[") else table
        key = line.split("=")[0].strip()
        if table.startswith("[output]") and key == "file":
            line = f'file = "{(folder / output).resolve()}"'
        if table.startswith("[sweep]") and sweep is not None and not line.startswith("["):
            continue
        lines.append(line.replace('"../', f'"{ROOT}/'))
        if line.startswith("[static]"):
            lines.append('bounds = "none"')
            bounded = True
        if line.startswith("[sweep]") and sweep is not None:
            lines.append(sweep)
    if not bounded:
        lines.append('[static]\nbounds = "none"')
    path = folder / f"{Path(output).stem}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def run(job: Path) -> float:
    """Run a job; returns its seconds. Points without a solution are in the result."""
    start = time.perf_counter()
    done = subprocess.run([Path(sys.executable).with_name("attrito"), "run", job], capture_output=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.decode())
    return time.perf_counter() - start


def truth(scene: str, folder: Path, result: Result, level: float, count: int) -> Path:
    """A result of so many listed frequencies of a level, as dense as the points of the sweep."""
    path = folder / f"{scene}.{level:g}.truth.h5"
    if not path.is_file():
        places = points_along(result, 20 * count)
        places = places[result.array("/points/level")[places.astype(int)] == level]
        frequency = np.sort(curve_of(result).at(places)[0])
        chosen = np.unique(np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(frequency)), frequency))
        listed = ", ".join(f"{one:.12g}" for one in chosen)
        run(job_of(scene, folder, path.name, f"frequencies_hz = [{listed}]\nlevels = [{level!r}]"))
    return path


def distances(result: Result, reference: Result, level: float, monitor: int) -> dict[str, float]:
    """Of the reference's points from the drawn curve of a level, part of the largest amplitude."""
    curve = curve_of(result)
    names = curve.monitors
    frequency = reference.array("/points/frequency_hz")
    true = reference.monitor(names[monitor], "amplitude")
    solved = reference.converged & np.isfinite(true)
    frequency, true = frequency[solved], true[solved]
    largest = true.max()
    across = np.full(len(true), np.inf)
    straight = np.full(len(true), np.inf)
    for run_ in stretches(result):
        if result.array("/points/level")[run_[0]] != level or len(run_) < 2:
            continue
        places = np.linspace(run_[0], run_[-1], PIECES * (len(run_) - 1) + 1)
        drawn = curve.at(places)[[0, 1 + monitor]]
        for i, (at, value) in enumerate(zip(frequency, true, strict=True)):
            x, y = (drawn[0] - at) / (UNIT * at), (drawn[1] - value) / largest
            across[i] = min(across[i], segments(x, y))
            inside = np.flatnonzero(x[1:] * x[:-1] <= 0)
            if len(inside):
                share = x[inside] / np.where(x[inside] == x[inside + 1], 1.0, x[inside] - x[inside + 1])
                straight[i] = min(straight[i], np.abs(y[inside] + share * (y[inside + 1] - y[inside])).min())
    other = across > ELSEWHERE
    return {
        "listed": len(true),
        "other_branch": int(other.sum()),
        "worst_across": float(across[~other].max()),
        "worst_at_frequency": float(straight[~other].max()),
        "peak_of_points": float(
            np.nanmax(np.where(result.array("/points/level") == level, curve.values[1 + monitor], 0))
        )
        / float(largest),
    }


def segments(x: np.ndarray, y: np.ndarray) -> float:
    """Distance of the origin from a line through points."""
    dx, dy = np.diff(x), np.diff(y)
    share = np.clip(-(x[:-1] * dx + y[:-1] * dy) / np.maximum(dx**2 + dy**2, 1e-300), 0, 1)
    return float(np.hypot(x[:-1] + share * dx, y[:-1] + share * dy).min())


def timed_before(command: str, job: Path, limit: float) -> dict[str, float | bool]:
    """Seconds and points of another build on a job, which is ended after a while."""
    start = time.perf_counter()
    done = subprocess.run([command, "run", "--max-seconds", str(limit), str(job)], capture_output=True, check=False)
    seconds = time.perf_counter() - start
    output = job.with_suffix(".h5")
    path = output if output.is_file() else output.with_name(f"{output.name}.partial")
    lines = subprocess.run([command, "table", path], capture_output=True, text=True, check=True).stdout.splitlines()
    return {"seconds": seconds, "points": len(lines) - 1, "finished": done.returncode == 0}


def measure(scene: str, options: argparse.Namespace) -> dict[str, object]:
    """One scene."""
    folder = options.folder
    found: dict[str, object] = {}
    if options.before:
        before = job_of(scene, folder, f"{scene}.before.h5")
        found["before"] = timed_before(options.before, before, options.limit)
    job = job_of(scene, folder, f"{scene}.h5")
    found["seconds"] = run(job)
    with Result(folder / f"{scene}.h5") as result:
        levels = result.array("/points/level")
        found |= {
            "points": result.points,
            "contacts": result.contacts,
            "iterations": int(result.array("/points/iterations").sum()),
            "without_a_solution": int((~result.converged).sum()),
        }
        for level in np.unique(levels).tolist() if options.points else []:
            with Result(truth(scene, folder, result, level, options.points)) as reference:
                names = result.monitors
                found[f"level {level:g}"] = {"points": int((levels == level).sum())} | {
                    name: distances(result, reference, level, monitor) for monitor, name in enumerate(names)
                }
    return found


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=SCENES, help="of wedge, strip, block, lap_joint, blade")
    parser.add_argument("--points", type=int, default=1000, help="listed frequencies a level; 0: no truth")
    parser.add_argument("--folder", type=Path, default=ROOT / "out/curve", help="where results go")
    parser.add_argument("--before", help="command of another build")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds that it may take a scene")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    json.dump({scene: measure(scene, options) for scene in options.scenes}, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
