"""Random scenes of the campaign: structures of `accuracy.py` with other contacts, loads, damping and modes.

A scene is drawn from a seed and a number alone. Of every scene are drawn

- the structure: a wedge, a chain of masses, or a small block; contacts with one or two tangents;
- the stiffness of its contacts, from 0.1 to 1e6 times that of the structure at its contacts;
- the level of the load, relative to the one at which contacts slip or open; for lift-off also gaps, a small preload, or
  shaking along the normal;
- for tuned scenes a mode whose natural frequency (with contacts stuck, frictionless or open) is h times the frequency
  of the excitation, within its half-power bandwidth, h from 3 to 31;
- now and then loads with further harmonics, and damping by a full matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import accuracy
import numpy as np
import scenes
from scipy.linalg import eigh

from attrito.library.reduced_scene import ReducedScene

# Shares of structures, of tuned scenes, of scenes that lift off, of loads with more than one harmonic
STRUCTURES = {
    "wedge, 1 tangent": 0.22,
    "wedge, 2 tangents": 0.12,
    "chain, 1 tangent": 0.26,
    "chain, 2 tangents": 0.2,
    "block, 1 tangent": 0.17,
    "block, 2 tangents": 0.03,
}
TUNED, LIFTED, MANY_HARMONICS, COUPLED_DAMPING = 0.35, 0.35, 0.15, 0.15
# Decades of the contacts' stiffness over the structure's; half of the scenes stay within the lower ones
RATIOS, USUAL_RATIOS = (-1.0, 6.0), (-1.0, 2.0)
STIFF = 1e4
TUNED_HARMONICS = (3, 31)
# Decades of the damping ratio
DAMPING = (-2.7, -1.5)
# The load at which contacts open is taken to be at most so many times the one at which they slip
MOST_LIFTED = 20.0
# Part of the largest static force with which contacts are pressed at least
LEAST_PRESSED = 0.02
# Of the frequencies of `accuracy.across`, those that are solved
FREQUENCIES = [0, 2, 3, 4, 6]


@dataclass(frozen=True)
class Scene:
    """What is solved, and what was drawn.

    Parameters
    ----------
    structure, tangents : kind of structure, tangents of its contacts
    ratio : of stiffness, contact over structure
    lifted : "", or how contacts are made to open
    tuned, tuned_state : harmonic to which a mode is tuned (0: none), and the contacts' state in which it is
    reduced, frequencies_hz : the scene, and the frequencies in the order in which they are solved
    """

    structure: str
    tangents: int
    ratio: float
    lifted: str
    tuned: int
    tuned_state: str
    reduced: ReducedScene
    frequencies_hz: list[float]

    @property
    def loaded_harmonics(self) -> int:
        """The highest harmonic of the loads."""
        return (len(self.reduced.harmonic) - 1) // 2

    @property
    def classes(self) -> list[str]:
        """The classes of the report that the scene belongs to."""
        named = {
            "all": True,
            "one tangent": self.tangents == 1,
            "two tangents": self.tangents == 2,
            f"stiff, from {STIFF:g}": self.ratio >= STIFF,
            "tuned": self.tuned > 0,
            "lift-off": self.lifted != "",
        }
        return [name for name, belongs in named.items() if belongs]


def kind_of(random: np.random.Generator, shares: dict[str, float], tangents: int | None) -> str:
    """A kind by its share, "..., N tangents"; of those with so many tangents where they are given."""
    left = {name: share for name, share in shares.items() if tangents in (None, int(name.split()[-2]))}
    return str(random.choice(list(left), p=np.array(list(left.values())) / sum(left.values())))


def make(seed: int, number: int, tangents: int | None = None) -> Scene:
    """The scene of a seed and a number, with so many tangents where they are given."""
    random = np.random.default_rng([seed, number])
    structure = kind_of(random, STRUCTURES, tangents)
    kind, tangents = structure.split(",")[0], int(structure.split()[1])
    scene = structure_of(random, kind, tangents)
    scene = replace(scene, **damping_of(random, scene))
    ratio = 10 ** random.uniform(*(RATIOS if random.random() < 0.5 else USUAL_RATIOS))
    scene = replace(scene, laws=laws_of(random, scene, ratio))
    tuned, state, aim = 0, "", None
    if random.random() < TUNED:
        state = str(random.choice(["stuck", "frictionless", "open"]))
        scene, tuned, aim = tune(random, scene, state)
    lifted = str(random.choice(["gaps", "small preload", "upright"])) if random.random() < LIFTED else ""
    scene = loaded(random, scene, lifted)
    frequencies = accuracy.across(scene)[FREQUENCIES].tolist()
    if tuned:
        # Where the tuned mode answers, in the order of the sweep
        frequencies = sorted([*frequencies, aim, aim * (1.0 + 0.5 * ratio_of(scene, aim))], reverse=True)
    if random.random() < 0.5:
        frequencies.reverse()
    return Scene(structure, tangents, ratio, lifted, tuned, state if tuned else "", scene, frequencies)


def structure_of(random: np.random.Generator, kind: str, tangents: int) -> ReducedScene:
    """A structure with its contacts and loads, before anything is varied."""
    if kind == "wedge":
        return accuracy.wedge(random).scene if tangents == 1 else wedge_in_space(random)
    if kind == "chain":
        return accuracy.chain(random, tangents).scene
    return accuracy.block(random, tangents).scene


def wedge_in_space(random: np.random.Generator) -> ReducedScene:
    """A mass on three springs, pressed against an inclined wall on which it slides in two directions."""
    angle = random.choice([0.0, random.uniform(0.0, np.pi / 3)])
    rows = np.array([[-np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [np.sin(angle), 0.0, np.cos(angle)]])
    natural = 2 * np.pi * np.array([100.0, random.uniform(105.0, 200.0), 250.0])
    level, turn = 10 ** random.uniform(0.3, 1.6), random.uniform(0.0, 1.0)
    return ReducedScene(
        np.eye(3),
        np.diag(natural**2),
        "mass",
        20 * np.pi,
        None,
        accuracy.laws(1, 2, np.full(2, 3.0e5), random.uniform(0.2, 0.8)),
        rows,
        np.array([[0.0, 0.0, 420.0]]) * random.uniform(0.5, 2.0),
        level * np.array([0.0 * rows[0], rows[0], turn * rows[1]]),
        np.array([[1.0, 0.3, 0.0]]),
        ["x"],
    )


def damping_of(random: np.random.Generator, scene: ReducedScene) -> dict:
    """Damping by the ratio, by the mass, or by a full matrix (Rayleigh's, no multiple of the mass)."""
    ratio = 10 ** random.uniform(*DAMPING)
    natural = 2 * np.pi * scenes.stuck_system(scene).frequencies_hz[0]
    if random.random() < COUPLED_DAMPING:
        matrix = ratio * (natural * scene.mass + scene.stiffness / natural)
        return {"damping_kind": "viscous", "damping_value": 0.0, "damping": np.ascontiguousarray(matrix)}
    if scene.damping_kind == "mass":
        return {"damping_value": 2.0 * ratio * natural}
    return {"damping_value": ratio}


def ratio_of(scene: ReducedScene, frequency_hz: float) -> float:
    """About the damping ratio of a mode at a frequency."""
    omega = 2 * np.pi * frequency_hz
    if scene.damping_kind == "viscous":
        stuck = scenes.stuck_system(scene)
        mode = stuck.modes[:, np.abs(stuck.frequencies_hz - frequency_hz).argmin()]
        return float(mode @ scene.damping @ mode / (2.0 * omega))
    return scene.damping_value / (2.0 * omega) if scene.damping_kind == "mass" else scene.damping_value


def laws_of(random: np.random.Generator, scene: ReducedScene, ratio: float) -> dict[str, np.ndarray]:
    """The scene's laws with contacts so many times as stiff as the structure is at them."""
    tangents = int(scene.laws["tangents"][0])
    compliance = np.einsum("ij,ij->i", scene.directions, np.linalg.solve(scene.stiffness, scene.directions.T).T)
    stiffness = 1.0 / compliance.reshape(-1, tangents + 1)
    laws = dict(scene.laws)
    laws["tangential_stiffness"] = ratio * stiffness[:, 0] * 10 ** random.uniform(-0.3, 0.0)
    laws["normal_stiffness"] = ratio * stiffness[:, -1] * 10 ** random.uniform(-0.3, 0.3)
    return laws


def tune(random: np.random.Generator, scene: ReducedScene, state: str) -> tuple[ReducedScene, int, float | None]:
    """The scene with one of its modes, contacts being in a state, moved up to a harmonic of a frequency of the sweep.

    Also the harmonic and that frequency; the scene as it is, 0 and None where no mode lies below a harmonic drawn.
    """
    aim = float(random.choice(accuracy.across(scene)[1:-1]))
    harmonic = int(random.integers(TUNED_HARMONICS[0], TUNED_HARMONICS[1] + 1))
    springs = springs_of(scene, state)
    squares, modes = eigh(scene.stiffness + scene.directions.T @ (springs[:, None] * scene.directions), scene.mass)
    wanted = 2 * np.pi * harmonic * aim * (1.0 + random.uniform(-1.0, 1.0) * ratio_of(scene, harmonic * aim))
    movable = [mode for mode in range(1, len(squares)) if squares[mode] < wanted**2]
    if not movable:
        return scene, 0, None
    mode = int(random.choice(movable))
    pushed = scene.mass @ modes[:, mode]
    stiffness = scene.stiffness + (wanted**2 - squares[mode]) * np.outer(pushed, pushed)
    return replace(scene, stiffness=np.ascontiguousarray(stiffness)), harmonic, aim


def springs_of(scene: ReducedScene, state: str) -> np.ndarray:
    """Stiffness of B's rows, `[rows]`, of contacts that are stuck, frictionless or open."""
    tangents = int(scene.laws["tangents"][0])
    along = [scene.laws["tangential_stiffness"] * (state == "stuck")] * tangents
    return np.stack([*along, scene.laws["normal_stiffness"] * (state != "open")], axis=1).ravel()


def pressed_together(scene: ReducedScene) -> ReducedScene:
    """The scene; its static load acts at the contacts if they would not be pressed by it, a mode having been moved."""
    tangents = int(scene.laws["tangents"][0])
    plain = replace(scene, damping_kind="ratio", damping_value=0.01, damping=None)
    stuck = scenes.stuck_system(scene)
    pressed = scenes.stuck_contacts(plain, stuck, 0.5 * stuck.frequencies_hz[0])[1]
    if np.median(pressed) > LEAST_PRESSED * np.abs(scene.static).max():
        return scene
    at_contacts = scene.directions[tangents :: tangents + 1].sum(axis=0)
    size = np.linalg.norm(scene.static) / np.linalg.norm(at_contacts)
    return replace(scene, static=np.ascontiguousarray(size * at_contacts[None, :]))


def loaded(random: np.random.Generator, scene: ReducedScene, lifted: str) -> ReducedScene:
    """The scene with its loads at a level at which contacts slip or open, and with what makes them open."""
    tangents = int(scene.laws["tangents"][0])
    normal = scene.directions[tangents :: tangents + 1]
    harmonic = scene.harmonic.copy()
    if lifted == "upright":
        share = np.linalg.norm(harmonic) * random.uniform(0.3, 2.0)
        harmonic[1] += share * normal[int(random.integers(len(normal)))]
    if random.random() < MANY_HARMONICS:
        count = int(random.integers(2, 6))
        more = np.zeros((2 * count + 1, harmonic.shape[1]))
        more[:3] = harmonic
        further = random.integers(2, count + 1)
        more[2 * further - 1 : 2 * further + 1] = random.uniform(0.05, 0.6) * harmonic[[2, 1]]
        more[2 * count - 1] += 0.05 * harmonic[1]
        harmonic = more
    scene = pressed_together(replace(scene, harmonic=np.ascontiguousarray(harmonic)))
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    plain = replace(scene, damping_kind="ratio", damping_value=ratio_of(scene, first), damping=None)
    level = np.median(scenes.slip_thresholds(plain, stuck, 0.97 * first))
    if lifted:
        # Contacts along which nothing is shaken never open.
        level = min(np.median(scenes.opening_thresholds(plain, stuck, 0.97 * first)), MOST_LIFTED * level)
    level *= 10 ** random.uniform(-0.3, 1.0)
    pressed = np.abs(scenes.stuck_contacts(plain, stuck, first)[1])
    laws = dict(scene.laws)
    if lifted == "gaps":
        chosen = random.random(len(normal)) < 0.6
        reach = pressed * np.einsum("ij,ij->i", normal, np.linalg.solve(scene.stiffness, normal.T).T)
        laws["gap"] = np.ascontiguousarray(np.where(chosen, random.uniform(0.0, 1.5) * reach, 0.0))
    static = scene.static * (10 ** random.uniform(-2.0, -0.5) if lifted == "small preload" else 1.0)
    return accuracy.loaded(replace(scene, laws=laws, static=np.ascontiguousarray(static)), level)
