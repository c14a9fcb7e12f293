"""Scenes of any size, made on the fly: steel blocks on friction contacts to ground, and the force levels that matter.

`plane_block` stands on one-tangent contacts along its lower edge, `hexahedral_block` on two-tangent contacts under its
lower face. Both are pressed from above and shaken along their upper side. `slip_thresholds` tells the force level up to
which each contact sticks, so that levels can be told relative to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from attrito.library.reduced_scene import ReducedScene

YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0
FRICTION = 0.3
# Rows of elements over the height of the plane block; beyond, they are flat rather than square.
MOST_ROWS = 25


@dataclass(frozen=True)
class Grid:
    """A box of equal elements: numbers of its nodes `[nx, (ny,) nz]`, where they are `[n, d]`, stiffness and mass."""

    number: np.ndarray
    points: np.ndarray
    stiffness: csc_matrix
    mass: csc_matrix

    def dofs(self, nodes: np.ndarray, axis: int) -> np.ndarray:
        """Dofs of nodes along an axis."""
        return self.points.shape[1] * np.asarray(nodes).ravel() + axis


def element(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass of a bilinear (plane stress) or trilinear element, by two Gauss points an axis.

    A row per node and axis; nodes come in the order of `product((0, 1), repeat=d)`.
    """
    d = len(edges)
    signs = np.array(list(product((-1.0, 1.0), repeat=d)))
    law = elasticity(d)
    stiffness, mass = np.zeros((2, d * 2**d, d * 2**d))
    for point in signs / np.sqrt(3.0):
        factors = 0.5 * (1.0 + signs * point)
        shape = factors.prod(axis=1)
        gradient = np.array([signs[:, i] / edges[i] * np.delete(factors, i, axis=1).prod(axis=1) for i in range(d)])
        strain = strains(gradient)
        stiffness += np.prod(edges) / 2**d * strain.T @ law @ strain
        mass += np.prod(edges) / 2**d * DENSITY * np.kron(np.outer(shape, shape), np.eye(d))
    return stiffness, mass


def elasticity(d: int) -> np.ndarray:
    """Hooke's law: plane stress, or in three dimensions; engineering shear strains last."""
    if d == 2:
        plane = np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
        return YOUNG / (1 - POISSON**2) * plane
    shear = YOUNG / (2 * (1 + POISSON))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    return law


def strains(gradient: np.ndarray) -> np.ndarray:
    """Strains by displacements of the nodes, from the gradients of their shape functions `[d, nodes]`."""
    d = len(gradient)
    shears = [(i, j) for i in range(d) for j in range(i + 1, d)]
    matrix = np.zeros((d + len(shears), d * gradient.shape[1]))
    for i in range(d):
        matrix[i, i::d] = gradient[i]
    for row, (i, j) in enumerate(shears, d):
        matrix[row, i::d], matrix[row, j::d] = gradient[j], gradient[i]
    return matrix


def box(counts: tuple[int, ...], edges: np.ndarray, thickness: float = 1.0) -> Grid:
    """A box of `counts` elements with these edges."""
    d = len(counts)
    number = np.arange(np.prod(np.add(counts, 1))).reshape(np.add(counts, 1))
    points = np.stack(np.indices(number.shape), axis=-1).reshape(-1, d) * edges
    corners = [
        number[tuple(slice(o, o + n) for o, n in zip(at, counts, strict=True))].ravel()
        for at in product((0, 1), repeat=d)
    ]
    dofs = (d * np.stack(corners, axis=1)[:, :, None] + np.arange(d)).reshape(-1, d * 2**d)
    rows, columns = np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, dofs.shape[1]).ravel()
    stiffness, mass = (
        coo_matrix((np.tile(thickness * matrix.ravel(), len(dofs)), (rows, columns))).tocsc()
        for matrix in element(edges)
    )
    return Grid(number, points, stiffness, mass)


