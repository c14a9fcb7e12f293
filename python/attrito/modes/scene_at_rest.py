"""A job's scene made ready for motion without excitation: reduced, and at its static solution."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.modes.families import families_of
from attrito.runs.progress import Progress
from attrito.scene import cautions
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


@dataclass(frozen=True)
class Prepared:
    """What a job is solved with.

    Parameters
    ----------
    rom, reduced : the reduced model, if there is one, and the scene in its coordinates; on rank 0 alone `rom` is there
    load_path : factors on the static loads, `[corners, loads]`
    options : of the solver
    """

    rom: Rom | None
    reduced: ReducedScene
    load_path: np.ndarray
    options: Options


def prepare(comm: Comm, job: Job, scene: Scene | None, progress: Progress) -> Prepared:
    """Reduce the scene, which rank 0 holds, and warn of what is doubtful in it. Collective."""
    progress.warn(on_root(comm, lambda: cautions.of_scene(job, scene)))
    rom, report = make_rom(comm, job, scene, progress.say, progress.step)
    progress.reduction(report)
    reduced, load_path, options = on_root(
        comm, lambda: (reduced_scene(job, scene, rom), scene.load_path, solver_options(job, rom))
    )
    progress.warn(on_root(comm, lambda: cautions.of_damping(reduced)))
    return Prepared(rom, reduced, load_path, options)


@contextmanager
def solver_at_rest(comm: Comm, job: Job, prepared: Prepared, progress: Progress) -> Iterator[Solver]:
    """A solver that has followed the static load path. Collective."""
    with Solver(comm, prepared.reduced, prepared.options) as solver:
        try:
            progress.static(come_to_rest(solver, job, prepared.load_path))
        finally:
            progress.warn(cautions.of_static_solution(solver.static_states))
        yield solver


def come_to_rest(solver: Solver, job: Job, load_path: np.ndarray) -> np.ndarray:
    """Follow the static load path `[corners, loads]`; the means of the monitors. Collective."""
    # The frequency matters to scales alone, but at a resonance without damping there are none.
    lowest = min(family.modes.natural_hz[0] for family in families_of(solver, "stuck", 1))
    quiet = 0.5 * lowest / (solver.coefficients // 2)
    return solver.follow_static_path(load_path, job["static"]["steps"], quiet)
