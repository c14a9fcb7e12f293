"""Kill commands at random moments and start them again: is anything lost, does the end differ from that of a whole run?

    .venv/bin/python benchmarks/kills.py --what run --kills 100 --ranks 2

The command is started again and again and killed (SIGKILL, all of its processes) after a random time of up to a little
more than a whole run of it takes. After every kill all that was finished before must still be there, unchanged, and
must read; when the command comes to its end its result must be that of the uninterrupted one bit for bit, and the next
start begins from nothing. Prints JSON: `lost`, `unreadable`, `different` and `touched` are to be zero.

With --signal a signal is sent to one rank of several, and the command is not started again: is any process left?

    .venv/bin/python benchmarks/kills.py --what run --kills 50 --ranks 2 --signal SIGINT

Prints JSON: `left`, how often a process was left after 20 s, and `unreadable`, how often what was kept does not read,
are to be zero; `kept`, how often points were kept; `slowest`, the longest wait in seconds.

run     five contacts that begin to slip and move from rank to rank; gone on with by --resume, point by point
bounds  points of contacts that stick and slip, whose bounds are sampled; auto: as far as their budget goes
stability  points of contacts with two tangents, whose verdicts take longer than they
search  the same where branches that coexist are sought; a search that is cut short begins again
study   peaks over samples; gone on with batch by batch
mode    a nonlinear mode; gone on with by --resume
fit     two parameters of a wedge; evaluations are kept
peak, campbell, optimise    nothing is kept before their end, and a file that is there is whole

Beside every result lie files of others, under names that end as those of attrito do: `touched` is to be zero.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parents[1] / "tests" / "python"
sys.path.insert(0, str(TESTS))

from jobs import ENVIRONMENT, Job, blocks, chain, wedge, write_blocks, write_job  # noqa: E402 (scripts, no package)
from mode_jobs import rubbing as mode_job  # noqa: E402
from restarts import differences  # noqa: E402
from rubbing_fit import measured, rubbing, write_fit  # noqa: E402
from wedge_optimum import wedge_peak, write_optimum  # noqa: E402

from attrito.results.journal import is_journal, read_journal  # noqa: E402
from attrito.results.result import Result  # noqa: E402
from attrito.results.tables import table  # noqa: E402

INPUT, RESULT = "input.toml", "result.h5"
# Not ours, in the folder of the result
FOREIGN = {
    name: f"{name} of others".encode() for name in ("other.h5", "other.h5.partial", "notes.parts", "other.h5.lock")
}
# From a signal at one rank to the end of all
MOST_SECONDS = 20.0
Kept = dict[Any, Any]


@dataclass(frozen=True)
class Target:
    """What is killed.

    Parameters
    ----------
    arguments : of the command
    prepare : writes its input into a folder, for a work of some size
    kept : what is finished of an interrupted run in a folder, by name or number
    reads : whether what is there of it can be read, all of it
    """

    arguments: tuple[str, ...]
    prepare: Callable[[Path, int], None]
    kept: Callable[[Path], Kept]
    reads: Callable[[Path], bool]


def _sliding(folder: Path, points: int, **continuation: int) -> None:
    job = chain(contacts=5)
    job["sweep"] = {"start_hz": 84.0, "stop_hz": 76.0}
    job["continuation"] = {"max_points": points, **continuation}
    job["output"]["file"] = RESULT
    write_job(folder, job, INPUT)


def _listed(folder: Path, points: int, **tables: Job) -> None:
    """Points at which five contacts of eight slip along two tangents: the others' sliders are free."""
    job = chain(contacts=8, tangents=2)
    job["load"][1] |= {"cosine": [[0, 60.0]], "sine": [[0, 30.0]]}
    job["sweep"] = {"frequencies_hz": [75.0 + 5.0 * i / points for i in range(points)]}
    job["output"]["file"] = RESULT
    write_job(folder, job | tables, INPUT)


