"""What a fit has found, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.fits.design import Fit
from attrito.fits.estimate import ALIKE, IDENTIFIED, Estimate, Profile


@dataclass(frozen=True)
class Found:
    """The best of a fit.

    Parameters
    ----------
    fit, start, values : what was asked for; parameters at the beginning and found, `[p]`
    best : in scaled parameters
    profiles : one a parameter, or none
    bounds : of scaled parameters `[p, 2]`
    solved : by set of measurements the values there, by column
    """

    fit: Fit
    start: np.ndarray
    values: np.ndarray
    best: Estimate
    profiles: list[Profile]
    bounds: np.ndarray
    solved: list[dict[str, np.ndarray]]

    @property
    def intervals(self) -> np.ndarray:
        """Of 95 %, linear in the scaled parameter, `[p, 2]`, within the bounds."""
        return self._values(self.best.intervals)

    @property
    def profile_intervals(self) -> np.ndarray:
        """Of 95 %, by profiles, `[p, 2]`; NaN where the profile does not close."""
        if not self.profiles:
            return np.full((len(self.values), 2), np.nan)
        return self._values(np.array([one.interval for one in self.profiles]))

    def _values(self, scaled: np.ndarray) -> np.ndarray:
        return np.array(
            [
                [one.value(end) if np.isfinite(end) else np.nan for end in row]
                for one, row in zip(self.fit.parameters, scaled, strict=True)
            ]
        )

    @property
    def identified(self) -> np.ndarray:
        """Whether the data identify each parameter: its interval takes at most half of what is between its bounds."""
        width = np.diff(self.best.intervals, axis=1).ravel()
        return np.asarray(width <= IDENTIFIED * np.diff(self.bounds, axis=1).ravel())

    @property
    def at_bound(self) -> list[str]:
        """`low` or `high` where a parameter has come to its bound, else nothing."""
        low, high = self.bounds.T
        near = 1e-6 * (high - low)
        ends = zip(self.best.x, low + near, high - near, strict=True)
        return ["low" if x <= least else "high" if x >= most else "" for x, least, most in ends]

    def alike(self) -> list[tuple[str, str]]:
        """Parameters that the data do not separate."""
        names = [one.name for one in self.fit.parameters]
        correlation = np.abs(self.best.correlation)
        pairs = zip(*np.nonzero(np.triu(correlation > ALIKE, 1)), strict=True)
        return [(names[i], names[j]) for i, j in pairs]

    def lines(self) -> list[str]:
        """A line a parameter, then how near the solutions are."""
        width = max(len(one.name) for one in self.fit.parameters)
        lines = []
        for i, parameter in enumerate(self.fit.parameters):
            low, high = self.intervals[i]
            interval = f"95 % in [{low:.5g}, {high:.5g}]" if np.isfinite(low) else "not identified"
            lines.append(f"{parameter.name:{width}}  {self.values[i]:.6g}  {interval}")
        size, count = float(np.sqrt(np.mean(self.best.residuals**2))), len(self.best.residuals)
        return [*lines, f"root of the mean square of {count} residuals: {size:.3g} deviations"]

    def warnings(self) -> list[str]:
        """What a user should know before taking the values."""
        lines = []
        for parameter, known, bound in zip(self.fit.parameters, self.identified, self.at_bound, strict=True):
            if bound:
                lines.append(f"{parameter.name} is at its bound {bound} = {getattr(parameter, bound):g}")
            elif not known:
                lines.append(f"the data do not identify {parameter.name}: its interval is wider than half of its range")
        lines += [f"the data do not separate {one} from {other}" for one, other in self.alike()]
        return lines
