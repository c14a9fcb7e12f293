"""Measurements, and how far a solution is from them.

A residual is a difference over a standard deviation. Amplitudes and frequencies with a relative one are compared by
their logarithms, so that an amplitude half as large is as far off as one twice as large; phases by the nearer way
round; the force of a steady loop up to a constant, which neither the instrument's zero nor the slider's place gives.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# By kind of measurement: the column that says where, and those that are compared, with what names their deviation
COLUMNS = {
    "response": ("frequency_hz", {"amplitude": "amplitude", "phase_deg": "phase"}),
    "mode": ("amplitude", {"frequency_hz": "frequency", "frequency_ratio": "frequency", "damping_ratio": "damping"}),
    "loop": ("displacement", {"tangential_force": "force", "displacement": "displacement"}),
}
# What may be zero is compared as it is, and what may have either sign
LINEAR, SIGNED = ("damping_ratio",), ("phase_deg", "tangential_force", "displacement")


@dataclass(frozen=True)
class Measured:
    """Numbers of a file.

    Parameters
    ----------
    at : where, `[n]`: frequencies of a response, ascending; amplitudes of a mode, ascending; displacements of a loop
    values : by column `[n]`; NaN: not measured
    deviations : standard deviation of each, `[n]`
    relative : columns whose deviations are relative
    centred : columns that are compared up to a constant
    beside : what else is known there, `[n]`: of a loop the normal force, or of one over a period the part of that
    """

    at: np.ndarray
    values: dict[str, np.ndarray]
    deviations: dict[str, np.ndarray]
    relative: tuple[str, ...]
    centred: tuple[str, ...] = ()
    beside: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many numbers are compared."""
        return sum(int(np.isfinite(values).sum()) for values in self.values.values())

    def deviation(self, name: str) -> np.ndarray:
        """Standard deviations of a column, absolute `[n]`."""
        own = self.deviations[name]
        return own * self.values[name] if name in self.relative else own

    def residuals(self, found: dict[str, np.ndarray], weight: float) -> np.ndarray:
        """Differences over standard deviations, column after column `[count]`."""
        parts = [self.differences(found, name)[np.isfinite(values)] for name, values in self.values.items()]
        return weight * np.concatenate(parts)

    def differences(self, found: dict[str, np.ndarray], name: str) -> np.ndarray:
        """Of one column, over standard deviations `[n]`; NaN where it was not measured."""
        own, there, deviation = self.values[name], self.shown(found, name), self.deviations[name]
        if name not in self.relative:
            apart = there - own
            return np.asarray((_nearer(apart) if name == "phase_deg" else apart) / deviation)
        if name in LINEAR:
            return np.asarray((there - own) / (deviation * np.abs(own)))
        return np.asarray(np.log(there / own) / deviation)

    def shown(self, found: dict[str, np.ndarray], name: str) -> np.ndarray:
        """A column of the solution as it is compared: with the constant that suits the measurements best."""
        there = found[name]
        if name not in self.centred:
            return there
        weights = np.where(np.isfinite(self.values[name]), self.deviations[name] ** -2, 0.0)
        apart = np.where(weights > 0.0, self.values[name] - there, 0.0)
        return np.asarray(there + (weights @ apart) / weights.sum())

    def slopes(self, found: dict[str, np.ndarray], rates: dict[str, np.ndarray], weight: float) -> np.ndarray:
        """Derivatives of the residuals where those of the solution are `rates`, `[n, parameters]` by column."""
        parts = []
        for name, values in self.values.items():
            known = np.isfinite(values)
            scale, slopes = self.deviations[name][known], rates[name][known]
            if name in self.relative:
                scale = scale * np.abs(values[known] if name in LINEAR else found[name][known])
            if name in self.centred:
                slopes = slopes - (scale**-2 @ slopes) / np.sum(scale**-2)
            parts.append(slopes / scale[:, np.newaxis])
        return weight * np.concatenate(parts)


def _nearer(angle: np.ndarray) -> np.ndarray:
    """The same angle, degrees, from -180 on to below 180."""
    return np.asarray((angle + 180.0) % 360.0 - 180.0)
