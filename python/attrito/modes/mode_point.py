"""What is found of a nonlinear mode at one amplitude, by whatever method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from attrito.library.points import Point


@dataclass(frozen=True)
class ModePoint:
    """A point of a mode.

    Parameters
    ----------
    point : its level has no meaning, and neither has its own estimate
    amplitude : Q, zero to peak of phi^T M q_1, user length times root of user mass; quasi-static: half the loop's range
    kinetic : sum over h of h^2 q_h^H M q_h, of zero-to-peak amplitudes; quasi-static: Q^2
    structural_ratio : damping ratio of the structure alone
    drive : what keeps the motion up, and what goes with it, by the names of their series: xi, rad per time, and the
        drift of sliders; quasi-static: amplitude of the load, area of the loop, frequency and damping ratio by Masing's
        rule
    iterations : of Newton's method on the way here
    error_harmonics, error_samples : parts of the estimated relative error, see `SERIES` in `nonlinear.py`; NaN: not
        estimated
    folded : whether the mode's curve folds between the point before and this one
    contact_work : of each contact a period, user energy, at the root `[nc]`; None: that of the balance
    """

    point: Point
    amplitude: float
    kinetic: float
    structural_ratio: float
    drive: dict[str, float]
    iterations: int
    error_harmonics: float = np.nan
    error_samples: float = np.nan
    contact_work: np.ndarray | None = None
    folded: bool = False

    @property
    def estimate(self) -> float:
        """Estimated relative error; NaN: not estimated."""
        parts = [part for part in (self.error_harmonics, self.error_samples) if not np.isnan(part)]
        return sum(parts) if parts else np.nan

    @property
    def converged(self) -> bool:
        """Whether it was found."""
        return self.point.is_solved

    def lost(self) -> ModePoint:
        """The same as a point that was not found."""
        return replace(self, point=self.point._replace(outcome="not_converged"))

    def damping_ratio(self, work: float) -> float:
        """Of the contacts, which do so much work a period, user energy: work / (2 pi omega^2 sum h^2 q_h^H M q_h)."""
        return work / (2.0 * np.pi * (2.0 * np.pi * self.point.frequency_hz) ** 2 * self.kinetic)
