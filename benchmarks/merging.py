"""Pairs merged into patches against all pairs, at every point: errors, what was estimated of them, and time.

    .venv/bin/python benchmarks/merging.py [--job input/lap_joint.toml] [--tolerance 0.01] [--output merging.csv]

The job's first level is swept with all pairs; the frequencies of that sweep are then solved one by one, with all pairs
and with `[balance] contacts = "auto"`, both with the job's own harmonics and samples. The job's model must be there. A
row a point:

- `amplitude`: relative difference of the first monitor's amplitude, and `estimate`, what patches were estimated to add;
- `damping`: relative difference of what all contacts dissipate, and `estimate_damping`;
- `share`: part of the loads' work that contacts dissipate, all pairs, where the load is a unit cosine at the first
  monitor; `patches`: how many there were.

JSON on standard output: the largest of each, and seconds of the processor of the points, without statics.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI

from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.patches.solver import PatchedSolver, places_of
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options

ROOT = Path(__file__).resolve().parent.parent
MOST_POINTS = 1000
# Part of the loads' work below which nothing is dissipated but by rounding
ROUNDING = 1e-8
REPORTED = ("error_contacts", "error_dissipation", "patches")


def points_of(solver: Solver, job: dict, load_path: np.ndarray, frequencies: list[float], level: float) -> dict:
    """Amplitude, dissipation and what is reported of each listed frequency."""
    solver.follow_static_path(load_path, job["static"]["steps"], min(frequencies))
    found: dict[str, list[float]] = {}
    begun = time.process_time()
    for point in solver.solve_at(frequencies, level, 0):
        heard: dict[str, np.ndarray] = {}
        solver.report_point(lambda path, _, values, into=heard: into.update({path: values}))
        one = {
            "seconds": time.process_time() - begun,
            "solved": float(point.is_solved),
            "amplitude": float(point.amplitude[0]),
            "dissipated": float(np.nansum(heard["/contacts/dissipated_energy"])),
            "harmonics": point.harmonics[0, :3],
        }
        one |= {name: float(heard.get(f"/points/{name}", np.nan)) for name in REPORTED}
        for name, value in one.items():
            found.setdefault(name, []).append(value)
    return {name: np.array(values) for name, values in found.items()}


def all_pairs(job: Job, scene: Scene, reduced: ReducedScene, settings: Options, file: Path | None) -> dict:
    """What all pairs have at the frequencies of the sweep of the job's first level; kept in a file, if there is one."""
    if file and file.is_file():
        with np.load(file) as stored:
            return dict(stored)
    level, path = float(job["sweep"]["levels"][0]), scene.load_path
    band = job["sweep"]["start_hz"], job["sweep"]["stop_hz"]
    with Solver(MPI.COMM_SELF, reduced, settings) as solver:
        solver.follow_static_path(path, job["static"]["steps"], band[0])
        swept = [point.frequency_hz for point in solver.sweep(*band, level, 0, MOST_POINTS) if point.is_solved]
    frequencies = np.unique(np.round(swept, 6)).tolist()
    with Solver(MPI.COMM_SELF, reduced, settings) as solver:
        found = points_of(solver, job, path, frequencies, level) | {"frequency_hz": np.array(frequencies)}
    if file:
        np.savez(file, **found)
    return found


def compared(truth: dict, merged: dict, level: float) -> dict[str, np.ndarray]:
    """The columns of the table: patches beside all pairs, point by point."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "frequency_hz": truth["frequency_hz"],
            "patches": merged["patches"],
            "amplitude": merged["amplitude"] / truth["amplitude"] - 1.0,
            "estimate": merged["error_contacts"],
            "damping": merged["dissipated"] / truth["dissipated"] - 1.0,
            "estimate_damping": merged["error_dissipation"],
            "share": truth["dissipated"] / (np.pi * level * np.abs(truth["harmonics"][:, 2])),
        }


def largest(rows: dict[str, np.ndarray]) -> dict[str, float]:
    """The largest errors, and the least that estimates were of them."""
    slips = rows["share"] > ROUNDING
    own = np.abs(rows["damping"][slips])
    # Errors of rounding and of the solver's tolerance are nothing that an estimate is to tell.
    felt = np.abs(rows["amplitude"]) > 1e-5
    return {
        "amplitude, largest error": float(np.abs(rows["amplitude"]).max()),
        "estimate by error, least": float((rows["estimate"] / np.abs(rows["amplitude"]))[felt].min(initial=np.inf)),
        "damping, largest error": float(own.max(initial=0.0)),
        "damping, points above 5 %": int(np.sum(own > 0.05)),
        "estimate of damping by error, least": float(
            (rows["estimate_damping"][slips] / own)[own > 1e-3].min(initial=np.inf)
        ),
    }


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--job", type=Path, default=ROOT / "input/lap_joint.toml")
    parser.add_argument("--tolerance", type=float, default=0.01)
    parser.add_argument("--output", type=Path, help="CSV, a row a point")
    parser.add_argument("--all-pairs", type=Path, help="file that keeps what all pairs have, made if it is not there")
    options = parser.parse_args()
    job = read_job(str(options.job))
    scene = build_scene(job)
    progress = Progress(MPI.COMM_SELF)
    rom = make_rom(MPI.COMM_SELF, job, scene, progress.say, progress.step)[0]
    reduced, settings = reduced_scene(job, scene, rom), solver_options(job, rom)
    truth = all_pairs(job, scene, reduced, settings, options.all_pairs)
    level = float(job["sweep"]["levels"][0])
    band = job["sweep"]["start_hz"], job["sweep"]["stop_hz"]
    places = places_of(scene.contacts.tables, scene.contacts.places)
    with PatchedSolver(MPI.COMM_SELF, reduced, settings, places, options.tolerance, band) as solver:
        merged = points_of(solver, job, scene.load_path, truth["frequency_hz"].tolist(), level)
    rows = compared(truth, merged, level)
    if options.output:
        with open(options.output, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(rows)
            writer.writerows(zip(*rows.values(), strict=True))
    common.report(
        {
            "points": len(truth["frequency_hz"]),
            "pairs": len(places.tables),
            "unsolved": int(np.sum(1 - merged["solved"])),
            "patches": [float(f(merged["patches"])) for f in (np.min, np.mean, np.max)],
            **largest(rows),
            "seconds, all pairs": float(truth["seconds"][-1]),
            "seconds": float(merged["seconds"][-1]),
        }
    )


if __name__ == "__main__":
    main()
