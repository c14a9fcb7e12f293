"""What `attrito peak` and `attrito mode` do around what they follow: read, check, build, write alone, and complain."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene
from attrito.scene.scene import Scene
from attrito.support.errors import UnsolvedError
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root, on_root_only

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Job, scene at the root, file and picture to write, progress; returns what is missing, in words
Follow = Callable[[Job, Scene | None, str, str, Progress], str]


def follow_job(
    comm: Comm,
    path: str | Job,
    check: Callable[[Job], None],
    file_of: Callable[[Job], str],
    picture: str | None,
    follow: Follow,
    excited: bool = True,
) -> str:
    """Follow what a job asks for, and return the file's path. Collective.

    Parameters
    ----------
    path : the job file, or the job
    check : raises `InputError` for faults of the job, at the root
    file_of : the file to write, which nobody else writes meanwhile
    picture : the file to draw it in; None: that of the file, ending .png
    follow : writes and shows what is found
    excited : whether the job needs a sweep and a harmonic load

    Raises
    ------
    UnsolvedError : something is missing; what was found is in the file
    """
    progress = Progress(comm)
    job = on_root(comm, lambda: read_job(path, excited=excited))
    on_root(comm, lambda: check(job))
    scene = on_root_only(comm, lambda: build_scene(job))
    file = file_of(job)
    picture = picture or str(Path(file).with_suffix(".png"))
    with writing_alone(comm, file, picture):
        missed = follow(job, scene, file, picture, progress)
    if missed:
        raise UnsolvedError(file, missed)
    return file
