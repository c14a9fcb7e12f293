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
    to the gap of each, `[nc]`, user length.
    """

    laws: dict[str, np.ndarray]
    rows: csr_matrix
    places: dict[str, np.ndarray]
    tables: np.ndarray
    gaps: np.ndarray
    notes: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.laws["tangents"])


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
    """

    model: Model
    contacts: Contacts
    static: dict[str, np.ndarray]
    harmonic: np.ndarray
    monitors: dict[str, np.ndarray]
    load_path: np.ndarray
    boundary: np.ndarray
    recovered: np.ndarray | None = None
