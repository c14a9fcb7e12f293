"""What friction carries at most along a direction in which a body slides, at an alternating motion.

Bodies slide along v where it lies in the planes of all contacts that close. Moved on along it, they push sliders until
each contact comes to its limit, so that the mean force of friction on them, F = sum_c mean T_c, is at most

    C(v) = sum_c max_w mean T_c(u(t) - w) . v,      u(t) the motion, w where the slider starts.

Contacts that slip in every period forget where their sliders were: their mean force is what it is. At the others the
largest is that of a slider which comes from far behind. With the load F . v, nothing holds a body any more where
C(v) - F . v vanishes beside what friction could carry if all of it acted along v. A body slides if the structure lets
it: v is a rigid motion that it has without friction. The body is on the same side of all contacts; its turns are not
looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Samples of a period at least, and of the shortest wave; periods until sliders pushed from behind are taken to rest
SAMPLES, PER_WAVE, PERIODS = 128, 16, 10
# Part of all friction up to which mean forces of one period are those of the period before
REPEATS = 1e-4
# Directions in a plane at first, and how often those beside the least are halved
DIRECTIONS, HALVINGS = 12, 4
# How far behind sliders come from, in the largest displacements and stretches of contacts' springs; no force
FAR, TINY = 1e3, np.finfo(float).tiny
# What friction has left, of what it could carry: the last steps of a branch show less than 1 % on the curve
NOTHING_LEFT = 0.01  # guess
# Part of a direction that is normal, up to which it is none; part of a slip that no rigid motion makes, likewise
NO_PART, HELD = 1e-6, 1e-3


class Closed(NamedTuple):
    """Contacts that close, of Coulomb's law.

    `frame` `[nc, 3, 3]`: tangents, 0 where there is no friction along one, and normal; `stiffness` `[nc]` and
    `displacement` `[nc, 2, 2 H + 1]` along the tangents; `limit` `[nc, samples]`: mu N over the period; `mean`
    `[nc, 2]`: mean friction; `holds` `[nc]`: which do not slip; `rigid` `[nc, 2, r]`: along the tangents, rigid motions
    that the structure has without friction.
    """

    frame: np.ndarray
    stiffness: np.ndarray
    displacement: np.ndarray
    limit: np.ndarray
    mean: np.ndarray
    holds: np.ndarray
    rigid: np.ndarray


class Reserve(NamedTuple):
    """What friction has left along `direction`: the `load` F . v, what it carries C(v), and what it could carry."""

    direction: np.ndarray
    load: float
    capacity: float
    most: float


def over_period(series: np.ndarray) -> np.ndarray:
    """Fourier series `[..., 2 H + 1]` over a period, at as many instants as they need."""
    harmonics = series.shape[-1] // 2
    samples = max(SAMPLES, PER_WAVE * harmonics)
    angle = 2.0 * np.pi * np.arange(samples) / samples
    order = np.arange(1, harmonics + 1)[:, None]
    waves = np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1).reshape(-1, samples)
    return series[..., :1] + series[..., 1:] @ waves


def least_reserve(closed: Closed) -> Reserve | None:
    """Where friction has least left of what it could carry; None where no body slides or no friction acts."""
    plane = _slides(closed)
    if len(plane) < 2:
        return _least(_reserves(closed, np.concatenate([plane, -plane])))
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    # If all contacts slip, nothing is left along any direction, and the body goes where the load points.
    towards = plane @ np.einsum("ckx,ck->x", closed.frame[:, :2], closed.mean)
    found = _reserves(closed, _unit(np.append(angle, np.arctan2(*towards[::-1]))) @ plane)
    for halving in range(1, HALVINGS + 1):
        if (least := _least(found)) is None:
            return None
        middle = np.arctan2(*(plane @ least.direction)[::-1])
        found += _reserves(closed, _unit(middle + np.array([-1.0, 1.0]) * angle[1] * 0.5**halving) @ plane)
    return _least(found)


def _unit(angle: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _slides(closed: Closed) -> np.ndarray:
    """Directions `[0, 1 or 2, 3]`, orthonormal, along which bodies slide as the structure without friction does."""
    _, across, free = np.linalg.svd(closed.frame[:, 2])
    free = free[np.count_nonzero(across > NO_PART * across[0]) :]
    slip = np.einsum("ckx,fx->fck", closed.frame[:, :2], free).reshape(len(free), 2 * len(closed.frame))
    moves, size, _ = np.linalg.svd(closed.rigid.reshape(slip.shape[1], closed.rigid.shape[-1]), full_matrices=False)
    moves = moves[:, size > NO_PART * size.max(initial=0.0)]
    turned, held, _ = np.linalg.svd(slip - slip @ moves @ moves.T, full_matrices=False)
    return turned[:, held <= HELD * np.linalg.norm(slip)].T @ free


def _least(found: list[Reserve]) -> Reserve | None:
    """Of those along which friction has next to nothing left, all the same, the one along which most is asked of it."""
    left = np.array([(one.capacity - one.load) / one.most for one in found])
    near = [one for one, part in zip(found, left, strict=True) if part <= left.min() + NOTHING_LEFT]
    return max(near, key=lambda one: 2.0 * one.load - one.capacity + NOTHING_LEFT * one.most, default=None)


def _reserves(closed: Closed, directions: np.ndarray) -> list[Reserve]:
    """Of directions `[n, 3]`, those along which friction acts."""
    along = np.einsum("ckx,vx->vck", closed.frame[:, :2], directions)
    most = np.linalg.norm(along, axis=-1) @ closed.limit.mean(axis=1)
    acts = most > NO_PART * closed.limit.mean(axis=1).sum()
    along, held = along[acts], closed.holds
    load = np.einsum("vck,ck->v", along, closed.mean)
    reserve = np.einsum("vck,vck->v", along[:, held], _pushed(closed, along) - closed.mean[held])
    return [
        Reserve(*one)
        for one in zip(directions[acts], load.tolist(), (load + reserve).tolist(), most[acts], strict=True)
    ]


def _pushed(closed: Closed, along: np.ndarray) -> np.ndarray:
    """Mean friction of the contacts that hold, their sliders having come from far behind `[directions, held, 2]`."""
    held = closed.holds
    motion, limit, stiffness = over_period(closed.displacement[held]), closed.limit[held], closed.stiffness[held, None]
    far = FAR * (np.abs(motion).max(initial=0.0) + (limit / stiffness).max(initial=0.0))
    slider, samples = -far * along[:, held], limit.shape[1]
    before, mean = np.full_like(slider, np.inf), np.zeros_like(slider)
    periods = 0
    while periods < PERIODS and np.abs(mean - before).sum(axis=(1, 2)).max(initial=0.0) > REPEATS * limit.mean(1).sum():
        before, mean = mean, np.zeros_like(slider)
        for instant in range(samples):
            force = stiffness * (motion[..., instant] - slider)
            most = limit[:, instant]
            force *= (most / np.maximum(np.hypot(force[..., 0], force[..., 1]), np.maximum(most, TINY)))[..., None]
            slider = motion[..., instant] - force / stiffness
            mean += force / samples
        periods += 1
    return mean
