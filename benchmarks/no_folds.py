"""Random scenes on which theory excludes folds: contacts of constant normal force on a structure with viscous damping.

The velocity of their periodic motion is unique, that of the exact equations and of the balance at any number of
harmonics if it is evaluated exactly. So a sweep has no fold, one branch, no unstable point, and every point converges.

    benchmarks/no_folds.py --scenes 500 --tangents 1
    benchmarks/no_folds.py --scenes 100 --tangents 2 --set harmonics=7
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import attrito
from attrito.support.errors import NumericsError


def make(seed: int, number: int, tangents: int) -> dict[str, Any]:
    """The job of a seed and a number."""
    random = np.random.default_rng([seed, number])
    n = int(random.integers(2, 6))
    contacts = int(random.integers(1, 4))
    frame = np.linalg.qr(random.normal(size=(n, n)))[0]
    natural = np.sort(random.uniform(50.0, 300.0, n)) * 2.0 * np.pi
    mass = np.diag(random.uniform(0.8, 2.0, n))
    root = np.sqrt(mass)
    stiffness = root @ frame @ np.diag(natural**2) @ frame.T @ root
    ratio = 10 ** random.uniform(-2.5, -1.5)
    damping = root @ frame @ np.diag(2.0 * ratio * natural) @ frame.T @ root
    load = random.normal(size=n)
    load *= 20.0 / np.linalg.norm(load)
    tables = []
    for _ in range(contacts):
        directions = np.linalg.qr(random.normal(size=(max(n, 2), tangents)))[0].T[:, :n]
        rows = [[[dof, float(value)] for dof, value in enumerate(row)] for row in directions]
        kt = float(natural[0] ** 2 * 10 ** random.uniform(-1.0, 1.0))
        # The limit is a part of the force of the spring in the resonance of the stuck structure.
        limit = 10 ** random.uniform(-1.0, 0.8) * 20.0
        tables.append(
            {"tangents": rows, "tangential_stiffness": kt, "friction_coefficient": 0.5, "preload": 2.0 * limit}
        )
    rows = np.array([[value for _, value in row] for one in tables for row in one["tangents"]])
    springs = np.repeat([one["tangential_stiffness"] for one in tables], tangents)
    stuck = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness + rows.T @ (springs[:, None] * rows))).real)
    ends = [1.2 * float(stuck.min()) / (2.0 * np.pi), 0.7 * float(natural[0]) / (2.0 * np.pi)]
    if random.random() < 0.5:
        ends.reverse()
    return {
        "model": {"mass": mass.tolist(), "stiffness": stiffness.tolist(), "damping": damping.tolist()},
        "contact": tables,
        "load": [{"kind": "harmonic", "cosine": [[dof, float(value)] for dof, value in enumerate(load)]}],
        "sweep": {"start_hz": ends[0], "stop_hz": ends[1]},
        "stability": {"method": "monodromy"},
        "static": {"bounds": "none"},
        "output": {"file": "r.h5", "monitors": [{"name": "q0", "dofs": [[0, 1.0]]}]},
    }


def look(job: dict[str, Any], folder: str) -> dict[str, Any]:
    """What the sweep of a job came to."""
    begin = time.process_time()
    try:
        result = attrito.run(job, folder=folder, quiet=True)
    except NumericsError as error:
        return {"error": str(error)}
    with result:
        points = result.points
        return {
            "points": len(points.branch),
            "branches": len(np.unique(points.branch)),
            "folds": sum("fold" in str(kind) for kind in result.bifurcations.kind.labels),
            "others": sorted({str(one) for one in points.outcome.labels} - {"converged"}),
            "iterations": int(np.sum(points.iterations)),
            "seconds": time.process_time() - begin,
        }


def main() -> None:
    """Print a line for each scene that is not as theory has it, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=26)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=30)
    parser.add_argument("--tangents", type=int, choices=(1, 2), default=1)
    parser.add_argument("--set", action="append", default=[], help="key=value of [balance], such as harmonics=7")
    options = parser.parse_args()
    balance = {key: json.loads(value) for key, value in (one.split("=", 1) for one in options.set)}
    warnings.simplefilter("ignore")
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.first, options.first + options.scenes):
            job = make(options.seed, number, options.tangents) | ({"balance": balance} if balance else {})
            one = look(job, folder)
            found.append(one)
            if "error" in one or one["folds"] or one["branches"] > 1 or one["others"]:
                print(number, json.dumps(one), flush=True)
            Path(folder, "r.h5").unlink(missing_ok=True)
    solved = [one for one in found if "error" not in one]
    print(
        f"{len(found)} scenes: {len(found) - len(solved)} errors, {sum(one['folds'] > 0 for one in solved)} fold"
        f" ({sum(one['folds'] for one in solved)} folds),"
        f" {sum(one['branches'] > 1 for one in solved)} have more branches,"
        f" {sum(bool(one['others']) for one in solved)} have points of other outcomes;"
        f" {sum(one['points'] for one in solved)} points, {sum(one['iterations'] for one in solved)} iterations,"
        f" {sum(one['seconds'] for one in solved):.0f} s"
    )


if __name__ == "__main__":
    main()
