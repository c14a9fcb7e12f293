"""Is the tolerance kept? Random scenes with tolerance 0.01, every converged point compared with the truth.

    .venv/bin/python benchmarks/campaign.py --scenes 800 --seed 5 --keep campaign.jsonl
    .venv/bin/python benchmarks/campaign.py --seed 5 --only-scene 17 --verbose
    .venv/bin/python benchmarks/campaign.py --scenes 300 --seed 6 --tangents 2 --keep two.jsonl
    .venv/bin/python benchmarks/campaign.py --keep campaign.jsonl --report-only --failures failures.csv
    .venv/bin/python benchmarks/campaign.py --scenes 200 --seed 5 --compare ../other

Scenes are those of `campaign_scenes.py`, truths those of `campaign_truth.py`, classes and shares those of
`campaign_report.py`. Options are those of a job with `tolerance = 0.01` and everything automatic. `--compare` solves
each scene alternately by this checkout and by another one, both built, and reports the ratio of their processor times.

Scenes are shared out to processes, each of which solves one at a time. Each way to a truth ends by itself after
`--truth-seconds` of the processor, all those of a scene after ten times that. A scene that takes longer than
`--seconds` by the clock is ended: it counts as skipped, its points that have no truth yet as without truth. But for
these limits, what a scene comes to depends on the seed and its number alone.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import campaign_report
import campaign_scenes
import numpy as np
from campaign_truth import PATH, Referee, Solved, Truth, Verdict
from mpi4py import MPI

from attrito.library.points import Point
from attrito.library.session import Options, Solver
from attrito.scene.solver_options import FIRST_HARMONICS, SAMPLES
from attrito.support.errors import NumericsError

TOLERANCE = 0.01
# A truth so near, in tolerances, needs no second one; every so many scenes all points have every truth
NEAR, EVERY = 0.5, 20
# Sweeps of each checkout, whose least time counts
REPEATS = 3


def options_of(scene: campaign_scenes.Scene) -> Options:
    """As a job's with a tolerance and nothing else."""
    harmonics = max(FIRST_HARMONICS, scene.loaded_harmonics)
    samples = max(SAMPLES, 6 * harmonics + 2)
    return Options(harmonics=harmonics, samples=samples, choose_harmonics=True, accepted_error=TOLERANCE)


def sweep(scene: campaign_scenes.Scene) -> Iterator[tuple[Point, Solved, float]]:
    """Points of a scene one by one, what a truth starts from, and processor time."""
    heard: dict[str, np.ndarray] = {}

    def hear(path: str, _what: object, entry: np.ndarray) -> None:
        heard[path] = entry

    with Solver(MPI.COMM_SELF, scene.reduced, options_of(scene)) as solver:
        solver.follow_static_path(PATH, 10, scene.frequencies_hz[0])
        points = solver.solve_at(scene.frequencies_hz, 1.0, 0)
        for _ in scene.frequencies_hz:
            started = time.process_time()
            point = next(points)
            seconds = time.process_time() - started
            solver.report_point(hear)
            solved = Solved(
                point.frequency_hz, float(point.amplitude[0]), solver.coordinates(), heard["/contacts/slider"]
            )
            yield point, solved, seconds


def examine(seed: int, number: int, tangents: int | None, truth_seconds: float, send: Callable[[dict], None]) -> None:
    """Solve a scene and judge its points; `send` gets the scene, its points, and each point again with its truth."""
    scene = campaign_scenes.make(seed, number, tangents)
    about = {"scene": number, "seed": seed, "structure": scene.structure, "classes": scene.classes}
    about |= {"ratio": scene.ratio, "lifted": scene.lifted, "tuned": scene.tuned, "tuned_state": scene.tuned_state}
    about |= {"damping": scene.reduced.damping_kind, "loads": scene.loaded_harmonics}
    send({"kind": "scene", **about, "points": len(scene.frequencies_hz)})
    try:
        solved = list(sweep(scene))
    except NumericsError as error:
        send({"kind": "unsolved", "scene": number, "seed": seed, "reason": str(error)})
        return
    points = [{"kind": "point", "scene": number, "seed": seed, "point": index, "classes": scene.classes}
              | row_of(point, seconds) for index, (point, _, seconds) in enumerate(solved)]  # fmt: skip
    send({"kind": "solved", "scene": number, "points": points})
    with Referee(scene.reduced, truth_seconds, 10.0 * truth_seconds) as referee:
        for row, (point, start, _) in zip(points, solved, strict=True):
            if point.outcome == "converged":
                started = time.process_time()
                row |= entry_of(referee.judge(start, NEAR * TOLERANCE, every=number % EVERY == 0))
                row["truth_seconds"] = time.process_time() - started
            send(row)


