"""Stresses at the nodes of a mesh from the motion of its nodes.

    epsilon = 1/2 (grad u + grad u^T),    sigma = lambda tr(epsilon) I + 2 mu epsilon

at the integration points of each element (`model/solid_shapes.py`), from there to its nodes, and averaged over the
elements of one material at a node. Linear in u, so each Fourier coefficient of the motion gives that of the stress.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.model import Model
from attrito.model.solid_shapes import KINDS, solid_shapes
from attrito.support.errors import Fault, InputError

# Components of a tensor, and their places in it
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
# What an element must have for its stress
EXPECTED = {
    "type": f"elements {', '.join(KINDS)}, whose strains are those of their nodes' motion",
    "motion": '[reduction] recovery = "all" in the job, or a list with the node sets, and the job run again',
    "elastic constants": "isotropic ones: *ELASTIC in the deck of attrito import --mesh, or --young and --poisson",
}
# Numbers of a block of elements that are held at once
_BLOCK = 5_000_000


@dataclass(frozen=True)
class NodalStress:
    """Fourier coefficients of the stress at nodes; of nodes between materials once for each.

    Parameters
    ----------
    node : rows of `Model.node_ids`, ascending, `[n]`
    elastic : Young's modulus and Poisson's ratio, `[n, 2]`
    harmonics : coefficients mean, cos 1, sin 1, ... of `COMPONENTS`, `[nk, n, 6]`, user force/length^2
    """

    node: np.ndarray
    elastic: np.ndarray
    harmonics: np.ndarray

    def strains(self) -> np.ndarray:
        """Coefficients of the strains, `[nk, n, 6]`."""
        return strain_of(self.harmonics, self.elastic)


def nodal_stress(model: Model, harmonics: np.ndarray, wanted: np.ndarray) -> NodalStress:
    """Stresses at some nodes.

    Parameters
    ----------
    model : with a mesh and the elastic constants of its elements
    harmonics : coefficients of the nodes' motion `[nk, N, 3]`; NaN: not known
    wanted : whether a node is, `[N]`; nodes without elements have no stress

    Raises
    ------
    InputError : an element at such a node lacks one of `EXPECTED`
    """
    nodes = np.flatnonzero(wanted)
    place = np.full(len(model.node_ids), -1)
    place[nodes] = np.arange(len(nodes))
    sums: dict[tuple[float, float], _Sum] = {}
    for name, rows, elastic in _elements(model):
        used = wanted[rows].any(axis=1)
        if not used.any():
            continue
        rows, elastic = rows[used], elastic[used]
        for what, lacking in _lacking(name, rows, elastic, harmonics).items():
            if lacking.any():
                value = f"{np.count_nonzero(lacking)} elements {name} at the chosen nodes"
                raise InputError(Fault("stress", what, value, EXPECTED[what]))
        for young, poisson in np.unique(elastic, axis=0).tolist():
            alike = rows[np.all(elastic == (young, poisson), axis=1)]
            total = sums.setdefault((young, poisson), _Sum(len(harmonics), len(nodes)))
            for block in np.array_split(alike, 1 + alike.size * 9 * len(harmonics) // _BLOCK):
                values = _element_stress(name, model.coordinates[block], harmonics[:, block], young, poisson)
                total.add(place[block].ravel(), values.reshape(len(harmonics), -1, 6))
    here = [np.flatnonzero(total.count) for total in sums.values()]
    row = np.concatenate([np.empty(0, dtype=int), *here])
    elastic = np.repeat(np.reshape(list(sums), (-1, 2)), [len(some) for some in here], axis=0)
    means = [total.mean(some) for total, some in zip(sums.values(), here, strict=True)]
    found = np.concatenate([np.empty((len(harmonics), 0, 6)), *means], axis=1)
    by_node = np.lexsort((*elastic.T[::-1], row))
    return NodalStress(nodes[row[by_node]], elastic[by_node], found[:, by_node])


def recoverable(model: Model, harmonics: np.ndarray) -> tuple[np.ndarray, dict[str, int]]:
    """Nodes all of whose elements have a stress, `[N]` bool, and why how many elements have none.

    Parameters are those of `nodal_stress`.
    """
    found = np.zeros(len(model.node_ids), dtype=bool)
    lost: list[np.ndarray] = []
    reasons: dict[str, int] = {}
    for name, rows, elastic in _elements(model):
        found[rows.ravel()] = True
        for what, lacking in _lacking(name, rows, elastic, harmonics).items():
            lost.append(rows[lacking].ravel())
            if lacking.any():
                reasons[what] = reasons.get(what, 0) + int(np.count_nonzero(lacking))
    for rows in lost:
        found[rows] = False
    return found, reasons


def _elements(model: Model) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Each type of elements: its name, rows of their nodes `[E, k]`, Young's modulus and Poisson's ratio `[E, 2]`."""
    order = np.argsort(model.node_ids)
    for name, (ids, connectivity) in model.elements.items():
        rows = order[np.searchsorted(model.node_ids, connectivity, sorter=order)]
        yield name, rows, model.elastic.get(name, np.full((len(ids), 2), np.nan))


