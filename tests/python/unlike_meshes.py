"""Two bodies, one on the other, whose meshes do not match: for tests of contact on faces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import synthetic

from attrito.model.model import Model

TURN = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [-2.0, 0.5, 1.0], [0.3, -1.0, 2.0]]))[0]


def flat(points: np.ndarray) -> np.ndarray:
    """No change of shape."""
    return points


def cylinder(points: np.ndarray) -> np.ndarray:
    """Bend the layer z = 1 into a quarter of a cylinder of radius 1 about the y axis; z is the radius."""
    angle = points[:, 0] * np.pi / 2
    return np.stack([points[:, 2] * np.sin(angle), points[:, 1], points[:, 2] * np.cos(angle)], axis=1)


def unlike_joint(
    kinds: tuple[str, str],
    counts: tuple[int, int],
    shape: Callable[[np.ndarray], np.ndarray] = flat,
    gap: float = 0.0,
    turn: np.ndarray | None = None,
    layers: tuple[int, int] = (1, 1),
    **options,
) -> Model:
    """Unit boxes of `counts` cells a side and some layers: sets `top` (of the lower) and `bottom`, `gap` apart.

    `shape` is applied after that, then the rotation `turn`.
    """
    raised = [np.zeros(3), np.array([0.0, 0.0, 1.0 + gap])]
    bodies, meets = [], []
    for kind, count, deep, up, level in zip(kinds, counts, layers, raised, (1.0, 1.0 + gap), strict=True):
        body = synthetic.block(kind, (count, count, deep), shape=lambda points, up=up: points + up)
        meets.append(np.abs(body.points[:, 2] - level) < 1e-9)
        place = shape(body.points)
        bodies.append(synthetic.Body(kind, place if turn is None else place @ turn.T, body.connectivity))
    interface = np.concatenate(meets)
    sets = {
        "top": lambda points, owner: interface & (owner == 0),
        "bottom": lambda points, owner: interface & (owner == 1),
    }
    return synthetic.assemble(bodies, sets, **options)


def rigid_motions(model: Model) -> np.ndarray:
    """The six rigid motions on the dofs of a model, `[n, 6]`, rotations about the origin."""
    place, axis = model.coordinates[model.rows_of(np.arange(model.size))], model.dof_direction - 1
    every = np.arange(model.size)
    turns = [np.cross(e, place)[every, axis] for e in np.eye(3)]
    return np.stack([*(np.eye(3)[axis].T), *turns], axis=1)