def row_of(point: Point, seconds: float) -> dict:
    """What the solver says of a point."""
    return {
        "frequency_hz": point.frequency_hz,
        "outcome": point.outcome,
        "amplitude": float(point.amplitude[0]),
        "estimate": point.estimate,
        "harmonics": point.harmonics.shape[1] // 2,
        "samples": point.samples,
        "states": list(point.states),
        "unique": point.unique,
        "iterations": point.iterations,
        "solve_seconds": seconds,
    }


def entry_of(verdict: Verdict) -> dict:
    """A verdict, for JSON."""

    def plain(truth: Truth) -> dict:
        return {name: value if value == value else None for name, value in asdict(truth).items()}

    error = None if verdict.truth is None else verdict.error
    return {
        "error": error,
        "truth": None if verdict.truth is None else plain(verdict.truth),
        "others": [plain(truth) for truth in verdict.others],
        "failures": verdict.failures,
    }


def taken_in(replies: list[dict], reply: dict) -> list[dict]:
    """Replies with one more: points come without their truths first, then one by one with them."""
    if reply["kind"] == "solved":
        return replies + reply["points"]
    if reply["kind"] == "point":
        return [reply if one["kind"] == "point" and one["point"] == reply["point"] else one for one in replies]
    return [*replies, reply]


def time_of(seed: int, number: int, tangents: int | None) -> dict:
    """Least processor time of a scene's sweep, and what its points come to."""
    scene = campaign_scenes.make(seed, number, tangents)
    try:
        points = list(sweep(scene))
    except NumericsError:
        return {"seconds": None, "outcomes": []}
    return {"seconds": sum(seconds for *_, seconds in points), "outcomes": [point.outcome for point, *_ in points]}


class Worker:
    """A process that does what it is asked, one request and its replies at a time; another checkout's where given."""

    def __init__(self, checkout: Path | None = None):
        self._checkout = checkout
        self._process: subprocess.Popen | None = None

    def ask(self, request: dict, seconds: float) -> list[dict]:
        """Replies to a request; the last is {"kind": "skipped"} where the process was ended or broke down."""
        if self._process is None:
            self._process = self._start()
        process, replies, timer = self._process, [], None
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.flush()
        timer = threading.Timer(seconds, process.kill)
        timer.start()
        for line in process.stdout:
            if not line.startswith("{"):
                continue
            reply = json.loads(line)
            if reply["kind"] == "end":
                timer.cancel()
                return replies
            replies = taken_in(replies, reply)
        timer.cancel()
        status = process.wait()
        self._process = None
        reason = f"longer than {seconds:g} s" if status == -9 else f"ended with status {status}"
        for reply in replies:
            if reply["kind"] == "point" and reply["outcome"] == "converged" and "error" not in reply:
                reply |= {"error": None, "truth": None, "others": [], "failures": [f"the scene: {reason}"]}
        return [*replies, {"kind": "skipped", "scene": request["scene"], "seed": request["seed"], "reason": reason}]

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.stdin.close()
            self._process.wait()

    def _start(self) -> subprocess.Popen:
        environment = dict(os.environ)
        if self._checkout is not None:
            environment["PYTHONPATH"] = str(self._checkout / "python")
            environment["ATTRITO_LIBRARY"] = str(self._checkout / "build" / "release" / "libattrito.so")
        command = [sys.executable, str(Path(__file__).resolve()), "--worker"]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, text=True)


def work() -> None:
    """Be a worker: a request a line on standard input, replies on standard output."""

    def send(reply: dict) -> None:
        print(json.dumps(reply), flush=True)

    for line in sys.stdin:
        request = json.loads(line)
        what = (request["seed"], request["scene"], request["tangents"])
        if request["timing"]:
            send({"kind": "time", **time_of(*what)})
        else:
            examine(*what, request["truth_seconds"], send)
        send({"kind": "end"})


