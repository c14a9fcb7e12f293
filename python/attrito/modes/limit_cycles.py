"""Limit cycles of a mode that its structure's damping feeds: where the contacts take just as much.

zeta(Q) = zeta_contacts(Q) + zeta_structure(Q) = 0: there the mode keeps itself up, without negative damping xi besides.
Where zeta rises with Q a motion that is a little larger decays and a smaller one grows: the limit cycle attracts. Where
zeta falls it repels: a larger motion grows without end.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Of `/points/limit_cycle`
NAMES = ("no", "attracts", "repels")
# Relative error of the amplitude, that to which a mode meets its amplitudes
TOLERANCE = 1e-9
MOST_SOLUTIONS = 40


class LimitCycles:
    """Where the damping of a mode changes its sign from one amplitude to the next.

    Attributes
    ----------
    found : limit cycles so far
    """

    def __init__(self) -> None:
        self.found = 0
        # Amplitude and damping ratio of the last amplitude that was asked for; whether one was found since
        self._last = (np.nan, np.nan)
        self._is_met = False

    def save_state(self) -> dict[str, np.ndarray]:
        """What the next point depends on."""
        return {"limit_cycles": np.array([self.found, *self._last, self._is_met], dtype=float)}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this."""
        count, amplitude, ratio, is_met = found["limit_cycles"].tolist()
        self.found, self._last, self._is_met = int(count), (amplitude, ratio), bool(is_met)

    def lie_before(self, ratio: float) -> bool:
        """Whether one that is not yet found lies between the last amplitude and one of a damping ratio."""
        return not self._is_met and self._last[1] * ratio < 0.0

    def pass_by(self, amplitude: float, ratio: float) -> None:
        """An amplitude that was asked for is done, of a damping ratio."""
        self._last, self._is_met = (amplitude, ratio), False

    def search(self, amplitude: float, ratio: float, at: Callable[[float], float]) -> tuple[float, str]:
        """The amplitude of the one before an amplitude of a damping ratio, and its name in `NAMES`. Collective.

        `at` solves the mode at an amplitude and returns its damping ratio, NaN where there is no solution: then NaN.
        """
        from scipy.optimize import brentq

        (start, before), self._is_met = self._last, True
        known = {np.log(start): before, np.log(amplitude): ratio}

        def at_logarithm(place: float) -> float:
            value = known[place] if place in known else at(float(np.exp(place)))
            if np.isnan(value):
                raise FloatingPointError
            return value

        try:
            place = brentq(at_logarithm, *known, xtol=TOLERANCE, rtol=4 * np.finfo(float).eps, maxiter=MOST_SOLUTIONS)
        except FloatingPointError:
            return np.nan, NAMES[0]
        self.found += 1
        return float(np.exp(place)), NAMES[1] if (ratio - before) * (amplitude - start) > 0.0 else NAMES[2]
