"""Vectors that vary over a period, as Fourier coefficients 1, cos, sin, cos 2, ...: where they are longest, and the two
instants between which they differ most.

f(s) = |x(s)|^2 and f(s, t) = |x(s) - x(t)|^2 are trigonometric polynomials of twice the order H of x. They are sampled,
and Newton's method climbs every hump that may be the highest: a hump of height f* is sampled nowhere farther than half
a step h off, where by Riesz's theorem f >= f* (1 + cos H h) / 2; f(s, t) too, whose phases change by H h at most.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

# Numbers held at once
BLOCK = 2_000_000
# Samples of a period of the highest harmonic, and what a hump keeps at the nearest of them
SAMPLES = 16
KEPT = 0.5 * (1.0 + np.cos(2.0 * np.pi / SAMPLES))
# Of a curvature, part of the greatest: below it is a flat top, along which there is nothing to climb
FLAT = 1e-10
# Newton's steps; each squares the distance to the top
STEPS = 6


def fourier(phase: np.ndarray | float, nk: int, derivative: int = 0) -> np.ndarray:
    """1, cos, sin, cos 2, sin 2, ... of `phase`, or a derivative: [..., nk]."""
    phase = np.asarray(phase, dtype=float)
    harmonic = (np.arange(nk) + 1) // 2
    # Every derivative turns a harmonic by a quarter; sin is cos a quarter late.
    turn = (derivative - (np.arange(nk) % 2 == 0)) * np.pi / 2
    values = harmonic**derivative * np.cos(phase[..., None] * harmonic + turn)
    values[..., 0] = derivative == 0
    return np.asarray(values)


def at_phases(vectors: np.ndarray, phase: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Each vector at its own phase, or a derivative, `[n, d]`, from coefficients `[nk, n, d]` and phases `[n]`."""
    return np.asarray(np.einsum("nk,knd->nd", fourier(phase, len(vectors), derivative), vectors))