def campaign(arguments: argparse.Namespace, hear: Callable[[list[dict]], None], done: set[int]) -> None:
    """Examine scenes by several processes; what is heard of each comes at once."""
    numbers = iter([n for n in range(arguments.first, arguments.first + arguments.scenes) if n not in done])
    lock = threading.Lock()

    def serve() -> None:
        worker = Worker()
        while True:
            with lock:
                number = next(numbers, None)
            if number is None:
                break
            request = {"seed": arguments.seed, "scene": number, "tangents": arguments.tangents, "timing": False}
            replies = worker.ask(request | {"truth_seconds": arguments.truth_seconds}, arguments.seconds)
            with lock:
                hear(replies)
        worker.close()

    threads = [threading.Thread(target=serve) for _ in range(arguments.processes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def compare(arguments: argparse.Namespace) -> dict:
    """Each scene alternately by this checkout and another: ratios of the least processor times."""
    workers = [Worker(), Worker(Path(arguments.compare).resolve())]
    rows = []
    for number in range(arguments.first, arguments.first + arguments.scenes):
        request = {"seed": arguments.seed, "scene": number, "tangents": arguments.tangents, "timing": True}
        least: list[float | None] = [None, None]
        for turn in range(REPEATS):
            for which in (0, 1) if turn % 2 == 0 else (1, 0):
                seconds = workers[which].ask(request, arguments.seconds)[-1].get("seconds")
                if seconds is not None:
                    least[which] = min(seconds, least[which] or seconds)
        if None not in least:
            rows.append({"scene": number, "seconds": least[0], "other_seconds": least[1]})
    for worker in workers:
        worker.close()
    ratios = [row["seconds"] / row["other_seconds"] for row in rows]
    total = sum(row["seconds"] for row in rows) / sum(row["other_seconds"] for row in rows)
    return {"scenes": len(rows), "ratio, median": float(np.median(ratios)), "ratio of totals": total,
            "ratio, quantiles 5, 25, 75, 95 %": np.quantile(ratios, [0.05, 0.25, 0.75, 0.95]).tolist(),
            "slowest": sorted(rows, key=lambda row: row["other_seconds"] - row["seconds"])[:10]}  # fmt: skip


def main() -> None:
    """Run, keep, report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=800)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tangents", type=int, choices=(1, 2), help="of contacts; both unless given")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=600.0, help="a scene that takes longer is skipped")
    parser.add_argument("--truth-seconds", type=float, default=6.0, help="of the processor, a way to a truth and point")
    parser.add_argument("--keep", metavar="FILE", help="JSON lines; a campaign goes on from there")
    parser.add_argument("--report-only", action="store_true", help="of what --keep has")
    parser.add_argument("--failures", metavar="FILE", help="CSV of every failure")
    parser.add_argument("--only-scene", type=int, metavar="N")
    parser.add_argument("--verbose", action="store_true", help="a line a point")
    parser.add_argument("--compare", metavar="CHECKOUT", help="another checkout, built: times of both")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        work()
        return
    if arguments.compare:
        common.report(compare(arguments))
        return
    if arguments.only_scene is not None:
        arguments.first, arguments.scenes, arguments.processes = arguments.only_scene, 1, 1
    kept = Path(arguments.keep) if arguments.keep else None
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept and kept.exists() else []

    def hear(replies: list[dict]) -> None:
        rows.extend(replies)
        if kept:
            with kept.open("a") as stream:
                stream.writelines(json.dumps(reply) + "\n" for reply in replies)
        for reply in replies if arguments.verbose else []:
            print(campaign_report.line_of(reply))
        scenes = sum(row["kind"] == "scene" for row in rows)
        if scenes % 20 == 0:
            common.progress(f"{scenes} scenes")

    if not arguments.report_only:
        campaign(arguments, hear, {row["scene"] for row in rows if row["kind"] == "scene"})
    if arguments.failures:
        campaign_report.write_failures(Path(arguments.failures), rows, TOLERANCE)
    if arguments.only_scene is None:
        common.report(campaign_report.summary(rows, TOLERANCE))


if __name__ == "__main__":
    main()
