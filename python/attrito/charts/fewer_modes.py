"""A scene without some of its coordinates: the reduced model with fewer fixed-interface modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from attrito.library.reduced_scene import ReducedScene


def restricted(scene: ReducedScene, kept: np.ndarray) -> ReducedScene:
    """The scene without some of its coordinates; those of a sector's boundaries and axis must be kept."""
    number = np.full(len(scene.mass), -1)
    number[kept] = np.arange(len(kept))
    sector = scene.sector
    if sector is not None:
        sector = replace(
            sector,
            lower=number[sector.lower].astype(np.int32),
            upper=number[sector.upper].astype(np.int32),
            along=number[sector.along].astype(np.int32),
            across=number[sector.across].astype(np.int32),
            next_directions=np.ascontiguousarray(sector.next_directions[:, kept]),
            # Nothing is drawn of it along the model's own axes.
            axes=None,
        )
    square, wide = np.ix_(kept, kept), (slice(None), kept)
    return replace(
        scene,
        sector=sector,
        mass=np.ascontiguousarray(scene.mass[square]),
        stiffness=np.ascontiguousarray(scene.stiffness[square]),
        damping=None if scene.damping is None else np.ascontiguousarray(scene.damping[square]),
        damping_ratios=None if scene.damping_ratios is None else scene.damping_ratios[: len(kept)],
        **{
            name: np.ascontiguousarray(getattr(scene, name)[wide])
            for name in ("directions", "static", "harmonic", "monitors")
        },
    )
