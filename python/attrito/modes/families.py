"""Modes of a linear system in families: those of a structure by itself, or of each nodal diameter of a wheel.

Of N equal sectors the nodal diameters are 0 ... N/2: n and N - n are conjugates, one running each way round the wheel.
Coriolis forces part the two: then n above 0 runs forward, with rising sectors, and -n, which is N - n, backward.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from attrito.library.points import LinearModes
from attrito.library.reduced_scene import Sector
from attrito.library.session import Solver
from attrito.runs.linear_references import in_words

# What a mode is
KINDS = ("elastic", "rigid")


@dataclass(frozen=True)
class Family:
    """Modes of one nodal diameter, below 0 of waves running backward; of a structure by itself, `diameter` None."""

    diameter: int | None
    modes: LinearModes

    @property
    def elastic_hz(self) -> np.ndarray:
        """Natural frequencies without those of rigid-body modes."""
        return self.modes.natural_hz[self.modes.rigid :]

    def in_words(self, count: int = 3) -> str:
        """The lowest natural frequencies."""
        words = f"{in_words(self.elastic_hz, self.modes.rigid, count)} Hz"
        return words if self.diameter is None else f"nodal diameter {self.diameter}: {words}"


def nodal_diameters(sector: Sector | None, split: bool = False) -> list[int | None]:
    """Those whose modes differ; of a structure by itself None alone.

    `split`: waves that run backward, -n, beside those that run forward.
    """
    if sector is None:
        return [None]
    each = [(n,) if not split or 2 * n % sector.sectors == 0 else (n, -n) for n in range(sector.sectors // 2 + 1)]
    return [n for both in each for n in both]


def meaning_of_diameters(families: Iterable[Family]) -> str:
    """What the nodal diameters of a file are."""
    if any(family.diameter is not None and family.diameter < 0 for family in families):
        return "nodal diameter; above 0 of waves running forward, with rising sectors, below 0 backward"
    return "nodal diameter; those above 0 and below N/2 stand for N - n too, the wave the other way round"


def families_of(solver: Solver, state: str, count: int) -> list[Family]:
    """The lowest modes of each family, at most `count`, of one of `REFERENCES`. Collective."""
    found = []
    for diameter in nodal_diameters(solver.sector, solver.has_coriolis):
        if diameter is None or solver.sector is None:
            modes = solver.linear_modes(state, count)
        else:
            modes = solver.diameter_modes(state, diameter % solver.sector.sectors, count)
        found.append(Family(diameter, modes))
    return found
