"""Derivatives of a peak's height and frequency by parameters.

By events a smooth peak has A_w = 0 whatever the parameter, and exact second derivatives. Elsewhere they are those of
two points beside the peak: one where the amplitude rises with the frequency, one where it falls. Where the peak is a
corner both lie on branches that are equal along it, whatever the parameter: it moves by w' with A_p + A_w w' the same
of both. Where the response is smooth between them that is what is left of A_p at A_w = 0, by the line through both.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from attrito.library.derivatives import Rates
from attrito.library.family import Family

# Parts of the frequency: how near the two points come, ten times what points are solved to (1e-10), a contact that
# begins to slip between them slipping for some root of it of a period; how far from the peak they are looked for
NEAREST, FARTHEST = 1e-9, 1e-4
# From one place that is tried to the next one
GROWTH = 4.0
# Relative difference of the amplitudes at the two points beyond which the response jumps between them
JUMP = 1e-6
# By so many times what points are solved to amplitudes there differ from the peak's: nearer to it a contact may slip by
# that alone, and what it does is not that of its side
CERTAIN = 100.0
# Derivatives of the amplitude at the present member by the parameters, and last by the frequency, or None
Find = Callable[[Family], "np.ndarray | None"]


def of_peak(
    family: Family, monitor: int, frequency_hz: float, at_corner: bool, find: Find, rates: Rates
) -> np.ndarray | None:
    """Derivatives of height and frequency, Hz, of a monitor's peak at the present member, `[2, parameters]`.

    By samples the slope of a smooth response has small jumps: its peak's frequency has none, NaN. None where a corner's
    branches are not found, or the equations are singular.
    """
    both = None
    if not at_corner:
        found, frequency = find(family), family.differentiate_peak_frequency(monitor, rates)
        if found is None or frequency is None:
            return None
        if not np.all(np.isnan(frequency)):
            # What its place is missed by is left out to first order.
            return np.array([found[:-1] + found[-1] * np.nan_to_num(frequency), frequency])
        both = found, found
    both = beside(family, monitor, frequency_hz, find, CERTAIN * family.tolerance if at_corner else 0.0) or both
    if both is None:
        return None
    rising, falling = both
    with np.errstate(invalid="ignore", divide="ignore"):
        frequency = -(falling[:-1] - rising[:-1]) / (falling[-1] - rising[-1])
    height = rising[:-1] + rising[-1] * np.nan_to_num(frequency)
    return np.array([height, frequency if at_corner else np.full_like(frequency, np.nan)])


def beside(
    family: Family, monitor: int, frequency_hz: float, find: Find, lower: float = 0.0
) -> tuple[np.ndarray, np.ndarray] | None:
    """Derivatives at a point where a monitor's amplitude rises, and at one where it falls, next to a peak.

    `[parameters + 1]`, by the frequency per Hz; None where there are no such points or the response jumps. `lower`: by
    which part of the peak amplitudes there are lower at least.
    """
    family.keep(0)

    def at(part: float) -> tuple[float, float] | None:
        """Amplitude, and its derivative by the frequency."""
        family.go_back(0)
        if not family.move_to(frequency_hz * (1.0 + part)):
            return None
        member, slopes = family.describe(), family.differentiate_by_frequency()
        return None if member is None or slopes is None else (float(member.amplitude[monitor]), float(slopes[monitor]))

    found = None
    if (ends := _ends(at)) is not None:
        found = []
        for part in _apart(at, ends, lower):
            at(part)
            found.append(find(family))
    family.go_back(0)
    return None if found is None or found[0] is None or found[1] is None else (found[0], found[1])


def _ends(at: Callable[[float], tuple[float, float] | None]) -> tuple[float, float] | None:
    """Parts of the frequency at which the amplitude rises and falls, next to each other.

    None where there are none, or the response jumps between them.
    """
    low, high, reach = -0.5 * NEAREST, 0.5 * NEAREST, NEAREST
    below, above = at(low), at(high)
    while below is not None and above is not None and not below[1] > 0.0 > above[1]:
        if reach > FARTHEST:
            return None
        reach *= GROWTH
        if below[1] <= 0.0:
            high, above, low = low, below, low - reach
            below = at(low)
        else:
            low, below, high = high, above, high + reach
            above = at(high)
    while below is not None and above is not None and high - low > NEAREST:
        middle = 0.5 * (low + high)
        between = at(middle)
        if between is None:
            return None
        if between[1] > 0.0:
            low, below = middle, between
        else:
            high, above = middle, between
    if below is None or above is None or abs(below[0] - above[0]) > JUMP * above[0]:
        return None
    return low, high


def _apart(
    at: Callable[[float], tuple[float, float] | None], ends: tuple[float, float], lower: float
) -> tuple[float, float]:
    """The ends, or places further out at which amplitudes are lower than at the higher of them by a part of it."""
    if not lower > 0.0:
        return ends
    top = max(there[0] for part in ends if (there := at(part)) is not None)

    def outwards(part: float, side: float) -> float:
        reach, place = NEAREST, part
        while reach <= FARTHEST:
            there = at(place)
            if there is None:
                break
            if there[0] <= (1.0 - lower) * top:
                return place
            reach *= GROWTH
            place = part + side * reach
        # Where amplitudes hardly fall the nearest point is as good as any.
        return part

    return outwards(ends[0], -1.0), outwards(ends[1], 1.0)
