"""Jobs started together in one folder: does each give what it gives alone?

    .venv/bin/python benchmarks/job_arrays.py --trials 100

Each trial starts 4 to 8 commands at once in a folder of its own: runs, reductions and integrations of two models, with
equal and different reductions, some of them of one file that they name, on one rank or two. In every other trial some
are killed (SIGKILL) at a random moment and started again when the others have ended. Every command must end with the
exit code that it ends with alone, and leave the numbers that it leaves alone; of those that write one file together
all but one may be refused instead (exit code 2, one message). In the end nothing may be there but results, reduced
models that read, and the models of them. Prints JSON: `wrong` is to be empty.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests" / "python"
sys.path.insert(0, str(TESTS))

from edited import edited  # noqa: E402 (a folder of scripts, not a package)
from jobs import ENVIRONMENT, Job, blocks, write_blocks, write_job  # noqa: E402 (a folder of scripts, not a package)

PATIENCE = 600.0
# Numbers of two runs of one job, on one rank and on two: rounding, times what the equations amplify it by.
TOLERANCE = 1e-8
MODELS = ("model.h5", "stiffer.h5")
MODES = (3, 5, 8)
# What runs are compared in, and integrations.
OF_A_RUN = ("points/frequency_hz", "monitors/tip/amplitude", "monitors/tip/mean", "contacts/n_mean")
OF_AN_INTEGRATION = ("integration/monitors/tip/amplitude", "integration/contacts/n_mean")


@dataclass(frozen=True)
class Kind:
    """What a job asks for, of which equal ones give equal numbers."""

    command: str
    model: str
    modes: int
    own_file: bool

    def job(self, output: str) -> Job:
        """The job with an output of its own."""
        job = blocks()
        job["model"] = {"file": self.model}
        job["reduction"] = {"modes": self.modes} | ({"file": "shared.h5"} if self.own_file else {})
        job["output"]["file"] = output
        job["integrate"] = {"frequency_hz": 60.0, "scheme": "exponential", "steps_per_period": 60, "cycles": 3}
        return job


@dataclass
class Command:
    """One command of a trial."""

    kind: Kind
    output: str
    file: str
    ranks: int
    killed: bool = False
    process: subprocess.Popen[bytes] | None = None
    log: Path = field(default_factory=Path)


def start(folder: Path, command: Command) -> None:
    """Start a command in a session of its own."""
    words = [sys.executable, "-m", "attrito.cli", command.kind.command, command.file]
    if command.ranks > 1:
        words = ["mpirun", "-n", str(command.ranks), *words]
    command.log = folder.parent / f"{folder.name}.{command.file}.log"
    with open(command.log, "ab") as log:
        command.process = subprocess.Popen(
            words, cwd=folder, env=os.environ | ENVIRONMENT, stdout=log, stderr=log, start_new_session=True
        )


def kill(process: subprocess.Popen[bytes]) -> None:
    """A process and, under mpirun, its ranks, which are in groups of their own."""
    with contextlib.suppress(OSError):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for one in [process.pid, *map(int, children)]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
    process.wait()


def numbers(path: Path, command: str) -> dict[str, np.ndarray]:
    """What a command's file is compared in."""
    with h5py.File(path) as file:
        if command == "reduce":
            # Modes are known up to their sign, and as a set: their frequencies.
            return {"modes": file["modes/frequency_hz"][:]}
        return {name: file[name][()] for name in (OF_A_RUN if command == "run" else OF_AN_INTEGRATION)}


