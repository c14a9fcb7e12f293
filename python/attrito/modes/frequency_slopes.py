"""Derivatives of natural frequencies of a linear reference by parameters of a job.

With shapes of unit modal mass, of contacts that stick (`docs/how-to/modes.md`),

    d omega_r / dp = x_r^T K' x_r / (2 omega_r),    K' = B^T diag(s') B,

s' being what the parameter changes of the rows' springs. Frequencies that are repeated part as the parameter grows: by
the eigenvalues of x^T K' x over all their shapes, ascending.
"""

from __future__ import annotations

import numpy as np

from attrito.library.points import LinearModes

# Relative difference of frequencies that are taken for one: some digits above those that the modes are found to
REPEATED = 1e-7


def spring_rates(tangents: np.ndarray, laws: np.ndarray, state: str, closed: np.ndarray) -> np.ndarray:
    """What parameters change of the springs of a linear reference, `[parameters, rows]`.

    Parameters
    ----------
    tangents : of each contact `[nc]`; its rows are these, then the normal
    laws : what parameters change of contacts, `[parameters, nc, 5]` in the order of `LAW_KEYS`
    state : one of `REFERENCES`
    closed : which contacts touch at the static solution `[nc]`
    """
    owner = np.repeat(np.arange(len(tangents)), tangents + 1)
    is_normal = np.zeros(len(owner), dtype=bool)
    is_normal[np.cumsum(tangents + 1) - 1] = True
    along = laws[:, owner, 0] * (state != "frictionless")
    held = closed[owner] if state == "tangent" else np.ones(len(owner))
    rates: np.ndarray = np.where(is_normal, laws[:, owner, 1], along) * held
    return rates


def frequency_slopes(modes: LinearModes, directions: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Derivatives of natural frequencies, Hz by unit of the parameter, `[modes, parameters]`; NaN of rigid-body modes.

    Parameters
    ----------
    modes : all that there are
    directions : rows of B, `[rows, m]`
    rates : of the springs, `[parameters, rows]`
    """
    travel = modes.shapes @ directions.T
    squares = travel**2 @ rates.T
    for first, last in _repeated(modes.natural_hz):
        own = travel[first:last]
        for i, rate in enumerate(rates):
            squares[first:last, i] = np.linalg.eigvalsh((own * rate) @ own.T)
    slopes = np.full(squares.shape, np.nan)
    slopes[modes.rigid :] = squares[modes.rigid :] / (8.0 * np.pi**2 * modes.natural_hz[modes.rigid :, None])
    return slopes


def _repeated(natural_hz: np.ndarray) -> list[tuple[int, int]]:
    """First and one after the last of the modes of each frequency that is there more than once."""
    parts = np.flatnonzero(np.diff(natural_hz) > REPEATED * natural_hz[1:]) + 1
    ends = [0, *parts.tolist(), len(natural_hz)]
    return [(first, last) for first, last in zip(ends, ends[1:], strict=False) if last > first + 1]
