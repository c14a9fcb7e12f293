"""Modes of a linear system in families: those of a structure by itself, or of each nodal diameter of a wheel.

Of N equal sectors the nodal diameters are 0 ... N/2: n and N - n are conjugates, one running each way round the wheel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.library.reduced_scene import Sector
from attrito.library.session import LinearModes, Solver
from attrito.runs.linear_references import in_words

# What a mode is
KINDS = ("elastic", "rigid")


@dataclass(frozen=True)
class Family:
    """Modes of one nodal diameter; of a structure by itself, `diameter` None."""

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


def nodal_diameters(sector: Sector | None) -> list[int | None]:
    """Those whose modes differ; of a structure by itself None alone."""
    return [None] if sector is None else list(range(sector.sectors // 2 + 1))


def families_of(solver: Solver, state: str, count: int) -> list[Family]:
    """The lowest modes of each family, at most `count`, of one of `REFERENCES`. Collective."""
    found = []
    for diameter in nodal_diameters(solver.sector):
        own = diameter is None
        modes = solver.linear_modes(state, count) if own else solver.diameter_modes(state, diameter, count)
        found.append(Family(diameter, modes))
    return found
