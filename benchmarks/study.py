"""A study of a thousand samples: how long it takes, and whether one that was killed ends like one that was not.

    .venv/bin/python benchmarks/study.py out/study --samples 1000 --ranks 2

A steel block of bricks stands on 20 contacts with two tangents, pressed unevenly and shaken along two directions; it is
reduced to its contact nodes and fixed-interface modes. Friction coefficient and preload vary. The study is run once as
it is and once in another folder, where it is killed (signal 9) as soon as half of its batches are there and started
again; every dataset of both files is compared bit by bit. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
import scenes

from attrito.model.model import Model
from attrito.model.model_file import write_model

ALONG, ACROSS = 5, 4
STIFFNESS, PRESSING = 2.0e10, 1.0e4
STUDY = """\
job = "block.toml"
design = "latin_hypercube"
samples = {samples}
batch = 20

[[vary]]
name = "friction coefficient"
keys = ["contact[*].friction_coefficient"]
low = 0.2
high = 0.4

[[vary]]
name = "preload"
keys = ["static.load_path[1]"]
low = 0.8
high = 1.2
"""


def write_block(folder: Path, fineness: int, level: float) -> None:
    """The block's model and its job; `fineness`: bricks between neighbouring contacts."""
    counts = (fineness * (ALONG - 1), fineness * (ACROSS - 1), 2 * fineness)
    grid = scenes.box(counts, np.full(3, 0.1 / counts[0]))
    dofs = np.arange(grid.points.size)
    node, direction = dofs // 3 + 1, dofs % 3 + 1
    number = grid.number + 1
    model = Model(grid.stiffness.tocsr(), grid.mass.tocsr(), None, node.astype(np.int64), direction.astype(np.int32))
    write_model(folder / "block.model.h5", model, [])
    lower, top = number[::fineness, ::fineness, 0].ravel(), number[:, :, -1]
    weight = 1.0 + 0.6 * np.linspace(-1.0, 1.0, top.shape[0])[:, None] * np.ones(top.shape[1])
    press = _terms(top, "z", -PRESSING * weight / weight.sum())
    shake = {way: np.full(top.shape, size / top.size) for way, size in (("x", 1.0), ("y", 0.4))}
    phase = np.pi / 3.0
    cosine = _terms(top, "x", shake["x"]) + _terms(top, "y", np.cos(phase) * shake["y"])
    law = {
        "tangential_stiffness": STIFFNESS / 20,
        "normal_stiffness": 1.2 * STIFFNESS / 20,
        "friction_coefficient": 0.3,
    }
    lines = ["[model]", 'file = "block.model.h5"', "[damping]", "ratio = 0.005", "[reduction]", "modes = 20"]
    for one in lower.tolist():
        lines += ["[[contact]]", f"normal = {json.dumps([[['node', one, 'z'], -1.0]])}"]
        lines += [f"tangents = {json.dumps([[[['node', one, way], 1.0]] for way in 'xy'])}"]
        lines += [f"{name} = {value!r}" for name, value in law.items()]
    lines += ["[[load]]", 'kind = "static"', f"dofs = {json.dumps(press)}"]
    sine = _terms(top, "y", np.sin(phase) * shake["y"])
    lines += ["[[load]]", 'kind = "harmonic"', f"cosine = {json.dumps(cosine)}", f"sine = {json.dumps(sine)}"]
    lines += ["[balance]", "harmonics = 3", "[static]", "steps = 4"]
    lines += ["[sweep]", "start_hz = 6000.0", "stop_hz = 9000.0", "[peak]", f"start = {level!r}"]
    monitor = json.dumps([["node", int(top[-1, -1]), "x"], 1.0])
    lines += ["[output]", 'file = "block.h5"', f'monitors = [{{ name = "top", dofs = [{monitor}] }}]']
    (folder / "block.toml").write_text("\n".join(lines) + "\n")


def _terms(nodes: np.ndarray, way: str, sizes: np.ndarray) -> list:
    return [
        [["node", one, way], size] for one, size in zip(nodes.ravel().tolist(), sizes.ravel().tolist(), strict=True)
    ]


def start(folder: Path, ranks: int) -> subprocess.Popen:
    """The study, in a group of processes of its own."""
    command = ["mpirun", "-n", str(ranks), sys.executable, "-m", "attrito.cli", "study", "study.toml"]
    allowed = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",
    }
    return subprocess.Popen(
        command, cwd=folder, env=os.environ | allowed, stdout=subprocess.DEVNULL, start_new_session=True
    )


def kill_half_way(folder: Path, ranks: int, batches: int) -> int:
    """Start it and kill all its processes; returns how many batches were there."""
    running = start(folder, ranks)
    while len(list(folder.glob("study.h5.parts/*/*.json"))) < batches // 2 and running.poll() is None:
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    return len(list(folder.glob("study.h5.parts/*/*.json")))


def _processor_seconds() -> float:
    """Of all processes that were started here and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def contents(path: Path) -> dict[str, np.ndarray]:
    """Every dataset of a file."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def main() -> None:
    """Run it whole, run it broken, compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--fineness", type=int, default=2, help="bricks between neighbouring contacts")
    parser.add_argument("--level", type=float, default=16.0)
    parser.add_argument("--once", action="store_true", help="without the one that is killed")
    arguments = parser.parse_args()
    seconds, killed_at = {}, None
    for name in ("whole",) if arguments.once else ("whole", "killed"):
        folder = arguments.folder / name
        folder.mkdir(parents=True, exist_ok=True)
        write_block(folder, arguments.fineness, arguments.level)
        (folder / "study.toml").write_text(STUDY.format(samples=arguments.samples))
        subprocess.run([sys.executable, "-m", "attrito.cli", "reduce", "block.toml"], cwd=folder, check=True, stdout=2)
        started, used = time.perf_counter(), _processor_seconds()
        if name == "killed":
            killed_at = kill_half_way(folder, arguments.ranks, -(-arguments.samples // 20))
        if start(folder, arguments.ranks).wait() != 0:
            sys.exit(f"the study in {folder} failed")
        seconds[name] = {
            "wall": time.perf_counter() - started,
            "processor_a_rank": (_processor_seconds() - used) / arguments.ranks,
        }
    found = contents(arguments.folder / "whole/study.h5")
    result = {"samples": arguments.samples, "ranks": arguments.ranks, "seconds": seconds}
    methods, states = found["peaks/method"].ravel(), found["peaks/states"][:, 0]
    result["found"] = dict(zip(("near", "tracked", "swept"), np.bincount(methods, minlength=3).tolist(), strict=True))
    result["slipping"] = [int(states[:, 2].min()), int(states[:, 2].max())]
    result["without_peak"] = int(np.isnan(found["peaks/amplitude"]).sum())
    if not arguments.once:
        again = contents(arguments.folder / "killed/study.h5")
        result["batches_when_killed"] = killed_at
        result["equal"] = found.keys() == again.keys() and all(
            np.array_equal(found[name], again[name], equal_nan=True) for name in found
        )
    common.report(result)


if __name__ == "__main__":
    main()
