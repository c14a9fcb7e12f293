"""The job's loads as vectors on the model's dofs, and what rotation takes from its stiffness."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.accelerations import BASE_KEYS, is_vector
from attrito.model.accelerations import HELD_BY_NOTHING, is_held, rigid_translation
from attrito.model.held_mass import UnknownMassError, inertia_of
from attrito.model.model import SPIN_SOFTENING
from attrito.model.rotation import centrifugal_load, partly_held, softening, spin_of
from attrito.scene.deck_loads import deck_force
from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    from attrito.job.job import Job
    from attrito.model.model import Model
    from attrito.scene.dofs import DofResolver
    from attrito.scene.scene import Contacts

# Relative difference of two speeds that count as one.
SAME_SPEED = 1e-6


def build_loads(job: Job, model: Model, places: DofResolver) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Static loads by name, each `[n]`, and the harmonic coefficients `[2 h + 1, n]`, user force."""
    static: dict[str, np.ndarray] = {}
    highest = max((load["harmonic"] for load in job["load"] if load["kind"] == "harmonic"), default=0)
    harmonic = np.zeros((2 * highest + 1, model.size))
    for i, load in enumerate(job["load"]):
        key = f"load[{i}]"
        if load["kind"] == "harmonic":
            for row, name in ((2 * load["harmonic"] - 1, "cosine"), (2 * load["harmonic"], "sine")):
                harmonic[row] += _given(job, model, places, load[name], f"{key} {name}")
                harmonic[row] -= _inertia(load, f"base_{name}", model, places, key)
        elif load["kind"] == "centrifugal":
            static[load["name"]] = np.zeros(model.size)
            if model.has_mesh:
                with _faults_of(places, f"{key} kind", "centrifugal"):
                    static[load["name"]] = centrifugal_load(model, spin_of(load))
            else:
                places.add(f"{key} kind", "centrifugal", "a model with a mesh: the load needs the nodes' coordinates")
        elif load["gravity"] is not None:
            static[load["name"]] = _inertia(load, "gravity", model, places, key)
        elif load["file"] is not None:
            static[load["name"]] = _given(job, model, places, load["file"], f"{key} file")
        else:
            static[load["name"]] = _given(job, model, places, load["dofs"], f"{key} dofs")
    return static, harmonic


def _inertia(load: dict[str, Any], name: str, model: Model, places: DofResolver, key: str) -> np.ndarray:
    """M times an acceleration of the load, `[n]`, user force; zero where it has none of this name."""
    given = load[name]
    if given is None:
        return np.zeros(model.size)
    if not is_vector(given):
        return np.asarray(model.mass @ places.vector(given, f"{key} {name}"))
    if model.dof_direction is not None:
        if model.has_mesh:
            with _faults_of(places, f"{key} {name}", given):
                return inertia_of(model, np.tile(np.asarray(given, dtype=float), (len(model.node_ids), 1)))
            return np.zeros(model.size)
        return np.asarray(model.mass @ rigid_translation(model, given))
    places.add(f"{key} {name}", given, "pairs [dof, acceleration], since the model does not say where its dofs point")
    return np.zeros(model.size)


@contextlib.contextmanager
def _faults_of(places: DofResolver, key: str, value: Any) -> Iterator[None]:
    """A fault where matrices and mesh do not tell a load by mass."""
    try:
        yield
    except UnknownMassError as error:
        places.add(key, value, str(error))


def check_base_holds(job: Job, model: Model, contacts: Contacts, places: DofResolver) -> None:
    """A fault where the base that a load moves holds the structure by nothing: no support, no contact with ground."""
    for i, load in enumerate(job["load"]):
        for name in BASE_KEYS if load["kind"] == "harmonic" else ():
            given = load[name]
            if given is None or not is_vector(given) or model.dof_direction is None:
                continue
            translation = rigid_translation(model, given)
            if not is_held(model, translation) and not touches_ground(contacts, translation):
                expected = "a structure that something holds along it, a support or a contact with the ground"
                places.add(f"load[{i}] {name}", given, expected)


def touches_ground(contacts: Contacts, translation: np.ndarray) -> bool:
    """Whether a contact feels a translation of the whole model, `[n]`: its other side is the ground."""
    felt = contacts.rows @ translation
    if contacts.next_rows is not None:
        felt = felt + contacts.next_rows @ translation
    return bool(np.any(np.abs(felt) > HELD_BY_NOTHING * np.abs(translation).max(initial=0.0)))


def _given(job: Job, model: Model, places: DofResolver, value: Any, key: str) -> np.ndarray:
    """Forces given as terms or by a file, `[n]`; faults go to `places`."""
    if not isinstance(value, str):
        return places.vector(value, key)
    try:
        return _from_file(job, model, value, key, places)
    except InputError as error:
        places.faults += error.faults
        return np.zeros(model.size)


def _from_file(job: Job, model: Model, name: str, key: str, places: DofResolver) -> np.ndarray:
    path = job.file(name)
    suffix = Path(path).suffix
    try:
        if suffix == ".inp":
            if not model.has_mesh:
                raise InputError(job.fault(key, name, "numbers for the dofs, since the model has no mesh"))
            force, words = deck_force(path, model)
            places.notes.append(f"{key}: {words}")
            return force
        vector = np.load(path) if suffix == ".npy" else np.loadtxt(path, ndmin=1)
    except OSError as error:
        raise InputError(job.fault(key, name, f"a file that can be read ({error.strerror})")) from None
    except ValueError as error:
        raise InputError(Fault(path, "contents", str(error), "one number for each dof")) from None
    if vector.shape != (model.size,) or vector.dtype.kind not in "iuf" or not np.all(np.isfinite(vector)):
        words = "" if vector.dtype.kind in "iuf" else f" of {vector.dtype}"
        shown = f"shape {vector.shape}{words}"
        raise InputError(Fault(path, "contents", shown, f"{model.size} finite numbers, one for each dof"))
    return np.asarray(vector, dtype=float)


def spin_faults(job: Job, model: Model) -> list[Fault]:
    """What of the job's rotation does not go with what the model's stiffness holds already."""
    faults = []
    for i, load in enumerate(job["load"]):
        if load["kind"] != "centrifugal" or not model.has_mesh:
            continue
        key = f"load[{i}]"
        speed = load["speed_hz"]
        if model.spin_hz is not None and abs(speed - model.spin_hz) > SAME_SPEED * model.spin_hz:
            held = " and ".join(model.stiffness_holds).replace("_", " ")
            expected = f"{model.spin_hz:.8g}, the speed of the {held} in the stiffness of {job['model']['file']}"
            faults.append(job.fault(f"{key} speed_hz", speed, expected))
        if not load["spin_softening"]:
            continue
        if SPIN_SOFTENING in model.stiffness_holds:
            expected = f"false: the stiffness of {job['model']['file']} holds spin softening already"
            faults.append(job.fault(f"{key} spin_softening", True, expected))
        held = partly_held(model, spin_of(load).direction)
        if len(held):
            expected = (
                f"no node held in part, as node {held[0]} is ({len(held)} such nodes), where the axis is oblique to"
                " what is held: the mass across is not in the matrices"
            )
            faults.append(job.fault(f"{key} spin_softening", True, expected))
    return faults


def soften(job: Job, model: Model) -> bool:
    """Take from the model's stiffness, in place, what the job's rotation does; whether it does anything."""
    softening_loads = [load for load in job["load"] if load["kind"] == "centrifugal" and load["spin_softening"]]
    for load in softening_loads:
        model.stiffness = (model.stiffness - softening(model, spin_of(load))).tocsr()
    return bool(softening_loads)
