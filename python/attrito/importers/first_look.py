"""What shows a wrong unit or a wrong file at once: centre of gravity, extents, first natural frequencies.

The natural frequencies are those of the imported matrices, K x = omega^2 M x, without any contact: from the shift
sigma < 0 next to zero, at which K - sigma M can be factorised though the body floats. Those of rigid motions x are zero
but for rounding of K, a part of |x|^T |K| |x|, x^T M x = 1.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from attrito.model.model import Model

# Natural frequencies to show; dofs up to which they take seconds
SHOWN, MOST_DOFS = 3, 40000
# The shift as a part of tr K / tr M; what is nearer to zero than this part of the shift is a rigid-body mode
SHIFT, RIGID = 1e-9, 1e-6
# And what is nearer than this many times the most negative square of a frequency: rounding of the matrices left that
TIMES_ROUNDING = 4.0
# Part of |x|^T |K| |x| that assembly and a file of sixteen digits leave of x^T K x
DIGITS = 32.0 * float(np.finfo(float).eps)
MOST_RIGID = 6


def first_look(model: Model) -> list[str]:
    """Lines for the user."""
    return [*_extents(model), *_frequencies(model)]


def centre_of_gravity(model: Model) -> np.ndarray | None:
    """`[3]`, user length, of the mass of all free dofs along x, y, z; None without a mesh or where nothing weighs."""
    if not model.has_mesh:
        return None
    assert model.dof_node is not None and model.node_ids is not None and model.coordinates is not None
    weight = np.zeros(model.size)
    for direction in (1, 2, 3):
        along = model.dof_direction == direction
        weight[along] = (model.mass @ along.astype(float))[along]
    moves = np.flatnonzero(weight)
    total = weight.sum()
    if not total > 0.0:
        return None
    order = np.argsort(model.node_ids)
    rows = order[np.searchsorted(model.node_ids, model.dof_node[moves], sorter=order)]
    return weight[moves] @ model.coordinates[rows] / total


def natural_frequencies(model: Model, count: int) -> np.ndarray:
    """The lowest ones in Hz, ascending, of rigid-body modes 0.

    Raises
    ------
    RuntimeError : the shifted stiffness is singular, or the iteration finds fewer
    """
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    stiffness, mass = csc_matrix(model.stiffness), csc_matrix(model.mass)
    shift = -SHIFT * abs(stiffness.diagonal()).sum() / abs(mass.diagonal()).sum()
    factors = splu(stiffness - shift * mass, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    inverse = LinearOperator(stiffness.shape, factors.solve, dtype=float)
    start = np.random.default_rng(0).standard_normal(model.size)
    squares, shapes = eigsh(stiffness, count, mass, shift, v0=start, OPinv=inverse)
    order = np.argsort(squares)
    squares, shapes = squares[order], np.abs(shapes[:, order])
    least = max(RIGID * abs(shift), min(-TIMES_ROUNDING * squares[0], abs(shift)))
    rounding = np.maximum(least, DIGITS * np.einsum("im,im->m", shapes, abs(stiffness) @ shapes))
    return np.sqrt(np.where(squares <= rounding, 0.0, squares)) / (2.0 * np.pi)


def _extents(model: Model) -> list[str]:
    if model.coordinates is None or not len(model.coordinates):
        return []
    size = " x ".join(f"{length:.4g}" for length in np.ptp(model.coordinates, axis=0))
    centre = centre_of_gravity(model)
    if centre is None:
        return [f"extents along x, y, z: {size}"]
    # What lies on an axis of symmetry is zero but for rounding.
    centre[abs(centre) < RIGID * np.ptp(model.coordinates)] = 0.0
    return [f"extents along x, y, z: {size}; centre of gravity: {', '.join(f'{x:.4g}' for x in centre)}"]


def _frequencies(model: Model) -> list[str]:
    from scipy.sparse.linalg import ArpackError

    if model.size > MOST_DOFS:
        words = "natural frequencies: not computed here above {} dofs; `attrito linear-modes` gives them"
        return [words.format(MOST_DOFS)]
    if model.size < 2 * (SHOWN + MOST_RIGID):
        return []
    try:
        found = natural_frequencies(model, SHOWN + MOST_RIGID)
        # Several bodies that float
        while np.count_nonzero(found) < SHOWN and 4 * len(found) < model.size:
            found = natural_frequencies(model, 2 * len(found))
    except (ArpackError, RuntimeError) as error:
        return [f"natural frequencies: not found ({error})"]
    rigid, elastic = int(np.count_nonzero(found == 0.0)), found[found > 0.0]
    floats = f" and {rigid} rigid-body mode{'s' if rigid > 1 else ''}" if rigid else ""
    lines = [f"natural frequencies without contacts: {', '.join(f'{f:.5g}' for f in elastic[:SHOWN])} Hz{floats}"]
    if rigid:
        lines += [
            "  what floats has to be held by contacts; what floats with them, by `[model] suspension_hz` of the job"
        ]
    return lines
