"""What an examination of stability finds, and how far two sets of multipliers are from each other."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from attrito.library.names import ENGINES, MULTIPLIER_KINDS, ORBITS
from attrito.runs.stability import examine_point, fetch_multipliers, fetch_wavenumbers

MONODROMY, HILL = ENGINES["monodromy"], ENGINES["hill"]
FLOQUET = MULTIPLIER_KINDS.index("floquet")


def examined(solver, methods):
    """Verdict, reason, change, and by engine multipliers, wavenumbers and how many of each kind."""
    report, reason = examine_point(solver, methods, ORBITS["balance"])
    found = {}
    for engine, count in ((MONODROMY, report.monodromy), (HILL, report.hill)):
        if count:
            real, imaginary, kind = fetch_multipliers(solver, engine, count)
            chosen = kind == FLOQUET
            waves = fetch_wavenumbers(solver, engine, count)[chosen]
            found[engine] = (real + 1j * imaginary)[chosen], waves, np.bincount(kind, minlength=3)
    return report.verdict, reason, report.change, found


def farthest(one, other):
    """The largest distance of partners."""
    assert len(one) == len(other)
    distance = np.abs(one[:, None] - other[None, :])
    return distance[linear_sum_assignment(distance)].max()
