"""The plane block beside a peer: pyHarm-os, an open harmonic-balance code in Python, on one problem in one run.

    .venv/bin/python benchmarks/peer.py --contacts 10 30 100 > peer.json

The peer is installed into an environment of its own, `out/peer`, at the first run. Both get the same matrices, loads,
contacts, harmonics and samples, on one thread. Prints JSON: seconds of one residual with Jacobian, and of one linear
step (ours condensed and exact, the peer's `numpy.linalg.solve`), the peer's over ours, and how far the two agree: the
peer's residual at our solution relative to the loads, and the amplitude that the peer's own equations lead to by
Newton's method from our solution at a frequency nearby. `agree` says whether both are below `--tolerance`.

What the peer is given that differs: its contact with variable normal force has two tangents, so here both are the same
axis, with half of kt and mu / sqrt 2 each, which is the same law; its normal force needs a preload that is not zero,
1e-12 of the largest load here; loads on all coordinates are one vector rather than its one object for each.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import subprocess
import tempfile
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options

ROOT = Path(__file__).resolve().parents[1]
PEER = "pyHarm-os==1.2.2"
HARMONICS, SAMPLES = 5, 128


def environment() -> Path:
    """Python of the peer's own environment, made at the first call."""
    folder = ROOT / "out" / "peer"
    python = folder / "bin" / "python"
    if not (folder / "installed").exists():
        common.progress(f"installing {PEER} into {folder.relative_to(ROOT)}")
        subprocess.run(["/usr/bin/python3", "-m", "venv", "--clear", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", PEER], check=True)
        (folder / "installed").touch()
    return python


def ours(scene: ReducedScene, frequency: float, level: float) -> tuple[dict, np.ndarray]:
    """Times of ours where it solves, and its solutions there and nearby `[2, m, 2 H + 1]`."""
    whole = dataclasses.replace(
        scene,
        monitors=np.eye(len(scene.mass)),
        monitor_names=[f"q{i}" for i in range(len(scene.mass))],
    )
    with common.TimedSolver(whole, Options(harmonics=HARMONICS, samples=SAMPLES)) as solver:
        nearby = solver.solve_from_static(0.998 * frequency, level)
        point = solver.solve_from_static(frequency, level)
        found = {
            "outcome": point.outcome,
            **common.states(point),
            "evaluation_seconds": solver.evaluation()["seconds"],
            "step_seconds": solver.linearised_step()[0],
        }
    return found, np.stack([point.harmonics, nearby.harmonics])


def problem(scene: ReducedScene, stuck: scenes.StuckSystem, frequency: float, level: float) -> dict[str, np.ndarray]:
    """What the peer needs, in arrays."""
    omega = 2 * np.pi * stuck.frequencies_hz
    weighted = scene.mass @ stuck.modes
    load = np.zeros((len(scene.mass), 2 * HARMONICS + 1))
    load[:, :3] = level * scene.harmonic.T
    load[:, 0] += scene.static[0]
    return {
        "mass": scene.mass,
        "stiffness": scene.stiffness,
        "damping": (2 * scene.damping_value * omega * weighted) @ weighted.T,
        "load": load,
        "omega": 2 * np.pi * frequency,
        "samples": SAMPLES,
        "kt": scene.laws["tangential_stiffness"],
        "kn": scene.laws["normal_stiffness"],
        "mu": scene.laws["friction_coefficient"],
        "monitor": scene.monitors[0],
    }


def theirs(python: Path, arrays: dict[str, np.ndarray]) -> dict:
    """What the peer finds, in a process of its own on one thread."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.npz"
        np.savez(path, **arrays)
        single = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "HOME": str(ROOT / "out" / "peer")}
        single["JAX_ENABLE_X64"] = "1"
        single["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
        command = [python, Path(__file__).with_name("peer_pyharm.py"), path]
        # It leaves its settings in the home and in the present folder.
        run = subprocess.run(
            command, env=os.environ | single, cwd=ROOT / "out" / "peer", check=True, stdout=subprocess.PIPE
        )
    return json.loads(run.stdout.splitlines()[-1])


def measure(python: Path, contacts: int, loads: list[float], tolerance: float) -> dict:
    """Both codes on one size, at the first load that ours solves."""
    scene = scenes.plane_block(contacts)
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    median = float(np.median(scenes.slip_thresholds(scene, stuck, frequency)))
    for level in median * np.array(loads):
        own, solutions = ours(scene, frequency, level)
        if own["outcome"] == "converged":
            break
    arrays = problem(scene, stuck, frequency, level) | {"solution": solutions[0], "nearby": solutions[1]}
    peer = theirs(python, arrays)
    amplitude = float(np.hypot(*(scene.monitors[0] @ solutions[0])[1:3]))
    difference = abs(peer["amplitude"] - amplitude) / amplitude
    return {
        "contacts": contacts,
        "unknowns": solutions[0].size,
        "frequency_hz": frequency,
        "load": float(level / median),
        "ours": own,
        "peer": peer,
        "evaluation_ratio": (peer["residual_seconds"] + peer["jacobian_seconds"]) / own["evaluation_seconds"],
        "step_ratio": peer["step_seconds"] / own["step_seconds"],
        "iteration_ratio": (peer["residual_seconds"] + peer["jacobian_seconds"] + peer["step_seconds"])
        / (own["evaluation_seconds"] + own["step_seconds"]),
        "amplitude": amplitude,
        "amplitude_difference": difference,
        "agree": max(difference, peer["residual_at_our_solution"]) < tolerance,
    }


def main() -> None:
    """Measure the sizes asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 30, 100])
    parser.add_argument(
        "--loads", type=float, nargs="+", default=[1.1, 1.07], help="forces, relative to where half the contacts slip"
    )
    parser.add_argument("--tolerance", type=float, default=1e-6)
    arguments = parser.parse_args()
    python = environment()
    rows = []
    for contacts in arguments.contacts:
        rows.append(measure(python, contacts, arguments.loads, arguments.tolerance))
        common.progress(f"{contacts} contacts: {rows[-1]['evaluation_ratio']:.0f} times, agree: {rows[-1]['agree']}")
    common.report({"peer": PEER, "harmonics": HARMONICS, "samples": SAMPLES, "rows": rows})


if __name__ == "__main__":
    main()