def _peaks(folder: Path, name: str, **peak: float | str) -> None:
    job = wedge(force=1.0)
    job["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    job["static"] = {"load_path": [0.0, 1.0]}
    job["peak"] = {"start": 10.0, **peak}
    job["output"]["file"] = "sweep.h5"
    write_job(folder, job, name)


def _study(folder: Path, samples: int) -> None:
    _peaks(folder, "job.toml")
    vary = [{"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.3, "high": 0.6}]
    study = {"job": "job.toml", "file": RESULT, "samples": samples, "batch": 2, "vary": vary}
    write_job(folder, study, INPUT)


def _mode(folder: Path, amplitudes: int) -> None:
    job = mode_job(harmonics=7)
    job["mode"] |= {"points": amplitudes, "file": RESULT}
    job["output"]["file"] = "sweep.h5"
    write_job(folder, job, INPUT)


def _fit(folder: Path, _: int) -> None:
    measured(folder, rubbing())
    Path(write_fit(folder, file=RESULT)).rename(folder / INPUT)
    _clean(folder)


def _optimise(folder: Path, _: int) -> None:
    write_job(folder, wedge_peak())
    Path(write_optimum(folder, file=RESULT)).rename(folder / INPUT)


def _campbell(folder: Path, speeds: int) -> None:
    write_blocks(folder / "model.h5")
    axis = {"axis_point": [0.0, 0.0, 0.0], "axis_direction": [0.0, 0.0, 1.0]}
    job = blocks()
    job["load"].append({"name": "spin", "kind": "centrifugal", "speed_hz": 1.0, **axis})
    job["campbell"] = {"speeds_hz": [i / speeds for i in range(speeds)], "modes": 3, "file": RESULT}
    job["output"]["file"] = "sweep.h5"
    write_job(folder, job, INPUT)


def _points(folder: Path) -> Kept:
    """The journal's points, but for those of a search that is not over: it begins again."""
    notes = _records(folder)
    while notes and notes[-1][0]["place"]["searching"]:
        notes.pop()
    return dict(enumerate(notes))


def _records(folder: Path) -> list[tuple[dict, dict]]:
    journal = folder / f"{RESULT}.partial"
    if not journal.is_file() or not is_journal(journal):
        return []
    records = [record for record, _ in read_journal(str(journal))]
    # What is found of a point afterwards has a record of its own, without a place in the run.
    points = [one for one in records[1:] if "place" in one.note]
    return [(one.note, {name: values.tobytes() for name, values in one.arrays.items()}) for one in points]


def _journal_reads(folder: Path) -> bool:
    points = len(_records(folder))
    if not points:
        return True
    with Result(folder / f"{RESULT}.partial") as result:
        return len(table(result).splitlines()) == points + 1


def _batches(folder: Path) -> Kept:
    return {path.name: path.read_bytes() for path in folder.glob(f"{RESULT}.parts/*/*.json")}


def _batches_read(folder: Path) -> bool:
    return all(json.loads(text)["rows"] for text in _batches(folder).values())


TARGETS = {
    "run": Target(("run", "--resume", INPUT), _sliding, _points, _journal_reads),
    "bounds": Target(
        ("run", "--resume", INPUT),
        lambda folder, points: _listed(folder, points, static={"bounds": "sampled"}),
        _points,
        _journal_reads,
    ),
    "auto": Target(
        ("run", "--resume", INPUT),
        lambda folder, points: _listed(folder, points, static={"bounds": "auto"}),
        _points,
        _journal_reads,
    ),
    "stability": Target(
        ("run", "--resume", INPUT),
        lambda folder, points: _listed(folder, points, stability={"method": "both"}),
        _points,
        _journal_reads,
    ),
    "search": Target(
        ("run", "--resume", INPUT), lambda folder, points: _sliding(folder, points, branches=2), _points, _journal_reads
    ),
    "study": Target(("study", INPUT), _study, _batches, _batches_read),
    "mode": Target(("mode", "--resume", INPUT), _mode, lambda folder: {}, lambda folder: True),
    "fit": Target(("fit", INPUT), _fit, lambda folder: {}, lambda folder: True),
    "peak": Target(
        ("peak", INPUT),
        lambda folder, points: _peaks(folder, INPUT, stop=10.0 + points, file=RESULT),
        lambda folder: {},
        lambda folder: True,
    ),
    "campbell": Target(("campbell", INPUT), _campbell, lambda folder: {}, lambda folder: True),
    "optimise": Target(("optimise", INPUT), _optimise, lambda folder: {}, lambda folder: True),
}


def kill_and_go_on(folder: Path, what: str, kills: int, ranks: int, size: int, seed: int) -> dict:
    """What so many kills found."""
    target, chance = TARGETS[what], random.Random(seed)
    target.prepare(folder, size)
    for name, content in FOREIGN.items():
        (folder / name).write_bytes(content)
    seconds = [_whole_run(folder, target, ranks) for _ in range(2)][-1]
    whole = (folder / RESULT).rename(folder / "whole.h5")
    _clean(folder)
    found = {"kills": 0, "with_something_kept": 0, "completed": 0, "lost": 0, "unreadable": 0, "different": 0}
    found |= {"touched": 0}
    before: Kept = {}
    while found["kills"] < kills:
        run = _start(folder, target, ranks)
        try:
            run.wait(chance.uniform(0.0, 1.1 * seconds))
        except subprocess.TimeoutExpired:
            _kill(run)
            found["kills"] += 1
        found["touched"] += any(
            not (folder / name).is_file() or (folder / name).read_bytes() != content
            for name, content in FOREIGN.items()
        )
        if (folder / RESULT).exists():
            found["completed"] += 1
            found["different"] += bool(differences(folder / RESULT, whole))
            _clean(folder)
            before = {}
            continue
        now = target.kept(folder)
        found["with_something_kept"] += bool(now)
        found["lost"] += any(now.get(name) != values for name, values in before.items())
        found["unreadable"] += not target.reads(folder)
        before = now
    _whole_run(folder, target, ranks)
    found["different"] += bool(differences(folder / RESULT, whole))
    return {"what": what, "ranks": ranks, "seconds_of_a_run": round(seconds, 2), "seed": seed} | found


def signal_one_rank(folder: Path, what: str, times: int, ranks: int, size: int, seed: int, name: str) -> dict:
    """How often processes were left when a signal had reached one rank, chosen by chance, at a moment chosen so too."""
    target, chance = TARGETS[what], random.Random(seed)
    target.prepare(folder, size)
    seconds = [_whole_run(folder, target, ranks) for _ in range(2)][-1]
    found = {"signals": 0, "over_before": 0, "ended_well": 0, "left": 0, "kept": 0, "unreadable": 0, "slowest": 0.0}
    while found["signals"] < times:
        _clean(folder)
        run = _start(folder, target, ranks)
        time.sleep(chance.uniform(0.0, seconds))
        members = _processes_of(run)
        # A process of one rank may have a child of MPI's own.
        rank = chance.choice(members[1:]) if ranks > 1 and members[1:] else run.pid
        if run.poll() is not None:
            found["over_before"] += 1
            continue
        with contextlib.suppress(ProcessLookupError):
            os.kill(rank, signal.Signals[name])
        found["signals"] += 1
        begun = time.monotonic()
        while run.poll() is None or any(map(_runs, members)):
            if time.monotonic() - begun > MOST_SECONDS:
                found["left"] += 1
                _kill(run)
                break
            time.sleep(0.02)
        found["slowest"] = round(max(found["slowest"], time.monotonic() - begun), 2)
        found["ended_well"] += run.returncode == 0
        found["kept"] += bool(target.kept(folder))
        found["unreadable"] += not target.reads(folder)
    return {"what": what, "signal": name, "ranks": ranks, "seconds_of_a_run": round(seconds, 2), "seed": seed} | found


def _processes_of(run: subprocess.Popen[bytes]) -> list[int]:
    """mpirun and its ranks, as far as they have begun."""
    try:
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    except OSError:
        children = []
    return [run.pid, *map(int, children)]


def _runs(process: int) -> bool:
    """Whether a process is there and is no corpse."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _whole_run(folder: Path, target: Target, ranks: int) -> float:
    """Seconds of a run that is left alone; sweeps here may end before their stop (exit code 1)."""
    begun = time.monotonic()
    run = _start(folder, target, ranks)
    if run.wait() not in (0, 1) or not (folder / RESULT).exists():
        raise RuntimeError(f"{target.arguments} ended with {run.returncode}")
    return time.monotonic() - begun


def _clean(folder: Path) -> None:
    for path in folder.glob(f"{RESULT}*"):
        if path.is_file():
            path.unlink()


def _start(folder: Path, target: Target, ranks: int) -> subprocess.Popen[bytes]:
    """A run in a session of its own, mpirun and all."""
    command = [sys.executable, "-m", "attrito.cli", *target.arguments]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(command, cwd=folder, env=os.environ | ENVIRONMENT, start_new_session=True, **quiet)


def _kill(run: subprocess.Popen[bytes]) -> None:
    """The process and, under mpirun, its ranks, which are not of its group."""
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split() if run.poll() is None else []
    for process in [run.pid, *map(int, children)]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    run.wait()
    while any(Path(f"/proc/{child}").exists() for child in children):
        time.sleep(0.01)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--what", choices=TARGETS, default="run")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("--size", type=int, default=60, help="points, samples, or levels")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--signal", choices=["SIGINT", "SIGTERM", "SIGKILL"], help="to one rank, instead of kills")
    options = parser.parse_args()
    chosen = (options.what, options.kills, options.ranks, options.size, options.seed)
    with tempfile.TemporaryDirectory() as place:
        if options.signal:
            found = signal_one_rank(Path(place), *chosen, options.signal)
        else:
            found = kill_and_go_on(Path(place), *chosen)
    print(json.dumps(found))
