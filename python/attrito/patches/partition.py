"""Which pairs are one patch: a number for each pair, `[nc]`, pairs of equal number being merged.

Only pairs of one contact set with the same law, friction coefficient and ratio of stiffnesses, all closed or all open
at the static solution, are ever merged.
"""

from __future__ import annotations

import numpy as np

from attrito.library.names import LAWS

# Pairs of a patch to begin with, at most: while nothing slips the size costs nothing
FIRST_SIZE = 64
# Largest angle between the normals of a patch: its cosine
ALIGNED = 0.95
# Part of the whole indicated error that the patches to be split make up
MARKED = 0.5


def kinds_of(laws: dict[str, np.ndarray], tables: np.ndarray, closed: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Pairs that may be merged have the same number, `[nc]`; one that may not has its own.

    Parameters
    ----------
    laws, tables : of the contacts, and the table of the job that each comes from
    closed : at the static solution, `[nc]`
    places : `[nc, 3]`, nan where a contact has none
    """
    count = len(tables)
    ratio = laws["tangential_stiffness"] / laws["normal_stiffness"]
    keys = [tables, closed, laws["tangents"], laws["friction_coefficient"], np.round(ratio, 9)]
    numbers = np.unique(np.column_stack([np.asarray(key, dtype=float) for key in keys]), axis=0, return_inverse=True)[1]
    alone = np.isnan(places).any(axis=1) | (laws["normal_stiffness"] <= 0.0)
    if "law" in laws:
        alone |= laws["law"] != LAWS.index("coulomb")
    numbers = numbers.reshape(-1).copy()
    numbers[alone] = count + np.arange(count)[alone]
    return numbered(numbers)


def first_partition(kinds: np.ndarray, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Compact patches of each kind, halved across their longest side until they are small and nearly plane."""
    parts: list[np.ndarray] = []
    for kind in np.unique(kinds):
        waiting = [np.flatnonzero(kinds == kind)]
        while waiting:
            pairs = waiting.pop()
            turned = (normals[pairs] @ normals[pairs].T).min(initial=1.0) < ALIGNED
            if len(pairs) > 1 and (len(pairs) > FIRST_SIZE or turned):
                waiting += halves(pairs, normals[pairs] if turned else places[pairs])
            else:
                parts.append(pairs)
    return of_parts(parts, len(kinds))


def halves(pairs: np.ndarray, features: np.ndarray) -> list[np.ndarray]:
    """Two parts of some pairs, across the direction `features` `[n, k]` spread most in."""
    centred = features - features.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(along, kind="stable")
    middle = len(pairs) // 2
    return [np.sort(pairs[order[:middle]]), np.sort(pairs[order[middle:]])]


def refined(partition: np.ndarray, indicated: np.ndarray, states: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Split the patches that make up most of the indicated error.

    Parameters
    ----------
    partition : `[nc]`
    indicated : of each pair, complex: what its force lacks, weighted, `[nc]`
    states : of each pair; a patch of pairs in different states is split between them
    places : `[nc, 3]`

    Returns
    -------
    the same partition where no patch of several pairs contributes
    """
    count = int(partition.max()) + 1
    size = np.bincount(partition, minlength=count)
    weight = np.bincount(partition, np.abs(indicated), minlength=count)
    weight[size == 1] = 0.0
    if weight.max(initial=0.0) <= 0.0:
        return partition
    order = np.argsort(-weight, kind="stable")
    needed = np.searchsorted(np.cumsum(weight[order]), MARKED * weight.sum()) + 1
    marked = set(order[:needed].tolist())
    parts: list[np.ndarray] = []
    for patch in range(count):
        pairs = np.flatnonzero(partition == patch)
        if patch not in marked or weight[patch] <= 0.0:
            parts.append(pairs)
            continue
        kinds = np.unique(states[pairs])
        if len(kinds) > 1:
            parts += [pairs[states[pairs] == kind] for kind in kinds]
        else:
            parts += halves(pairs, places[pairs])
    return of_parts(parts, len(partition))


def of_parts(parts: list[np.ndarray], count: int) -> np.ndarray:
    """The partition of parts, numbered by their first pairs."""
    partition = np.empty(count, dtype=np.int64)
    for number, pairs in enumerate(parts):
        partition[pairs] = number
    return numbered(partition)


def numbered(partition: np.ndarray) -> np.ndarray:
    """The same partition, its patches numbered in the order of their first pairs."""
    _, first, inverse = np.unique(partition, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    result: np.ndarray = rank[inverse.reshape(-1)]
    return result
