"""Equal tangent modes: of modes of one frequency every mixture is a mode while contacts stick.

A mode's equations fix amplitude and phase of one coordinate. What other modes of that frequency add is not fixed by
them, K phi = omega^2 M phi for each, so they have no isolated solution while contacts stick.
"""

from __future__ import annotations

import numpy as np

# Relative difference of frequencies that counts as none: rounding of large models; far below a damping ratio
SAME_FREQUENCY = 1e-7


def equal_modes(natural_hz: np.ndarray, number: int) -> list[int]:
    """Numbers, from 1, of the modes that have the frequency of one of them, itself among them.

    Parameters
    ----------
    natural_hz : of all modes, Hz
    number : from 1
    """
    own = natural_hz[number - 1]
    return [int(i) + 1 for i in np.flatnonzero(abs(natural_hz - own) <= SAME_FREQUENCY * own)]


def said_of_equal(numbers: list[int]) -> str:
    """What is to be known of a mode among equal ones, in words; nothing where it is alone."""
    if len(numbers) == 1:
        return ""
    listed = ", ".join(map(str, numbers))
    return (
        f"tangent modes {listed} have the same frequency: any mixture of them is a mode while contacts stick, so that"
        " none is found for sure; what parts their frequencies (a stiffness, a mass, a symmetry that is used) lets one"
        " be followed"
    )
