"""Tangent modes, which nonlinear ones begin at: closed contacts stick there, open ones are free.

Of modes of one frequency every mixture is a mode while contacts stick. A mode's equations fix amplitude and phase of
one coordinate. What other modes of that frequency add is not fixed by them, K phi = omega^2 M phi for each, so they
have no isolated solution while contacts stick: their coordinates are held too (`src/peak/backbone_point.f90`).
"""

from __future__ import annotations

import numpy as np

from attrito.job.cyclic import is_cyclic, nodal_diameter
from attrito.job.job import Job
from attrito.library.points import LinearModes
from attrito.library.session import Solver

# Relative difference of frequencies that counts as none: rounding of large models; far below a damping ratio
SAME_FREQUENCY = 1e-7


def tangent_modes(job: Job, solver: Solver, count: int) -> LinearModes:
    """The lowest, at most `count`, after the static path; of a sector those of the diameter of its engine order."""
    if not is_cyclic(job):
        return solver.linear_modes("tangent", count)
    diameter = nodal_diameter(job["cyclic"]["sectors"], job["cyclic"]["engine_order"])
    return solver.diameter_modes("tangent", diameter, count)


def equal_modes(natural_hz: np.ndarray, number: int) -> list[int]:
    """Numbers, from 1, of the modes that have the frequency of one of them, which comes first.

    Parameters
    ----------
    natural_hz : of all modes, Hz
    number : from 1
    """
    own = natural_hz[number - 1]
    alike = np.flatnonzero(abs(natural_hz - own) <= SAME_FREQUENCY * own) + 1
    return [number, *(int(one) for one in alike if one != number)]


def said_of_equal(numbers: list[int]) -> str:
    """What is to be known of a mode among equal ones, in words; nothing where it is alone."""
    if len(numbers) == 1:
        return ""
    listed = ", ".join(map(str, sorted(numbers)))
    return (
        f"tangent modes {listed} have the same frequency: any mixture of them is a mode while contacts stick; the one"
        " asked for is followed until contacts slip or open, where it may turn into another mixture or end; what parts"
        " their frequencies (a stiffness, a mass, a symmetry that is used) keeps each by itself"
    )
