"""`attrito campbell`: tangent modes of a job's scene against the speed of rotation, into an HDF5 file.

At each speed the static solution is found again, from the start of its load path: contacts that are open there are open
in the modes, the others stick. Of a wheel these are the modes of each nodal diameter.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito.job.coriolis import take_no_coriolis
from attrito.job.cyclic import excited_diameter, folded_diameter, is_cyclic
from attrito.job.job import Job, campbell_path, model_path
from attrito.job.reading import read_job
from attrito.modes.crossings import Crossing, crossings
from attrito.modes.families import KINDS, Family, families_of, meaning_of_diameters
from attrito.modes.scene_at_rest import Prepared, prepare, solver_at_rest
from attrito.results.result import CAMPBELL, Result
from attrito.runs.progress import Progress
from attrito.scene.at_speed import RotatingScene, rotating_scene
from attrito.scene.build import build_scene
from attrito.scene.reduced_sector import attributes_of_sector
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import InputError, NumericsError
from attrito.support.hdf5_writing import described
from attrito.support.locks import writing_alone
from attrito.support.own_folders import remove_folder, take_folder
from attrito.support.parallel import on_root, on_root_only
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Engine orders that are drawn where the job names none
ORDERS = range(1, 13)


@dataclass(frozen=True)
class AtSpeed:
    """What is found at a speed: modes, and which contacts touch `[nc]`."""

    speed_hz: float
    families: list[Family]
    closed: np.ndarray

    def in_words(self) -> str:
        """Contacts, and the lowest natural frequency of each family."""
        lowest = [hz for family in self.families for hz in family.elastic_hz[:1]]
        modes = f"lowest mode {lowest[0]:.5g} Hz" if len(lowest) == 1 else f"lowest modes {_span(lowest)} Hz"
        return f"{self.speed_hz:g} Hz: {self.closed.sum()} of {len(self.closed)} contacts closed; {modes}"

    def cautions(self) -> list[str]:
        """A warning where motion grows by itself."""
        lost = sum(np.count_nonzero(family.elastic_hz == 0.0) for family in self.families)
        words = f"at {self.speed_hz:g} Hz {lost} modes are unstable, omega^2 < 0: they stand at 0 Hz"
        return [words] if lost else []


def _span(values: list[float]) -> str:
    return f"{min(values):.5g} to {max(values):.5g}" if values else "none"


def campbell_job(comm: Comm, path: str | Job, picture: str | None = None) -> str:
    """Find the tangent modes of a job at the speeds of its `[campbell]`: file, critical speeds in words, picture.

    Parameters
    ----------
    path : the job file, or the job; it needs neither a sweep nor a harmonic load nor monitors
    picture : the file to draw the diagram in; None: that of the diagram, ending .png

    Returns
    -------
    the file's path
    """
    progress = Progress(comm)
    job = on_root(comm, lambda: _checked(read_job(path, excited=False)))
    scene = on_root_only(comm, lambda: rotating_scene(job, build_scene(job)))
    progress.warn(on_root(comm, lambda: scene.cautions))
    file = campbell_path(job)
    picture = picture or str(Path(file).with_suffix(".png"))
    with writing_alone(comm, file, picture):
        found = []
        for speed, prepared in _prepared(comm, job, scene, progress):
            try:
                with solver_at_rest(comm, job, prepared, progress) as solver:
                    families = families_of(solver, "tangent", job["campbell"]["modes"])
                    found.append(AtSpeed(speed, families, solver.closed_contacts()))
            except InputError as error:
                expected = f"speeds at which the structure stands; {error}"
                raise InputError(job.fault("[campbell] speeds_hz", speed, expected)) from error
            except NumericsError as error:
                raise NumericsError(f"at {speed:g} Hz: {error}") from error
            progress.say(found[-1].in_words())
            progress.warn(found[-1].cautions())
        met = crossings_of(job, found)
        on_root(comm, lambda: _write(file, job, prepared, found, met, progress.warnings))

    def draw() -> None:
        from attrito.plots.campbell import campbell_diagram
        from attrito.plots.style import save

        with Result(file) as result:
            save(campbell_diagram(result), picture)

    on_root(comm, draw)
    progress.say("\n".join([*in_words(met), f"Result: {file}; picture: {picture}. Table: attrito table {file}"]))
    return file


def _checked(job: Job) -> Job:
    if not is_cyclic(job):
        take_no_coriolis(job, "campbell on a whole model")
    if "campbell" not in job.given:
        raise InputError(job.fault("[campbell]", "missing", "this table, with speeds_hz"))
    return job


def _prepared(
    comm: Comm, job: Job, scene: RotatingScene | None, progress: Progress
) -> Iterator[tuple[float, Prepared]]:
    """Each speed with what is solved there, reduced once where the stiffness is the same at all of them. Collective.

    Where it is not, reductions are kept for as long as they are needed: in a folder beside the diagram's file.
    """
    speeds = job["campbell"]["speeds_hz"]
    varies = on_root(comm, lambda: scene.stiffness_varies)
    if not varies:
        own = prepare(comm, job, None if scene is None else scene.at(speeds[-1]), progress)
        for speed in speeds:
            reduced = own.reduced.turning(speed / speeds[-1] if speeds[-1] else 1.0)
            yield speed, replace(own, reduced=reduced, load_path=on_root(comm, lambda at=speed: scene.load_path(at)))
        return
    with _folder(comm, job) as folder:
        for number, speed in enumerate(speeds):
            there = on_root_only(comm, lambda at=speed: _without_recovery(job, scene.at(at)))
            keys = job["reduction"] | {"file": str(Path(folder).absolute() / f"speed_{number}.h5")}
            yield speed, prepare(comm, replace(job, tables=job.tables | {"reduction": keys}), there, progress)


def _without_recovery(job: Job, scene):
    """The scene whose reduction gives back no motion but that of what it keeps."""
    return replace(scene, recovered=np.empty(0, dtype=np.int64)) if "reduction" in job.given else scene


@contextlib.contextmanager
def _folder(comm: Comm, job: Job) -> Iterator[str]:
    """A folder of the diagram's own, which has been locked; removed at the end, or what a killed process left of it."""

    folder = f"{campbell_path(job)}.reductions"
    on_root(comm, lambda: take_folder(folder, ""))
    try:
        yield folder
    finally:
        if comm.rank == 0:
            with contextlib.suppress(OSError):
                # What cannot be removed is taken up by the next one.
                remove_folder(folder)


