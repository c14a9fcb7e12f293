"""Is the static solution the only one? Wedging, and friction so large that the static problem has several solutions.

A contact that slips one way, side = +-1, has T = side mu N: its springs act like the unsymmetric matrix

    side mu kn B_t^T B_n + kn B_n^T B_n

and large friction can turn the sign of the structure's determinant in that state. With the compliance of the stuck
structure, R = B (K + B^T K_c B)^-1 B^T, and the change G of the contacts' stiffness in a combination of states (each
contact stuck, slipping one way or the other, or open), the sign is that of det(I + R G). The contact law is piecewise
linear in the displacements, its pieces are these combinations; with friction scaled by s it is, at s = 0, a monotone
map and has one solution. So it has while no determinant reaches zero, and the least s at which one does,

    det(I + R G_0 + s R G_1) = 0   =>   1/s the largest positive eigenvalue of -(I + R G_0)^-1 R G_1,

is the margin reported here: above 1, every step of the static problem has one solution for the sliders it starts from.
At 1 or below, the body can wedge: some loads have several solutions, or slip cannot go on. One contact: with the
compliances c of the structure without it, s mu = (1/kn + c_nn)/|c_nt|, which for a mass on a spring along x that is
stiff along y, at a wall at an angle a, comes to tan a as kn grows.
Source: Klarbring 1999, Contact, friction, discrete mechanical structures and mathematical programming (CISM 388).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from attrito.library.laws import are_coulomb, cone_coefficients
from attrito.library.reduced_scene import ReducedScene, all_alike

# Contacts with one tangent up to which all combinations are asked, 4^n; beyond, each contact while the others stick,
# and up to the second number all of them slipping alike.
MOST_CONTACTS, MOST_ALIKE = 5, 200
STATES = {"stuck": 0, "slip+": 1, "slip-": -1, "open": 2}
# Part of the largest eigenvalue that is taken for rounding; beyond its inverse a condition number is taken for singular
ROUNDING = 1e-9


@dataclass(frozen=True)
class Margin:
    """How far friction may grow before the static problem loses its uniqueness.

    Parameters
    ----------
    factor : on all friction coefficients; infinite: no friction does it
    states : of the contacts where it happens
    complete : whether every combination of states was asked
    """

    factor: float
    states: tuple[str, ...]
    complete: bool

    @property
    def unique(self) -> bool | None:
        """Whether the static problem has one solution for given sliders; None if not all combinations were asked."""
        if self.factor <= 1.0:
            return False
        return True if self.complete else None


def friction_margin(scene: ReducedScene) -> Margin | None:
    """The margin of a scene; None without friction cones, or with two tangents, where slip has its own direction."""
    tangents = np.asarray(scene.laws["tangents"])
    if np.any(tangents != 1) or not are_coulomb(scene.laws):
        return None
    scene = all_alike(scene)
    kt, kn = (np.asarray(scene.laws[name], dtype=float) for name in ("tangential_stiffness", "normal_stiffness"))
    mu = cone_coefficients(scene.laws)
    springs = np.column_stack([kt, kn]).ravel()
    rows = scene.directions
    stuck = scene.stiffness + rows.T @ (springs[:, None] * rows)
    compliance = rows @ np.linalg.solve(stuck, rows.T)
    count = len(kt)
    complete = count <= MOST_CONTACTS
    best, where = np.inf, ()
    for states in product(STATES, repeat=count) if complete else _fewer(count):
        factor = _critical(compliance, kt, kn, mu, states)
        if factor < best:
            best, where = factor, states
    return Margin(best, where, complete)


def _fewer(count: int) -> Iterator[tuple[str, ...]]:
    """One contact slips while the others stick; all slip alike."""
    for i in range(count):
        for way in ("slip+", "slip-"):
            yield tuple(way if j == i else "stuck" for j in range(count))
    if count <= MOST_ALIKE:
        yield ("slip+",) * count
        yield ("slip-",) * count


def _critical(compliance: np.ndarray, kt: np.ndarray, kn: np.ndarray, mu: np.ndarray, states: tuple[str, ...]) -> float:
    """The least factor on friction at which this combination's determinant is zero."""
    moving = [i for i, state in enumerate(states) if state != "stuck"]
    fixed, grows = np.zeros((2, 2 * len(moving), 2 * len(moving)))
    for k, i in enumerate(moving):
        fixed[2 * k, 2 * k] = -kt[i]
        if states[i] == "open":
            fixed[2 * k + 1, 2 * k + 1] = -kn[i]
        else:
            grows[2 * k, 2 * k + 1] = STATES[states[i]] * mu[i] * kn[i]
    if not np.any(grows):
        return np.inf
    # Contacts that stick change nothing: their columns of G are zero.
    rows = [row for i in moving for row in (2 * i, 2 * i + 1)]
    compliance = compliance[np.ix_(rows, rows)]
    without = np.eye(len(rows)) + compliance @ fixed
    if np.linalg.cond(without) > 1.0 / ROUNDING:
        # Nothing but friction holds the body in this state: it gives way, and does not wedge.
        return np.inf
    values = np.linalg.eigvals(-np.linalg.solve(without, compliance @ grows))
    # Relative to 1 too: friction 1e9 times its size is none.
    rounding = ROUNDING * max(1.0, np.abs(values).max())
    real = values.real[(np.abs(values.imag) <= rounding) & (values.real > rounding)]
    return float(1.0 / real.max()) if len(real) else np.inf


def described_margin(margin: Margin | None) -> dict[str, tuple[np.ndarray, str]]:
    """Values and descriptions of the datasets below `/static` of a result; None: it was not examined."""
    return {
        "friction_margin": (
            np.array(np.nan if margin is None else margin.factor),
            "factor on all friction coefficients at which the static problem loses its uniqueness (wedging);"
            " NaN: not examined",
        ),
        "unique": (
            np.array(-1 if margin is None or margin.unique is None else int(margin.unique)),
            "1: one static solution for given sliders, 0: not for all loads, -1: not known",
        ),
    }


def warning(margin: Margin | None) -> str | None:
    """What a run says of a margin that is used up."""
    if margin is None or margin.unique is not False:
        return None
    moving = ", ".join(f"contact {i} {state}" for i, state in enumerate(margin.states) if state != "stuck")
    return (
        f"static solutions are not unique: friction wedges the structure at {margin.factor:.3g} times its coefficients"
        f" already ({moving[:200]}); which solution is found follows the load path"
    )
