"""A block on two feet that friction alone holds across its load."""

from __future__ import annotations

import numpy as np
from jobs import Job

KT, KN, FRICTION, RATIO = 4.0e4, 6.0e4, 0.3, 1.0e-3
MASS, STIFFNESS = np.diag([1.0, 1.0, 1.0, 0.3]), np.diag([0.0, 0.0, 0.0, 2.0e5])
# Rows of the two feet: along x and y, and down; the block turns about y.
FEET = np.array([[[1.0, 0, 0, 0.5], [0, 1.0, 0, 0], [0, 0, 1.0, side]] for side in (-1.0, 1.0)])


def rocking_block() -> Job:
    """A block on two feet that rocks about y: only friction holds x and y, and a 400th of its load pushes along y."""
    feet = [
        {
            "normal": _terms(rows[2]),
            "tangents": [_terms(rows[0]), _terms(rows[1])],
            "tangential_stiffness": KT,
            "normal_stiffness": KN,
            "friction_coefficient": FRICTION,
        }
        for rows in FEET
    ]
    return {
        "model": {"mass": MASS.tolist(), "stiffness": STIFFNESS.tolist()},
        "damping": {"ratio": RATIO},
        "contact": feet,
        "load": [{"name": "press", "kind": "static", "dofs": [[2, 200.0], [1, 0.5]]}],
        "balance": {"harmonics": 3},
        "mode": {"number": 4, "start": 4.0e-4, "stop": 8.4e-4, "points": 3},
        "output": {"file": "result.h5", "monitors": [{"name": "turn", "dofs": [[3, 1.0]]}]},
    }


def _terms(row: np.ndarray) -> list[list[float]]:
    """A row as a job lists it: dof and factor."""
    return [[dof, float(row[dof])] for dof in np.flatnonzero(row).tolist()]
