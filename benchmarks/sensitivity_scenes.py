"""Random scenes whose derivatives are compared with differences, and the parameters that they have.

To the scenes of `campaign_scenes.py` are added other laws (Iwan's, friction by pressure), a loss factor, and sectors of
wheels (`cyclic_scenes.py`). Of every scene is drawn what is looked at there: a point, a peak, or a nonlinear mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import campaign_scenes
import cyclic_scenes
import numpy as np

from attrito.library.names import LAWS
from attrito.library.reduced_scene import ReducedScene, Sector

NUMBERS = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# Numbers of damping by its kind, in the order of the library: alpha, beta, ratio, loss factor
DAMPED = {"none": (), "viscous": (0, 1), "ratio": (2,), "mass": (0,), "loss_factor": (3,)}
# Shares of sectors, of other laws and loss factors among the others, and of what is looked at
SECTORS, IWAN, PRESSURE, LOSS_FACTOR = 0.12, 0.2, 0.1, 0.15
LOOKS = {"point": 0.5, "peak": 0.3, "mode": 0.2}
WHEELS = (3, 5, 6, 8, 12)
HARMONICS = 5

# A name and a place: a contact and one of its law's numbers; a load's number; a number of damping; or the level
Parameter = tuple[str, int]
# Of points alone: the frequency
BY_FREQUENCY: Parameter = ("frequency", 0)


@dataclass(frozen=True)
class Case:
    """What is solved.

    Parameters
    ----------
    kinds : what was drawn, for the summary
    scene : what is solved
    look : one of `LOOKS`
    frequencies_hz : where it is looked for
    harmonics : of the balance
    """

    kinds: tuple[str, ...]
    scene: ReducedScene
    look: str
    frequencies_hz: list[float]
    harmonics: int

    @property
    def is_smooth(self) -> bool:
        """Whether peaks have a frequency that is differentiable."""
        return "law" not in self.scene.laws or bool(np.all(self.scene.laws["law"] != LAWS.index("pressure")))


def make(seed: int, number: int) -> Case:
    """The scene of a seed and a number."""
    random = np.random.default_rng([seed, number, 1])
    look = str(random.choice(list(LOOKS), p=list(LOOKS.values())))
    # Drawn and not used: a seed keeps the scenes that docs/how-to/sensitivity.md has measured.
    random.random()
    if random.random() < SECTORS:
        return sector(random, "peak" if look == "mode" else look)
    drawn = campaign_scenes.make(seed, number)
    scene, kinds = drawn.reduced, [drawn.structure]
    if random.random() < LOSS_FACTOR:
        scene = replace(
            scene, damping_kind="loss_factor", damping_value=float(10 ** random.uniform(-2.3, -1.2)), damping=None
        )
    kinds.append(scene.damping_kind)
    scene, law = with_laws(random, scene)
    return Case(
        (*kinds, law, look),
        scene,
        look,
        [float(frequency) for frequency in drawn.frequencies_hz],
        max(HARMONICS, drawn.loaded_harmonics),
    )


def sector(random: np.random.Generator, look: str) -> Case:
    """One of a wheel's, in a wave."""
    sectors = int(random.choice(WHEELS))
    order, tangents = int(random.integers(1, sectors)), int(random.integers(1, 3))
    scene = cyclic_scenes.random_sector(int(random.integers(2**31)), sectors, order, tangents=tangents)
    scene = replace(scene, harmonic=np.ascontiguousarray(10 ** random.uniform(-1.3, 0.6) * scene.harmonic))
    words = f"sector, {tangents} tangent{'s'[: tangents - 1]}"
    frequencies = np.linspace(0.4, 0.08, 9).tolist()
    return Case((words, "mass", "coulomb", look), scene, look, frequencies, HARMONICS)


def with_laws(random: np.random.Generator, scene: ReducedScene) -> tuple[ReducedScene, str]:
    """The scene with other laws at some of its contacts, and the name of that law."""
    tangents = scene.laws["tangents"]
    draw, contacts = random.random(), len(tangents)
    if draw < IWAN and np.all(tangents == 1):
        law = "iwan"
        rows = [[random.uniform(-0.8, -0.2), random.uniform(0.1, 2.0), float(random.integers(3, 9))]] * contacts
    elif draw > 1.0 - PRESSURE:
        law = "pressure"
        friction = float(scene.laws["friction_coefficient"][0])
        pressed = float(np.abs(scene.static).max())
        table = [(part * pressed, friction * random.uniform(0.7, 1.3)) for part in (0.03, 0.3, 1.0)]
        rows = [[1.0, *(number for pair in table for number in pair)]] * contacts
    else:
        return scene, "coulomb"
    # Every contact has it, or half of them do
    chosen = np.ones(contacts, dtype=bool) if random.random() < 0.5 else random.random(contacts) < 0.5
    if not np.any(chosen):
        return scene, "coulomb"
    kinds = np.where(chosen, LAWS.index(law), 0).astype(np.int32)
    numbers = np.where(chosen[:, np.newaxis], np.array(rows), np.nan)
    return replace(scene, laws=scene.laws | {"law": kinds, "law_numbers": np.ascontiguousarray(numbers)}), law


