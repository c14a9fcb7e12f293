"""The matrices of one model: on the same dofs, in one order, without those that are held.

Where dofs have names (node and direction), those that cannot move go out: rows with a diagonal of 1e30 or more (Abaqus
writes 1e36 for a held dof), rows with nothing but a unit diagonal in the stiffness and nothing in the mass (as some
programs write held dofs), and rows with nothing at all (the rotations at nodes of solids, in Nastran).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.source import Rows, Source
from attrito.support.errors import Fault, InputError

HELD_DIAGONAL = 1.0e30
# Rows that a file may declare however few its entries are, and beyond them for each entry: to be refused before
# memory is asked for.
MOST_ROWS, ROWS_AN_ENTRY = 1_000_000, 100


@dataclass
class Matrices:
    """Matrices by name `[n, n]`; node id and direction `[n]` of each dof where they have names; notes for the user."""

    matrices: dict[str, csr_matrix]
    node: np.ndarray | None
    direction: np.ndarray | None
    notes: list[str]


def assemble(
    sources: dict[str, Source], numbers: DofNumbers, dofs: tuple[np.ndarray, np.ndarray] | None = None, file: str = ""
) -> Matrices:
    """Put the matrices of a model on their dofs; the sources are used up.

    Parameters
    ----------
    sources : `stiffness`, `mass` and perhaps `damping`
    numbers : that the sources were read with
    dofs : node id and direction of each row, from a file beside the matrices
    file : that file
    """
    for name, source in sources.items():
        if source.entries is not None and (source.size or 0) > MOST_ROWS + ROWS_AN_ENTRY * source.entries.count:
            shown = f"{source.size} rows, {source.entries.count} entries"
            raise InputError(Fault(source.path, name, shown, "a size that the entries bear out"))
    named = [name for name, source in sources.items() if source.numbers is not None]
    if named and len(named) < len(sources):
        other = next(name for name in sources if name not in named)
        expected = f"dofs named by node and direction, as in the file of the {named[0]}, or numbered rows in both"
        raise InputError(Fault(sources[other].path, other, "numbered rows", expected))
    if named and dofs is not None:
        raise InputError(Fault(file, "dofs", "given", f"no such file: {sources[named[0]].path} names its dofs itself"))
    size = len(numbers) if named else _common_size(sources, None if dofs is None else len(dofs[0]))
    if not named and dofs is None:
        return Matrices({name: _numbered(source, size) for name, source in sources.items()}, None, None, [])
    if not named and any(_size(source, size) != (size, size) for source in sources.values()):
        # The check of the matrices names what does not fit.
        return Matrices({name: _numbered(source, size) for name, source in sources.items()}, *dofs, [])
    rows = {name: source.rows(size) for name, source in sources.items()}
    keep, notes = _movable(rows, bool(named))
    if named:
        renumber, node, direction = numbers.order(keep)
    elif keep.all():
        renumber, (node, direction) = None, dofs
    else:
        renumber = np.where(keep, np.cumsum(keep) - 1, -1).astype(np.int32)
        node, direction = dofs[0][keep], dofs[1][keep]
    _check_points(node, direction, file or next(iter(sources.values())).path)
    matrices = {name: source.assembled(len(node), renumber, (node, direction)) for name, source in sources.items()}
    return Matrices(matrices, node, direction, notes)


def _check_points(node: np.ndarray, direction: np.ndarray, file: str) -> None:
    """A point is scalar, a generalised coordinate, or one in space."""
    both = np.intersect1d(node[direction == 0], node[direction > 0])
    if len(both):
        value = f"point {both[0]} without a component and with one"
        raise InputError(Fault(file, "dofs", value, "components 1 to 6 of a grid point, none (0) of a scalar point"))


def _movable(rows: dict[str, Rows], named: bool) -> tuple[np.ndarray, list[str]]:
    """Which dofs stay, and notes on those that do not."""
    stiffness, mass = rows["stiffness"], rows["mass"]
    used = np.any([found.used for found in rows.values()], axis=0)
    held = stiffness.diagonal >= HELD_DIAGONAL
    alone = (stiffness.diagonal == 1.0) & ~mass.used & ~stiffness.coupled
    notes = []
    if held.any():
        notes.append(f"{np.count_nonzero(held)} dofs held by a diagonal of {HELD_DIAGONAL:g} or more: taken out")
    if alone.any():
        count = np.count_nonzero(alone)
        notes.append(f"{count} dofs held by a row with nothing but a unit diagonal: taken out")
    empty = np.count_nonzero(~used)
    if empty and not named:
        notes.append(f"{empty} dofs without stiffness and mass: taken out")
    return used & ~held & ~alone, notes


def _numbered(source: Source, size: int) -> csr_matrix:
    """A matrix on its own rows, or on those of the model where it does not say how many it has."""
    return source.assembled(_size(source, size)[0])


def _size(source: Source, size: int) -> tuple[int, int]:
    if source.matrix is not None:
        return source.matrix.shape
    return (size, size) if source.open_size and source.size <= size else (source.size, source.size)


def _common_size(sources: dict[str, Source], dofs: int | None) -> int | None:
    """Rows of the model: files that do not say how many they have take the number of the others."""
    said = [source.size if source.matrix is None else source.matrix.shape[0] for source in sources.values()]
    if dofs is not None:
        return dofs
    return max(said)
