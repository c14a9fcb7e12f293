"""What a tolerance costs: the counted work of a job with it against that of the cheapest fixed series that holds it.

Errors are those of the monitors' amplitudes at listed frequencies where contacts slip, against a long series;
a way that errs by less than the tolerance at all holds it. Work is counted for the list and for a
sweep of the job's band, both at the job's last level. Ratios beyond 3 are too many.

    benchmarks/tolerance_cost.py input/blade.toml input/lap_joint.toml input/wedge.toml input/damper.toml
"""

from __future__ import annotations

import argparse
import contextlib
import json
import tempfile
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import attrito
from attrito.results.result import Result
from attrito.support.errors import NumericsError

TOLERANCES = (1e-2, 1e-3, 1e-4)
HARMONICS = (1, 3, 5, 7, 9, 13, 19, 25)
REFERENCE = {"harmonics": 41}
FREQUENCIES = 12


def load(path: str) -> tuple[dict[str, Any], Path]:
    """A job of one level, without bounds and stability, and its folder."""
    job = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    job["sweep"] = {key: job["sweep"][key] for key in ("start_hz", "stop_hz")} | {
        "levels": [job["sweep"].get("levels", [1.0])[-1]]
    }
    job["static"] = job.get("static", {}) | {"bounds": "none"}
    return {key: table for key, table in job.items() if key not in ("stability", "peak")}, Path(path).parent


def run(job: dict[str, Any], folder: Path, balance: dict[str, Any], frequencies: list[float] | None) -> dict[str, Any]:
    """Work and points of a job on a series, swept or at listed frequencies."""
    with tempfile.TemporaryDirectory() as place:
        made = job | {"balance": balance, "output": job["output"] | {"file": f"{place}/r.h5"}}
        if frequencies is not None:
            made["sweep"] = {"frequencies_hz": frequencies, "levels": job["sweep"]["levels"]}
        with contextlib.suppress(NumericsError):
            attrito.run(made, folder=str(folder), quiet=True).close()
        with Result(f"{place}/r.h5") as result:
            return {
                "work": float(result.array("/points/work")[-1]),
                "hz": result.array("/points/frequency_hz"),
                "solved": result.converged,
                "amplitudes": np.array([result.monitor(name, "amplitude") for name in result.monitors]),
                "estimate": result.array("/points/estimate"),
                "harmonics": int(result.array("/points/harmonics").max()),
            }


def slipping(job: dict[str, Any], folder: Path) -> list[float]:
    """Frequencies of a sweep's resonance where some contact slips, in its order."""
    swept = run(job, folder, {}, None)
    there = np.flatnonzero(swept["estimate"] > 0.0)
    hz = np.unique(swept["hz"][there])
    hz = hz[np.unique(np.linspace(0, len(hz) - 1, FREQUENCIES).astype(int))]
    return (hz if job["sweep"]["stop_hz"] > job["sweep"]["start_hz"] else hz[::-1]).tolist()


def error_of(way: dict[str, Any], reference: dict[str, Any]) -> float:
    """Largest relative error of an amplitude, as estimates are relative; infinite where a point is missing."""
    if not np.all(way["solved"]) or len(way["hz"]) != len(reference["hz"]):
        return float("inf")
    true = reference["amplitudes"]
    return float(np.max(np.abs(way["amplitudes"] - true) / np.maximum(true, 1e-3 * true.max(axis=0))))


def look(path: str, tolerances: list[float]) -> None:
    """Print a line for each way of solving a job."""
    job, folder = load(path)
    hz = slipping(job, folder)
    reference = run(job, folder, REFERENCE, hz)
    fixed = []

    def say(balance: dict[str, Any]) -> dict[str, float]:
        listed = run(job, folder, balance, hz)
        swept = run(job, folder, balance, None)
        one = {"error": error_of(listed, reference), "list": listed["work"], "sweep": swept["work"]}
        print(json.dumps({"job": path, "H": swept["harmonics"]} | balance | one), flush=True)
        return one

    for harmonics in HARMONICS:
        if not fixed or min(one["error"] for one in fixed) > min(tolerances):
            fixed.append(say({"harmonics": harmonics}))
    for tolerance in tolerances:
        way = say({"tolerance": tolerance})
        holding = [one for one in fixed if one["error"] <= tolerance]
        ratios = {
            kind: way[kind] / min(one[kind] for one in holding) if holding else float("nan")
            for kind in ("list", "sweep")
        }
        print(f"{path}: tolerance {tolerance:g}: error {way['error']:.1e}, work of a list {ratios['list']:.2f}, of a"
              f" sweep {ratios['sweep']:.2f} times that of the cheapest fixed series", flush=True)  # fmt: skip


def main() -> None:
    """Print, for each job and tolerance, the ratio of works."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("jobs", nargs="+")
    parser.add_argument("--tolerance", type=float, action="append", help="(default: 0.01, 0.001, 0.0001)")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    for path in options.jobs:
        look(path, options.tolerance or list(TOLERANCES))


if __name__ == "__main__":
    main()
