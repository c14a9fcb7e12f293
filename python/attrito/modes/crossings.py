"""Where engine orders cross natural frequencies over the speed of rotation.

Between two speeds the square of a natural frequency is taken as linear in that of the speed, as it is where all that
rotation does is (Southwell's rule):

    f^2 = f_0^2 + s (f_1^2 - f_0^2),   Omega^2 = Omega_0^2 + s (Omega_1^2 - Omega_0^2),   f = e Omega.

Where Coriolis forces part the waves that run forward from those that run backward, their frequencies change with the
speed itself to first order, and so both are taken as linear, f = f_0 + s (f_1 - f_0).

Engine order e excites a wheel of N sectors at the nodal diameter it folds to alone.
Source: Southwell & Gough 1921, Aeronautical Research Committee R&M 766.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Crossing:
    """A critical speed: engine order e is in resonance with a mode, numbered from 1 within its nodal diameter."""

    speed_hz: float
    frequency_hz: float
    engine_order: int
    diameter: int | None
    mode: int


def crossings(
    speeds_hz: np.ndarray,
    frequency_hz: np.ndarray,
    orders: Sequence[int],
    diameter: int | None = None,
    parted: bool = False,
) -> list[Crossing]:
    """Those of the modes of one nodal diameter.

    Parameters
    ----------
    speeds_hz : rising, `[speeds]`
    frequency_hz : of each mode, `[speeds, modes]`
    orders : those that excite this diameter
    parted : whether waves both ways differ at it
    """
    found, power = [], 1 if parted else 2
    for order in orders:
        above = frequency_hz**power - (order * speeds_hz[:, None]) ** power
        for i, mode in zip(*np.nonzero((above[:-1] > 0.0) != (above[1:] > 0.0)), strict=True):
            part = above[i, mode] / (above[i, mode] - above[i + 1, mode])
            first, last = speeds_hz[i : i + 2] ** power
            speed = float((first + part * (last - first)) ** (1.0 / power))
            found.append(Crossing(speed, order * speed, order, diameter, int(mode) + 1))
    return found
