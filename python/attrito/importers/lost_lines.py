"""Lines lost of a matrix file, off its diagonal, that break what elements keep.

Elements resist no rigid translation, and their mass is the same along x, y and z:

    sum_j k_ij = 0 over the displacements j along any direction,    m_ax,bx = m_ay,by = m_az,bz.

Without a line k_ij the sums of the rows i and j, over the directions of j and of i, are both -k_ij. Equal springs to
the ground leave equal sums, too. They differ by a rotation about the row's own node, at x_i:

    sum_c k_ic (e x (x_c - x_i))_c = -k_ij (e x (x_j - x_i))_j    without the line,    0 with a spring at the node.

If x_j - x_i lies along the directions of both, both are 0, and nothing is decided. Rows next to supports have sums
of their own, and are left out. Of a mass that has entries along two directions between two nodes of an element, and
the same, but none along the third, a line is lost; between others fluids, or nodes that depend on others, may do that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.entries import row_blocks
from attrito.model.model import Model
from attrito.model.rigidity import lies_whole
from attrito.support.errors import Fault

# Part of the entries of a row that nine digits of a file leave of a sum.
DIGITS = 1e-7
# And how far beyond what half of the rows leave. The largest of 10^6 errors is 7.3 times the median; those of the 243
# entries of a row, quadratic bricks, add up to the root of their number or are one entry's alone.
BEYOND = 7.3 * 243**0.5
# Rows that are looked at: where more have sums, something else makes them
MOST_ROWS = 2000


def lost_lines(model: Model, where: dict[str, str], label: Callable[[int], str]) -> tuple[list[Fault], list[str]]:
    """Entries that files of a model's stiffness and mass must have lost, and a note on rows that may have.

    Parameters
    ----------
    model : with dofs by node and direction; the stiffness is looked at if there is a mesh, too
    where : the files, by `stiffness` and `mass`
    label : name of a dof for the user
    """
    if not model.names_dofs or model.stiffness_holds:
        return [], []
    of_stiffness, held = _of_stiffness(model)
    of_mass, doubtful = _of_mass(model)
    faults = [
        Fault(
            where[name],
            name,
            f"no entry of {label(lost[0][0])} and {label(lost[0][1])}" + (f", {len(lost)} such" if lost[1:] else ""),
            "the entry that others of both rows ask for: lines of the file are lost",
        )
        for name, lost in (("stiffness", of_stiffness), ("mass", of_mass))
        if lost
    ]
    notes = []
    if held:
        notes.append(
            f"rows of the stiffness, away from supports, that resist a rigid translation: {len(held)}, the first that"
            f" of {label(held[0])}; springs to the ground do, and if there are none, lines of the file are lost"
        )
    if doubtful:
        notes.append(
            f"pairs of nodes that share the same mass along two directions and none along the third: {len(doubtful)},"
            f" the first without an entry of {label(doubtful[0][0])} and {label(doubtful[0][1])}; fluids, supports and"
            " nodes that depend on others do that, and if there are none, lines of the file are lost"
        )
    return faults, notes


def _of_stiffness(model: Model) -> tuple[list[tuple[int, int]], list[int]]:
    """Pairs of dofs whose entry is lost, and rows away from supports with sums."""
    stiffness = model.stiffness
    assert stiffness is not None
    if not model.has_mesh or not model.elements:
        return [], []
    direction = np.where(model.translates, np.asarray(model.dof_direction, dtype=int), 0)
    sums = np.column_stack([stiffness @ (direction == d).astype(float) for d in (1, 2, 3)])
    size = np.zeros(model.size)
    for begin, end in row_blocks(stiffness):
        size[begin:end] = np.asarray(abs(stiffness[begin:end]).sum(axis=1)).ravel()
    left = np.abs(sums).max(axis=1) / np.where(size > 0.0, size, 1.0)
    moves = np.flatnonzero(direction > 0)
    some = moves[:: len(moves) // MOST_ROWS + 1]
    digits = _digits(left[some[_lie_whole(model, some)[0]]])
    rows = moves[left[moves] > digits]
    if not 0 < len(rows) <= MOST_ROWS:
        return [], []
    whole, beside = _lie_whole(model, rows)
    rows, beside = rows[whole], beside[whole][:, whole]
    one, other = beside.nonzero()
    one, other = one[one < other], other[one < other]
    i, j = rows[one], rows[other]
    mine, its = sums[i, direction[j] - 1], sums[j, direction[i] - 1]
    scale = digits * np.maximum(size[i], size[j])
    absent = np.asarray(stiffness[i, j]).ravel() == 0.0 if len(i) else np.zeros(0, bool)
    lost = absent & (np.abs(mine) > scale) & (np.abs(mine - its) <= scale)
    i, j, mine, its = i[lost], j[lost], mine[lost], its[lost]
    says, agrees = _turns(model, i, j, mine, digits)
    other_says, other_agrees = _turns(model, j, i, its, digits)
    lost = (says | other_says) & agrees & other_agrees
    return list(zip(i[lost].tolist(), j[lost].tolist(), strict=True)), rows.tolist()


def _lie_whole(model: Model, rows: np.ndarray) -> tuple[np.ndarray, csr_matrix]:
    """As `lies_whole`, by the entries of the stiffness: rows away from supports, and which share an element."""
    part = csr_matrix(model.stiffness[rows])
    row = np.repeat(np.arange(len(rows)), np.diff(part.indptr))
    placed = np.asarray(model.dof_direction)[part.indices] > 0
    return lies_whole(model, rows, row[placed], part.indices[placed])


def _turns(
    model: Model, i: np.ndarray, j: np.ndarray, sums: np.ndarray, digits: float
) -> tuple[np.ndarray, np.ndarray]:
    """Whether rotations about nodes of rows i distinguish a lost k_ij from a spring, and do not speak against it."""
    part = csr_matrix(model.stiffness[i])
    row, column = np.repeat(np.arange(len(i)), np.diff(part.indptr)), part.indices
    direction = np.asarray(model.dof_direction, dtype=int)
    # Generalised coordinates take no part in a rigid motion.
    spatial = direction[column] > 0
    row, column, value = row[spatial], column[spatial], part.data[spatial]

    def rotation(e: np.ndarray, center: np.ndarray, dofs: np.ndarray) -> np.ndarray:
        turn = np.cross(e, model.coordinates[model.rows_of(dofs)] - model.coordinates[model.rows_of(center)])
        axis = (direction[dofs] - 1) % 3
        return np.where(direction[dofs] < 4, turn[np.arange(len(dofs)), axis], e[axis])

    differs, lost, size = (np.zeros((3, len(i))) for _ in range(3))
    for k, e in enumerate(np.eye(3)):
        terms = value * rotation(e, i[row], column)
        lost[k] = sums * rotation(e, i, j)
        differs[k] = np.bincount(row, terms, len(i)) - lost[k]
        size[k] = np.bincount(row, np.abs(terms), len(i))
    scale = digits * size.max(axis=0)
    return np.abs(lost).max(axis=0) > scale, np.abs(differs).max(axis=0) <= scale


def _digits(left: np.ndarray) -> float:
    """Part of a row's entries that may be rounding of the file, by what rows leave of their sums."""
    return max(DIGITS, BEYOND * float(np.median(left))) if len(left) else DIGITS


