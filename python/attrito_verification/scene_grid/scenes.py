"""The scenes that methods are tried on: the wedge and a chain of two, over stiffness, friction, preload and angle.

A mass stands on springs, kx = (2 pi 100)^2 and ky = (2 pi 250)^2, damped by 20 pi (the wedge of Zucca & Firrone 2014,
doi:10.1016/j.jsv.2013.09.032, with m = 1), and meets a wall: u = -x cos a + y sin a along it, v = x sin a + y cos a
towards it. The chain is two of them, held together by springs of the size of kx, each at a wall of its own. Both are
driven by one unit of force along x at every mass; contact stiffness is measured in kx, preload (towards the wall) in
the force. What changes within a family is the frequency alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from attrito.library.reduced_scene import ReducedScene

# Springs, N/m at 1 kg, damping, N s/m, and the harmonic force on every mass, N.
STIFFNESS = ((200.0 * np.pi) ** 2, (500.0 * np.pi) ** 2)
DAMPING = 20.0 * np.pi
FORCE = 10.0

RATIOS = (0.1, 1.0, 10.0, 1.0e2, 1.0e3, 1.0e4)
# Not 1: with kt = kn and a wall at 45 degrees every motion along x would lie on the limit of friction.
FRICTIONS = (0.0, 0.3, 0.8, 3.0)
# Static force towards the wall, in the harmonic force.
PRELOADS = {"none": 0.0, "small": 1.0, "large": 30.0, "apart": -1.0}
ANGLES = (0.0, 45.0, 80.0)
FREQUENCIES = 40
BAND = (60.0, 280.0)
# The chain meets a part of the grid.
MASSES = {
    1: (RATIOS, FRICTIONS),
    2: ((1.0, 1.0e2, 1.0e4), (0.3, 3.0)),
}


@dataclass(frozen=True)
class Family:
    """Scenes that differ in frequency alone.

    Parameters
    ----------
    masses : 1, the wedge; 2, the chain
    ratio : contact stiffness, kn = kt, in kx
    friction, preload, degrees : as the module says; preload by its name
    """

    masses: int
    ratio: float
    friction: float
    preload: str
    degrees: float

    @property
    def name(self) -> str:
        """One word a parameter."""
        kind = "wedge" if self.masses == 1 else f"chain of {self.masses}"
        return f"{kind}, kn/k {self.ratio:g}, mu {self.friction:g}, preload {self.preload}, {self.degrees:g} degrees"

    def scene(self) -> ReducedScene:
        """What is solved; monitors are the coordinates."""
        n = self.masses
        angle = np.radians(self.degrees)
        cosine, sine = np.cos(angle), np.sin(angle)
        directions = np.kron(np.eye(n), [[-cosine, sine], [sine, cosine]])
        stiffness = np.kron(np.eye(n), np.diag(STIFFNESS))
        links = np.diag(np.full(n - 1, -STIFFNESS[0]), 1)
        links = links + links.T
        stiffness = stiffness + np.kron(links - np.diag(links.sum(axis=1)), np.eye(2))
        harmonic = np.zeros((3, 2 * n))
        harmonic[1, ::2] = FORCE
        contact = np.full(n, self.ratio * STIFFNESS[0])
        laws = {"tangents": np.ones(n, dtype=np.int32), "tangential_stiffness": contact, "normal_stiffness": contact}
        laws |= {"friction_coefficient": np.full(n, self.friction), "gap": np.zeros(n), "preload": np.zeros(n)}
        # Towards the wall of each, which is what the static load does.
        static = PRELOADS[self.preload] * FORCE * directions[1::2].sum(axis=0)
        return ReducedScene(
            np.eye(2 * n),
            stiffness,
            "viscous",
            0.0,
            DAMPING * np.eye(2 * n),
            laws,
            directions,
            static[None, :],
            harmonic,
            np.eye(2 * n),
            [f"{axis}{i}" for i in range(n) for axis in "xy"],
        )


def frequencies() -> np.ndarray:
    """Of every family, Hz."""
    return np.linspace(*BAND, FREQUENCIES)


def families() -> list[Family]:
    """All of them, the wedge's first."""
    return [
        Family(masses, ratio, friction, preload, degrees)
        for masses, (ratios, frictions) in MASSES.items()
        for ratio, friction, preload, degrees in product(ratios, frictions, PRELOADS, ANGLES)
    ]
