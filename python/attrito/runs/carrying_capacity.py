"""What friction carries at most along a direction in which a body slides, at an alternating motion.

Bodies slide along v where it lies in the planes of all contacts that close. Moved on along it, they push sliders until
each contact comes to its limit, so that the mean force of friction on them, F = sum_c mean T_c, is at most

    C(v) = sum_c max_w mean T_c(u(t) - w) . v,      u(t) the motion, w where the slider starts.

Contacts that slip in every period forget where their sliders were: their mean force is what it is. At the others the
largest is that of a slider which comes from far behind. With the load F . v, nothing holds a body any more where
C(v) - F . v vanishes. The body is on the same side of all contacts; its turns are not looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Samples of a period, and periods until sliders pushed from behind are taken to rest
SAMPLES, PERIODS = 256, 10
# Directions in a plane
DIRECTIONS = 64
# How far behind sliders come from, in the largest displacements and stretches of contacts' springs; no force
FAR, TINY = 1e3, np.finfo(float).tiny
# Part of a direction that is normal, up to which it is none
NO_PART = 1e-6


class Closed(NamedTuple):
    """Contacts that close, of Coulomb's law.

    `frame` `[nc, 3, 3]`: tangents, 0 where there is no friction along one, and normal; `stiffness` `[nc]` and
    `displacement` `[nc, 2, 2 H + 1]` along the tangents; `limit` `[nc, SAMPLES]`: mu N over the period; `mean`
    `[nc, 2]`: mean friction; `holds` `[nc]`: which do not slip.
    """

    frame: np.ndarray
    stiffness: np.ndarray
    displacement: np.ndarray
    limit: np.ndarray
    mean: np.ndarray
    holds: np.ndarray


def over_period(series: np.ndarray) -> np.ndarray:
    """Fourier series `[..., 2 H + 1]` at `SAMPLES` instants."""
    angle = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    order = np.arange(1, series.shape[-1] // 2 + 1)[:, None]
    waves = np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1).reshape(-1, SAMPLES)
    return series[..., :1] + series[..., 1:] @ waves


def least_reserve(closed: Closed) -> tuple[np.ndarray, float, float] | None:
    """The direction v along which friction has least left, load F . v and capacity C(v); None where no body slides."""
    _, across, free = np.linalg.svd(closed.frame[:, 2])
    free = free[np.count_nonzero(across > NO_PART * across[0]) :]
    if len(free) == 0:
        return None
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = (
        np.stack([np.cos(angle), np.sin(angle)], axis=1) @ free if len(free) > 1 else np.array([free[0], -free[0]])
    )
    along = np.einsum("ckx,vx->vck", closed.frame[:, :2], directions)
    load = np.einsum("vck,ck->v", along, closed.mean)
    held = closed.holds
    reserve = np.einsum("vck,vck->v", along[:, held], _pushed(closed, along) - closed.mean[held])
    least = int(np.argmin(reserve))
    return directions[least], float(load[least]), float(load[least] + reserve[least])


def _pushed(closed: Closed, along: np.ndarray) -> np.ndarray:
    """Mean friction of the contacts that hold, their sliders having come from far behind `[directions, held, 2]`."""
    held = closed.holds
    motion, limit, stiffness = over_period(closed.displacement[held]), closed.limit[held], closed.stiffness[held, None]
    far = FAR * (np.abs(motion).max(initial=0.0) + (limit / stiffness).max(initial=0.0))
    slider = -far * along[:, held]
    for _ in range(PERIODS):
        total = np.zeros_like(slider)
        for instant in range(SAMPLES):
            force = stiffness * (motion[..., instant] - slider)
            most = limit[:, instant]
            force *= (most / np.maximum(np.linalg.norm(force, axis=-1), np.maximum(most, TINY)))[..., None]
            slider = motion[..., instant] - force / stiffness
            total += force
    return total / SAMPLES