def equal_laws(
    contacts: int, tangents: int, tangential: float, normal: float, friction: float = FRICTION
) -> dict[str, np.ndarray]:
    """Laws of contacts that share a total stiffness."""
    return {
        "tangents": np.full(contacts, tangents, dtype=np.int32),
        "tangential_stiffness": np.full(contacts, tangential / contacts),
        "normal_stiffness": np.full(contacts, normal / contacts),
        "friction_coefficient": np.full(contacts, friction),
        "gap": np.zeros(contacts),
        "preload": np.zeros(contacts),
    }


def bouncing_block(
    contacts: int,
    modes: int = 10,
    stiffness: float = 2.0e9,
    pressing: float = 1.0e5,
    friction: float = 2.0,
    damping: float = 0.02,
) -> ReducedScene:
    """The plane block shaken upright, with so much friction that contacts hardly slip before they open."""
    return plane_block(contacts, modes, stiffness, pressing, friction, damping, upright=True)


def plane_block(
    contacts: int,
    modes: int = 10,
    stiffness: float = 2.0e9,
    pressing: float = 1.0e5,
    friction: float = FRICTION,
    damping: float = 0.005,
    upright: bool = False,
) -> ReducedScene:
    """A block 1 m by 0.25 m, 10 mm thick, reduced onto its contact dofs and `modes` fixed-interface modes.

    `stiffness`: of all contacts together, N/m, each way; `pressing`: the force on its upper edge, N; `upright`: shaken
    and watched along y rather than x.
    """
    length, height, thickness = 1.0, 0.25, 0.01
    size = length / (contacts - 1)
    rows = max(round(height / size), 2)
    edges = np.array([size, size if rows <= MOST_ROWS else height / MOST_ROWS])
    grid = box((contacts - 1, min(rows, MOST_ROWS)), edges, thickness)
    lower, top = grid.number[:, 0], grid.number[:, -1]
    press, shake, monitor = np.zeros((3, grid.points.size))
    press[grid.dofs(top, 1)] = -pressing / len(top)
    shake[grid.dofs(top, int(upright))] = 1.0 / len(top)
    monitor[grid.dofs(top[-1], int(upright))] = 1.0
    boundary = np.concatenate([grid.dofs(lower, 0), grid.dofs(lower, 1)])
    basis = craig_bampton(grid, boundary, modes, [press, monitor] if upright else [press, shake, monitor])
    directions = np.zeros((2 * contacts, basis.shape[1]))
    directions[0::2, :contacts] = np.eye(contacts)
    directions[1::2, contacts : 2 * contacts] = -np.eye(contacts)
    return reduced(
        grid,
        basis,
        damping=damping,
        laws=equal_laws(contacts, 1, stiffness, stiffness, friction),
        directions=directions,
        static=press,
        harmonic=np.stack([0.0 * shake, shake, 0.0 * shake]),
        monitor=monitor,
    )


def craig_bampton(grid: Grid, boundary: np.ndarray, modes: int, vectors: list[np.ndarray]) -> np.ndarray:
    """Basis `[n, m]`: constraint modes, fixed-interface modes, static corrections for vectors."""
    n = grid.stiffness.shape[0]
    inside = np.setdiff1d(np.arange(n), boundary)
    stiffness, mass = (matrix[inside][:, inside].tocsc() for matrix in (grid.stiffness, grid.mass))
    factors = factorise(stiffness)
    fixed = lowest_modes(stiffness, mass, modes)
    corrections = np.array([factors.solve(vector[inside]) for vector in vectors]).T
    local = np.linalg.qr(np.hstack([fixed, corrections / np.linalg.norm(corrections, axis=0)]))[0]
    basis = np.zeros((n, len(boundary) + local.shape[1]))
    basis[boundary, : len(boundary)] = np.eye(len(boundary))
    basis[inside, : len(boundary)] = -factors.solve(grid.stiffness[inside][:, boundary].toarray())
    basis[inside, len(boundary) :] = local
    return basis


