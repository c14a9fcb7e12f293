"""What contacts dissipate, by the balance and by loops that are marched in time outside of it.

    .venv/bin/python benchmarks/loops.py [--job input/lap_joint.toml] [--hz 137.385] [--steps 20000]

A frequency of the job is solved at its first level, with its own harmonics. The motion of every contact is then
followed step by step by the law itself, written again here: a spring, a Coulomb slider of two tangents by radial
return, lift-off; period after period until no slider ends elsewhere than it began. W is the sum over steps of the work
of the friction force, its mean over the step, times the step of the motion. JSON on standard
output: W of the balance over W of the loops, less 1, of all contacts together and of the worst one that dissipates a
hundredth of what the largest does. The job's model must be there.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI

from attrito.job.reading import read_job
from attrito.library.session import Solver
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options

ROOT = Path(__file__).resolve().parent.parent
MOST_PERIODS = 50
# Of the largest displacement: how far a slider may end from where it began
PERIODIC = 1e-9


def marched(motion: np.ndarray, laws: dict[str, np.ndarray], start: np.ndarray, steps: int) -> np.ndarray:
    """Work of friction a period `[nc]` under displacements `[nc, 3, nk]`: tangents, then the normal."""
    angle = 2.0 * np.pi * np.arange(steps + 1) / steps
    order = np.arange(1, (motion.shape[2] + 1) // 2)
    basis = np.vstack([np.ones(steps + 1), *(f(h * angle) for h in order for f in (np.cos, np.sin))])
    path = motion @ basis
    kt, kn, mu = (laws[name] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient"))
    normal = np.maximum(laws["preload"][:, None] + kn[:, None] * (path[:, 2] - laws["gap"][:, None]), 0.0)
    reach = mu[:, None] * normal / kt[:, None]
    slider = start.copy()
    scale = np.abs(path[:, :2]).max()
    for _ in range(MOST_PERIODS):
        before, work = slider.copy(), np.zeros(len(kt))
        force = None
        for i in range(steps + 1):
            apart = path[:, :2, i] - slider
            distance = np.hypot(apart[:, 0], apart[:, 1])
            part = np.where(distance > reach[:, i], reach[:, i] / np.maximum(distance, 1e-300), 1.0)
            slider = path[:, :2, i] - part[:, None] * apart
            new = kt[:, None] * part[:, None] * apart
            if force is not None:
                work += (0.5 * (force + new) * (path[:, :2, i] - path[:, :2, i - 1])).sum(axis=1)
            force = new
        if np.abs(slider - before).max() <= PERIODIC * scale:
            return work
    raise RuntimeError(f"sliders are not periodic after {MOST_PERIODS} periods")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--job", type=Path, default=ROOT / "input/lap_joint.toml")
    parser.add_argument("--hz", type=float, default=137.385)
    parser.add_argument("--steps", type=int, default=20_000)
    arguments = parser.parse_args()
    job = read_job(str(arguments.job))
    scene, progress = build_scene(job), Progress(MPI.COMM_SELF)
    rom = make_rom(MPI.COMM_SELF, job, scene, progress.say, progress.step)[0]
    reduced, options = reduced_scene(job, scene, rom), solver_options(job, rom)
    with Solver(MPI.COMM_SELF, reduced, options) as solver:
        solver.follow_static_path(scene.load_path, job["static"]["steps"], arguments.hz)
        (point,) = solver.solve_at([arguments.hz], float(job["sweep"]["levels"][0]), 0)
        heard: dict[str, np.ndarray] = {}
        solver.report_point(lambda path, _, values: heard.update({path: values}))
    own = np.nan_to_num(heard["/contacts/dissipated_energy"])
    loops = marched(heard["/contacts/displacement"], reduced.laws, heard["/contacts/slider"], arguments.steps)
    large = own > 0.01 * own.max()
    common.report(
        {
            "frequency_hz": arguments.hz,
            "steps": arguments.steps,
            "outcome": point.outcome,
            "slipping": point.states[2],
            "dissipated": float(own.sum()),
            "balance over loops, all": float(own.sum() / loops.sum() - 1.0),
            "balance over loops, worst contact": float(np.abs(own[large] / loops[large] - 1.0).max()),
        }
    )


if __name__ == "__main__":
    main()
