"""What is solved, in the coordinates that are solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ReducedScene:
    """What is solved, in the model's (reduced) coordinates.

    Parameters
    ----------
    mass, stiffness : `[m, m]`
    damping_kind, damping_value, damping : a name of `DAMPING_KINDS`, its number, and `[m, m]` if viscous
    laws : arrays `[nc]` by the names of a contact's keys
    directions : rows of B, `[rows, m]`
    static, harmonic, monitors : `[loads, m]`, `[2 h + 1, m]`, `[monitors, m]`
    monitor_names : their names
    reduction : fingerprint of the reduced model; empty without one
    """

    mass: np.ndarray
    stiffness: np.ndarray
    damping_kind: str
    damping_value: float
    damping: np.ndarray | None
    laws: dict[str, np.ndarray]
    directions: np.ndarray
    static: np.ndarray
    harmonic: np.ndarray
    monitors: np.ndarray
    monitor_names: list[str]
    reduction: str = ""
