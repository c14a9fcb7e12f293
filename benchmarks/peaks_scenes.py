"""Random scenes whose resonance peak is followed: strips, blocks, joints of two plates, wedges.

A scene is drawn from a seed and a number alone: its size, stiffness, friction, damping and loads, the band that holds
its first resonance with contacts stuck, and the ranges of level and preload. A range begins where all contacts stick at
the resonance, or most of them, and ends where they slip or open for much of the period.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import accuracy
import campaign_scenes
import numpy as np
import scenes
from scipy.linalg import solve_triangular
from scipy.sparse import block_diag, coo_matrix, csc_matrix

from attrito.library.reduced_scene import ReducedScene

# Shares of kinds; the second number is the tangents of a contact
KINDS = {
    "strip, 1 tangent": 0.2,
    "strip, 2 tangents": 0.07,
    "block, 1 tangent": 0.2,
    "block, 2 tangents": 0.05,
    "joint, 1 tangent": 0.12,
    "bolted joint, 1 tangent": 0.11,
    "wedge, 1 tangent": 0.15,
    "wedge, 2 tangents": 0.1,
}
# Of strips and plates, m
LENGTH, THICKNESS, WIDTH = 0.12, 0.006, 0.008
# Diameter of a bolt, m
BOLT = 0.004
# Modes of the stuck structure that are kept
MODES = 40
# Ends of the band, parts of the stuck natural frequency
BAND = (0.35, 1.25)


@dataclass(frozen=True)
class Scene:
    """What is followed.

    Parameters
    ----------
    kind : of structure, with the tangents of its contacts
    reduced : the scene; level 1 is where the median contact begins to slip at the stuck resonance
    band_hz : where the peak is looked for
    levels, preloads : least and greatest value of each parameter
    level : at which the preload is varied
    """

    kind: str
    reduced: ReducedScene
    band_hz: tuple[float, float]
    levels: tuple[float, float]
    preloads: tuple[float, float]
    level: float


def make(seed: int, number: int, tangents: int | None = None) -> Scene:
    """The scene of a seed and a number, with so many tangents where they are given."""
    random = np.random.default_rng([seed, number])
    kind = campaign_scenes.kind_of(random, KINDS, tangents)
    structure, tangents = kind.split(",")[0], int(kind.split()[-2])
    scene = structure_of(random, structure, tangents)
    stuck = scenes.stuck_system(scene)
    first = float(stuck.frequencies_hz[0])
    plain = scene
    if scene.damping_kind == "mass":
        plain = replace(scene, damping_kind="ratio", damping_value=scene.damping_value / (4.0 * np.pi * first))
    threshold = float(np.median(scenes.slip_thresholds(plain, stuck, first)))
    scene = accuracy.loaded(scene, threshold)
    low = 10 ** random.uniform(-1.0, 0.0)
    # Far beyond, what friction alone holds is not held.
    levels = (low, low * 10 ** (random.uniform(0.7, 1.5) if structure.endswith("joint") else random.uniform(1.0, 2.0)))
    least = 10 ** random.uniform(-1.3, -0.3)
    preloads = (least, least * 10 ** random.uniform(1.0, 2.0))
    level = 10 ** random.uniform(-0.3, 0.7)
    return Scene(kind, scene, (BAND[0] * first, BAND[1] * first), levels, preloads, level)


def structure_of(random: np.random.Generator, structure: str, tangents: int) -> ReducedScene:
    """A structure with contacts and loads."""
    if structure == "wedge":
        return accuracy.wedge(random).scene if tangents == 1 else campaign_scenes.wedge_in_space(random)
    if structure == "block":
        return accuracy.block(random, tangents).scene
    return strip(random, tangents) if structure == "strip" else joint(random, bolted=structure == "bolted joint")


def strip(random: np.random.Generator, tangents: int) -> ReducedScene:
    """A strip clamped at one end, pressed down and shaken sideways at the other, whose underside rubs there."""
    count = int(random.integers(8, 15))
    grid = scenes.box((count, 2, 1), np.array([LENGTH / count, WIDTH / 2, THICKNESS]))
    foot = grid.number[-int(random.integers(2, 5)) :, :, 0].ravel()
    axes = (1,) if tangents == 1 else (0, 1)
    rows = [(1.0, grid.dofs(node, axis)[0]) for node in foot for axis in (*axes, 2)]
    contacts = np.zeros((len(rows), grid.points.size))
    contacts[np.arange(len(rows)), [dof for _, dof in rows]] = 1.0
    contacts[tangents :: tangents + 1] *= -1.0
    tip = grid.number[-1, :, -1]
    press, shake = np.zeros((2, grid.points.size))
    press[grid.dofs(tip, 2)] = -1.0 / len(tip)
    shake[grid.dofs(tip, 1)] = 1.0 / len(tip)
    if random.random() < 0.4:
        # Loads that also press vary the normal forces.
        shake[grid.dofs(tip, 2)] = random.uniform(0.05, 0.5) / len(tip)
    monitor = np.zeros(grid.points.size)
    monitor[grid.dofs(tip[len(tip) // 2], 1)] = 1.0
    held = grid.dofs(grid.number[0], 0)[:, None] + np.arange(3)
    return structure_on(random, grid.stiffness, grid.mass, held, contacts, tangents, press, shake, monitor)


def joint(random: np.random.Generator, *, bolted: bool) -> ReducedScene:
    """Two plates that overlap, the lower one clamped at its end; pressed together in the middle of the overlap.

    Contact alone holds the upper one, or a bolt too, whose shank bends. Plates bend in their plane, so that the overlap
    opens at its ends.
    """
    count = int(random.integers(10, 17))
    overlap = int(random.integers(4, count - 3))
    rows = 2
    grid = scenes.box((count, rows), np.array([LENGTH / count, THICKNESS / rows]), WIDTH)
    size = grid.points.size
    lower, upper = grid.number[-overlap - 1 :, -1], grid.number[: overlap + 1, 0]
    contacts = np.zeros((2 * (overlap + 1), 2 * size))
    for axis, sign in ((0, 1.0), (1, -1.0)):
        at = np.arange(overlap + 1)
        contacts[2 * at + axis, size + grid.dofs(upper, axis)] = sign
        contacts[2 * at + axis, grid.dofs(lower, axis)] = -sign
    washer = slice(overlap // 2 - 1, overlap - overlap // 2 + 2)
    press, shake, monitor = np.zeros((3, 2 * size))
    top, bottom = grid.number[: overlap + 1, -1][washer], grid.number[-overlap - 1 :, 0][washer]
    press[size + grid.dofs(top, 1)] = -1.0 / len(top)
    press[grid.dofs(bottom, 1)] = 1.0 / len(bottom)
    tip = size + grid.dofs(grid.number[-1, -1], 1)
    shake[tip] = monitor[tip] = 1.0
    held = grid.dofs(grid.number[0], 0)[:, None] + np.arange(2)
    stiffness, mass = (block_diag([matrix, matrix]).tocsc() for matrix in (grid.stiffness, grid.mass))
    if bolted:
        # Clamped in both plates it would be the stiffest; washers and play make it softer.
        shank = 12.0 * scenes.YOUNG * np.pi / 64.0 * BOLT**4 / (2.0 * THICKNESS) ** 3 * 10 ** random.uniform(-2.5, -1.0)
        ends = [
            size + grid.dofs(grid.number[overlap // 2, 1], 0)[0],
            grid.dofs(grid.number[-overlap - 1 + overlap // 2, 1], 0)[0],
        ]
        stiffness += coo_matrix(
            (shank * np.array([1.0, 1.0, -1.0, -1.0]), (np.tile(ends, 2), [*ends, *ends[::-1]])), stiffness.shape
        )
    # Contact alone holds the upper plate: without these motions a truncated basis would hold it too.
    rigid = np.zeros((3, 2 * size))
    along, across = (size + grid.dofs(np.arange(len(grid.points)), axis) for axis in (0, 1))
    rigid[0, along] = rigid[1, across] = 1.0
    rigid[2, along], rigid[2, across] = -grid.points[:, 1], grid.points[:, 0]
    return structure_on(random, stiffness, mass, held, contacts, 1, press, shake, monitor, rigid)


def structure_on(
    random: np.random.Generator,
    stiffness: csc_matrix,
    mass: csc_matrix,
    held: np.ndarray,
    directions: np.ndarray,
    tangents: int,
    press: np.ndarray,
    shake: np.ndarray,
    monitor: np.ndarray,
    rigid: np.ndarray | None = None,
) -> ReducedScene:
    """In modes of the stuck system, with random laws, force and damping.

    `held`: dofs that do not move; `rigid` `[motions, n]`: of bodies that only contact holds, kept besides the modes.
    """
    free = np.setdiff1d(np.arange(len(press)), held)
    rows, contacts = directions[:, free], len(directions) // (tangents + 1)
    # Of springs against which a strip of this size deflects as the plate does
    bending = scenes.YOUNG * WIDTH * THICKNESS**3 / (4.0 * (LENGTH / 2) ** 3)
    normal = bending * 10 ** random.uniform(1.0, 2.5)
    tangential = bending * 10 ** random.uniform(0.0, 1.5)
    laws = scenes.equal_laws(contacts, tangents, tangential, normal, random.uniform(0.1, 0.7))
    springs = np.tile([*[tangential] * tangents, normal], contacts) / contacts
    inner = stiffness[free][:, free].toarray(), mass[free][:, free].toarray()
    stuck = inner[0] + rows.T @ (springs[:, None] * rows)
    basis = scenes.lowest_modes(csc_matrix(stuck), csc_matrix(inner[1]), min(MODES, len(free) - 1))
    if rigid is not None:
        basis = np.hstack([rigid[:, free].T, basis])
        basis = solve_triangular(np.linalg.cholesky(basis.T @ inner[1] @ basis), basis.T, lower=True).T
    reduced_stiffness, reduced_mass = (basis.T @ matrix @ basis for matrix in inner)
    force = 10 ** random.uniform(0.0, 3.0)
    return ReducedScene(
        0.5 * (reduced_mass + reduced_mass.T),
        0.5 * (reduced_stiffness + reduced_stiffness.T),
        "ratio",
        10 ** random.uniform(-2.7, -1.7),
        None,
        laws,
        np.ascontiguousarray(rows @ basis),
        np.ascontiguousarray(force * press[None, free] @ basis),
        np.ascontiguousarray(np.stack([0.0 * shake, shake, 0.0 * shake])[:, free] @ basis),
        np.ascontiguousarray(monitor[None, free] @ basis),
        ["tip"],
    )
