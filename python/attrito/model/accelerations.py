"""The loads of an acceleration that is the same everywhere: weight, and a base that moves to and fro.

Of a structure whose supports all move by x(t) along one direction, q is the displacement relative to the base. The
inertia is of q + r x, r the displacement of every dof when the whole moves by one; nothing else feels r x, since the
supports, and what contacts touch of the ground, move with it:

    M q'' + C q' + K q = -M r x'',        and with weight, of the acceleration g along r, = M r g.

Held dofs have no row: what a node next to a support shares with it comes from the mesh (`held_mass`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from attrito.model.model import Model

# K r of a structure that nothing holds is rounded at some 1e-12 of what its entries add up to
HELD_BY_NOTHING = 1e-9


def rigid_translation(model: Model, along: Sequence[float]) -> np.ndarray:
    """Every dof when the model, whose dofs have directions, moves by `along` (x, y, z) without deformation, `[n]`."""
    translation = np.zeros(model.size)
    moves = model.translates
    translation[moves] = np.asarray(along, dtype=float)[np.asarray(model.dof_direction, dtype=int)[moves] - 1]
    return translation


def is_held(model: Model, translation: np.ndarray) -> bool:
    """Whether the model's own stiffness resists a translation, `[n]`: it is fixed to what moves."""
    resisted = np.abs(model.stiffness @ translation)
    entries = abs(model.stiffness) @ np.abs(translation)
    return bool(np.any(resisted > HELD_BY_NOTHING * entries.max(initial=0.0)))
