"""Are the errors of peaks and of dissipated energy estimated? Scenes of the campaign, compared with long series.

    .venv/bin/python benchmarks/campaign_estimates.py --peaks 300 --energies 300 --seed 11 --keep estimates.jsonl
    .venv/bin/python benchmarks/campaign_estimates.py --seed 11 --first 17 --scenes 1 --verbose

Scenes are those of `campaign_scenes.py`. Each is solved with `attrito peak`'s first series, five harmonics, without a
tolerance, so that there are errors to be estimated: its peak at the level of the scene, and the points of its sweep.
The references are the same from there with 60 harmonics, if those with 40 differ from them by no more than a third of
the error; an error below `LEAST` is none. An estimate holds if the error is at most three times it. A scene takes
`--seconds` of the processor at most, or is passed over.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import campaign_scenes
import numpy as np
from campaign_truth import FEWER_HARMONICS, HARMONICS, PATH, Solved
from mpi4py import MPI

from attrito.library.peak_tracker import Peak, PeakTracker, Start
from attrito.library.points import Point, StoredPoint
from attrito.library.session import Options, Solver
from attrito.support.errors import NumericsError

FIRST_HARMONICS, FIRST_SAMPLES = 5, 128
SAMPLES = 2048
# Errors below are not held against their estimate
LEAST = 1e-6
# How far the series that stand for the truth may differ, parts of the error; and what an estimate may miss
AGREEMENT, FACTOR = 1.0 / 3.0, 3.0
# A motion whose amplitude differs by more than this part is another one, which no estimate sees
OTHER = 0.5
# Points of a scene's sweep, which are alike
POINTS = (1, 3)


def options_of(scene: campaign_scenes.Scene, harmonics: int, samples: int) -> Options:
    """Fixed series, no tolerance."""
    harmonics = max(harmonics, scene.loaded_harmonics)
    return Options(harmonics=harmonics, samples=max(samples, 6 * harmonics + 2))


class Series:
    """A scene on one series; use it in a `with` block."""

    def __init__(self, scene: campaign_scenes.Scene, harmonics: int, samples: int):
        self._scene = scene
        self.solver = Solver(MPI.COMM_SELF, scene.reduced, options_of(scene, harmonics, samples))
        self.solver.follow_static_path(PATH, 10, scene.frequencies_hz[0])
        frequencies = scene.frequencies_hz
        self.band = 0.5 * min(frequencies), 1.5 * max(frequencies)
        factors = np.ones(len(scene.reduced.static))
        self.tracker = PeakTracker(self.solver, 0, "half_range", self.band, factors)

    def __enter__(self) -> Series:
        return self

    def __exit__(self, *_: object) -> None:
        self.solver.close()

    def contacts(self) -> dict[str, np.ndarray]:
        """Of the last point: work of each contact and its estimated error, sliders."""
        heard: dict[str, np.ndarray] = {}
        self.solver.report_point(lambda path, _what, entry: heard.__setitem__(path, entry))
        return {name: heard[f"/contacts/{name}"] for name in ("dissipated_energy", "dissipated_energy_error", "slider")}


def peak_of(scene: campaign_scenes.Scene, harmonics: int, samples: int, start: Start | None) -> tuple[Peak, Start]:
    """The peak at the scene's level: near a motion, or as `attrito peak` finds its first one."""
    with Series(scene, harmonics, samples) as series:
        tracker = series.tracker
        peak = tracker.begin_near(start, 1.0) if start else tracker.begin(1.0, tracker.linear_peak_hz())
        return peak, tracker.start(peak.frequency_hz)


def point_of(scene: campaign_scenes.Scene, solved: Solved, harmonics: int) -> tuple[Point, float]:
    """A point of the sweep and what all contacts dissipate, from the point's own motion and sliders."""
    with Series(scene, harmonics, SAMPLES) as series:
        solver = series.solver
        solver.set_excitation(solved.frequency_hz, solved.frequency_hz, 1.0)
        if not solver.start_from(StoredPoint(solved.frequency_hz, solved.coordinates, solved.slider), 1.0):
            raise NumericsError("not converged")
        point = next(solver.go_on_at([solved.frequency_hz], 0))
        return point, float(np.nansum(series.contacts()["dissipated_energy"]))


def judged(
    found: dict[str, float], near: dict[str, float], truth: dict[str, float], estimates: dict[str, float]
) -> dict:
    """Errors of some quantities and their estimates; `near`: those of the shorter long series."""
    row: dict = {}
    if abs(found["amplitude"] / truth["amplitude"] - 1.0) > OTHER:
        return {"outcome": "another motion"}
    for name, estimate in estimates.items():
        error, open_ = (abs(one[name] / truth[name] - 1.0) if truth[name] else 0.0 for one in (found, near))
        known = open_ <= max(AGREEMENT * error, LEAST)
        row[name] = {"error": error, "known": known, "estimate": None if np.isnan(estimate) else estimate}
    return {"outcome": "judged", **row}


def look_at_peak(scene: campaign_scenes.Scene) -> dict:
    """The scene's peak."""
    peak, start = peak_of(scene, FIRST_HARMONICS, FIRST_SAMPLES, None)
    if peak.outcome == "not_converged":
        return {"outcome": "no peak"}
    about = {"at_corner": peak.at_corner, "states": list(peak.point.states), "point": peak.point.estimate}
    if sum(peak.point.states[2:]) == 0:
        return {"outcome": "all stick", **about}
    truth, there = peak_of(scene, HARMONICS, SAMPLES, start)
    near = peak_of(scene, FEWER_HARMONICS, SAMPLES, there)[0] if truth.outcome != "not_converged" else truth
    if "not_converged" in (truth.outcome, near.outcome):
        return {"outcome": "no reference", **about}
    numbers = [{"amplitude": one.amplitude, "frequency": one.frequency_hz} for one in (peak, near, truth)]
    return about | judged(*numbers, {"amplitude": peak.amplitude_error, "frequency": peak.frequency_error})


