"""`attrito linear-modes`: modes of a linear system that a job's scene is compared with, into an HDF5 file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito.job.coriolis import take_no_coriolis
from attrito.job.cyclic import is_cyclic
from attrito.job.job import Job, linear_modes_path, model_path
from attrito.job.reading import read_job
from attrito.job.sensitivity import parameters_of, refuse_for_sectors
from attrito.library.session import Solver
from attrito.modes.families import KINDS, Family, families_of, meaning_of_diameters
from attrito.modes.frequency_slopes import frequency_slopes, spring_rates
from attrito.modes.scene_at_rest import Prepared, prepare, solver_at_rest
from attrito.results.result import LINEAR_MODES
from attrito.runs.linear_references import MEANINGS
from attrito.runs.progress import Progress
from attrito.runs.sensitivity import SERIES, rates_of
from attrito.scene.build import build_scene
from attrito.scene.reduced_sector import attributes_of_sector, axes_of_sector
from attrito.scene.scene import Scene
from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root, on_root_only
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


def linear_modes_job(comm: Comm, path: str | Job, state: str = "tangent", count: int = 20) -> str:
    """Find the modes of a job's scene in one of `REFERENCES`: file, and table on standard output.

    Parameters
    ----------
    path : the job file, or the job; it needs neither a sweep nor a harmonic load nor monitors
    state : one of `REFERENCES`
    count : of modes, at most; of a sector's wheel, of each nodal diameter

    Returns
    -------
    the file's path
    """
    progress = Progress(comm)
    job = on_root(comm, lambda: _checked(read_job(path, excited=False)))
    on_root(comm, lambda: refuse_for_sectors(job, "modes"))
    scene = on_root_only(comm, lambda: build_scene(job))
    file = linear_modes_path(job, state)
    with writing_alone(comm, file):
        prepared = prepare(comm, job, scene, progress)
        with solver_at_rest(comm, job, prepared, progress) as solver:
            families, closed = families_of(solver, state, count), solver.closed_contacts()
            slopes = _slopes(comm, solver, job, scene, prepared, state, closed)
        found = [family.in_words() for family in families]
        progress.say(f"{state} ({MEANINGS[state]}): " + ("" if len(found) == 1 else "\n  ") + "\n  ".join(found))
        on_root(comm, lambda: _write(file, job, prepared, state, families, closed, slopes, progress.warnings))
    progress.say(f"Result: {file}. Table: attrito table {file}")
    return file


def _checked(job: Job) -> Job:
    if not is_cyclic(job):
        take_no_coriolis(job, "linear-modes on a whole model")
    return job


def _slopes(
    comm: Comm, solver: Solver, job: Job, scene: Scene | None, prepared: Prepared, state: str, closed: np.ndarray
) -> np.ndarray | None:
    """Derivatives of all natural frequencies by `[sensitivity] to`, `[modes, parameters]`; None without. Collective."""
    if not (parameters := parameters_of(job)):
        return None
    # All of them: of a frequency that is repeated some might not be among those asked for.
    modes = solver.linear_modes(state, len(prepared.reduced.mass))

    def find() -> np.ndarray:
        laws = rates_of(job, scene, prepared.reduced, parameters).laws
        rates = spring_rates(prepared.reduced.laws["tangents"], laws, state, closed)
        return frequency_slopes(modes, prepared.reduced.directions, rates)

    return on_root(comm, find)


def _write(
    path: str,
    job: Job,
    prepared: Prepared,
    state: str,
    families: list[Family],
    closed: np.ndarray,
    slopes: np.ndarray | None,
    warnings: list[str],
) -> None:
    """Write the modes; the file appears when it is complete."""
    rom = None if prepared.rom is None else prepared.rom.path
    model = model_path(job, rom)
    sector = prepared.reduced.sector
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(path) as file:
        file.attrs["format"] = LINEAR_MODES
        file.attrs["format_version"] = 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = f"Linear modes, {state}: {MEANINGS[state]}; see docs/how-to/modes.md of attrito"
        file.attrs["references"] = "Craig & Bampton 1968, doi:10.2514/3.4741"
        if sector is not None:
            file.attrs["references"] += "; Thomas 1979, Int. J. Numer. Methods Eng. 14, 81-102"
        file.attrs.update(job.attributes)
        file.attrs["job_file"] = str(Path(job.path).resolve()) if Path(job.path).is_file() else ""
        file.attrs["model_file"] = "" if model is None else str(Path(model).resolve())
        file.attrs["rom_file"] = "" if rom is None else str(Path(rom).resolve())
        file.attrs["rom_fingerprint"] = prepared.reduced.reduction
        file.attrs["state"] = state
        file.attrs.update(attributes_of_sector(sector))
        for name, (values, description) in axes_of_sector(sector).items():
            described(file, name, description, data=values)
        file.attrs["warnings"] = "\n".join(warnings)
        of_all = [family.modes for family in families]
        frequency = np.concatenate([modes.natural_hz for modes in of_all])
        described(file, "points/frequency_hz", "natural frequency", "Hz", data=frequency)
        if sector is not None:
            diameter = np.repeat([family.diameter for family in families], [len(modes.natural_hz) for modes in of_all])
            what = meaning_of_diameters(families)
            described(file, "points/nodal_diameter", what, data=diameter.astype(np.int32))
        ratio = "of the structure's own damping, x^H C x / (2 omega); 0 of rigid-body modes"
        described(file, "points/damping_ratio", ratio, data=np.concatenate([modes.damping_ratio for modes in of_all]))
        kind = np.concatenate([np.arange(len(modes.natural_hz)) < modes.rigid for modes in of_all])
        described(file, "points/kind", "of the mode", names=KINDS, data=kind.astype(np.int32))
        _write_shapes(file, prepared, np.concatenate([modes.shapes for modes in of_all]))
        if slopes is not None:
            values = [one.value(job) for one in parameters_of(job)]
            for name, data in (
                ("frequency_hz", slopes[: len(frequency)]),
                ("value", np.tile(values, (len(frequency), 1))),
            ):
                series = SERIES[name]
                described(file, f"sensitivity/{name}", series.description, series.unit, data=data)
        described(file, "closed", "contacts that touch at the static solution", data=closed.astype(np.int32))


def _write_shapes(file: h5py.File, prepared: Prepared, shapes: np.ndarray) -> None:
    """Shapes `[modes, m]` on coordinates and monitors; complex ones are x = cosine - i sine."""
    unit = "user length (user mass)^-0.5"
    whole = np.zeros((*shapes.shape, 3))
    whole[:, :, 1], whole[:, :, 2] = shapes.real, -shapes.imag
    norm = "x^H M x = 1" if np.iscomplexobj(shapes) else "unit modal mass"
    description = f"shape with {norm} in the coordinates that are solved, as mean, cos 1, sin 1"
    described(file, "points/coordinates", description, unit, data=whole)
    parts = {"cosine": whole[:, :, 1], "sine": whole[:, :, 2]} if np.iscomplexobj(shapes) else {"shape": shapes}
    for name, vector in zip(prepared.reduced.monitor_names, prepared.reduced.monitors, strict=True):
        for part, values in parts.items():
            described(file, f"monitors/{name}/{part}", f"{part} at the monitor", unit, data=values @ vector)