def engine_orders(job: Job) -> list[int]:
    """Those that are drawn."""
    given = job["campbell"]["engine_orders"]
    if given is not None:
        return sorted(set(given))
    own = {abs(job["cyclic"]["engine_order"])} if is_cyclic(job) else set()
    return sorted({*ORDERS, *own} - {0})


def _excited(job: Job, order: int) -> int:
    """The nodal diameter of an engine order; where waves both ways differ it runs as that of the job does."""
    sectors = job["cyclic"]["sectors"]
    if not job["cyclic"]["coriolis"]:
        return folded_diameter(sectors, order)
    return excited_diameter(sectors, -order if job["cyclic"]["engine_order"] < 0 else order)


def crossings_of(job: Job, found: list[AtSpeed]) -> list[Crossing]:
    """Critical speeds, lowest first: of each nodal diameter by the engine orders that excite it."""
    speeds = np.array([one.speed_hz for one in found])
    met = []
    for at_each in zip(*(one.families for one in found), strict=True):
        diameter = at_each[0].diameter
        differ = diameter is not None and any(family.diameter == -diameter != 0 for family in found[0].families)
        orders = [order for order in engine_orders(job) if diameter is None or _excited(job, order) == diameter]
        met += crossings(speeds, np.array([one.modes.natural_hz for one in at_each]), orders, diameter, differ)
    return sorted(met, key=lambda one: (one.speed_hz, one.engine_order))


