"""A job on its full model: contacts as rows on dofs, loads and monitors as vectors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.model import Model


@dataclass
class Contacts:
    """Contacts on the full model: laws `[nc]`, rows of B `[rows, n]` (each contact's tangents before its normal).

    `places` holds what is known of where they are: `set`, `node_a`, `node_b`, `area`, `position`, `frame`, `clearance`.
    `tables`: which of the job's [[contact]] and [[contact_set]], in this order, each comes from. `gaps`: what files add
    to the gap of each, `[nc]`, user length. `next_rows`: rows of B on the next sector's dofs, `[rows, n]`; None where
    there is no next one.
    """

    laws: dict[str, np.ndarray]
    rows: csr_matrix
    places: dict[str, np.ndarray]
    tables: np.ndarray
    gaps: np.ndarray
    notes: list[str] = field(default_factory=list)
    next_rows: csr_matrix | None = None

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.laws["tangents"])


@dataclass(frozen=True)
class CyclicSector:
    """One of N equal sectors of a wheel on its full model; what its contacts touch of the next one is theirs.

    Parameters
    ----------
    sectors, engine_order : N and EO
    lower, upper : dofs of the boundaries, paired `[k]`
    axes : A `[n, n]`, q = A p: p_upper, in the next sector's axes, is p_lower of the next sector; None where dofs are
        in such axes as they stand
    along, across : dofs of nodes on the axis, `[a]` and `[c, 2]`; in p along it, and in pairs across it, the second a
        quarter turn ahead of the first
    apart : how far at most a node of the upper boundary is from its partner's image, user length
    """

    sectors: int
    engine_order: int
    lower: np.ndarray
    upper: np.ndarray
    axes: csr_matrix | None = None
    along: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    across: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    apart: float = 0.0


@dataclass
class Scene:
    """A job on its full model.

    Parameters
    ----------
    model : its stiffness less what rotation takes, where the job asks for that
    static : vectors of the static loads by name, each `[n]`, user force
    harmonic : coefficients of the harmonic load at level 1, `[2 h + 1, n]`, rows mean (zero), cosine 1, sine 1, ...
    monitors : vectors by name, each `[n]`
    load_path : factors on the static loads at the corners, `[corners, loads]`
    boundary : dofs that a reduction keeps, ascending
    recovered : other dofs whose motion a reduced model is to give back, ascending; None: of all
    sector : what makes the model one of N sectors; None: it is whole
    altered : whether the stiffness is another than that of the model's file
    spin : speed of rotation of the Coriolis forces, rad/s, the model's `gyroscopic` being of one unit; None: there are
        no such forces
    """

    model: Model
    contacts: Contacts
    static: dict[str, np.ndarray]
    harmonic: np.ndarray
    monitors: dict[str, np.ndarray]
    load_path: np.ndarray
    boundary: np.ndarray
    recovered: np.ndarray | None = None
    sector: CyclicSector | None = None
    altered: bool = False
    spin: float | None = None