def differs(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> str:
    """The first quantity that differs by more than rounding; empty if none does."""
    for name, expected in one.items():
        scale = np.abs(expected).max(initial=0.0)
        if other[name].shape != expected.shape or np.abs(other[name] - expected).max(initial=0.0) > TOLERANCE * scale:
            return name
    return ""


class Alone:
    """What each kind of job gives alone; found once."""

    def __init__(self, place: Path):
        self.place = place
        self._known: dict[Kind, tuple[int, dict[str, np.ndarray]]] = {}

    def of(self, kind: Kind) -> tuple[int, dict[str, np.ndarray]]:
        """Exit code and numbers."""
        if kind not in self._known:
            folder = self.place / f"alone_{len(self._known)}"
            prepare(folder)
            write_job(folder, kind.job("result.h5"))
            command = Command(kind, "result.h5", "job.toml", 1)
            start(folder, command)
            code = command.process.wait(PATIENCE)
            self._known[kind] = code, numbers(folder / _file_of(folder, command), kind.command)
            shutil.rmtree(folder)
        return self._known[kind]


def _file_of(folder: Path, command: Command) -> str:
    """The file that a command leaves: of a reduction the one whose number of modes it is."""
    if command.kind.command != "reduce":
        return command.output
    if command.kind.own_file:
        return "shared.h5"
    found = [path.name for path in folder.glob("rom*.h5") if _made_of(path) == (command.kind.model, command.kind.modes)]
    return found[0] if found else "rom.h5"


def _made_of(path: Path) -> tuple[str, int]:
    with h5py.File(path) as file:
        job = json.loads(file.attrs["job"])
    return job["model"]["file"], job["reduction"]["modes"]


def prepare(folder: Path) -> None:
    """A folder with the models."""
    folder.mkdir()
    write_blocks(folder / MODELS[0])
    shutil.copy(folder / MODELS[0], folder / MODELS[1])
    with edited(folder / MODELS[1]) as file:
        file["stiffness/values"][:] *= 1.5


def draw(chance: random.Random) -> list[Command]:
    """Commands of a trial."""
    # Many of few kinds, or each another.
    kinds = [
        Kind(
            chance.choices(["run", "reduce", "integrate"], [6, 2, 1])[0],
            chance.choice(MODELS),
            chance.choice(MODES),
            chance.random() < 0.25,
        )
        for _ in range(chance.choice([1, 2, 4, 8]))
    ]
    commands = []
    for i in range(chance.randint(4, 8)):
        ranks = 2 if chance.random() < 0.15 else 1
        commands.append(Command(chance.choice(kinds), f"result_{i}.h5", f"job_{i}.toml", ranks))
    if chance.random() < 0.25:
        # Two that write one file.
        commands[1].output, commands[1].kind = commands[0].output, commands[0].kind
    return commands


def trial(folder: Path, chance: random.Random, alone: Alone, kills: bool) -> list[str]:
    """What went wrong in one trial, in words."""
    prepare(folder)
    commands = draw(chance)
    for command in commands:
        alone.of(command.kind)
        write_job(folder, command.kind.job(command.output), command.file)
    for command in commands:
        start(folder, command)
        time.sleep(chance.choice([0.0, 0.0, 0.2, 0.5]))
    if kills:
        for command in chance.sample(commands, chance.randint(1, 2)):
            time.sleep(chance.uniform(0.0, 1.5))
            if command.process.poll() is None:
                kill(command.process)
                command.killed = True
    wrong = _wait(commands)
    for command in commands:
        if command.killed:
            start(folder, command)
    wrong += _wait([command for command in commands if command.killed])
    return wrong + _judge(folder, commands, alone)


def _wait(commands: list[Command]) -> list[str]:
    end = time.monotonic() + PATIENCE
    wrong = []
    for command in commands:
        try:
            command.process.wait(max(0.1, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            kill(command.process)
            wrong.append(f"{command.file} does not end: {command.log.read_text()[-300:]}")
    return wrong


def _judge(folder: Path, commands: list[Command], alone: Alone) -> list[str]:
    wrong = []
    for command in commands:
        code, expected = alone.of(command.kind)
        said = command.log.read_text()
        shared = [other for other in commands if other.output == command.output and command.kind.command != "reduce"]
        ended = command.process.returncode
        refused = ended == 2 and "'in use'" in said and len(shared) > 1
        if ended != code and not refused:
            wrong.append(f"{command.file} ({command.kind}) ended with {ended}: {said[-400:]}")
        elif not refused and not (command.kind.command == "reduce" and command.kind.own_file):
            # A file that others name too holds what the last of them made.
            name = differs(expected, numbers(folder / _file_of(folder, command), command.kind.command))
            if name:
                wrong.append(f"{command.file} ({command.kind}): {name} differs from that of the job alone")
    for path in folder.iterdir():
        known = path.suffix in (".h5", ".toml") and not path.name.endswith(".new")
        if not known or path.is_dir():
            wrong.append(f"{path.name} is left")
        elif path.suffix == ".h5" and not h5py.is_hdf5(path):
            wrong.append(f"{path.name} is broken")
    return wrong


def job_arrays(place: Path, trials: int, seed: int, first: int = 0) -> dict:
    """So many trials; what went wrong in which."""
    alone, wrong, commands = Alone(place), {}, 0
    begun = time.monotonic()
    for number in range(first, first + trials):
        chance = random.Random(f"{seed}:{number}")
        folder = place / f"trial_{number}"
        if found := trial(folder, chance, alone, kills=number % 2 == 1):
            wrong[number] = found
        commands += len(list(folder.glob("job_*.toml")))
        shutil.rmtree(folder)
    seconds = round(time.monotonic() - begun)
    return {"seed": seed, "trials": trials, "commands": commands, "seconds": seconds, "wrong": wrong}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        print(json.dumps(job_arrays(Path(name), options.trials, options.seed, options.first), indent=1))
