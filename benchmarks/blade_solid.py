"""A twisted blade on a thicker root, of ten-node tetrahedra, in any number of dofs: model.h5, and a deck for CalculiX.

    .venv/bin/python benchmarks/blade_solid.py out/blade_300k 300000 [--deck]

The mesh is a lattice of bricks bent into shape, each cut into six tetrahedra along the same diagonal, with straight
edges: nodes are the points of a lattice twice as fine, and integrals over an element are exact,

    K_e = V sum_g B_g^T D B_g / 4  (gradients are linear: four points),    M_e = rho V m (x) I,

m the mass of ten quadratic functions on a tetrahedron of unit volume. 200 nodes, 10 by 10 on each flank of the root,
are the node set `flanks`; `tip` is one corner of the tip.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from math import factorial
from pathlib import Path

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from attrito.model.model import Model
from attrito.model.model_file import write_model

YOUNG, POISSON, DENSITY = 1.15e11, 0.32, 4430.0  # titanium, SI
SPAN, CHORD, ROOT = 0.30, 0.08, 0.16  # length, width, and the share of the length that is root
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))  # of nodes 5 to 10, in CalculiX's order
ELEMENTS_AT_A_TIME = 20_000


@dataclass(frozen=True)
class Mesh:
    """Points `[n, 3]`, ten-node tetrahedra `[e, 10]` from 0, and the lattice `[2 a + 1, 2 b + 1, 2 c + 1]`."""

    points: np.ndarray
    elements: np.ndarray
    lattice: np.ndarray

    @property
    def flanks(self) -> np.ndarray:
        """10 by 10 nodes on each flank of the root, from 0, ascending."""
        spans = np.linspace(0.02, 0.98, 10) * ROOT * (len(self.lattice) - 1)
        chords = np.linspace(0.02, 0.98, 10) * (self.lattice.shape[1] - 1)
        rows, columns = (np.rint(place).astype(int) for place in (spans, chords))
        return np.unique(self.lattice[np.ix_(rows, columns, [0, -1])])


def blade_counts(dofs: int) -> tuple[int, int, int]:
    """Bricks along span, chord and thickness for about as many dofs."""
    thickness = max(2, round(5 * (dofs / 1e6) ** (1 / 3)))
    # Along the span some four times as many as along the chord.
    chord = max(9, round((np.sqrt(dofs / 3 / (2 * thickness + 1) / 4) - 1) / 2))
    span = round((dofs / 3 / (2 * thickness + 1) / (2 * chord + 1) - 1) / 2)
    return span, chord, thickness


def blade_mesh(span: int, chord: int, thickness: int) -> Mesh:
    """The blade of so many bricks each way."""
    counts = np.array([span, chord, thickness])
    shape = 2 * counts + 1
    lattice = np.arange(np.prod(shape)).reshape(shape)
    points = np.zeros((*shape, 3))
    corner = np.stack(np.meshgrid(*(np.linspace(0, 1, count + 1) for count in counts), indexing="ij"), axis=-1)
    points[::2, ::2, ::2] = _bend(corner)
    points = points.reshape(-1, 3)
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    elements = []
    for path in permutations(range(3)):
        corners = np.zeros((4, 3), dtype=int)
        for step, axis in enumerate(path):
            corners[step + 1 :, axis] += 1
        if np.linalg.det(corners[1:] - corners[0]) < 0:
            corners[[2, 3]] = corners[[3, 2]]
        # On the lattice twice as fine corners are even, and the middle of an edge is the mean of its ends.
        nodes = np.concatenate([2 * corners, [corners[a] + corners[b] for a, b in EDGES]])
        elements.append(lattice[tuple((2 * cells[:, None] + nodes).transpose(2, 0, 1))])
    joined = np.concatenate(elements)
    for place, (a, b) in enumerate(EDGES):
        points[joined[:, 4 + place]] = 0.5 * (points[joined[:, a]] + points[joined[:, b]])
    return Mesh(points, joined, lattice)


def _bend(place: np.ndarray) -> np.ndarray:
    """From the unit cube (span, chord, thickness) to the blade: a dovetail, then a tapered and twisted aerofoil."""
    z, chord, across = place[..., 0], place[..., 1] - 0.5, place[..., 2] - 0.5
    up = np.clip((z - ROOT) / (1 - ROOT), 0, 1)
    # The dovetail narrows from 36 mm at its foot to 12 at its neck, and blends into the aerofoil.
    root = 0.036 - 0.024 * np.clip(z / ROOT, 0, 1)
    profile = (0.010 - 0.006 * up) * (1.0 - 0.75 * (2 * chord) ** 2)
    blend = np.clip(6 * up, 0, 1)
    thick = root * (1 - blend) + profile * blend
    width = CHORD * (1 - 0.3 * up)
    x, y = width * chord, across * thick + 0.010 * up * (1 - (2 * chord) ** 2)
    angle = np.radians(40.0) * up
    return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), SPAN * z], axis=-1)


def assemble(mesh: Mesh) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness and mass, three dofs a node, one pattern."""
    count = len(mesh.points)
    keys = np.concatenate([_pairs(part, count) for part in _parts(mesh.elements)])
    pattern = np.unique(keys)
    del keys
    stiffness, mass = np.zeros((len(pattern), 3, 3)), np.zeros(len(pattern))
    for part in _parts(mesh.elements):
        places = np.searchsorted(pattern, _pairs(part, count))
        volume, blocks = _stiffness(mesh.points[part[:, :4]])
        weights = DENSITY * volume[:, None, None] * unit_mass()
        mass += np.bincount(places, weights.ravel(), len(pattern))
        for i in range(3):
            for j in range(3):
                stiffness[:, i, j] += np.bincount(places, blocks[:, :, i, :, j].ravel(), len(pattern))
    rows, columns = np.divmod(pattern, count)
    offsets = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))]).astype(np.int32)
    parts = [stiffness, mass[:, None, None] * np.eye(3)]
    columns = columns.astype(np.int32)
    return tuple(bsr_matrix((parts.pop(0), columns, offsets), shape=(3 * count,) * 2).tocsr() for _ in range(2))


