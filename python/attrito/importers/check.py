"""Faults of a set of matrices, all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.entries import CHUNK, SYMMETRY_TOLERANCE, looks_symmetric, row_blocks
from attrito.support.errors import Fault


def check_matrices(
    stiffness: csr_matrix,
    mass: csr_matrix,
    damping: csr_matrix | None,
    where: str | Mapping[str, str],
    label: Callable[[int], str] = "dof {}".format,
    without_mass: str = "",
) -> list[Fault]:
    """Every fault of the matrices of a model; none if they can be used.

    Parameters
    ----------
    stiffness, mass, damping : `[n, n]`, both triangles
    where : the file they come from, or one for each of `stiffness`, `mass`, `damping`
    label : name of a dof (from 0) for the user, such as its node
    without_mass : what to expect where a dof has no mass; "": such dofs follow the others statically
    """
    matrices = {"stiffness": stiffness, "mass": mass, "damping": damping}
    faults: list[Fault] = []
    for name, matrix in matrices.items():
        if matrix is None:
            continue
        file = where if isinstance(where, str) else where[name]
        if matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
            faults.append(Fault(file, name, _size(matrix), "a square matrix"))
            continue
        if matrix.shape != stiffness.shape and stiffness.shape[0] == stiffness.shape[1]:
            faults.append(Fault(file, name, _size(matrix), f"the size of the stiffness, {_size(stiffness)}"))
        contents = _not_finite(name, matrix, file, label)
        faults += contents or _contents(name, matrix, file, label)
    return faults or _massless(matrices, where, label, without_mass)


def lost_diagonals(stiffness: csr_matrix, file: str, label: Callable[[int], str]) -> list[Fault]:
    """Dofs of a structure's stiffness from a file that are coupled, with nothing on the diagonal.

    Of a positive matrix k_ij^2 <= k_ii k_jj. A file that has lost lines has others; couplings between bodies that
    nothing holds are rounding. A stiffness that holds stresses or rotation need not be positive.
    """
    diagonal = stiffness.diagonal()
    bare = np.flatnonzero(diagonal == 0.0)
    coupled = np.ravel(abs(stiffness[bare]).max(axis=1).toarray()) if len(bare) else np.empty(0)
    lost = bare[coupled > SYMMETRY_TOLERANCE * np.abs(diagonal).max()]
    if len(lost) == 0:
        return []
    expected = "a diagonal in every row with entries: have lines of the file been lost?"
    return [Fault(file, "stiffness", f"0 on the diagonal at {label(int(lost[0]))}" + _others(len(lost)), expected)]


def massless(mass: csr_matrix) -> np.ndarray:
    """Numbers of the dofs (from 0) in whose row of the mass there is nothing but zeros."""
    sums = np.zeros(mass.shape[0])
    for begin, end in row_blocks(mass):
        sums[begin:end] = np.asarray(abs(mass[begin:end]).sum(axis=1)).ravel()
    return np.flatnonzero(sums == 0.0)


def _massless(
    matrices: dict[str, csr_matrix | None],
    where: str | Mapping[str, str],
    label: Callable[[int], str],
    without_mass: str,
) -> list[Fault]:
    """Dofs without mass where there must be none, or that the others do not carry: by stiffness, without damping."""
    mass, stiffness, damping = (matrices[name] for name in ("mass", "stiffness", "damping"))
    assert mass is not None and stiffness is not None
    bare = massless(mass)

    def fault(name: str, what: str, dofs: np.ndarray, expected: str) -> list[Fault]:
        if len(dofs) == 0:
            return []
        file = where if isinstance(where, str) else where[name]
        return [Fault(file, name, f"{what} at {label(int(dofs[0]))}" + _others(len(dofs)), expected)]

    if len(bare) == mass.shape[0]:
        return fault("mass", "no mass", bare, "mass at some dof")
    if without_mass:
        return fault("mass", "no mass", bare, without_mass)
    expected = "stiffness where no mass is (a Lagrange multiplier has none: remove what makes it)"
    faults = fault("stiffness", "no stiffness", bare[stiffness.diagonal()[bare] <= 0.0], expected)
    if damping is not None:
        damped = bare[np.asarray(abs(damping[bare]).sum(axis=1)).ravel() > 0.0]
        faults += fault("damping", "damping", damped, "no damping where no mass is")
    return faults


def _contents(name: str, matrix: csr_matrix, file: str, label: Callable[[int], str]) -> list[Fault]:
    faults = _unsymmetric(name, matrix, file, label)
    if name == "mass":
        faults += _not_positive(matrix, file, label)
    return faults


def _not_finite(name: str, matrix: csr_matrix, file: str, label: Callable[[int], str]) -> list[Fault]:
    bad = np.concatenate([k.start + np.flatnonzero(~np.isfinite(matrix.data[k])) for k in _parts(matrix)] or [[]])
    if len(bad) == 0:
        return []
    bad = bad.astype(int)
    row, column = _place(matrix, bad[0])
    value = f"{matrix.data[bad[0]]} at {_entry(row, column, label)}" + _others(len(bad))
    return [Fault(file, name, value, "finite numbers")]


def _unsymmetric(name: str, matrix: csr_matrix, file: str, label: Callable[[int], str]) -> list[Fault]:
    if looks_symmetric(matrix):
        return []
    difference = (matrix - matrix.T).tocsr()
    if difference.nnz == 0:
        return []
    worst = int(np.argmax(np.abs(difference.data)))
    if abs(difference.data[worst]) <= SYMMETRY_TOLERANCE * abs(matrix).max():
        return []
    row, column = _place(difference, worst)
    value = f"{matrix[row, column]:.17g} against {matrix[column, row]:.17g} at {_entry(row, column, label)}"
    return [Fault(file, name, value, f"a symmetric matrix (to {SYMMETRY_TOLERANCE:g} of its largest entry)")]


def _not_positive(mass: csr_matrix, file: str, label: Callable[[int], str]) -> list[Fault]:
    """Necessary conditions that cost nothing: no diagonal below zero, and every 2 x 2 minor at least zero."""
    faults: list[Fault] = []
    diagonal = mass.diagonal()
    negative = np.flatnonzero(diagonal < 0.0)
    if len(negative) > 0:
        first = int(negative[0])
        value = f"{diagonal[first]:.6g} at {label(first)}" + _others(len(negative))
        return [Fault(file, "mass", value, "a diagonal above zero")]
    found, count = None, 0
    for begin, end in row_blocks(mass):
        part = slice(mass.indptr[begin], mass.indptr[end])
        rows = np.repeat(np.arange(begin, end), np.diff(mass.indptr[begin : end + 1]))
        bound = np.sqrt(diagonal[rows] * diagonal[mass.indices[part]])
        large = np.flatnonzero(np.abs(mass.data[part]) > bound * (1.0 + SYMMETRY_TOLERANCE))
        count += len(large)
        if found is None and len(large) > 0:
            found = (int(part.start + large[0]), float(bound[large[0]]))
    if found is not None:
        row, column = _place(mass, found[0])
        value = f"{mass.data[found[0]]:.6g} at {_entry(row, column, label)}" + _others(count)
        expected = f"at most {found[1]:.6g}, the geometric mean of the diagonal entries (a positive matrix)"
        faults.append(Fault(file, "mass", value, expected))
    return faults


def _parts(matrix: csr_matrix) -> list[slice]:
    """Entries in parts, so that what is made of them stays small."""
    return [slice(k, k + CHUNK) for k in range(0, matrix.nnz, CHUNK)]


def _place(matrix: csr_matrix, entry: int) -> tuple[int, int]:
    return int(np.searchsorted(matrix.indptr, entry, side="right") - 1), int(matrix.indices[entry])


def _entry(row: int, column: int, label: Callable[[int], str]) -> str:
    return f"row {row}, column {column} ({label(row)}, {label(column)})"


def _others(count: int) -> str:
    return f" and {count - 1} more" if count > 1 else ""


def _size(matrix: csr_matrix) -> str:
    return f"{matrix.shape[0]} x {matrix.shape[1]}"
