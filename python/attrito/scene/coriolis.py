"""The Coriolis forces of a job: their matrix at 1 rad/s, and the speed that the job is of.

They are those of a matrix that the job gives, or of the mass and the centrifugal load's rotation.
"""

from __future__ import annotations

import numpy as np

from attrito.job.coriolis import asking_key, turning_load
from attrito.job.job import Job
from attrito.model.coriolis import coriolis_matrix
from attrito.model.model import Model
from attrito.model.rotation import spin_of
from attrito.scene.dofs import DofResolver

# Part of the largest entry that a matrix may miss of being skew
SKEW = 1e-9
# What to expect of a mass that Coriolis forces do not follow from
PLAIN_MASS = (
    "a mass m_ij I between any two nodes, as solids along axes that all nodes share have, which Coriolis"
    " forces follow from; else [model] gyroscopic"
)


def take_coriolis(job: Job, model: Model, places: DofResolver) -> float | None:
    """Give the model its matrix of Coriolis forces; the speed of rotation, rad/s, None where there are none.

    Faults go to `places`.
    """
    key = asking_key(job)
    if key is None:
        return None
    if job["model"]["gyroscopic"] is not None:
        speed = 2.0 * np.pi * (job["model"]["gyroscopic_hz"] or 1.0 / (2.0 * np.pi))
        _check_given(model, places)
        if not places.faults:
            model.gyroscopic = (model.gyroscopic - model.gyroscopic.T) / (2.0 * speed)
        return speed
    load = turning_load(job)
    if not model.has_mesh or load is None:
        # The load, which needs a mesh, is at fault.
        return None
    spin = spin_of(load)
    try:
        model.gyroscopic = coriolis_matrix(model, spin.direction)
    except ValueError as error:
        places.add(key, str(error), PLAIN_MASS)
    return spin.omega


def _check_given(model: Model, places: DofResolver) -> None:
    """A matrix of the job is skew, and of the model's size."""
    matrix = model.gyroscopic
    assert matrix is not None
    if matrix.shape != model.mass.shape:
        shown = f"{matrix.shape[0]} x {matrix.shape[1]}"
        places.add("[model] gyroscopic", shown, f"the size of the mass, {model.size} x {model.size}")
        return
    if not np.all(np.isfinite(matrix.data)):
        places.add("[model] gyroscopic", "not finite", "finite numbers")
        return
    even = (matrix + matrix.T).tocoo()
    largest = abs(matrix).max()
    if even.nnz and np.abs(even.data).max() > SKEW * largest:
        worst = int(np.argmax(np.abs(even.data)))
        i, j = even.row[worst], even.col[worst]
        value = f"{matrix[i, j]:.6g} and {matrix[j, i]:.6g} at ({i}, {j}) and its mirror image"
        places.add("[model] gyroscopic", value, f"a skew matrix, G^T = -G (to {SKEW:g} of its largest entry)")
