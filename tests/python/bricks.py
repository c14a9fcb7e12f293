"""An elastic brick and jobs on it, for tests of loads."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from elastic import assemble_bricks
from jobs import write_job
from scipy.sparse import csr_matrix

from attrito.job.reading import read_job
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.scene.build import build_scene
from attrito.support.errors import InputError

SPEED_HZ = 30.0


def brick(
    held=lambda points: np.zeros(len(points), dtype=bool), shape=lambda points: points, seed=5, layers=3
) -> Model:
    """An elastic body of eight-node bricks with its mesh and the sets `low` and `high` (its ends in x)."""
    body = synthetic.block("C3D8", (layers, 2, 2), (0.1, 0.04, 0.03), shape)
    x = synthetic.block("C3D8", (layers, 2, 2), (0.1, 0.04, 0.03)).points[:, 0]
    sets = {"low": lambda points, owner: x < 1e-9, "high": lambda points, owner: x > 0.1 - 1e-9}
    model = synthetic.assemble([body], sets, held, seed)
    stiffness, mass = assemble_bricks(body.points, body.connectivity)
    row = {node: index for index, node in enumerate(model.node_ids)}
    keep = [3 * row[node] + direction - 1 for node, direction in zip(model.dof_node, model.dof_direction, strict=True)]
    model.stiffness, model.mass = (csr_matrix(matrix[keep][:, keep]) for matrix in (stiffness, mass))
    return model


def centrifugal(**keys):
    return {
        "name": "spin",
        "kind": "centrifugal",
        "speed_hz": SPEED_HZ,
        "axis_point": [0.0, 0.0, 0.0],
        "axis_direction": [0.0, 0.0, 1.0],
    } | keys


def job(*loads, **tables):
    """A brick held at its low end, pressed with its high end against the ground."""
    contact = {"a": "high", "b": "ground", "tolerance": 0.0, "tangents": 2, "friction_coefficient": 0.3}
    stiffness = {"normal_stiffness": 1.0e11, "tangential_stiffness": 1.0e11}
    return {
        "model": {"file": "model.h5"},
        "reduction": {"modes": 30},
        "contact_set": [contact | stiffness],
        "load": [*loads, {"kind": "harmonic", "cosine": [[0, 1.0]]}],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [10.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "first", "dofs": [[0, 1.0]]}]},
    } | tables


def scene_of(folder, model, description):
    write_model(folder / "model.h5", model, [])
    return build_scene(read_job(folder / write_job(folder, description)))


def faults_of(folder, model, description) -> str:
    with pytest.raises(InputError) as raised:
        scene_of(folder, model, description)
    return str(raised.value)