def _parts(elements: np.ndarray) -> list[np.ndarray]:
    return np.array_split(elements, max(1, len(elements) // ELEMENTS_AT_A_TIME))


def _pairs(elements: np.ndarray, count: int) -> np.ndarray:
    return (elements[:, :, None].astype(np.int64) * count + elements[:, None, :]).ravel()


def _stiffness(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumes `[e]` and stiffness `[e, 10, 3, 10, 3]` of tetrahedra by their corners `[e, 4, 3]`."""
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.linalg.det(edges) / 6.0
    if np.any(volume <= 0.0):
        raise ValueError("an element is turned inside out")
    slopes = np.linalg.inv(edges).transpose(0, 2, 1)  # of barycentric coordinates 2 to 4
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    shear = YOUNG / (2 * (1 + POISSON))
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    near, far = 0.5854101966249685, 0.1381966011250105
    blocks = np.zeros((len(corners), 10, 3, 10, 3))
    for point in np.full((4, 4), far) + (near - far) * np.eye(4):
        vertex = (4 * point - 1)[:, None] * slopes
        middle = np.stack([4 * (point[a] * slopes[:, b] + point[b] * slopes[:, a]) for a, b in EDGES], axis=1)
        gradient = np.concatenate([vertex, middle], axis=1)
        outer = np.einsum("eai,ebj->eaibj", gradient, gradient, optimize=True) * (volume / 4)[:, None, None, None, None]
        blocks += lame * outer + shear * outer.transpose(0, 1, 4, 3, 2)
        trace = np.einsum("eaibi->eab", outer)
        for i in range(3):
            blocks[:, :, i, :, i] += shear * trace
    return volume, blocks


@cache
def unit_mass() -> np.ndarray:
    """Integrals of products of the ten functions over a tetrahedron of unit volume `[10, 10]`.

    The mean of L1^a L2^b L3^c L4^d is 6 a! b! c! d! / (a + b + c + d + 3)!.
    """
    terms: list[dict[tuple[int, ...], float]] = []
    unit = np.eye(4, dtype=int)
    for i in range(4):
        terms.append({tuple(2 * unit[i]): 2.0, tuple(unit[i]): -1.0})
    terms += [{tuple(unit[a] + unit[b]): 4.0} for a, b in EDGES]

    def mean(powers: np.ndarray) -> float:
        return 6.0 * np.prod([factorial(power) for power in powers]) / factorial(powers.sum() + 3)

    def product(a: dict, b: dict) -> float:
        return sum(x * y * mean(np.add(p, q)) for p, x in a.items() for q, y in b.items())

    return np.array([[product(a, b) for b in terms] for a in terms])


def blade_model(dofs: int) -> Model:
    """The blade in free space, with about as many dofs, node sets `flanks` and `tip`."""
    mesh = blade_mesh(*blade_counts(dofs))
    stiffness, mass = assemble(mesh)
    ids = np.arange(1, len(mesh.points) + 1)
    return Model(
        stiffness,
        mass,
        dof_node=np.repeat(ids, 3),
        dof_direction=np.tile([1, 2, 3], len(ids)),
        node_ids=ids,
        coordinates=mesh.points,
        elements={"C3D10": (np.arange(1, len(mesh.elements) + 1), mesh.elements + 1)},
        node_sets={"flanks": ids[mesh.flanks], "tip": ids[[mesh.lattice[-1, -1, 0]]]},
    )


def write_deck(path: Path, model: Model, modes: int) -> None:
    """A deck that asks CalculiX for the modes with the flanks held."""
    ids, connectivity = model.elements["C3D10"]
    with path.open("w") as deck:
        # CalculiX reads twenty characters of a number.
        deck.write("*NODE, NSET=ALL\n")
        np.savetxt(deck, np.column_stack([model.node_ids, model.coordinates]), fmt="%d, %.12g, %.12g, %.12g")
        deck.write("*ELEMENT, TYPE=C3D10, ELSET=BLADE\n")
        np.savetxt(deck, np.column_stack([ids, connectivity]), fmt="%d", delimiter=", ")
        deck.write("*NSET, NSET=FLANKS\n" + ",\n".join(map(str, model.node_sets["flanks"])) + "\n")
        deck.write(f"*MATERIAL, NAME=TITANIUM\n*ELASTIC\n{YOUNG}, {POISSON}\n*DENSITY\n{DENSITY}\n")
        deck.write("*SOLID SECTION, ELSET=BLADE, MATERIAL=TITANIUM\n*BOUNDARY\nFLANKS, 1, 3\n")
        deck.write(f"*STEP\n*FREQUENCY\n{modes}\n*END STEP\n")


def main() -> None:
    """Write what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("dofs", type=int)
    parser.add_argument("--deck", action="store_true", help="also blade.inp for CalculiX")
    parser.add_argument("--modes", type=int, default=100, help="that CalculiX is asked for")
    arguments = parser.parse_args()
    model = blade_model(arguments.dofs)
    print(f"{model.size} dofs, {model.stiffness.nnz} entries, {len(model.node_sets['flanks'])} nodes on the flanks")
    write_model(arguments.folder / "model.h5", model, [])
    if arguments.deck:
        write_deck(arguments.folder / "blade.inp", model, arguments.modes)


if __name__ == "__main__":
    main()
