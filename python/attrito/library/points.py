"""What a session of the library has found: points of a sweep, and modes of linear systems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from attrito.library.names import NO_SOLUTION


class Point(NamedTuple):
    """One point of a sweep.

    `states` counts contacts stuck, shaken down, slipping, open; `harmonics` are the coefficients of the monitors,
    `[monitors, 2 H + 1]`, and `amplitude` half their ranges over the period, `[monitors]`, user length;
    `amplitude_rate`, its change by the length along the branch, is 0 where that is not known. `errors` are
    the parts of `estimate` in the order of `ERRORS`; `work` counts floating-point operations of the session up to here.
    `followed`: a point of a sweep, not of a list of frequencies.
    """

    frequency_hz: float
    level: float
    branch: int
    iterations: int
    linear_iterations: int
    outcome: str
    unique: bool
    residual: float
    estimate: float
    errors: tuple[float, float, float]
    samples: int
    work: float
    states: tuple[int, int, int, int]
    harmonics: np.ndarray
    amplitude: np.ndarray
    amplitude_rate: np.ndarray
    finished: bool
    reached_stop: bool
    followed: bool

    @property
    def is_solved(self) -> bool:
        """Whether there is a solution, whatever is known of its stability and error."""
        return self.outcome not in NO_SOLUTION


@dataclass(frozen=True)
class StoredPoint:
    """A point of a result: `coordinates` `[m, nk]`, `slider` `[nc, width]` at the start of the period."""

    frequency_hz: float
    coordinates: np.ndarray
    slider: np.ndarray


@dataclass(frozen=True)
class LinearModes:
    """Modes of a linear system, ascending: natural frequencies `[n]` in Hz, damping ratios `[n]`, shapes `[n, m]`.

    The shapes have unit modal mass. The first `rigid` are rigid-body modes, their damping ratios zero.
    """

    natural_hz: np.ndarray
    damping_ratio: np.ndarray
    shapes: np.ndarray
    rigid: int
