"""The job's `[cyclic]` on its model: the dofs of the sector's boundaries, paired."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.check import massless
from attrito.job.cyclic import is_cyclic
from attrito.job.job import Job
from attrito.model.model import Model
from attrito.model.sector import Axis, PairingError, axis_dofs, axis_of, pair_boundaries, paired_dofs
from attrito.scene.dofs import DofResolver
from attrito.scene.scene import CyclicSector


def build_sector(job: Job, model: Model, places: DofResolver) -> CyclicSector | None:
    """The sector that the job's model is; None where it is whole, or at fault, which goes to `places`."""
    if not is_cyclic(job):
        return None
    keys = job["cyclic"]
    numbers = keys["sectors"], keys["engine_order"]
    if not isinstance(keys["lower"], str):
        lower, upper = (_listed(places, keys[name] or [], f"[cyclic] {name}") for name in ("lower", "upper"))
        along, across = _on_axis(places, keys["on_axis"])
        used = np.concatenate([lower, upper, along, across.ravel()])
        values, counts = np.unique(used, return_counts=True)
        if np.any(counts > 1):
            twice = values[counts > 1][0]
            key = "on_axis" if twice in along or twice in across else "upper"
            expected = "dofs that are not in lower" if key == "upper" else "dofs that are in no other place of [cyclic]"
            places.add(f"[cyclic] {key}", f"dof {twice}", expected)
        return CyclicSector(*numbers, lower, upper, None, along, across)
    nodes = [_nodes(model, places, keys[name], f"[cyclic] {name}") for name in ("lower", "upper")]
    if any(found is None for found in nodes):
        return None
    axis = wheel_axis(job)
    try:
        names = keys["lower"], keys["upper"]
        *paired, apart = pair_boundaries(model, *nodes, names, axis, keys["sectors"], keys["tolerance"])
        lower, upper, axes = paired_dofs(model, *paired, axis.turn(2.0 * np.pi / keys["sectors"]))
    except PairingError as error:
        places.add("[cyclic] upper", error.value, str(error))
        return None
    if keys["sectors"] == 1:
        # What is on the axis of a single sector moves as all else does.
        return CyclicSector(*numbers, lower, upper, axes, apart=apart)
    try:
        along, across, own = axis_dofs(model, axis)
    except PairingError as error:
        places.add("[cyclic] axis_direction", error.value, str(error))
        return None
    return CyclicSector(*numbers, lower, upper, csr_matrix(axes @ own), along, across, apart)


def check_mass_of_sector(job: Job, model: Model, sector: CyclicSector, places: DofResolver, expected: str) -> None:
    """Without a reduction every dof needs mass, of its own or its partner's on the other boundary."""
    if "reduction" in job.given:
        return
    bare = massless(model.mass)
    here, there = np.isin(sector.lower, bare), np.isin(sector.upper, bare)
    carried = np.concatenate([sector.lower[here & ~there], sector.upper[there & ~here]])
    alone = np.setdiff1d(bare, carried)
    if len(alone):
        places.add("[model] mass", f"no mass at dof {alone[0]}", expected)


def wheel_axis(job: Job) -> Axis:
    """The axis of a job's wheel."""
    return axis_of(job["cyclic"]["axis_point"], job["cyclic"]["axis_direction"])


def _listed(places: DofResolver, dofs: list[Any], key: str) -> np.ndarray:
    """Numbers of the dofs of a list."""
    found = [places.dof(dof, key) for dof in dofs]
    known = np.array([dof for dof in found if dof is not None], dtype=np.int64)
    values, counts = np.unique(known, return_counts=True)
    if np.any(counts > 1):
        places.add(key, f"dof {values[counts > 1][0]}", "dofs that differ")
    return known


def _on_axis(places: DofResolver, nodes: list[list[Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the dofs along the axis `[a]`, and in pairs across it `[c, 2]`, of nodes that a job lists."""
    along: list[int] = []
    across: list[list[int]] = []
    for i, node in enumerate(nodes):
        found = [places.dof(dof, f"[cyclic] on_axis[{i}]") for dof in node]
        known = [dof for dof in found if dof is not None]
        if len(known) < len(node):
            continue
        along += known[2:] if len(known) > 1 else known
        across += [known[:2]] if len(known) > 1 else []
    return np.array(along, dtype=np.int64), np.array(across, dtype=np.int64).reshape(-1, 2)


def _nodes(model: Model, places: DofResolver, name: str, key: str) -> np.ndarray | None:
    """Node ids of a set."""
    if not model.has_mesh:
        places.add(key, name, "a list of dofs, or a model with a mesh: node sets need one")
        return None
    nodes = model.node_sets.get(name)
    if nodes is None or not len(nodes):
        known = ", ".join(set_name for set_name, ids in model.node_sets.items() if len(ids)) or "none"
        places.add(key, name, f"a node set of the model that has nodes: {known}")
        return None
    return np.asarray(nodes, dtype=np.int64)
