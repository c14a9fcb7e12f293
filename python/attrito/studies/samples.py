"""What samples of a study share: the ranks, the scene that they differ from, and the reduced model of them all."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job, rom_path
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options
from attrito.runs.progress import Progress
from attrito.scene import cautions
from attrito.scene.build import build_scene, with_numbers_of
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.scene.solver_options import solver_options
from attrito.support.parallel import on_root, on_root_only

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Samples:
    """Jobs that differ in numbers, solved one after another.

    Parameters
    ----------
    comm : group of ranks
    base : scene of a job that the others differ from in contacts' laws, load path and damping alone, on rank 0; None
        where each is to be built again
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


def shared_scene(
    comm: Comm, job: Job, keeps_places: bool, progress: Progress, reads: bool
) -> tuple[Scene | None, Rom | None]:
    """The scene that samples differ from in numbers alone, if they do, and the reduced model of all, where `reads`."""
    scene = on_root_only(comm, lambda: build_scene(job))
    progress.warn(on_root(comm, lambda: cautions.of_scene(job, scene)))
    rom, report = make_rom(comm, job, scene, progress.say, progress.step, reads)
    progress.reduction(report)
    progress.warn(on_root(comm, lambda: cautions.of_damping(reduced_scene(job, scene, rom))))
    if not keeps_places:
        return None, rom

    def light() -> Scene:
        if rom_path(job) is None:
            return scene
        return replace(scene, model=replace(scene.model, stiffness=None, mass=None, damping=None))

    return on_root(comm, light), rom