def longest(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Greatest length of each vector over the period, and the phase where it has it.

    Parameters
    ----------
    vectors : coefficients [nk, n, d]

    Returns
    -------
    [n] each; phases in [0, 2 pi)
    """
    found = _in_blocks(_longest, vectors, np.any(vectors != 0, axis=(0, 2)), 1)
    return found[:, 0], found[:, 1]


def widest(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Greatest distance between each vector at two instants of the period, and the phases of these.

    Parameters
    ----------
    vectors : coefficients [nk, n, d]; the mean does not matter

    Returns
    -------
    [n] each; phases in [0, 2 pi), the lesser first
    """
    # Without the mean, whose rounding would hide small motion
    varying = vectors.copy()
    varying[0] = 0
    found = _in_blocks(_widest, varying, np.any(varying != 0, axis=(0, 2)), 2)
    phases = np.sort(found[:, 1:], axis=1)
    return found[:, 0], phases[:, 0], phases[:, 1]


def _in_blocks(
    work: Callable[[np.ndarray, int], np.ndarray], vectors: np.ndarray, moving: np.ndarray, instants: int
) -> np.ndarray:
    """Size and phases of the vectors that move, zeros of the others, `[n, 1 + instants]`."""
    rows = np.flatnonzero(moving)
    found = np.zeros((vectors.shape[1], 1 + instants))
    samples = SAMPLES * max(1, len(vectors) // 2)
    for block in np.array_split(rows, 1 + len(rows) * samples**instants // BLOCK):
        if len(block):
            found[block] = work(vectors[:, block], samples)
    found[:, 1:] %= 2.0 * np.pi
    return found


def _longest(vectors: np.ndarray, samples: int) -> np.ndarray:
    grid = 2.0 * np.pi * np.arange(samples) / samples
    squared = sum((fourier(grid, len(vectors)) @ vectors[:, :, axis]) ** 2 for axis in range(vectors.shape[2]))
    one, start = _humps(squared.T)
    own = vectors[:, one]

    def height(phase: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(at_phases(own, phase[:, 0]), axis=1))

    def uphill(phase: np.ndarray) -> np.ndarray:
        x, velocity, acceleration = (at_phases(own, phase[:, 0], order) for order in range(3))
        slope = (x * velocity).sum(axis=1)
        curvature = (velocity**2).sum(axis=1) + (x * acceleration).sum(axis=1)
        return np.where(curvature < 0, -slope / np.where(curvature < 0, curvature, 1), 0)[:, None]

    return _highest(one, *_climbed(grid[start], grid[1], height, uphill))


def _widest(vectors: np.ndarray, samples: int) -> np.ndarray:
    grid = 2.0 * np.pi * np.arange(samples) / samples
    values = np.einsum("sk,knd->nsd", fourier(grid, len(vectors)), vectors)
    length = (values**2).sum(axis=2)
    squared = length[:, :, None] + length[:, None, :] - 2.0 * values @ values.transpose(0, 2, 1)
    # f(s, t) = f(t, s), which rounding must not change: of two equal maxima one is taken.
    squared = np.maximum(squared, squared.transpose(0, 2, 1))
    one, start = _humps(squared)
    once = start[:, 0] < start[:, 1]
    one, start = one[once], start[once]
    own = vectors[:, one]

    def height(phase: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(at_phases(own, phase[:, 0]) - at_phases(own, phase[:, 1]), axis=1))

    return _highest(one, *_climbed(grid[start], grid[1], height, lambda phase: _uphill(own, phase)))


def _humps(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples that no neighbour exceeds, of those that may be near the highest hump.

    Parameters
    ----------
    values : on a periodic grid of one or two phases, `[n, samples]` or `[n, samples, samples]`

    Returns
    -------
    which of the n each belongs to, and its place on the grid, `[m]` and `[m, 1 or 2]`
    """
    axes = tuple(range(1, values.ndim))
    # Rounding of a flat top must not lose it.
    place = np.nonzero(values >= KEPT * (1.0 - 1e-9) * values.max(axis=axes, keepdims=True))
    own = values[place]
    is_top = np.ones(len(own), dtype=bool)
    for step in product((-1, 0, 1), repeat=len(axes)):
        beside = tuple((at + by) % values.shape[1] for at, by in zip(place[1:], step, strict=True))
        is_top &= own >= values[(place[0], *beside)]
    return place[0][is_top], np.stack(place[1:], axis=1)[is_top]


def _climbed(
    start: np.ndarray,
    step: float,
    height: Callable[[np.ndarray], np.ndarray],
    uphill: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Heights and phases of humps, climbed from samples at a distance of at most `step`."""
    phase = start.copy()
    for _ in range(STEPS):
        phase = np.clip(phase + uphill(phase), start - step, start + step)
    sampled, climbed = height(start), height(phase)
    # A flat top (a circle) has nothing to climb; keep whichever is higher.
    return np.maximum(sampled, climbed), np.where((climbed >= sampled)[:, None], phase, start)


def _highest(one: np.ndarray, height: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Of humps that belong to some vector the highest of each, `[n, 1 + instants]`."""
    order = np.lexsort((-height, one))
    first = order[np.unique(one[order], return_index=True)[1]]
    return np.column_stack([height[first], phase[first]])


def _uphill(vectors: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Newton's step in both phases, `[n, 2]`, along the directions in which 1/2 |x(s) - x(t)|^2 curves down."""
    (x, v, a), (y, w, b) = ([at_phases(vectors, phase[:, one], order) for order in range(3)] for one in (0, 1))
    apart = x - y
    slope = np.stack([(apart * v).sum(axis=1), -(apart * w).sum(axis=1)], axis=1)
    across = -(v * w).sum(axis=1)
    along = [(v * v + apart * a).sum(axis=1), (w * w - apart * b).sum(axis=1)]
    hessian = np.stack([along[0], across, across, along[1]], axis=1).reshape(-1, 2, 2)
    curvature, direction = np.linalg.eigh(hessian)
    steep = curvature < -FLAT * np.abs(curvature).max(axis=1, keepdims=True)
    amount = np.where(steep, -np.einsum("nij,ni->nj", direction, slope) / np.where(steep, curvature, 1.0), 0.0)
    return np.asarray(np.einsum("nij,nj->ni", direction, amount))
