"""The point of a nonlinear mode at which a monitor has an amplitude, as a sensor measures it.

a is half the range of the monitor, or the amplitude of its first harmonic, of displacement, velocity or acceleration,
(2 pi f)^n |x_1|. Of the mode it grows with Q, nearly in proportion: log Q goes along the line through the last two
solutions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from attrito.library.points import Point
from attrito.library.structures import omega
from attrito.modes.mode_point import ModePoint

# Relative difference of the monitor's amplitude from what is asked for, and how often Q is corrected
MONITOR_TOLERANCE, MOST_CORRECTIONS = 1e-8, 12


@dataclass(frozen=True)
class Sensor:
    """What measures a mode's amplitude.

    Parameters
    ----------
    monitor : number of the monitor, from 0
    power : n; None: half the range
    """

    monitor: int
    power: int | None = None

    def read(self, point: Point) -> float:
        """Its amplitude at a point."""
        if self.power is None:
            return float(point.amplitude[self.monitor])
        _, cosine, sine = point.harmonics[self.monitor][:3]
        return float(np.hypot(cosine, sine) * omega(point.frequency_hz) ** self.power)

    def of_shape(self, entry: complex, frequency_hz: float) -> float:
        """Its amplitude by that of the tangent mode, Q = 1, whose shape has an entry at the monitor."""
        return abs(entry) * omega(frequency_hz) ** (self.power or 0)


class AtMonitor:
    """Follows a mode in a sensor's amplitude.

    Parameters
    ----------
    at : the mode's point of an amplitude Q
    sensor : what measures
    ratio : the sensor's amplitude over Q at first
    """

    def __init__(self, at: Callable[[float], ModePoint], sensor: Sensor, ratio: float):
        self._at, self._sensor, self._ratio = at, sensor, ratio

    def at(self, amplitude: float) -> ModePoint:
        """The point at which the sensor has an amplitude; not converged where the mode is lost on the way there."""
        asked, slope, last = np.log(amplitude), 1.0, None
        place = asked - np.log(self._ratio)
        for _ in range(MOST_CORRECTIONS):
            one = self._at(float(np.exp(place)))
            if not one.converged:
                break
            found = np.log(self._sensor.read(one.point))
            self._ratio = float(np.exp(found - place))
            if abs(found - asked) <= MONITOR_TOLERANCE:
                return one
            if last is not None and place != last[0]:
                slope = float(np.clip((found - last[1]) / (place - last[0]), 0.2, 5.0))
            last = place, found
            place += (asked - found) / slope
        return one.lost()
