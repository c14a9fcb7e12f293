"""A job's scene at any speed of rotation, out of what the job gives at one: all that rotation does grows with Omega^2.

    K(Omega) = K_0 + Omega^2 (K_s - P M P),    f(Omega) = Omega^2 M P (x - p)

K_0 is the stiffness at rest, Omega^2 K_s the stress stiffening, Omega^2 P M P the spin softening. The stiffness of a
job's model may hold stress stiffening, softening, or both, of a speed Omega_m; with the stiffness at rest beside it

    K(Omega) = K_0 + (Omega / Omega_m)^2 (K - K_0).

Softening that the job asks for, or that the stiffness holds alone, is known by itself. Static loads but the centrifugal
one, and contacts, are those of the job at every speed. Coriolis forces, where the job asks for them, grow with Omega.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers import check_matrices, read_matrix
from attrito.job.job import Job
from attrito.model.held_mass import UnknownMassError
from attrito.model.model import SPIN_SOFTENING, STRESS_STIFFENING, Model
from attrito.model.model_file import read_model
from attrito.model.rotation import Spin, centrifugal_load, softening, spin_of
from attrito.scene.loads import SAME_SPEED
from attrito.scene.scene import Scene
from attrito.support.errors import Fault, InputError

NOTHING_TURNS = (
    "nothing in the job depends on the speed: no [[load]] of kind centrifugal, no [campbell] stiffness_at_rest"
)
NO_STIFFENING = (
    "stress stiffening is left out: [campbell] stiffness_at_rest goes with a model whose stiffness holds it"
    " (attrito import --holds stress_stiffening --spin-hz)"
)


@dataclass(frozen=True)
class RotatingScene:
    """A scene whose stiffness and centrifugal load are known at every speed.

    Parameters
    ----------
    scene : of the job; its centrifugal load is that of `load_hz`
    at_rest : K_0 `[n, n]`
    per_square : what rotation adds to it, per (rad/s)^2 `[n, n]`; None where it adds nothing
    load : the centrifugal load's place among the static loads; None where there is none
    load_hz : its speed
    """

    scene: Scene
    at_rest: csr_matrix
    per_square: csr_matrix | None
    load: int | None
    load_hz: float
    cautions: tuple[str, ...] = ()

    @property
    def stiffness_varies(self) -> bool:
        """Whether a reduction of one speed is none of another."""
        return self.per_square is not None

    def load_path(self, speed_hz: float) -> np.ndarray:
        """Factors on the static loads at a speed, `[corners, loads]`."""
        path = self.scene.load_path.copy()
        if self.load is not None:
            path[:, self.load] *= (speed_hz / self.load_hz) ** 2
        return path

    def at(self, speed_hz: float) -> Scene:
        """The scene at a speed, its matrices its own."""
        spin = None if self.scene.spin is None else 2.0 * np.pi * speed_hz
        if self.per_square is None:
            return replace(self.scene, load_path=self.load_path(speed_hz), spin=spin)
        stiffness = csr_matrix(self.at_rest + (2.0 * np.pi * speed_hz) ** 2 * self.per_square)
        model = replace(self.scene.model, stiffness=stiffness)
        return replace(self.scene, model=model, load_path=self.load_path(speed_hz), altered=True, spin=spin)


def rotating_scene(job: Job, scene: Scene) -> RotatingScene:
    """What of a job's scene depends on the speed, and how.

    Raises
    ------
    InputError : that cannot be known from what the job gives
    """
    faults = _faults(job, scene.model)
    if faults:
        raise InputError(*faults)
    model, keys = scene.model, job["campbell"]
    stiffness = model.stiffness
    spinning = next((load for load in job["load"] if load["kind"] == "centrifugal"), None)
    load, load_hz = None, 0.0
    if spinning is not None:
        load = list(scene.static).index(spinning["name"])
        # A load of speed 0 cannot be scaled.
        load_hz = spinning["speed_hz"] or max(keys["speeds_hz"]) or 1.0
        try:
            vector = centrifugal_load(model, spin_of(spinning | {"speed_hz": load_hz}))
        except UnknownMassError as error:
            raise InputError(job.fault(f"load {spinning['name']}", "centrifugal", str(error))) from None
        scene = replace(scene, static=scene.static | {spinning["name"]: vector})
        taken = softening(model, Spin(1.0, *_axis(spinning)))
    parts: list[csr_matrix] = []
    if spinning is not None and spinning["spin_softening"]:
        stiffness = stiffness + (2.0 * np.pi * spinning["speed_hz"]) ** 2 * taken
        parts.append(-taken)
    held_hz = keys["stiffness_hz"] or model.spin_hz
    at_rest = stiffness
    if keys["stiffness_at_rest"] is not None:
        at_rest = _stiffness_at_rest(job, model)
        parts.append((stiffness - at_rest) / (2.0 * np.pi * held_hz) ** 2)
    elif SPIN_SOFTENING in model.stiffness_holds and held_hz:
        at_rest = stiffness + (2.0 * np.pi * held_hz) ** 2 * taken
        parts.append(-taken)
    cautions = []
    if spinning is None and not parts:
        cautions += [] if scene.spin is not None else [NOTHING_TURNS]
    elif keys["stiffness_at_rest"] is None:
        cautions.append(NO_STIFFENING)
    per_square = csr_matrix(sum(parts[1:], parts[0])) if parts else None
    return RotatingScene(scene, csr_matrix(at_rest), per_square, load, load_hz, tuple(cautions))


def _axis(load: dict) -> tuple[np.ndarray, np.ndarray]:
    spin = spin_of(load)
    return spin.point, spin.direction


def _faults(job: Job, model: Model) -> list[Fault]:
    """What is missing, or contradicts another key."""
    faults, keys = [], job["campbell"]
    if job["model"]["gyroscopic"] is not None and job["model"]["gyroscopic_hz"] is None:
        expected = "the speed of rotation that gyroscopic is of, with [campbell]"
        faults.append(job.fault("[model] gyroscopic_hz", "missing", expected))
    spinning = [(i, load) for i, load in enumerate(job["load"]) if load["kind"] == "centrifugal"]
    for i, _ in spinning[1:]:
        faults.append(job.fault(f"load[{i}] kind", "centrifugal", "one centrifugal load with [campbell]"))
    for _, load in spinning:
        last = job["static"]["load_path"][-1]
        factor = last.get(load["name"], 0.0) if isinstance(last, dict) else last
        if factor != 1.0:
            expected = f"1 at the end for {load['name']}: with [campbell] its speed is each of speeds_hz"
            faults.append(job.fault(f"[static] load_path[{len(job['static']['load_path']) - 1}]", factor, expected))
    where = job["model"]["file"] or "the model"
    held = " and ".join(model.stiffness_holds).replace("_", " ")
    at_rest, given = keys["stiffness_at_rest"], keys["stiffness_hz"]
    if at_rest is None:
        if given is not None:
            faults.append(job.fault("[campbell] stiffness_hz", given, "no such key without stiffness_at_rest"))
        if STRESS_STIFFENING in model.stiffness_holds and model.spin_hz:
            expected = (
                f"the stiffness of the same structure at rest: that of {where} holds {held} of {model.spin_hz:.8g} Hz"
            )
            faults.append(job.fault("[campbell] stiffness_at_rest", "missing", expected))
        elif SPIN_SOFTENING in model.stiffness_holds and model.spin_hz and not spinning:
            expected = f"a [[load]] of kind centrifugal, whose axis the {held} in the stiffness of {where} is about"
            faults.append(job.fault("load", "missing", expected))
        return faults
    if given is None and not model.spin_hz:
        expected = f"the speed of rotation that the stiffness of {where} is of"
        faults.append(job.fault("[campbell] stiffness_hz", "missing", expected))
    if given is not None and model.spin_hz and abs(given - model.spin_hz) > SAME_SPEED * model.spin_hz:
        expected = f"{model.spin_hz:.8g}, the speed of the {held} in the stiffness of {where}"
        faults.append(job.fault("[campbell] stiffness_hz", given, expected))
    return faults


def _stiffness_at_rest(job: Job, model: Model) -> csr_matrix:
    """K_0 on the model's dofs, from a model file, a matrix file, or rows."""
    source = job["campbell"]["stiffness_at_rest"]
    key, same = "[campbell] stiffness_at_rest", f"{model.size} dofs, those of the model"
    where = job.file(source) if isinstance(source, str) else f"{job.path}: {key}"
    if isinstance(source, str) and os.path.splitext(source)[1] == ".h5":
        rest = read_model(where)
        if rest.size != model.size:
            raise InputError(job.fault(key, f"{source}, {rest.size} dofs", same))
        for mine, its in ((model.dof_node, rest.dof_node), (model.dof_direction, rest.dof_direction)):
            if mine is not None and (its is None or not np.array_equal(mine, its)):
                raise InputError(job.fault(key, source, "the same dofs in the same order as the model's"))
        if rest.stiffness_holds:
            held = " and ".join(rest.stiffness_holds).replace("_", " ")
            raise InputError(job.fault(key, source, f"a stiffness at rest: this one holds {held}"))
        stiffness = rest.stiffness
    else:
        stiffness = read_matrix(where if isinstance(source, str) else source, key, job.path)
        if stiffness.shape[0] != model.size:
            raise InputError(job.fault(key, f"{stiffness.shape[0]} dofs", same))
    faults = check_matrices(stiffness, model.mass, None, {"stiffness": where, "mass": where}, without_mass="")
    if faults:
        raise InputError(*faults)
    return csr_matrix(stiffness)
