"""What is solved, in the coordinates that are solved."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

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
        is along the next sector's, and nodes on the axis along and across it; None where they are the same
    along, across : int32 `[a]` and `[c, 2]`, coordinates of nodes on the axis: along it, and across it in pairs, the
        second a quarter turn ahead of the first. These are in all sectors at once: of their matrices and loads a
        sector has its share
    """

    sectors: int
    engine_order: int
    lower: np.ndarray
    upper: np.ndarray
    next_directions: np.ndarray
    axes: csr_matrix | None = None
    along: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    across: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int32))

    def expansion(self, size: int, diameter: int) -> csr_matrix:
        """S_n `[m, n]`, complex: coordinates `[m]` from those that move at a nodal diameter.

        The upper boundary follows the lower one, and nodes on the axis move along it (n = 0), across it (1 and N - 1)
        or not at all.
        """
        factor, owner = np.ones(size, dtype=complex), np.arange(size)
        factor[self.upper] = np.exp(-2j * np.pi * diameter / self.sectors)
        owner[self.upper] = owner[self.lower]
        if self.sectors > 1:
            number = diameter % self.sectors
            factor[self.along] = number == 0
            turns = {1: 1.0, self.sectors - 1: -1.0}.get(number, 0.0)
            factor[self.across] = turns != 0.0
            if self.sectors > 2:
                factor[self.across] *= np.array([1.0, -1j * turns]) * np.sqrt(0.5)
                owner[self.across[:, 1]] = owner[self.across[:, 0]]
        moving = np.unique(owner[factor != 0.0])
        entries = np.flatnonzero(factor)
        place = np.searchsorted(moving, owner[entries])
        return coo_matrix((factor[entries], (entries, place)), shape=(size, len(moving))).tocsr()

    def own(self, size: int) -> np.ndarray:
        """Coordinates that each sector has for itself: neither of the upper boundary nor on the axis, ascending."""
        others: np.ndarray = np.concatenate([self.upper, self.along, self.across.ravel()]).astype(int)
        return np.delete(np.arange(size), others)

    @property
    def digest(self) -> str:
        """SHA-256 of all its numbers."""
        total = hashlib.sha256(f"{self.sectors} {self.engine_order}".encode())
        for values in (self.lower, self.upper, self.next_directions, self.along, self.across):
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
    gyroscopic : G of the Coriolis forces at the speed of the job, `[m, m]`, skew; None without them
    damping_ratios : of the kind "ratio", that of each mode of the stuck system, ascending in frequency, `[m]`; None:
        `damping_value` is that of all
    suspension_hz : what the stiffness holds of springs that the structure hangs in, (2 pi f)^2 M; 0: none
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
    gyroscopic: np.ndarray | None = None
    damping_ratios: np.ndarray | None = None
    suspension_hz: float = 0.0

    def turning(self, factor: float) -> ReducedScene:
        """The same with the Coriolis forces of another speed, so many times the scene's own."""
        if self.gyroscopic is None:
            return self
        return replace(self, gyroscopic=np.ascontiguousarray(factor * self.gyroscopic))

    @property
    def coordinates(self) -> int:
        """How many are solved for at a harmonic: of a sector, without those that others say."""
        sector, size = self.sector, len(self.mass)
        if sector is None:
            return size
        return size - len(sector.upper) - (len(sector.across) if sector.sectors > 2 else 0)

    def has_the_modes_of(self, other: ReducedScene) -> bool:
        """Whether two scenes differ in `FREE_OF_MODES` alone."""
        plain = (
            "mass",
            "stiffness",
            "damping",
            "damping_ratios",
            "gyroscopic",
            "directions",
            "static",
            "harmonic",
            "monitors",
        )
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

    The upper boundary's coordinates are gone, and nodes on the axis move along it; a whole model stays as it is.
    """
    if scene.sector is None:
        return scene
    tie = scene.sector.expansion(len(scene.mass), 0).toarray().real
    damping, gyroscopic = (
        None if matrix is None else np.ascontiguousarray(tie.T @ matrix @ tie)
        for matrix in (scene.damping, scene.gyroscopic)
    )
    return replace(
        scene,
        mass=np.ascontiguousarray(tie.T @ scene.mass @ tie),
        stiffness=np.ascontiguousarray(tie.T @ scene.stiffness @ tie),
        damping=damping,
        gyroscopic=gyroscopic,
        directions=np.ascontiguousarray((scene.directions + scene.sector.next_directions) @ tie),
        static=np.ascontiguousarray(scene.static @ tie),
        harmonic=np.ascontiguousarray(scene.harmonic @ tie),
        monitors=np.ascontiguousarray(scene.monitors @ tie),
        sector=None,
    )
