"""The reduced model of a scene: made by the library and kept in rom.h5, or the matrices as they stand.

A `rom.h5` is used again when its fingerprint says that it was made from the same matrices, boundary, vectors and modes.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from attrito import __version__
from attrito.faults import Fault, InputError
from attrito.info import receptance_errors
from attrito.job import HARMONICS, Job, model_path, rom_path
from attrito.model_file import write_model
from attrito.parallel import on_root
from attrito.reduction import Listener, Report, reduce_model
from attrito.scene import Scene
from attrito.solver import ReducedScene
from attrito.stored import UNREADABLE, stored
from attrito.whole_file import whole_hdf5

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

LARGEST_DENSE = 4000
ROM = "a rom.h5 of `attrito reduce` (delete it, and it is made anew)"
# Error below which modes, solved to residuals of 1e-12, tell nothing
LEAST_ERROR = 1e-12
# Raised when the reduction of the same input changes, so that no older rom.h5 is taken for it.
REDUCTION_VERSION = 2


def make_rom(
    comm: Comm, job: Job, scene: Scene | None, say: Any = print, listener: Listener | None = None
) -> Report | None:
    """Reduce the scene (held by rank 0) unless rom.h5 already holds it; returns the library's report, if it worked.

    The matrices of the scene's model are released: the library reads its own, and a big model is not to be held twice.
    """
    path, source = rom_path(job), model_path(job)
    # The library reads matrices from files; those of a softened stiffness are of use to nobody else.
    softened = any(load["spin_softening"] for load in job["load"])
    source = f"{path}.softened" if softened else source
    keys = job["reduction"]

    def prepare() -> tuple[bool, str, np.ndarray]:
        _check_interior(job, scene)
        fingerprint = _fingerprint(job, scene)
        fresh = rom_fingerprint(path) == fingerprint
        if fresh:
            say(f"reduced model {path}: up to date")
        else:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            if job["model"]["file"] is None or softened:
                write_model(source, scene.model, [])
            if Path(path).exists():
                say(f"replacing {path}, another reduced model: shapes of its results can be exported no longer")
            say(f"reducing {scene.model.size} dofs onto {len(scene.boundary)} boundary dofs and {_modes_in_words(job)}")
            scene.model.stiffness = scene.model.mass = scene.model.damping = None
        return fresh, fingerprint, scene.boundary

    fresh, fingerprint, boundary = on_root(comm, prepare)
    if fresh:
        return None
    vectors = None if comm.rank else np.array(list(_vectors(scene).values()))
    partial = f"{path}.partial"
    by_error = keys["modes"] == "auto"
    try:
        report = reduce_model(
            comm,
            source,
            partial,
            boundary,
            vectors,
            modes=None if by_error else keys["modes"],
            max_frequency_hz=keys["max_frequency_hz"],
            error_target=keys["error"] if by_error else None,
            top_frequency_hz=excited_hz(job),
            ordering=keys["ordering"],
            out_of_core=None if keys["out_of_core"] == "auto" else keys["out_of_core"],
            memory_gb=keys["memory_gb"],
            fingerprint=fingerprint,
            listener=listener,
        )
    finally:
        if softened and comm.rank == 0:
            Path(source).unlink(missing_ok=True)

    def finish() -> None:
        with whole_hdf5(path, start=partial) as file:
            file.attrs["fingerprint"] = fingerprint
            file.attrs["attrito_version"] = __version__
            file.attrs["job"] = json.dumps(job.tables)
            names = np.array(list(_vectors(scene)), dtype=h5py.string_dtype())
            named = file.create_dataset("vectors/name", data=names)
            named.attrs["description"], named.attrs["unit"] = "names of the loads and monitors", "1"

    on_root(comm, finish)
    return report


def excited_hz(job: Job) -> float:
    """The highest frequency that modes matter for: that of the highest harmonic at the end of the sweep.

    Where harmonics are chosen point by point, of the fifth: beyond, modes that are left out follow at rest.
    """
    sweep = job["sweep"]
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


def reduced_scene(job: Job, scene: Scene) -> ReducedScene:
    """The scene in the coordinates that are solved, from rom.h5 or the matrices as they stand (rank 0)."""
    path = rom_path(job)
    counts = [len(scene.static), len(scene.harmonic), len(scene.monitors)]
    if path is None:
        model = scene.model
        if model.size > LARGEST_DENSE:
            raise InputError(
                job.fault(
                    "[reduction]", "missing", f"a reduction: {model.size} dofs are too many to be used as they stand"
                )
            )
        mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
        damping = None if model.damping is None else model.damping.toarray()
        vectors = np.array(list(_vectors(scene).values()))
        directions = scene.contacts.rows.toarray()
    else:
        mass, stiffness, damping, vectors, boundary = _read_rom(path, sum(counts), scene.model.size)
        directions = np.zeros((scene.contacts.rows.shape[0], len(mass)))
        directions[:, : len(boundary)] = scene.contacts.rows[:, boundary].toarray()
    static, harmonic, monitors = np.split(np.ascontiguousarray(vectors, dtype=float), np.cumsum(counts)[:-1])
    kind, value, damping = _damping(job, mass, stiffness, damping)
    return ReducedScene(
        *(np.ascontiguousarray(matrix, dtype=float) for matrix in (mass, stiffness)),
        kind,
        value,
        damping,
        scene.contacts.laws,
        np.ascontiguousarray(directions),
        *(np.ascontiguousarray(part) for part in (static, harmonic, monitors)),
        list(scene.monitors),
    )


def _read_rom(path: str, vectors: int, dofs: int) -> tuple:
    """Mass, stiffness, damping or None, loads and monitors, boundary dofs of a rom.h5."""
    with stored(path, ROM) as file:
        size = len(file["mass"])
        wanted = {"mass": (size, size), "stiffness": (size, size), "vectors/reduced": (vectors, size)}
        wanted |= {"damping": (size, size)} if "damping" in file else {}
        read = {name: file[name][()] for name in wanted}
        boundary = file["boundary/dof"][:]
    faults = [
        Fault(path, name, f"{values.dtype} of shape {values.shape}", f"finite numbers of shape {wanted[name]}")
        for name, values in read.items()
        if values.shape != wanted[name] or values.dtype.kind != "f" or not np.all(np.isfinite(values))
    ]
    if boundary.dtype.kind != "i" or len(boundary) > size or np.any((boundary < 0) | (boundary >= dofs)):
        faults.append(Fault(path, "boundary/dof", boundary, f"at most {size} dofs of the model, 0 to {dofs - 1}"))
    if faults:
        raise InputError(*faults)
    return read["mass"], read["stiffness"], read.get("damping"), read["vectors/reduced"], boundary


def _damping(
    job: Job, mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray | None
) -> tuple[str, float, np.ndarray | None]:
    keys = job["damping"]
    if keys["ratio"] is not None:
        return "ratio", keys["ratio"], None
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
    for matrix in (scene.model.stiffness, scene.model.mass, scene.model.damping):
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
    return digest.hexdigest()


def mode_error(path: str | None) -> float:
    """What the modes left out of a rom.h5 cost the monitors, relative to the largest response; 0 without a reduction.

    The largest estimated error of a receptance between a monitor and a load (method.md, Reduction).
    """
    if path is None:
        return 0.0
    with stored(path, ROM) as file:
        if "quality" not in file or "vectors/name" not in file:
            return 0.0
        names = [name.decode() for name in file["vectors/name"][:]]
        errors = receptance_errors(file["quality/receptance"][:], file["quality/receptance_error"][:])
        watched = [i for i, name in enumerate(names) if name.startswith("monitor:")]
        loads = [i for i in range(len(names)) if i not in watched] or watched
        worst = float(np.nan_to_num(errors[np.ix_(watched, loads)]).max(initial=0.0))
    return worst if worst > LEAST_ERROR else 0.0


def coordinates_fingerprint(job: Job, scene: ReducedScene) -> str:
    """Of what coordinates and sliders stand for: the reduction, or the mass as it stands, and the contacts' rows."""
    digest = hashlib.sha256(rom_fingerprint(rom_path(job)).encode() or np.ascontiguousarray(scene.mass).tobytes())
    digest.update(np.ascontiguousarray(scene.directions).tobytes())
    return digest.hexdigest()


def rom_fingerprint(path: str | None) -> str:
    """Fingerprint of a rom.h5; empty where there is none."""
    try:
        with h5py.File(path or "") as file:
            return str(file.attrs.get("fingerprint", ""))
    except UNREADABLE:
        return ""
