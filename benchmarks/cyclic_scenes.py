"""Random sectors of wheels: what one sector and the whole wheel are both solved for."""

from __future__ import annotations

import numpy as np

from attrito.library.reduced_scene import ReducedScene, Sector

# Coordinates inside, and pairs of the boundary
INSIDE, PAIRS = 5, 2


def random_sector(
    seed: int,
    sectors: int,
    engine_order: int,
    *,
    tangents: int = 1,
    boundary: bool = True,
    inside: int = INSIDE,
    axis_nodes: int = 0,
) -> ReducedScene:
    """A sector with full random matrices, a contact inside to the ground and one across to the next sector.

    Natural frequencies are 0.1 to 1 Hz. `boundary` = False: sectors meet in contacts alone, and at `axis_nodes` nodes
    on the axis, of which the matrices are a sector's share.
    """
    draw = np.random.default_rng(seed)
    pairs = PAIRS if boundary else 0
    size = inside + 2 * pairs + 3 * axis_nodes

    def positive(strength: float, diagonal: np.ndarray) -> np.ndarray:
        mixed = draw.uniform(-1.0, 1.0, (size, size))
        return np.ascontiguousarray(strength * mixed.T @ mixed + np.diag(diagonal))

    mass = positive(0.05, np.ones(size))
    stiffness = positive(0.3, draw.uniform(0.5, 4.0, size))
    rows = 2 * (tangents + 1)
    here, ahead = draw.uniform(-1.0, 1.0, (rows, size)), draw.uniform(-1.0, 1.0, (rows, size))
    ahead[: rows // 2] = 0.0
    laws = {
        "tangents": np.full(2, tangents, dtype=np.int32),
        "tangential_stiffness": draw.uniform(0.3, 3.0, 2),
        "normal_stiffness": draw.uniform(0.3, 3.0, 2),
        "friction_coefficient": draw.uniform(0.2, 0.6, 2),
        "gap": np.zeros(2),
        "preload": draw.uniform(0.3, 1.0, 2),
    }
    harmonic = np.zeros((5, size))
    harmonic[1:3] = draw.uniform(-1.0, 1.0, (2, size))
    # The second engine order beside the first
    harmonic[3:] = 0.2 * draw.uniform(-1.0, 1.0, (2, size))
    ends = np.arange(inside, inside + 2 * pairs)
    on_axis = np.arange(inside + 2 * pairs, size).reshape(-1, 3)
    return ReducedScene(
        mass=mass,
        stiffness=stiffness,
        damping_kind="mass",
        damping_value=float(draw.uniform(0.02, 0.1)),
        damping=None,
        laws=laws,
        directions=here,
        static=0.3 * draw.uniform(-1.0, 1.0, (1, size)),
        harmonic=harmonic,
        monitors=np.vstack([np.eye(size)[:2], draw.uniform(-1.0, 1.0, (1, size))]),
        monitor_names=["first", "second", "mixed"],
        sector=Sector(
            sectors, engine_order, ends[:pairs], ends[pairs:], ahead, along=on_axis[:, 2], across=on_axis[:, :2]
        ),
    )
