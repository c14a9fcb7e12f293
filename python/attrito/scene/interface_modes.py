"""Interface modes of a sector: a few shapes of its boundary in place of all the boundary's dofs.

    q_lower = W p_lower,    q_upper = W p_upper along the next sector's axes,    W^T W = 1    [k, r]

At each nodal diameter n = 0 ... N/2 a boundary moves as in the lowest modes with every contact stuck, and as under
static loads f on contacts and structure,

    (K~_n - omega^2 M_n) x = 0,    K~_n x = f_n,
    K~_n = S_n^H K S_n + B_n^H s B_n,    B_n = (B + exp(-2 pi i n / N) B_next) S_n

s being the structure's own stiffness at a row. W spans what these leave on the lower boundary, each with unit energy
x^H K~_n x, by its singular values. One W serves all nodal diameters, and so all engine orders and harmonics.

Castanier, Tan & Pierre 2001, AIAA Journal 39, 1182-1187 (characteristic constraint modes).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from attrito.library.reduced_scene import Sector

# Singular values that are left out, parts of the largest: at first, how much less where frequencies are off, at last
FIRST, SMALLER, LAST = 1e-5, 0.1, 1e-9
# Modes are taken up to so many times the highest frequency that matters, and so many more
BEYOND, MORE = 1.5, 2
# Where no frequency is known
COUNT = 10


@dataclass(frozen=True)
class Boundary:
    """A sector in dense coordinates, its upper boundary along the next sector's axes.

    Parameters
    ----------
    mass, stiffness : `[m, m]`
    rows : of contacts, on its own coordinates, `[rows, m]`
    loads : `[loads, m]`
    sector : its boundaries, and the contacts' rows on the next sector
    """

    mass: np.ndarray
    stiffness: np.ndarray
    rows: np.ndarray
    loads: np.ndarray
    sector: Sector


@dataclass(frozen=True)
class InterfaceModes:
    """W `[k, r]`, and the largest relative error that it leaves of natural frequencies up to the top one."""

    basis: np.ndarray
    error: float


def interface_modes(boundary: Boundary, count: int | None, top_hz: float, accepted: float) -> InterfaceModes:
    """W of a boundary.

    Parameters
    ----------
    count : modes of each nodal diameter; None: those up to 1.5 `top_hz` and two more, and as many shapes as it takes
        for frequencies up to `top_hz` to have the accepted error
    top_hz : highest frequency that matters; 0: not known
    accepted : relative error
    """
    traces, frequencies = [], []
    for one in _diameters(boundary):
        omega, columns = one.traces(count, 2.0 * np.pi * top_hz)
        frequencies.append(omega)
        traces += [columns.real, columns.imag]
    left, sizes, _ = np.linalg.svd(np.hstack(traces), full_matrices=False)
    part = FIRST
    while True:
        basis = np.ascontiguousarray(left[:, sizes > part * sizes[0]])
        error = max(
            one.error(basis, omega, 2.0 * np.pi * top_hz)
            for one, omega in zip(_diameters(boundary), frequencies, strict=True)
        )
        if count is not None or error <= accepted or part < LAST:
            return InterfaceModes(basis, error)
        part *= SMALLER


def _diameters(boundary: Boundary) -> Iterator[_Diameter]:
    """One after the other: each holds matrices as large as the sector's."""
    for number in range(boundary.sector.sectors // 2 + 1):
        yield _Diameter(boundary, number)


class _Diameter:
    """A sector at one nodal diameter: K~_n, M_n, and its loads in columns, of the coordinates that move there."""

    def __init__(self, boundary: Boundary, number: int):
        sector = boundary.sector
        turn = np.exp(-2j * np.pi * number / sector.sectors)
        shape = sector.expansion(len(boundary.mass), number)
        self._lower = shape[sector.lower].indices

        def coupled(matrix: np.ndarray) -> np.ndarray:
            found = shape.conj().T @ (matrix @ shape)
            return 0.5 * (found + found.conj().T)

        rows = (boundary.rows + turn * sector.next_directions) @ shape
        stiffness = coupled(boundary.stiffness)
        size = np.square(np.abs(rows))
        springs = (size @ np.diag(stiffness).real) / np.square(size.sum(axis=1)).clip(np.finfo(float).tiny)
        self.stiffness = stiffness + rows.conj().T @ (springs[:, None] * rows)
        self.mass = coupled(boundary.mass)
        self._loads = np.vstack([rows, boundary.loads @ shape]).conj().T

    def traces(self, count: int | None, top: float) -> tuple[np.ndarray, np.ndarray]:
        """Natural angular frequencies, and what modes and static motion leave on the lower boundary `[k, columns]`."""
        from scipy.linalg import cho_factor, cho_solve, eigh

        size = len(self.mass)
        if count is None and top > 0.0:
            squares, modes = eigh(self.stiffness, self.mass, subset_by_value=(-np.inf, (BEYOND * top) ** 2))
            if len(squares) < size:
                last = min(len(squares) + MORE, size) - 1
                squares, modes = eigh(self.stiffness, self.mass, subset_by_index=(0, last))
        else:
            last = min(COUNT if count is None else count, size) - 1
            squares, modes = eigh(self.stiffness, self.mass, subset_by_index=(0, last))
        static = cho_solve(cho_factor(self.stiffness), self._loads)
        columns = np.hstack([modes, static])
        energy = np.einsum("ij,ij->j", columns.conj(), self.stiffness @ columns).real
        moved = energy > 0.0
        return np.sqrt(squares.clip(0.0)), columns[self._lower][:, moved] / np.sqrt(energy[moved])

    def error(self, basis: np.ndarray, omega: np.ndarray, top: float) -> float:
        """The largest relative error of the natural frequencies up to the top one with W on the boundary."""
        from scipy.linalg import eigh

        omega = omega[omega <= top] if top > 0.0 else omega
        if not len(omega):
            return 0.0
        others = np.delete(np.arange(len(self.mass)), self._lower)

        def condensed(matrix: np.ndarray) -> np.ndarray:
            beside = matrix[np.ix_(others, self._lower)] @ basis
            own = basis.T @ matrix[np.ix_(self._lower, self._lower)] @ basis
            return np.block([[matrix[np.ix_(others, others)], beside], [beside.conj().T, own]])

        squares = eigh(
            condensed(self.stiffness), condensed(self.mass), eigvals_only=True, subset_by_index=(0, len(omega) - 1)
        )
        return float(np.max(np.sqrt(squares.clip(0.0)) / omega - 1.0))
