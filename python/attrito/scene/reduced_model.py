"""The reduced model of a scene: made by the library and kept in a file, or the matrices as they are.

A file is used again when its fingerprint says that it was made from the same matrices, boundary, vectors and modes.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from attrito.job.defaults import HARMONICS, MODE_ERROR
from attrito.job.job import Job, model_path, rom_path
from attrito.library.reduced_scene import ReducedScene
from attrito.library.reduction import Listener, Options, Report, reduce_model
from attrito.model.model_file import write_model
from attrito.scene.interface_modes import Boundary, interface_modes
from attrito.scene.reduced_sector import on_coordinates, sector_of, solved_axes, turned_axes
from attrito.scene.rom_claim import Claim, claim, steps_of
from attrito.scene.rom_file import Rom, read_rom, rom_fingerprint
from attrito.scene.scene import Scene
from attrito.scene.stiff_contacts import refuse_stiffer
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import is_of_format
from attrito.support.hdf5_writing import described
from attrito.support.own_folders import owner_of
from attrito.support.parallel import everywhere, on_root, on_root_in_its_time
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

LARGEST_DENSE = 4000
# Twice the square of twice as many is below 2^31.
LARGEST_REDUCED = 16000
# How often a file that others replace is looked at again, where there are no locks
MOST_ROUNDS = 5
# Raised when the reduction of the same input changes, so that no older rom.h5 is taken for it.
REDUCTION_VERSION = 2


def make_rom(
    comm: Comm,
    job: Job,
    scene: Scene | None,
    say: Any = print,
    listener: Listener | None = None,
    reads: bool | None = None,
) -> tuple[Rom | None, Report | None]:
    """The reduced model of a scene (held by rank 0), made unless its file is there, and the library's report if so.

    Other processes may want the same or another one in the same folder (`rom_claim`). What is read is looked at after
    it was read: it is what was asked for, whoever has written to the folder meanwhile. The matrices of the scene's
    model are released where the reduction reads its own: a big model is not to be held twice.

    Parameters
    ----------
    comm, job, scene : the ranks, the job, and its scene on rank 0
    say, listener : receive what is done, in words and in steps
    reads : whether this rank is to have the reduced model; None: rank 0 alone

    Returns
    -------
    the reduced model, None on ranks that do not read it and where the job asks for none; the report
    """
    if rom_path(job) is None:
        return None, None
    reads = comm.rank == 0 if reads is None else reads
    report: Report | None = None
    held: list[Claim] = []
    # The matrices may be gone later.
    fingerprint = on_root(comm, lambda: _asked(job, scene))
    sizes = comm.bcast(None if scene is None else (len(_vectors(scene)), scene.model.size, _paired(scene)))
    for _ in range(MOST_ROUNDS):
        try:
            path, fresh = on_root_in_its_time(comm, lambda: _claim(job, fingerprint, say, held))
            if not fresh:
                report = _make(comm, job, scene, held, path, fingerprint, say, listener)
            rom = everywhere(comm, lambda at=path: read_rom(at, *sizes) if reads else None)  # noqa: B023
        finally:
            if held:
                held.pop().release()
        # Another process may have replaced it before it was read, where there are no locks.
        if all(comm.allgather(rom is None or rom.fingerprint == fingerprint)):
            return rom, report
        if not fresh:
            break
    raise InputError(Fault(path, "fingerprint", "of another reduction, again and again", "a file of its own"))


def _asked(job: Job, scene: Scene) -> str:
    """Fingerprint of what is asked for (rank 0)."""
    _check_interior(job, scene)
    return _fingerprint(job, scene)


def _claim(job: Job, fingerprint: str, say: Any, held: list[Claim]) -> tuple[str, bool]:
    """The file, and whether it is there; what is held of it goes to `held` (rank 0)."""
    first = rom_path(job)
    given = job["reduction"]["file"] is not None
    held.append(claim(first, fingerprint, given, rom_fingerprint, say))
    path, fresh = held[0].path, held[0].fresh
    if fresh:
        say(f"reduced model {path}: up to date")
    elif Path(path).exists():
        what = "another reduced model" if rom_fingerprint(path) else "which cannot be read"
        say(f"replacing {path}, {what}: shapes of its results can be exported no longer")
    elif not given and path != first:
        say(f"{first} is of another reduction, done or interrupted: this one is {path}")
    return path, fresh


def _make(
    comm: Comm,
    job: Job,
    scene: Scene | None,
    held: list[Claim],
    path: str,
    fingerprint: str,
    say: Any,
    listener: Listener | None,
) -> Report:
    """Reduce the scene into a file under the lock of it."""
    source, partial, boundary, recovered = on_root(comm, lambda: _prepare(job, scene, path, held[0].work, say))
    vectors = None if comm.rank else np.array(list(_vectors(scene).values()))
    try:
        report = reduce_model(
            comm,
            source,
            partial,
            boundary,
            _options(job),
            vectors,
            recovered=recovered,
            fingerprint=fingerprint,
            listener=listener,
        )
    finally:
        if comm.rank == 0 and _is_altered(scene):
            Path(source).unlink(missing_ok=True)
    on_root(comm, lambda: _finish(job, scene, path, partial, fingerprint, say))
    return report


def _options(job: Job) -> Options:
    """What the job asks of the reduction."""
    keys = job["reduction"]
    by_error = keys["modes"] == "auto"
    return Options(
        modes=None if by_error else keys["modes"],
        max_frequency_hz=keys["max_frequency_hz"],
        error_target=keys["error"] if by_error else None,
        top_frequency_hz=excited_hz(job),
        eigensolver=keys["eigensolver"],
        ordering=keys["ordering"],
        out_of_core=None if keys["out_of_core"] == "auto" else keys["out_of_core"],
        memory_gb=keys["memory_gb"],
    )


def _is_altered(scene: Scene) -> bool:
    """Whether the scene's matrices are not those of the model's file."""
    return scene.altered or scene.spin is not None


def _prepare(job: Job, scene: Scene, path: str, work: str, say: Any) -> tuple[str, str, np.ndarray, np.ndarray | None]:
    """Files that the library reads and writes, boundary and recovered dofs; the scene's matrices are gone (rank 0).

    The library reads matrices from files; those of an altered stiffness are of use to nobody else.
    """
    source = model_path(job, path)
    if job["model"]["file"] is None:
        _check_spared(source, "attrito model")
        write_model(source, dataclasses.replace(scene.model, gyroscopic=None), [])
    if _is_altered(scene):
        source = f"{work}.altered"
        _check_spared(source, "attrito model")
        write_model(source, scene.model, [])
    if owner_of(steps_of(work)) is None:
        _check_spared(f"{work}.partial", "attrito rom")
    say(f"reducing {scene.model.size} dofs onto {len(scene.boundary)} boundary dofs and {_modes_in_words(job)}")
    scene.model.stiffness = scene.model.mass = scene.model.damping = scene.model.gyroscopic = None
    return source, f"{work}.partial", scene.boundary, scene.recovered


def _finish(job: Job, scene: Scene, path: str, partial: str, fingerprint: str, say: Any) -> None:
    """From what the library has written to the whole file (rank 0)."""
    with whole_hdf5(path, start=partial) as file:
        file.attrs["fingerprint"] = fingerprint
        file.attrs["attrito_version"] = __version__
        file.attrs["job"] = json.dumps(job.tables)
        names = np.array(list(_vectors(scene)), dtype=h5py.string_dtype())
        described(file, "vectors/name", "names of the loads and monitors", data=names)
        if _has_interface_modes(job):
            _write_interface(file, job, scene, say)


def _check_spared(path: str, form: str) -> None:
    """Raise where something that attrito has not made would be written over, or what a link leads to."""
    if os.path.lexists(path) and (os.path.islink(path) or not is_of_format(path, form)):
        expected = f"an {form} that is made for the reduction, or no file of this name: rename it"
        raise InputError(Fault(path, "file", "in the way", expected))


def excited_hz(job: Job) -> float:
    """The highest frequency that modes matter for: that of the highest harmonic at the end of the sweep.

    Where harmonics are chosen point by point, of the fifth: beyond, modes that are left out follow at rest. 0 where
    nothing is swept.
    """
    sweep = job["sweep"]
    if "sweep" not in job.given:
        return 0.0
    highest = max(sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]])
    harmonics = job["balance"]["harmonics"]
    return highest * (HARMONICS if harmonics == "auto" else harmonics)


def _modes_in_words(job: Job) -> str:
    keys = job["reduction"]
    if keys["modes"] == "auto":
        return f"as many modes as an error of {keys['error']:g} up to {excited_hz(job):g} Hz asks for"
    return f"{keys['modes']} modes" if keys["modes"] is not None else f"modes to {keys['max_frequency_hz']:g} Hz"


def _check_interior(job: Job, scene: Scene) -> None:
    """Raise unless there is something to reduce, and as many modes as the job asks for."""
    interior = scene.model.size - len(scene.boundary)
    modes = job["reduction"]["modes"]
    if interior == 0:
        expected = f"none: all {scene.model.size} dofs are boundary dofs, so there is nothing to reduce"
        raise InputError(job.fault("[reduction]", "given", expected))
    if isinstance(modes, int) and modes > interior:
        raise InputError(job.fault("[reduction] modes", modes, f"at most {interior}, the number of interior dofs"))
    kept = len(scene.boundary) + (modes if isinstance(modes, int) else 0)
    if kept > LARGEST_REDUCED:
        expected = f"at most {LARGEST_REDUCED} boundary dofs and modes: LAPACK counts entries of matrices by 32 bits"
        raise InputError(job.fault("[reduction]", f"{kept} boundary dofs and modes", expected))


def reduced_scene(job: Job, scene: Scene, rom: Rom | None = None) -> ReducedScene:
    """The scene in the coordinates that are solved: of a reduced model, or the matrices as they are (rank 0)."""
    counts = [len(scene.static), len(scene.harmonic), len(scene.monitors)]
    if rom is None and rom_path(job) is not None:
        raise TypeError("the job asks for a reduced model: give what make_rom returns")
    if rom is None:
        model = scene.model
        if model.size > LARGEST_DENSE:
            raise InputError(
                job.fault(
                    "[reduction]", "missing", f"a reduction: {model.size} dofs are too many to be used as they are"
                )
            )
        mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
        damping, gyroscopic = (None if one is None else one.toarray() for one in (model.damping, model.gyroscopic))
        vectors = np.array(list(_vectors(scene).values()))
    else:
        mass, stiffness, damping, vectors = rom.mass, rom.stiffness, rom.damping, rom.vectors
        gyroscopic = rom.gyroscopic
    place = len(mass), None if rom is None else rom.boundary
    interface = None if rom is None else rom.interface
    directions = on_coordinates(scene.contacts.rows, *place)
    axes = solved_axes(scene.sector, *place, interface)
    if axes is not None:
        mass, stiffness = (axes.T @ matrix @ axes for matrix in (mass, stiffness))
        damping, gyroscopic = (None if one is None else axes.T @ one @ axes for one in (damping, gyroscopic))
        vectors, directions = vectors @ axes, directions @ axes
    static, harmonic, monitors = np.split(np.ascontiguousarray(vectors, dtype=float), np.cumsum(counts)[:-1])
    kind, value, damping = _damping(job, mass, stiffness, damping)
    suspension_hz = job["model"]["suspension_hz"] or 0.0
    stiffness = stiffness + (2.0 * np.pi * suspension_hz) ** 2 * mass
    reduced = ReducedScene(
        *(np.ascontiguousarray(matrix, dtype=float) for matrix in (mass, stiffness)),
        kind,
        value,
        damping,
        scene.contacts.laws,
        np.ascontiguousarray(directions),
        *(np.ascontiguousarray(part) for part in (static, harmonic, monitors)),
        list(scene.monitors),
        "" if rom is None else rom.fingerprint,
        sector_of(scene, *place, interface, axes),
        None if scene.spin is None else np.ascontiguousarray(scene.spin * gyroscopic),
        _ratios_of_modes(job, len(mass)),
        suspension_hz,
    )
    refuse_stiffer(job, reduced)
    return reduced


def _paired(scene: Scene) -> int:
    """How many dofs the lower boundary of a sector has; 0 where the model is whole."""
    return 0 if scene.sector is None else len(scene.sector.lower)


def _ratios_of_modes(job: Job, modes: int) -> np.ndarray | None:
    """The damping ratio of each of so many modes, the last one given being that of all others; None: one of all."""
    given = job["damping"]["ratio"]
    if not isinstance(given, list):
        return None
    if len(given) > modes:
        expected = f"at most as many as the model has modes, {modes}"
        raise InputError(job.fault("[damping] ratio", f"a list of {len(given)}", expected))
    return np.array([*given, *[given[-1]] * (modes - len(given))])


def _damping(
    job: Job, mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray | None
) -> tuple[str, float, np.ndarray | None]:
    keys = job["damping"]
    if keys["ratio"] is not None:
        return "ratio", 0.0 if isinstance(keys["ratio"], list) else keys["ratio"], None
    if keys["loss_factor"] is not None:
        return "loss_factor", keys["loss_factor"], None
    alpha, beta = keys["rayleigh"] or (0.0, 0.0)
    if damping is not None or beta > 0.0:
        own = 0.0 if damping is None else damping
        with np.errstate(over="ignore", invalid="ignore"):
            viscous = np.ascontiguousarray(own + alpha * mass + beta * stiffness)
        if not np.all(np.isfinite(viscous)):
            raise InputError(job.fault("[damping] rayleigh", [alpha, beta], "factors whose damping is finite"))
        return "viscous", 0.0, viscous
    return ("mass", alpha, None) if alpha > 0.0 else ("none", 0.0, None)


def _vectors(scene: Scene) -> dict[str, np.ndarray]:
    """Every load and monitor by name, each `[n]`."""
    named = {f"load:{name}": vector for name, vector in scene.static.items()}
    named |= {f"harmonic:{i}": vector for i, vector in enumerate(scene.harmonic)}
    return named | {f"monitor:{name}": vector for name, vector in scene.monitors.items()}


def _fingerprint(job: Job, scene: Scene) -> str:
    digest = hashlib.sha256(f"reduction {REDUCTION_VERSION}".encode())
    gyroscopic = None if scene.spin is None else scene.model.gyroscopic
    for matrix in (scene.model.stiffness, scene.model.mass, scene.model.damping, gyroscopic):
        if matrix is not None:
            for array in (matrix.indptr, matrix.indices, matrix.data):
                digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(scene.boundary.tobytes())
    for name, vector in _vectors(scene).items():
        digest.update(name.encode() + vector.tobytes())
    keys = job["reduction"]
    digest.update(json.dumps([keys["modes"], keys["max_frequency_hz"]]).encode())
    if keys["modes"] == "auto":
        digest.update(json.dumps([keys["error"], excited_hz(job)]).encode())
    if scene.recovered is not None:
        digest.update(b"recovery" + scene.recovered.tobytes())
    if _has_interface_modes(job):
        cyclic = job["cyclic"]
        digest.update(json.dumps([cyclic["interface_modes"], cyclic["sectors"], _interface_error(job)]).encode())
        digest.update(json.dumps(excited_hz(job)).encode())
        for places in (scene.sector.lower, scene.sector.upper, scene.sector.along, scene.sector.across):
            digest.update(places.tobytes())
        for rows in (scene.contacts.rows, scene.contacts.next_rows, scene.sector.axes):
            if rows is not None:
                digest.update(rows.indptr.tobytes() + rows.indices.tobytes() + rows.data.tobytes())
    return digest.hexdigest()


def _has_interface_modes(job: Job) -> bool:
    return "cyclic" in job.given and job["cyclic"]["interface_modes"] != "all"


def _interface_error(job: Job) -> float:
    """Relative error of natural frequencies that interface modes may leave."""
    error: float = job["reduction"]["error"] or MODE_ERROR
    return error


def _write_interface(file: h5py.File, job: Job, scene: Scene, say: Any) -> None:
    """Find the interface modes of a reduced sector and keep them beside it."""
    boundary, size = file["boundary/dof"][:], len(file["mass"])
    mass, stiffness, loads = (file[name][()] for name in ("mass", "stiffness", "vectors/reduced"))
    rows = on_coordinates(scene.contacts.rows, size, boundary)
    axes = turned_axes(scene.sector, size, boundary)
    if axes is not None:
        mass, stiffness = axes.T @ mass @ axes, axes.T @ stiffness @ axes
        loads, rows = loads @ axes, rows @ axes
    asked, accepted = job["cyclic"]["interface_modes"], _interface_error(job)
    sector = sector_of(scene, size, boundary, None, axes)
    held = Boundary(mass, stiffness, rows, loads, sector)
    found = interface_modes(held, None if asked == "auto" else asked, excited_hz(job), accepted)
    shapes = "W, shapes of the lower boundary's dofs, and of the upper one's along the next sector's axes"
    described(file, "interface/basis", shapes, data=found.basis)
    what = "largest relative error of natural frequencies up to the highest that is excited, by the interface modes"
    described(file, "interface/error", what, data=found.error)
    say(
        f"boundaries of {len(sector.lower)} dofs each in {found.basis.shape[1]} interface modes: natural frequencies of"
        f" all nodal diameters, with every contact stuck, within {found.error:.1e}"
    )


def coordinates_fingerprint(scene: ReducedScene) -> str:
    """Of what coordinates and sliders stand for: the reduction, or the mass as it is, and the contacts' rows."""
    digest = hashlib.sha256(scene.reduction.encode() or np.ascontiguousarray(scene.mass).tobytes())
    digest.update(np.ascontiguousarray(scene.directions).tobytes())
    if scene.sector is not None:
        # The wave may change; what coordinates stand for does not.
        digest.update(dataclasses.replace(scene.sector, engine_order=0).digest.encode())
    return digest.hexdigest()
