"""`attrito linear-modes`: modes of a linear system that a job's scene is compared with, into an HDF5 file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.cyclic import take_no_sector
from attrito.job.job import Job, linear_modes_path, model_path
from attrito.job.reading import read_job
from attrito.library.session import LinearModes
from attrito.modes.scene_at_rest import Prepared, prepare, solver_at_rest
from attrito.results.result import LINEAR_MODES, Result
from attrito.runs.linear_references import MEANINGS, in_words
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene
from attrito.scene.reduced_sector import attributes_of_sector, axes_of_sector
from attrito.support.atomic_files import whole_hdf5
from attrito.support.csv_text import cell
from attrito.support.hdf5_writing import described
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root, on_root_only
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

KINDS = ("elastic", "rigid")


def linear_modes_job(comm: Comm, path: str | Job, state: str = "tangent", count: int = 20) -> str:
    """Find the modes of a job's scene in one of `REFERENCES`: file, and table on standard output.

    Parameters
    ----------
    path : the job file, or the job; it needs neither a sweep nor a harmonic load nor monitors
    state : one of `REFERENCES`
    count : of modes, at most

    Returns
    -------
    the file's path
    """
    progress = Progress(comm)
    job = on_root(comm, lambda: read_job(path, excited=False))
    on_root(comm, lambda: take_no_sector(job, "linear-modes"))
    scene = on_root_only(comm, lambda: build_scene(job))
    file = linear_modes_path(job)
    with writing_alone(comm, file):
        prepared = prepare(comm, job, scene, progress)
        with solver_at_rest(comm, job, prepared, progress) as solver:
            modes, closed = solver.linear_modes(state, count), solver.closed_contacts()
        progress.say(f"{state} ({MEANINGS[state]}): {in_words(modes.natural_hz[modes.rigid :], modes.rigid, 3)} Hz")
        on_root(comm, lambda: _write(file, job, prepared, state, modes, closed, progress.warnings))
    progress.say(file)

    def show() -> None:
        with Result(file) as result:
            print(table(result), end="")

    on_root(comm, show)
    return file


def _write(
    path: str, job: Job, prepared: Prepared, state: str, modes: LinearModes, closed: np.ndarray, warnings: list[str]
) -> None:
    """Write the modes; the file appears when it is complete."""
    rom = None if prepared.rom is None else prepared.rom.path
    model = model_path(job, rom)
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(path) as file:
        file.attrs["format"] = LINEAR_MODES
        file.attrs["format_version"] = 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = f"Linear modes, {state}: {MEANINGS[state]}; see docs/modes.md of attrito"
        file.attrs["references"] = "Craig & Bampton 1968, doi:10.2514/3.4741"
        file.attrs.update(job.attributes)
        file.attrs["job_file"] = str(Path(job.path).resolve()) if Path(job.path).is_file() else ""
        file.attrs["model_file"] = "" if model is None else str(Path(model).resolve())
        file.attrs["rom_file"] = "" if rom is None else str(Path(rom).resolve())
        file.attrs["rom_fingerprint"] = prepared.reduced.reduction
        file.attrs["state"] = state
        file.attrs.update(attributes_of_sector(prepared.reduced.sector))
        for name, (values, description) in axes_of_sector(prepared.reduced.sector).items():
            described(file, name, description, data=values)
        file.attrs["warnings"] = "\n".join(warnings)
        described(file, "points/frequency_hz", "natural frequency", "Hz", data=modes.natural_hz)
        ratio = "of the structure's own damping, x^T C x / (2 omega); 0 of rigid-body modes"
        described(file, "points/damping_ratio", ratio, data=modes.damping_ratio)
        kind = (np.arange(len(modes.natural_hz)) < modes.rigid).astype(np.int32)
        described(file, "points/kind", "of the mode", names=KINDS, data=kind)
        shapes = np.zeros((*modes.shapes.shape, 3))
        shapes[:, :, 1] = modes.shapes
        description = "shape with unit modal mass in the coordinates that are solved, as mean, cos 1, sin 1"
        described(file, "points/coordinates", description, "user length (user mass)^-0.5", data=shapes)
        for name, vector in zip(prepared.reduced.monitor_names, prepared.reduced.monitors, strict=True):
            values = modes.shapes @ vector
            described(file, f"monitors/{name}/shape", "of the shape", "user length (user mass)^-0.5", data=values)
        described(file, "closed", "contacts that touch at the static solution", data=closed.astype(np.int32))


def table(result: Result) -> str:
    """The modes as CSV: `mode, frequency_hz, kind, damping_ratio`, then the shape at each monitor."""
    monitors = result.monitors
    lines = [",".join(["mode", "frequency_hz", "kind", "damping_ratio", *map(cell, monitors)])]
    kinds, names = result.array("/points/kind"), result.names("/points/kind")
    columns = [result.array("/points/damping_ratio"), *(result.monitor(name, "shape") for name in monitors)]
    for i, frequency in enumerate(result.array("/points/frequency_hz")):
        numbers = [f"{column[i]:.12g}" for column in columns]
        lines.append(",".join([str(i + 1), f"{frequency:.12g}", names[kinds[i]], *numbers]))
    return "\n".join(lines) + "\n"
