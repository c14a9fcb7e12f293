"""What a reader makes of one matrix in a file, before the model's dofs are known and in order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.entries import Entries
from attrito.importers.text import Block
from attrito.support.errors import Fault, InputError

# What to expect of a matrix that is no stiffness, mass or damping for what it is.
USABLE = {
    "rectangular": "a square matrix",
    "complex": "type 1 or 2, a real matrix",
    "triangular factor": "a matrix, not a factor of one (forms 4 and 5)",
}


@dataclass(frozen=True)
class Rows:
    """Rows of a matrix, by number: diagonal `[n]`, and which have entries at all, and entries off the diagonal."""

    diagonal: np.ndarray
    used: np.ndarray
    coupled: np.ndarray


@dataclass
class Source:
    """One matrix as its file holds it.

    Parameters
    ----------
    path, key : where it was read, for faults
    matrix : `[n, n]`, where the file's rows are the model's, or
    entries : by rows and columns
    size : number of rows; None where dofs are named by node and direction
    open_size : the file does not say its size: rows beyond the last entry are empty
    storage : `"full"`, both triangles; `"symmetric"`, one of them; `"either"`, the file does not say
    repeated : `"refuse"` an entry that occurs again, or `"sum"`
    numbers : of the dofs, where they are named by node and direction
    """

    path: str
    key: str
    matrix: csr_matrix | None = None
    entries: Entries | None = None
    size: int | None = None
    open_size: bool = False
    storage: str = "full"
    repeated: str = "refuse"
    numbers: DofNumbers | None = None

    def rows(self, size: int) -> Rows:
        """What its rows hold."""
        if self.entries is not None:
            return Rows(self.entries.diagonal(size), self.entries.used(size), self.entries.coupled(size))
        count = np.diff(self.matrix.indptr)
        diagonal = self.matrix.diagonal()
        return Rows(diagonal, count > 0, count > (diagonal != 0.0))

    def assembled(
        self,
        size: int | None = None,
        renumber: np.ndarray | None = None,
        names: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> csr_matrix:
        """The matrix, both triangles; the entries are used up.

        Parameters
        ----------
        size, renumber : where the rows go: how many they become, and the new number of each (below zero: left out)
        names : node and direction of each row, for faults
        """
        if self.entries is None:
            return self.matrix if renumber is None else self.matrix[renumber >= 0][:, renumber >= 0]
        self.entries.names = names
        size = self.size if size is None else size
        if self.storage == "either":
            return self.entries.either(size, renumber)
        if self.storage == "symmetric":
            return self.entries.symmetric(size, self.repeated, renumber)
        return self.entries.full(size, self.repeated, renumber)


def integers(block: Block, lines: np.ndarray, values: np.ndarray, bounds: tuple[int, int], expected: str) -> np.ndarray:
    """Whole numbers within bounds, int64, out of a column of a table; the fault quotes the first line at fault."""
    with np.errstate(invalid="ignore"):
        whole = values.astype(np.int64)
    # An empty field, NaN, equals nothing.
    if len(whole) and (not np.array_equal(whole, values) or whole.min() < bounds[0] or whole.max() > bounds[1]):
        good = (values >= bounds[0]) & (values <= bounds[1]) & (values == np.floor(values))
        raise block.fault(lines[int(np.argmin(good))], expected)
    return whole


def refuse(path: str, key: str, value: object, expected: str) -> InputError:
    """An error to raise for one fault."""
    return InputError(Fault(path, key, value, expected))


def no_such_matrix(path: str, key: str, name: str | None, found: str) -> InputError:
    """Which names there are, where one that is not there, or none, was given."""
    value = "no name" if name is None else name
    found = "".join(letter if letter.isprintable() else "?" for letter in found)
    return refuse(path, key, value, f"one matrix of the file, named after it and a colon, FILE:NAME; it holds: {found}")