def _of_mass(model: Model) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Pairs of dofs whose entry is lost, and those for whose lack there may be another reason."""
    mass = model.mass
    assert mass is not None
    order = [np.flatnonzero(np.asarray(model.dof_direction) == d) for d in (1, 2, 3)]
    nodes = np.intersect1d(np.intersect1d(*(model.dof_node[own] for own in order[:2])), model.dof_node[order[2]])
    dofs = [own[np.isin(model.dof_node[own], nodes)] for own in order]
    dofs = [own[np.argsort(model.dof_node[own])] for own in dofs]
    probe = np.random.default_rng(0).uniform(1.0, 2.0, len(nodes))
    along = []
    for own in dofs:
        motion = np.zeros(model.size)
        motion[own] = probe
        along.append((mass @ motion)[own])
    left = np.ptp(along, axis=0) / np.maximum(np.max(np.abs(along), axis=0), np.finfo(float).tiny)
    digits = _digits(left)
    rows = np.flatnonzero(left > digits)
    if not 1 < len(rows) <= MOST_ROWS:
        return [], []
    certain = np.zeros((len(rows), len(rows)), dtype=bool)
    if model.has_mesh and model.elements:
        entries = mass[dofs[0][rows]].tocoo()
        placed = np.asarray(model.dof_direction)[entries.col] > 0
        whole, beside = lies_whole(model, dofs[0][rows], entries.row[placed], entries.col[placed])
        certain = (beside.toarray() > 0.0) & whole & whole[:, None]
    parts = np.array([mass[own[rows]][:, own[rows]].toarray() for own in dofs])
    found: tuple[list[tuple[int, int]], list[tuple[int, int]]] = [], []
    for k, own in enumerate(dofs):
        a, b = (parts[m] for m in range(3) if m != k)
        lost = (parts[k] == 0.0) & (a != 0.0) & (np.abs(a - b) <= digits * np.abs(a))
        for i, j in np.argwhere(np.triu(lost, 1)):
            found[0 if certain[i, j] else 1].append((int(own[rows[i]]), int(own[rows[j]])))
    return found