def _lacking(name: str, rows: np.ndarray, elastic: np.ndarray, harmonics: np.ndarray) -> dict[str, np.ndarray]:
    """Which elements lack what of `EXPECTED`, `[E]` bool each."""
    unknown = np.isnan(harmonics[0]).any(axis=1)
    return {
        "type": np.full(len(rows), name not in KINDS),
        "motion": unknown[rows].any(axis=1),
        "elastic constants": np.isnan(elastic).any(axis=1),
    }


class _Sum:
    """Of values that elements of one material have at nodes."""

    def __init__(self, coefficients: int, nodes: int):
        self.total, self.count = np.zeros((coefficients, nodes, 6)), np.zeros(nodes)

    def add(self, place: np.ndarray, values: np.ndarray) -> None:
        """Values `[nk, n, 6]` of nodes at some places `[n]`, -1: not wanted."""
        kept = np.flatnonzero(place >= 0)
        nodes, to = np.unique(place[kept], return_inverse=True)
        gather = csr_matrix((np.ones(len(kept)), (to, kept)), shape=(len(nodes), len(place)))
        self.count[nodes] += np.diff(gather.indptr)
        for total, of_elements in zip(self.total, values, strict=True):
            total[nodes] += gather @ of_elements

    def mean(self, nodes: np.ndarray) -> np.ndarray:
        """At some nodes, `[nk, n, 6]`."""
        return np.asarray(self.total[:, nodes] / self.count[nodes, None])


def _element_stress(kind: str, places: np.ndarray, motion: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """Stresses at the nodes of elements, `[nk, E, nodes, 6]`.

    Parameters
    ----------
    places, motion : of their nodes, `[E, nodes, 3]` and `[nk, E, nodes, 3]`
    """
    shapes = solid_shapes(kind)
    jacobian = np.einsum("eix,pir->eprx", places, shapes.gradients)
    flat = np.count_nonzero((np.linalg.det(jacobian) <= 0.0).any(axis=1))
    if flat:
        expected = "elements with a positive volume at their integration points"
        raise InputError(Fault("stress", "elements", f"{flat} elements {kind} that are flat or inside out", expected))
    gradients = np.einsum("pir,epxr->epix", shapes.gradients, np.linalg.inv(jacobian), optimize=True)
    volume = shapes.weights * np.linalg.det(jacobian)
    if shapes.is_uniform:
        mean = np.einsum("ep,epix->eix", volume / volume.sum(axis=1, keepdims=True), gradients)
        gradients = np.broadcast_to(mean[:, None], gradients.shape)
    strain = _strain(motion, gradients)
    if shapes.incompatible.shape[1]:
        centre = np.einsum("eix,ir->erx", places, shapes.centre)
        own = np.einsum("pmr,exr->epmx", shapes.incompatible, np.linalg.inv(centre))
        own *= (np.linalg.det(centre)[:, None] / np.linalg.det(jacobian))[:, :, None, None]
        strain += _incompatible_strain(own, volume, strain, young, poisson)
    return np.einsum("ip,kepc->keic", shapes.to_nodes, hooke(strain, young, poisson), optimize=True)


def hooke(strain: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """Stresses of strains `[..., 6]`, of the tensor."""
    shear = young / (2.0 * (1.0 + poisson))
    lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    stress = 2.0 * shear * strain
    stress[..., :3] += lame * strain[..., :3].sum(axis=-1, keepdims=True)
    return np.asarray(stress)


def strain_of(stress: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """Strains of stresses `[..., n, 6]`; of shear the tensor's, half the engineer's.

    Parameters
    ----------
    elastic : Young's modulus and Poisson's ratio, `[n, 2]`
    """
    young, poisson = elastic.T[:, :, None]
    found = (1.0 + poisson) / young * stress
    found[..., :3] -= poisson / young * stress[..., :3].sum(axis=-1, keepdims=True)
    return np.asarray(found)


def _strain(motion: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Strains `[k, E, points, 6]` of motions `[k, E, nodes, 3]` by gradients `[E, points, nodes, 3]`."""
    by_place = np.einsum("keia,epib->kepab", motion, gradients, optimize=True)
    return np.stack([0.5 * (by_place[..., a, b] + by_place[..., b, a]) for a, b in _PLACES], axis=-1)


def _incompatible_strain(
    gradients: np.ndarray, volume: np.ndarray, strain: np.ndarray, young: float, poisson: float
) -> np.ndarray:
    """Strains of modes without nodes, which bear no force: int G^T D (B u + G a) dV = 0.

    Parameters
    ----------
    gradients : of the modes, `[E, points, modes, 3]`
    volume : of the points, `[E, points]`
    strain : that of the nodes' motion, B u, `[nk, E, points, 6]`

    Returns
    -------
    G a, as `strain`
    """
    elements, modes = len(gradients), gradients.shape[2]
    unit = np.eye(3 * modes).reshape(-1, 1, modes, 3)
    own = _strain(np.broadcast_to(unit, (3 * modes, elements, modes, 3)), gradients)
    # A shear strain of the tensor does its work twice.
    twice = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    dual = twice * hooke(own, young, poisson) * volume[None, :, :, None]
    stiffness = np.einsum("aepc,bepc->eab", dual, own, optimize=True)
    force = np.einsum("aepc,kepc->eak", dual, strain, optimize=True)
    amount = -np.linalg.solve(stiffness, force)
    return np.asarray(np.einsum("eak,aepc->kepc", amount, own, optimize=True))
