"""What `attrito peak` finds: peaks along a curve, and the backbone of a mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.library.peak_tracker import Peak
from attrito.library.session import Point


@dataclass(frozen=True)
class BackbonePoint:
    """Motion without excitation at one amplitude.

    Parameters
    ----------
    point : without an estimate of its error; its level has no meaning
    modal_amplitude : coordinate of the mode, whose modal stiffness is 1
    excitation : negative damping that keeps it up, a part of the mass, rad per time
    level : factor on the harmonic loads whose work would do the same
    amplitude : of the monitor, user length
    """

    point: Point
    modal_amplitude: float
    excitation: float
    level: float
    amplitude: float

    @property
    def frequency_hz(self) -> float:
        """Frequency of the motion, Hz."""
        return self.point.frequency_hz

    @property
    def converged(self) -> bool:
        """Whether it was found."""
        return self.point.outcome != "not_converged"

    @property
    def response(self) -> float:
        """Amplitude of the monitor by level."""
        return self.amplitude / self.level if self.level > 0.0 else np.nan


@dataclass(frozen=True)
class Backbone:
    """The backbone of a mode (from 1): its points in stretches, and those at the levels of peaks, where it has them."""

    mode: int
    stretches: list[list[BackbonePoint]]
    at_peaks: list[BackbonePoint | None]


KINDS = ("step", "value", "optimum")


@dataclass(frozen=True)
class Found:
    """A peak on the curve, and why it is there: one of `KINDS`."""

    peak: Peak
    kind: str

    @property
    def converged(self) -> bool:
        """Whether there is a peak to tell of."""
        return self.peak.outcome != "not_converged"


def elasticity(peak: Peak, parameter: str) -> float:
    """Relative change of the peak per relative change of the parameter: of amplitude per level, or of amplitude."""
    return peak.slope * peak.parameter / peak.amplitude - (1.0 if parameter == "level" else 0.0)