def in_words(met: list[Crossing], most: int = 12) -> list[str]:
    """Critical speeds, the lowest ones."""
    lines = [
        f"engine order {one.engine_order} meets mode {one.mode}"
        + (f" of nodal diameter {one.diameter}" if one.diameter is not None else "")
        + f" at {one.speed_hz:.5g} Hz: {one.frequency_hz:.5g} Hz"
        for one in met[:most]
    ]
    more = len(met) - most
    return [*lines, f"and {more} more in the file"] if more > 0 else lines or ["no engine order meets a mode"]


def _write(
    path: str, job: Job, prepared: Prepared, found: list[AtSpeed], met: list[Crossing], warnings: list[str]
) -> None:
    """Write the diagram; the file appears when it is complete."""
    model = model_path(job, None)
    rows = [(one, family, i) for one in found for family in one.families for i in range(len(family.modes.natural_hz))]
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(path) as file:
        file.attrs["format"] = CAMPBELL
        file.attrs["format_version"] = 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = "Tangent modes against the speed of rotation; see docs/how-to/modes.md of attrito"
        file.attrs["references"] = (
            "Campbell 1924, Trans. ASME 46, 31-160; Southwell & Gough 1921, Aeronautical Research Committee R&M 766"
        )
        file.attrs.update(job.attributes)
        file.attrs["job_file"] = str(Path(job.path).resolve()) if Path(job.path).is_file() else ""
        file.attrs["model_file"] = "" if model is None else str(Path(model).resolve())
        file.attrs.update(attributes_of_sector(prepared.reduced.sector))
        file.attrs["warnings"] = "\n".join(warnings)
        speeds = np.array([one.speed_hz for one in found])
        described(file, "speeds/speed_hz", "speed of rotation", "Hz", data=speeds)
        closed = np.array([one.closed for one in found]).astype(np.int32)
        described(file, "speeds/closed", "contacts that touch at the static solution", data=closed)
        _write_modes(file, rows)
        _write_crossings(file, met)
        orders = np.array(engine_orders(job), dtype=np.int32)
        described(file, "crossings/drawn", "engine orders that were looked at", data=orders)


def _write_modes(file: h5py.File, rows: list[tuple[AtSpeed, Family, int]]) -> None:
    """A row a mode, by speed, nodal diameter and frequency."""

    def column(value, kind: type) -> np.ndarray:
        return np.array([value(*row) for row in rows], dtype=kind)

    described(file, "points/speed_hz", "speed of rotation", "Hz", data=column(lambda at, family, i: at.speed_hz, float))
    if rows and rows[0][1].diameter is not None:
        what = meaning_of_diameters(family for _, family, _ in rows)
        described(file, "points/nodal_diameter", what, data=column(lambda at, family, i: family.diameter, np.int32))
    described(
        file,
        "points/mode",
        "number within speed and nodal diameter",
        data=column(lambda at, family, i: i + 1, np.int32),
    )
    described(
        file,
        "points/frequency_hz",
        "natural frequency in the frame that turns",
        "Hz",
        data=column(lambda at, family, i: family.modes.natural_hz[i], float),
    )
    ratio = "of the structure's own damping, x^H C x / (2 omega); 0 of rigid-body modes"
    described(
        file, "points/damping_ratio", ratio, data=column(lambda at, family, i: family.modes.damping_ratio[i], float)
    )
    kind = column(lambda at, family, i: i < family.modes.rigid, np.int32)
    described(file, "points/kind", "of the mode", names=KINDS, data=kind)


def _write_crossings(file: h5py.File, met: list[Crossing]) -> None:
    """A row a critical speed."""
    between = "between the speeds of the job f^2 is linear in the square of the speed"
    described(
        file, "crossings/speed_hz", f"critical speed; {between}", "Hz", data=np.array([one.speed_hz for one in met])
    )
    described(
        file, "crossings/frequency_hz", "of the mode there", "Hz", data=np.array([one.frequency_hz for one in met])
    )
    for name, description, values in (
        ("engine_order", "that meets the mode", [one.engine_order for one in met]),
        ("mode", "number within its nodal diameter", [one.mode for one in met]),
        ("nodal_diameter", "of the mode", [one.diameter for one in met]),
    ):
        if None not in values:
            described(file, f"crossings/{name}", description, data=np.array(values, dtype=np.int32))
