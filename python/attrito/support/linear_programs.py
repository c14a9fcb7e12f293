"""Families of linear programs, max c x with A x <= b, where only b changes from one to the next.

A basis that solved one of them stays dual feasible for all: the dual simplex method takes it up again and mostly needs
no pivot, or a few. Dense, for some hundred unknowns. `scipy.optimize.linprog` is the oracle in the tests.
"""

from __future__ import annotations

import numpy as np

BOX = 1e5
TOLERANCE = 1e-11
# Part of the largest |b| that rounding may leave of the rows that hold a maximum; beyond, the basis is inverted again
DRIFT = 1e-8
PIVOT = 1e-9
SLACK = 1e-12
REFRESH = 50
# Pivots per unknown after which a program is taken to go round in circles
PATIENCE = 4
GUESSES = 4


class DualSimplex:
    """max c x subject to A x <= b, for one c and one b after another.

    Every unknown is also held within `BOX` times the largest |b|. A maximum that leans on that box is infinite.

    Parameters
    ----------
    a : rows of A, `[m, n]`, entries of order one
    c : `[n]`, entries of order one

    Attributes
    ----------
    pivots : made so far, of all maxima
    """

    def __init__(self, a: np.ndarray, c: np.ndarray):
        n = len(c)
        self._rows = np.vstack([a, np.eye(n), -np.eye(n)])
        self._c, self._own = c, len(a)
        self._basis = self._begin(n)
        self.pivots = 0
        self._invert()

    def maximum(self, b: np.ndarray) -> float:
        """The maximum for one `b`, `[m]`; infinite if unbounded, NaN if no x fulfils A x <= b or it was not found."""
        try:
            return self._maximum(b)
        except np.linalg.LinAlgError:
            self._basis = self._box(len(self._c))
            self._invert()
            return np.nan

    def maximizer(self, b: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Where the maximum is, `[n]`, and the rows of A that hold it there; None if none was found."""
        try:
            x = self._solve(b)
        except np.linalg.LinAlgError:
            x = None
        return None if x is None else (x, self._basis[self._holds()])

    def add(self, a: np.ndarray) -> None:
        """Further rows of A, `[k, n]`, after those there are; the next maximum starts where the last one was."""
        self._rows = np.insert(self._rows, self._own, a, axis=0)
        self._basis[self._basis >= self._own] += len(a)
        self._own += len(a)

    def _maximum(self, b: np.ndarray) -> float:
        x = self._solve(b)
        if x is None:
            return np.nan
        return np.inf if (self._basis[self._holds()] >= self._own).any() else float(self._c @ x)

    def _holds(self) -> np.ndarray:
        """Which rows of the basis the maximum leans on."""
        return self._c @ self._inverse > TOLERANCE * np.abs(self._c).max()

    def _solve(self, b: np.ndarray) -> np.ndarray | None:
        largest = max(float(np.abs(b).max(initial=0.0)), np.finfo(float).tiny)
        limit = np.concatenate([b, np.full(2 * len(self._c), BOX * largest)])
        fresh = False
        for step in range(20 * len(limit)):
            x = self._inverse @ limit[self._basis]
            excess = self._rows @ x - limit
            circles = step > PATIENCE * len(self._c)
            accepted = TOLERANCE * max(largest, float(np.abs(x).max()))
            entering = int((excess > accepted).argmax() if circles else excess.argmax())
            if excess[entering] <= accepted:
                if fresh or np.abs(excess[self._basis]).max() <= DRIFT * largest:
                    return x
                self._invert()
                fresh = True
            elif self._pivot(entering, circles):
                fresh = False
            else:
                break
        return None

    def _begin(self, n: int) -> np.ndarray:
        """A dual feasible basis: one row of each pair (i, n + i) of A, if a few changes of side make it one."""
        sides = np.zeros(n, dtype=int)
        for _ in range(GUESSES if self._own >= 2 * n else 0):
            basis = np.arange(n) + n * sides
            try:
                inverse = np.linalg.inv(self._rows[basis])
            except np.linalg.LinAlgError:
                break
            if np.abs(inverse).max() > 1.0 / PIVOT:
                break
            multipliers = self._c @ inverse
            if multipliers.min() >= -SLACK:
                return basis
            sides ^= multipliers < 0.0
        return self._box(n)

    def _box(self, n: int) -> np.ndarray:
        """The sides of the box that c points at: dual feasible whatever A is."""
        return self._own + np.arange(n) + np.where(self._c >= 0.0, 0, n)

    def _pivot(self, entering: int, circles: bool) -> bool:
        """Take a row into the basis for the one that keeps the multipliers from turning negative; False if none can.

        Where multipliers are zero none may be left to choose by; `circles`: the least numbers enter and leave, which
        never come round (Bland 1977, doi:10.1287/moor.2.2.103).
        """
        part = self._rows[entering] @ self._inverse
        able = part > PIVOT
        if not able.any():
            return False
        # Two passes (Harris 1973): how far with a little slack on the multipliers, then the largest pivot up to there.
        multipliers = np.maximum(self._c @ self._inverse, 0.0)
        farthest = ((multipliers[able] + SLACK) / part[able]).min()
        candidates = able & (multipliers <= farthest * part)
        leaving = np.where(candidates, -self._basis if circles else part, -np.inf).argmax()
        self._basis[leaving] = entering
        self.pivots += 1
        if self.pivots % REFRESH == 0:
            self._invert()
        else:
            column = self._inverse[:, leaving] / part[leaving]
            part[leaving] = 0.0
            self._inverse -= np.outer(column, part)
            self._inverse[:, leaving] = column
        return True

    def _invert(self) -> None:
        self._inverse = np.linalg.inv(self._rows[self._basis])
