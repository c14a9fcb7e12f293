"""What is solved, in the coordinates that are solved."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

# Of a contact's law, what its stuck state does not show
FREE_OF_MODES = ("friction_coefficient", "gap", "preload", "law", "law_numbers")


@dataclass(frozen=True)
class Sector:
    """One of N equal sectors, q_{j+1}(t) = q_j(t - EO T / N), in axes that turn with the sector.

    Parameters
    ----------
    sectors, engine_order : N and EO; above 0 the loads are f_j(t) = f_0(t - j EO T / N)
    lower, upper : int32 `[k]`, coordinates from 0 of the two boundaries, paired: q_upper of a sector is q_lower of the
        next one
    next_directions : rows of B on the next sector's coordinates, `[rows, m]`; zero of contacts inside or to the ground
    axes : A `[m, m]`, with A p the coordinates along the model's own axes, p those solved, whose upper boundary
        is along the next sector's; None where they are the same
    """

    sectors: int
    engine_order: int
    lower: np.ndarray
    upper: np.ndarray
    next_directions: np.ndarray
    axes: csr_matrix | None = None

    @property
    def digest(self) -> str:
        """SHA-256 of all its numbers."""
        total = hashlib.sha256(f"{self.sectors} {self.engine_order}".encode())
        for values in (self.lower, self.upper, self.next_directions):
            total.update(np.ascontiguousarray(values).tobytes())
        return total.hexdigest()


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
    sector : None where the model is a whole one
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
    sector: Sector | None = None

    def has_the_modes_of(self, other: ReducedScene) -> bool:
        """Whether two scenes differ in `FREE_OF_MODES` alone."""
        plain = ("mass", "stiffness", "damping", "directions", "static", "harmonic", "monitors")
        same = all(
            getattr(self, name) == getattr(other, name) for name in ("damping_kind", "damping_value", "monitor_names")
        )
        same = same and all(np.array_equal(getattr(self, name), getattr(other, name)) for name in plain)
        wheels = [None if scene.sector is None else scene.sector.digest for scene in (self, other)]
        same = same and wheels[0] == wheels[1]
        shared = (self.laws.keys() | other.laws.keys()) - set(FREE_OF_MODES)
        return same and all(np.array_equal(self.laws[name], other.laws[name]) for name in shared)


def all_alike(scene: ReducedScene) -> ReducedScene:
    """What a sector is while all sectors move alike, as at rest: its upper boundary is its own lower one.

    The upper boundary's coordinates are gone; a whole model stays as it is.
    """
    if scene.sector is None:
        return scene
    tie = np.eye(len(scene.mass))
    tie[scene.sector.upper, scene.sector.lower] = 1.0
    tie = np.delete(tie, scene.sector.upper, axis=1)
    damping = None if scene.damping is None else np.ascontiguousarray(tie.T @ scene.damping @ tie)
    return replace(
        scene,
        mass=np.ascontiguousarray(tie.T @ scene.mass @ tie),
        stiffness=np.ascontiguousarray(tie.T @ scene.stiffness @ tie),
        damping=damping,
        directions=np.ascontiguousarray((scene.directions + scene.sector.next_directions) @ tie),
        static=np.ascontiguousarray(scene.static @ tie),
        harmonic=np.ascontiguousarray(scene.harmonic @ tie),
        monitors=np.ascontiguousarray(scene.monitors @ tie),
        sector=None,
    )