def look_at_energies(scene: campaign_scenes.Scene) -> Iterator[dict]:
    """Points of the scene's sweep."""
    solved = []
    with Series(scene, FIRST_HARMONICS, FIRST_SAMPLES) as series:
        for i, point in enumerate(series.solver.solve_at(scene.frequencies_hz, 1.0, 0)):
            if i in POINTS and point.outcome not in ("not_converged", "no_period_one_orbit"):
                contacts, coordinates = series.contacts(), series.solver.coordinates()
                at = Solved(point.frequency_hz, float(point.amplitude[0]), coordinates, contacts["slider"])
                solved.append((point, at, contacts))
    for point, at, contacts in solved:
        about = {"states": list(point.states), "point": point.estimate}
        energy, error = (float(np.sum(contacts[f"dissipated_energy{name}"])) for name in ("", "_error"))
        if sum(point.states[2:]) == 0 or energy <= 0.0:
            yield {"outcome": "nothing dissipated", **about}
            continue
        try:
            (fine, most), (coarse, fewer) = (point_of(scene, at, one) for one in (HARMONICS, FEWER_HARMONICS))
        except NumericsError:
            yield {"outcome": "no reference", **about}
            continue
        if "not_converged" in (fine.outcome, coarse.outcome):
            yield {"outcome": "no reference", **about}
            continue
        pairs = ((at.amplitude, energy), (float(coarse.amplitude[0]), fewer), (float(fine.amplitude[0]), most))
        numbers = [{"amplitude": amplitude, "energy": work} for amplitude, work in pairs]
        yield about | judged(*numbers, {"energy": error / most if most else 0.0})


def replies_of(seed: int, number: int, kinds: list[str], seconds: int) -> list[dict]:
    """What is found of a scene, by a process of its own that ends when its time is up."""
    answer, question = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(answer)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        with os.fdopen(question, "w") as stream:
            scene = campaign_scenes.make(seed, number)
            try:
                rows = [{"kind": "peak", **look_at_peak(scene)}] if "peak" in kinds else []
                rows += [{"kind": "energy", **row} for row in look_at_energies(scene)] if "energy" in kinds else []
            except NumericsError as error:
                rows = [{"kind": "scene", "outcome": str(error)}]
            json.dump(rows, stream)
        os._exit(0)
    os.close(question)
    with os.fdopen(answer) as stream:
        written = stream.read()
    os.waitpid(child, 0)
    rows = json.loads(written) if written else [{"kind": "scene", "outcome": "out of time"}]
    return [{"scene": number, "seed": seed, **row} for row in rows]


def holds(one: dict) -> bool:
    """Whether an estimate holds; an error that is not known to be is not passed over in silence."""
    return one["error"] <= LEAST or one["estimate"] is None or one["error"] <= FACTOR * one["estimate"]


def summary(rows: list[dict]) -> dict:
    """Shares of the estimates that hold."""
    found: dict = {"scenes": len({row["scene"] for row in rows})}
    for kind, names in (("peak", ("amplitude", "frequency")), ("energy", ("energy",))):
        own = [row for row in rows if row["kind"] == kind]
        found[kind] = dict(Counter(row["outcome"] for row in own))
        for name in names:
            known = [row[name] for row in own if row["outcome"] == "judged" and row[name]["known"]]
            of = np.array([one["estimate"] / one["error"] for one in known if one["estimate"] and one["error"] > LEAST])
            found[f"{kind}, {name}"] = {
                "judged": len(known),
                "hold, %": 100.0 * float(np.mean([holds(one) for one in known])) if known else None,
                "not known": sum(one["estimate"] is None for one in known),
                "estimate over error, quantiles 3, 50, 97 %": np.quantile(of, [0.03, 0.5, 0.97]).tolist()
                if len(of)
                else None,
                "largest error": max((one["error"] for one in known), default=None),
            }
    return found


def main() -> None:
    """Look, keep, report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--peaks", type=int, default=300, help="to be judged")
    parser.add_argument("--energies", type=int, default=300, help="to be judged")
    parser.add_argument("--scenes", type=int, default=2000, help="at most")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=int, default=20, help="of the processor, a scene")
    parser.add_argument("--keep", metavar="FILE", help="JSON lines; a campaign goes on from there")
    parser.add_argument("--report-only", action="store_true", help="of what --keep has")
    parser.add_argument("--verbose", action="store_true", help="a line each")
    arguments = parser.parse_args()
    kept = Path(arguments.keep) if arguments.keep else None
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept and kept.exists() else []

    def count(kind: str) -> int:
        return sum(row["kind"] == kind and row["outcome"] == "judged" for row in rows)

    done = {row["scene"] for row in rows}
    for number in range(arguments.first, arguments.first + arguments.scenes):
        if arguments.report_only or (count("peak") >= arguments.peaks and count("energy") >= arguments.energies):
            break
        if number in done:
            continue
        wanted = {"peak": arguments.peaks, "energy": arguments.energies}
        kinds = [kind for kind, most in wanted.items() if count(kind) < most]
        replies = replies_of(arguments.seed, number, kinds, arguments.seconds)
        rows += replies
        if kept:
            with kept.open("a") as stream:
                stream.writelines(json.dumps(reply) + "\n" for reply in replies)
        for reply in replies if arguments.verbose else []:
            print(json.dumps(reply), flush=True)
        common.progress(f"scene {number}: {count('peak')} peaks, {count('energy')} energies")
    common.report(summary(rows))


if __name__ == "__main__":
    main()
