"""Where engine orders cross natural frequencies over the speed of rotation.

Between two speeds the square of a natural frequency is taken as linear in that of the speed, as it is where all that
rotation does is (Southwell's rule):

    f^2 = f_0^2 + s (f_1^2 - f_0^2),   Omega^2 = Omega_0^2 + s (Omega_1^2 - Omega_0^2),   f = e Omega.

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
    speeds_hz: np.ndarray, frequency_hz: np.ndarray, orders: Sequence[int], diameter: int | None = None
) -> list[Crossing]:
    """Those of the modes of one nodal diameter.

    Parameters
    ----------
    speeds_hz : rising, `[speeds]`
    frequency_hz : of each mode, `[speeds, modes]`
    orders : those that excite this diameter
    """
    found = []
    for order in orders:
        above = frequency_hz**2 - (order * speeds_hz[:, None]) ** 2
        for i, mode in zip(*np.nonzero((above[:-1] > 0.0) != (above[1:] > 0.0)), strict=True):
            part = above[i, mode] / (above[i, mode] - above[i + 1, mode])
            first, last = speeds_hz[i : i + 2] ** 2
            speed = float(np.sqrt(first + part * (last - first)))
            found.append(Crossing(speed, order * speed, order, diameter, int(mode) + 1))
    return found