def parameters_of(scene: ReducedScene) -> list[Parameter]:
    """All that a scene has."""
    numbers = NUMBERS[2:] if scene.damping_kind == "ratio" else NUMBERS
    contacts = range(len(scene.laws["tangents"]))
    kinds = scene.laws.get("law", np.zeros(len(contacts), dtype=int))
    found = [
        (name, i)
        for i in contacts
        for name in numbers
        if name != "friction_coefficient" or LAWS[kinds[i]] != "pressure"
    ]
    for i in contacts:
        # chi and beta, but not how many sliders; the coefficients of a table
        columns = {"iwan": (0, 1), "pressure": (2, 4, 6)}.get(LAWS[kinds[i]], ())
        found += [(f"law_numbers {column}", i) for column in columns]
    loaded = [h for h in range(1, len(scene.harmonic) // 2 + 1) if np.any(scene.harmonic[2 * h - 1 : 2 * h + 1])]
    return [
        *found,
        *(("load", i) for i in range(len(scene.static))),
        *(("harmonic", h) for h in loaded),
        *(("damping", i) for i in DAMPED[scene.damping_kind]),
        *([("gap field", 0)] if np.any(scene.laws["gap"]) else []),
        ("level", 0),
    ]


def scale_of(scene: ReducedScene, parameter: Parameter) -> float:
    """What a parameter is measured by: itself; gaps and preloads by the largest static force."""
    name, place = parameter
    if name in NUMBERS[:3]:
        return float(scene.laws[name][place])
    if name.startswith("law_numbers"):
        return abs(float(scene.laws["law_numbers"][place, column_of(name)]))
    if name in ("load", "level", "harmonic", "gap field"):
        return 1.0
    if name == "damping":
        # Of a matrix the alpha or beta that would be as large.
        if scene.damping is None:
            return scene.damping_value
        return float(np.trace(scene.damping) / np.trace((scene.mass, scene.stiffness)[place]))
    force = max(float(np.abs(scene.static).max()), float(np.abs(scene.laws["preload"]).max()))
    return force if name == "preload" else force / float(scene.laws["normal_stiffness"][place])


def column_of(name: str) -> int:
    """Of a law's further numbers."""
    return int(name.split()[1])


def moved(scene: ReducedScene, parameter: Parameter, change: float) -> ReducedScene:
    """The scene with a parameter changed."""
    name, place = parameter
    if name == "level":
        return replace(scene, harmonic=(1.0 + change) * scene.harmonic)
    if name == "harmonic":
        harmonic = scene.harmonic.copy()
        harmonic[2 * place - 1 : 2 * place + 1] *= 1.0 + change
        return replace(scene, harmonic=harmonic)
    if name == "damping":
        if scene.damping is None:
            return replace(scene, damping_value=scene.damping_value + change)
        return replace(scene, damping=scene.damping + change * (scene.mass, scene.stiffness)[place])
    if name == "load":
        static = scene.static.copy()
        static[place] *= 1.0 + change
        return replace(scene, static=static)
    if name == "gap field":
        return replace(scene, laws=scene.laws | {"gap": (1.0 + change) * scene.laws["gap"]})
    key = name.split()[0]
    values = scene.laws[key].copy()
    values[(place, column_of(name)) if key == "law_numbers" else place] += change
    return replace(scene, laws=scene.laws | {key: values})


def contact_motion(scene: ReducedScene, coordinates: np.ndarray) -> np.ndarray:
    """Relative displacements `[rows, 2 H + 1]`; the next sector's coordinates lag by EO/N of a period."""
    motion = scene.directions @ coordinates
    if scene.sector is None:
        return motion
    return motion + scene.sector.next_directions @ one_sector_on(scene.sector, coordinates)


def one_sector_on(sector: Sector, coordinates: np.ndarray) -> np.ndarray:
    """q_{j+1}(t) = q_j(t - EO T/N), as coefficients."""
    found = coordinates.copy()
    for h in range(1, coordinates.shape[1] // 2 + 1):
        angle = 2.0 * np.pi * h * sector.engine_order / sector.sectors
        cosine, sine = coordinates[:, 2 * h - 1], coordinates[:, 2 * h]
        found[:, 2 * h - 1] = np.cos(angle) * cosine - np.sin(angle) * sine
        found[:, 2 * h] = np.sin(angle) * cosine + np.cos(angle) * sine
    return found
