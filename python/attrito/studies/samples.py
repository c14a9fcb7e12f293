"""What samples of a study share: the ranks, the scene that they differ from, and the reduced model of them all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options
from attrito.scene.build import build_scene, with_numbers_of
from attrito.scene.reduced_model import Rom, reduced_scene
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Samples:
    """Jobs that differ in numbers, solved one after another.

    Parameters
    ----------
    comm : group of ranks
    base : scene of a job that the others differ from in contacts' laws, load path and damping alone, on rank 0; None
        where each is to be built anew
    rom : the reduced model of them all, on rank 0, where they have one
    """

    def __init__(self, comm: Comm, base: Scene | None, rom: Rom | None = None):
        self._comm, self._base, self._rom = comm, base, rom

    def close(self) -> None:
        """Release what is kept from sample to sample: nothing, unless a kind of samples says so."""

    def scene_of(self, job: Job) -> tuple[ReducedScene, np.ndarray, Options]:
        """What a job is solved with: the scene, its load path `[corners, loads]`, the solver's options. Collective."""

        def build() -> tuple[ReducedScene, np.ndarray, Options]:
            scene = build_scene(job) if self._base is None else with_numbers_of(job, self._base)
            return reduced_scene(job, scene, self._rom), scene.load_path, solver_options(job, self._rom)

        return on_root(self._comm, build)
