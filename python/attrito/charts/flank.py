"""Frequencies by which each way of a chart comes to the peak: up the flank of the sweep, none far from the one before.

Evenly spaced frequencies leave the last step before a sharp peak to Newton's method alone: on a lap joint that takes
longer than the whole sweep. So frequencies are those at which the sweep first has parts of the peak's amplitude.
"""

from __future__ import annotations

import numpy as np

# Of the peak's amplitude
PARTS = (0.05, 0.125, 0.25, 0.5, 0.75, 0.9)


def up_the_flank(start: float, frequency: np.ndarray, amplitude: np.ndarray) -> list[float]:
    """The start of a sweep, frequencies on the way up and that of the peak, Hz, in one direction.

    Parameters
    ----------
    start : of the sweep, Hz
    frequency, amplitude : of its solved points, in turn `[points]`
    """
    top = int(np.argmax(amplitude))
    peak = float(frequency[top])
    found = [start]
    for part in PARTS:
        at = float(frequency[np.flatnonzero(amplitude[: top + 1] >= part * amplitude[top])[0]])
        # Beyond a fold the branch comes back; frequencies of a list go one way
        if abs(at - start) > abs(found[-1] - start) and abs(at - start) < abs(peak - start):
            found.append(at)
    return [*found, peak] if peak != start else found