def lowest_modes(stiffness: csc_matrix, mass: csc_matrix, modes: int) -> np.ndarray:
    """Lowest eigenvectors `[n, modes]`, of unit modal mass, by shift-invert about 0; the same ones on every run."""
    n = stiffness.shape[0]
    if n < 2 * modes + 2:
        return eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, modes - 1])[1]
    start = np.random.default_rng(0).standard_normal(n)
    inverse = LinearOperator(stiffness.shape, factorise(stiffness).solve, dtype=float)
    values, vectors = eigsh(stiffness, modes, mass, sigma=0.0, v0=start, OPinv=inverse)
    return vectors[:, np.argsort(values)]


def factorise(stiffness: csc_matrix) -> SuperLU:
    """Factors of the positive definite stiffness of a box in its own order, a band: less fill than by degrees."""
    return splu(stiffness, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def reduced(
    grid: Grid,
    basis: np.ndarray,
    *,
    damping: float,
    laws: dict[str, np.ndarray],
    directions: np.ndarray,
    static: np.ndarray,
    harmonic: np.ndarray,
    monitor: np.ndarray,
) -> ReducedScene:
    """The scene in the coordinates of a basis `[n, m]`; `directions` are in those already."""
    mass, stiffness = (np.ascontiguousarray(basis.T @ (matrix @ basis)) for matrix in (grid.mass, grid.stiffness))
    return ReducedScene(
        0.5 * (mass + mass.T),
        0.5 * (stiffness + stiffness.T),
        "ratio",
        damping,
        None,
        laws,
        np.ascontiguousarray(directions),
        (static @ basis)[None, :],
        np.ascontiguousarray(harmonic @ basis),
        (monitor @ basis)[None, :],
        ["top"],
    )


def hexahedral_block(
    contacts: int,
    modes: int = 200,
    stiffness: float = 2.0e10,
    pressing: float = 1.0e4,
    tilt: float = 0.6,
) -> ReducedScene:
    """A block of cubes, 0.1 m along its longer side, a quarter as high as broad, in `modes` modes of the stuck system.

    Contacts with two tangents stand under the nodes of its lower face. The force on top is spread as 1 + tilt x over
    its length, x from -1 to 1: contacts slip one after another as the level grows. It is shaken along x, and along y by
    0.4 of that a sixth of a period later, so that the direction of slip turns.

    `stiffness`: of all contacts together along each tangent, N/m, 1.2 times that along the normal; `pressing`: N.
    """
    across, along = nearly_square(contacts)
    size = 0.1 / (along - 1)
    grid = box((along - 1, across - 1, max(round((across - 1) / 4), 2)), np.full(3, size))
    lower, top = grid.number[:, :, 0].ravel()[:contacts], grid.number[:, :, -1]
    laws = equal_laws(contacts, 2, stiffness, 1.2 * stiffness)
    rows = np.stack([grid.dofs(lower, axis) for axis in range(3)], axis=1).ravel()
    press, along_x, along_y, monitor = np.zeros((4, grid.points.size))
    weight = 1.0 + tilt * np.linspace(-1.0, 1.0, along)[:, None] * np.ones(across)
    press[grid.dofs(top, 2)] = -pressing * weight.ravel() / weight.sum()
    along_x[grid.dofs(top, 0)] = 1.0 / top.size
    along_y[grid.dofs(top, 1)] = 0.4 / top.size
    monitor[grid.dofs(top[-1, -1], 0)] = 1.0
    springs = np.zeros(grid.points.size)
    springs[rows] = np.tile([stiffness, stiffness, 1.2 * stiffness], contacts) / contacts
    basis = lowest_modes((grid.stiffness + diags(springs)).tocsc(), grid.mass, min(modes, grid.points.size))
    phase = np.pi / 3.0
    return reduced(
        grid,
        basis,
        damping=0.005,
        laws=laws,
        directions=np.tile([1.0, 1.0, -1.0], contacts)[:, None] * basis[rows],
        static=press,
        harmonic=np.stack([0.0 * along_x, along_x + np.cos(phase) * along_y, np.sin(phase) * along_y]),
        monitor=monitor,
    )


def nearly_square(count: int) -> tuple[int, int]:
    """Sides of a grid of at least `count` nodes: exact if its sides then differ by no more than two to one."""
    root = int(np.sqrt(count))
    for short in range(root, 1, -1):
        if count % short == 0 and count <= 2 * short**2:
            return short, count // short
    return root, -(-count // root)


@dataclass(frozen=True)
class StuckSystem:
    """A scene with every contact stuck: natural frequencies, Hz, modes of unit mass `[m, m]`, stiffness of B's rows."""

    frequencies_hz: np.ndarray
    modes: np.ndarray
    springs: np.ndarray


def stuck_system(scene: ReducedScene) -> StuckSystem:
    """Its modes, dense."""
    tangents = scene.laws["tangents"]
    springs = np.concatenate(
        [
            [*[scene.laws["tangential_stiffness"][i]] * tangents[i], scene.laws["normal_stiffness"][i]]
            for i in range(len(tangents))
        ]
    )
    squares, modes = eigh(scene.stiffness + scene.directions.T @ (springs[:, None] * scene.directions), scene.mass)
    return StuckSystem(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), modes, springs)


def stuck_contacts(
    scene: ReducedScene, stuck: StuckSystem, frequency_hz: float, instants: int = 64
) -> tuple[np.ndarray, np.ndarray]:
    """Forces of the stuck response at unit level `[contacts, rows, instants]`, static normal forces `[contacts]`."""
    omega, natural = 2 * np.pi * frequency_hz, 2 * np.pi * stuck.frequencies_hz
    rows = stuck.springs[:, None] * (scene.directions @ stuck.modes)
    load = stuck.modes.T @ (scene.harmonic[1] - 1j * scene.harmonic[2])
    response = rows @ (load / (natural**2 - omega**2 + 2j * scene.damping_value * omega * natural))
    turn = np.exp(2j * np.pi * np.arange(instants) / instants)
    rows_per_contact = 1 + int(scene.laws["tangents"][0])
    forces = np.real(response[:, None] * turn).reshape(-1, rows_per_contact, instants)
    return forces, (rows @ (stuck.modes.T @ scene.static[0] / natural**2)).reshape(-1, rows_per_contact)[:, -1]


def opening_thresholds(scene: ReducedScene, stuck: StuckSystem, frequency_hz: float) -> np.ndarray:
    """Force level up to which each contact stays closed at this frequency, `[contacts]`, were all of them stuck."""
    forces, pressed = stuck_contacts(scene, stuck, frequency_hz)
    return np.maximum(pressed, 0.0) / np.maximum(-forces[:, -1].min(axis=1), np.finfo(float).tiny)


def slip_thresholds(scene: ReducedScene, stuck: StuckSystem, frequency_hz: float, instants: int = 64) -> np.ndarray:
    """Force level up to which each contact sticks at this frequency, `[contacts]`, were all others stuck.

    The least level at which |T| > mu N at some instant, with T and N of the stuck response at unit level and the static
    normal force. Beyond it the contact slips, or its mean shakes down to where it sticks again. Every contact has the
    same number of tangents.
    """
    forces, pressed = stuck_contacts(scene, stuck, frequency_hz, instants)
    room = np.maximum(scene.laws["friction_coefficient"] * pressed, 0.0)
    growth = np.linalg.norm(forces[:, :-1], axis=1) - scene.laws["friction_coefficient"][:, None] * forces[:, -1]
    return room / np.maximum(growth.max(axis=1), np.finfo(float).tiny)


# Parts of the median slip threshold: at 0.9 of the first stuck frequency of a hexahedral block nothing slips, about a
# tenth of the contacts does, all do.
LEVELS = {"stuck": 0.3, "partial": 0.7, "sliding": 5.0}


def force_levels(scene: ReducedScene, stuck: StuckSystem, frequency_hz: float) -> dict[str, float]:
    """Levels by the names of `LEVELS`."""
    median = float(np.median(slip_thresholds(scene, stuck, frequency_hz)))
    return {name: part * median for name, part in LEVELS.items()}
