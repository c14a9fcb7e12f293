"""Wheels of equal sectors, small enough to be assembled whole: lumped ones as jobs, elastic rings as models."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from elastic import assemble_bricks
from synthetic import Body, assemble, block

from attrito.model.model import Model

AXIS = {"axis_point": [0.0, 0.0, 0.0], "axis_direction": [0.0, 0.0, 1.0]}
INNER, OUTER, THICKNESS = 0.1, 0.2, 0.03


def lumped_sector(sectors: int = 5, engine_order: int = 2) -> dict[str, Any]:
    """A blade on a disc whose neighbours are tied, rubbing on the next blade and on the ground.

    Dofs: 0 and 1 the blade along and across the circumference, 2 the disc's lower boundary, 3 its upper one.
    """
    stiffness = np.diag([3.0e4, 5.0e4, 2.0e4, 0.0])
    for i, j, spring in ((0, 2, 2.0e4), (2, 3, 6.0e4), (1, 2, 1.0e4)):
        for row, column, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            stiffness[row, column] += sign * spring
    law = {"tangential_stiffness": 1.0e4, "normal_stiffness": 2.0e4, "friction_coefficient": 0.4, "preload": 3.0}
    return {
        "model": {"mass": np.diag([1.0, 1.0, 2.0, 0.0]).tolist(), "stiffness": stiffness.tolist()},
        "damping": {"rayleigh": [8.0, 0.0]},
        "cyclic": {"sectors": sectors, "engine_order": engine_order, "lower": [2], "upper": [3]},
        "contact": [
            {
                "normal": [[0, 1.0]],
                "normal_next": [[0, -1.0]],
                "tangents": [[[1, 1.0]]],
                "tangents_next": [[[1, -1.0]]],
                **law,
            },
            {"normal": [[1, 1.0]], "tangents": [[[2, 1.0]]], **law},
        ],
        "load": [{"name": "wake", "kind": "harmonic", "cosine": [[0, 5.0]], "sine": [[1, 2.0]]}],
        "balance": {"harmonics": 3},
        "sweep": {"start_hz": 40.0, "stop_hz": 20.0},
        "output": {"file": "result.h5", "monitors": [{"name": "blade", "dofs": [[0, 1.0]]}]},
    }


def sector_on_axis(sectors: int = 5, engine_order: int = 1) -> dict[str, Any]:
    """`lumped_sector` whose disc and blade hang on a hub on the axis too, dofs 4 and 5 across it and 6 along it.

    Stiffness and mass of the hub, itself on soft springs, are a sector's share.
    """
    job = lumped_sector(sectors, engine_order)
    mass, stiffness = np.diag([1.0, 1.0, 2.0, 0.0, 0.4, 0.4, 0.3]), np.zeros((7, 7))
    stiffness[:4, :4] = job["model"]["stiffness"]
    for terms, spring in (({0: 1.0, 4: -1.0}, 3.0e4), ({2: 1.0, 5: -0.8, 4: 0.3}, 5.0e4), ({1: 1.0, 6: -1.0}, 2.0e4)):
        row = np.zeros(7)
        row[list(terms)] = list(terms.values())
        stiffness += spring * np.outer(row, row)
    stiffness[4:, 4:] += np.diag([6.0e3, 6.0e3, 9.0e3])
    job["model"] = {"mass": mass.tolist(), "stiffness": stiffness.tolist()}
    job["cyclic"]["on_axis"] = [[4, 5, 6]]
    return job


def sector_job(model: Model, sectors: int, **cyclic: Any) -> dict[str, Any]:
    """A job on `model.h5`, a sector of `ring`, its rim on the ground, driven at one node of the rim."""
    node = int(model.node_sets["rim"][0])
    law = {"tangential_stiffness": 1e9, "normal_stiffness": 1e9, "friction_coefficient": 0.3}
    load = {"cosine": [[["node", node, "x"], 1.0], [["node", node, "z"], 3.0]], "sine": [[["node", node, "x"], 2.0]]}
    return {
        "model": {"file": "model.h5"},
        "cyclic": {"sectors": sectors, "engine_order": 1, "lower": "low", "upper": "high", **AXIS, **cyclic},
        "contact_set": [{"a": "rim", "b": "ground", "tolerance": 1e-6, "tangents": 1, **law}],
        "load": [{"kind": "harmonic", **load}],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [100.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "rim", "dofs": [[["node", node, "z"], 1.0]]}]},
    }


def ring(
    sectors: int,
    cells: int = 2,
    *,
    span: int = 1,
    seed: int | None = None,
    section: tuple[int, int] = (2, 1),
    bored: bool = True,
) -> Model:
    """`span` of the sectors of an elastic ring, held at its bore; `low` and `high` are its ends.

    It has `cells` a sector, and so many along its radius and its axis as `section` says. What is not `bored` is a disc
    whose bricks meet at the axis, held below half way to its rim; its nodes on the axis are in both ends.

    Its axis is z through the origin, and its first end lies along x. A full ring has no ends.
    """
    angle, inner = 2.0 * np.pi * span / sectors, INNER if bored else 0.0

    def bent(points: np.ndarray) -> np.ndarray:
        radius, turn = inner + (OUTER - inner) * points[:, 0], angle * points[:, 1]
        # A bulge and a twist, so that no plane of symmetry pairs directions that the rotation does not.
        height = THICKNESS * (points[:, 2] - 0.5) * (1.0 + 0.5 * points[:, 0]) + 0.1 * (radius - inner)
        return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])

    counts = (section[0], cells * span, section[1])
    body = block("C3D8", counts, shape=bent)
    flat = block("C3D8", counts).points
    first, last = flat[:, 1] < 1e-9, flat[:, 1] > 1.0 - 1e-9
    if span == sectors:
        body, kept = _merged(body, first, last)
        flat, first, last = flat[kept], np.zeros(kept.sum(), bool), np.zeros(kept.sum(), bool)
    if not bored:
        # Points come with the axis' height last: all of one height, whatever their turn, are one.
        inside = flat[:, 0] < 1e-9
        height = np.flatnonzero(inside)[: section[1] + 1]
        others = np.setdiff1d(np.flatnonzero(inside), height)
        body, kept = _merged(body, height, others, np.tile(height, len(others) // len(height)))
        flat, first, last = flat[kept], (first | inside)[kept], (last | inside)[kept]
        if span == sectors:
            first, last = np.zeros(len(flat), bool), np.zeros(len(flat), bool)
    held = flat[:, 0] < 1e-9 if bored else (np.abs(flat[:, 0] - 0.5) < 1e-9) & (flat[:, 2] < 1e-9)
    sets = {
        "low": lambda points, owner: first & ~held,
        "high": lambda points, owner: last & ~held,
        "bore": lambda points, owner: held,
        "rim": lambda points, owner: np.isclose(np.hypot(*points[:, :2].T), OUTER) & ~last,
    }
    model = assemble([body], sets, held=lambda points: held, seed=seed)
    order = np.argsort(model.node_ids)
    stiffness, mass = assemble_bricks(model.coordinates, body.connectivity)
    place = order[np.searchsorted(model.node_ids, model.dof_node, sorter=order)]
    dofs = 3 * place + model.dof_direction - 1
    return replace(model, stiffness=stiffness[dofs][:, dofs], mass=mass[dofs][:, dofs])


def _merged(body: Body, first: np.ndarray, last: np.ndarray, onto: np.ndarray | None = None) -> tuple[Body, np.ndarray]:
    """The body whose last points are its first, in their order, or those `onto`; and which points are kept."""
    kept = np.ones(len(body.points), dtype=bool)
    kept[last] = False
    number = np.cumsum(kept) - 1
    number[last] = number[first if onto is None else onto]
    return Body(body.kind, body.points[kept], number[body.connectivity]), kept
