"""Stability in result.h5: the Floquet multipliers of its points, and what their examinations say."""

from __future__ import annotations

import h5py
import numpy as np

from attrito.library.names import ENGINES, MULTIPLIER_KINDS
from attrito.support.hdf5_writing import described

# What a record of the journal has of its point's examination, below `stability/`: a number, NaN where there is none.
NUMBERS = {
    "distance": "of the event-exact orbit from the balance's, the largest over the period, part of its amplitude",
    "change": "what doubling the modes last changed of the multipliers by the monodromy",
    "low": "of an indeterminate point: its largest multiplier's modulus is at least that",
    "high": "and at most that",
}
COLUMNS = {
    "point": (np.int32, "number of the point, from 0", ()),
    "method": (np.int32, "engine: index into the attribute names", tuple(ENGINES)),
    "real": (float, "real part of the Floquet multiplier", ()),
    "imag": (float, "its imaginary part", ()),
    "kind": (
        np.int32,
        "index into the attribute names: dynamic; zero of a slider that a period forgets; one of a slider that stays",
        MULTIPLIER_KINDS,
    ),
}
# Of a sector of a wheel alone
WAVENUMBER = "Bloch wavenumber of the perturbation in the wheel, 0 to N - 1; -1: none, of sliders"


def write_stability(file: h5py.File, found: list[dict[str, np.ndarray]]) -> None:
    """Add multipliers, and why points have no verdict, to a result file that is open; nothing where none was examined.

    Parameters
    ----------
    file : open for writing
    found : of each point, arrays of its record below `stability/`: `multipliers` `[k, 5]` (engine, real part,
        imaginary part, kind, wavenumber), `reason` (bytes of a text), and `NUMBERS`
    """
    multipliers = [one.get("multipliers", np.empty((0, 5))) for one in found]
    reasons = [one["reason"].tobytes().decode() if "reason" in one else "" for one in found]
    points = np.repeat(np.arange(len(found)), [len(rows) for rows in multipliers])
    if not len(points) and not any(reasons):
        return
    rows = np.column_stack([points, np.concatenate(multipliers)])
    for column, (name, (kind, description, names)) in zip(rows.T, COLUMNS.items(), strict=False):
        described(file, f"multipliers/{name}", description, names=names, data=column.astype(kind))
    if np.any(rows[:, 5] >= 0):
        described(file, "multipliers/wavenumber", WAVENUMBER, data=rows[:, 5].astype(np.int32))
    largest = np.full(len(found), np.nan)
    decides = rows[:, 4] == MULTIPLIER_KINDS.index("floquet")
    np.fmax.at(largest, points[decides], np.hypot(rows[:, 2], rows[:, 3])[decides])
    described(file, "stability/largest_multiplier", "largest modulus of the point's dynamic multipliers", data=largest)
    for name, description in NUMBERS.items():
        values = [float(one.get(name, np.nan)) for one in found]
        described(file, f"stability/{name}", description, data=np.array(values))
    described(file, "stability/reason", "why the point has no verdict", data=reasons, dtype=h5py.string_dtype())
