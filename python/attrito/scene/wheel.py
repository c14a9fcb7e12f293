"""All sectors of a wheel at once, out of one of them: what a sector under a travelling wave is compared with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from attrito.library.reduced_scene import ReducedScene, Sector


def whole_wheel(scene: ReducedScene) -> ReducedScene:
    """The N sectors of a sector's wheel, tied at their boundaries; loads are f_j(t) = f_0(t - j EO T / N).

    Coordinates and contacts are those of sector 0, 1, ..., each without its upper boundary and what it has on the axis;
    at the end come those of nodes on the axis, along the first sector's axes. Monitors are those of the first. There is
    no `sector` left.
    """
    sector = scene.sector
    if sector is None:
        return scene
    onto = [of_sector(sector, len(scene.mass), j) for j in range(sector.sectors)]
    ahead = onto[1:] + onto[:1]

    def assembled(matrix: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(sum(t @ matrix @ t.T for t in onto))

    return replace(
        scene,
        mass=assembled(scene.mass),
        stiffness=assembled(scene.stiffness),
        damping=None if scene.damping is None else assembled(scene.damping),
        gyroscopic=None if scene.gyroscopic is None else assembled(scene.gyroscopic),
        laws={name: np.concatenate([values] * sector.sectors) for name, values in scene.laws.items()},
        directions=np.vstack(
            [scene.directions @ t.T + sector.next_directions @ u.T for t, u in zip(onto, ahead, strict=True)]
        ),
        static=np.ascontiguousarray(sum(scene.static @ t.T for t in onto)),
        harmonic=np.ascontiguousarray(sum(delayed(scene.harmonic, sector, j) @ t.T for j, t in enumerate(onto))),
        monitors=np.ascontiguousarray(scene.monitors @ onto[0].T),
        sector=None,
    )


def of_sector(sector: Sector, size: int, number: int) -> np.ndarray:
    """From a sector's coordinates to the wheel's, `[n, m]`; sector j sees a node on the axis turned by R^-j."""
    own = sector.own(size)
    last = sector.sectors * len(own)
    place = np.full(size, -1)
    place[own] = (number % sector.sectors) * len(own) + np.arange(len(own))
    place[sector.upper] = place[sector.lower] + (((number + 1) % sector.sectors) - (number % sector.sectors)) * len(own)
    place[sector.along] = last + np.arange(len(sector.along))
    across = last + len(sector.along) + np.arange(sector.across.size).reshape(-1, 2)
    place[sector.across] = across
    onto = np.zeros((last + len(sector.along) + sector.across.size, size))
    onto[place, np.arange(size)] = 1.0
    angle = 2.0 * np.pi * (number % sector.sectors) / sector.sectors
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    onto[across[:, :, None], sector.across[:, None, :]] = turn
    return onto


def delayed(series: np.ndarray, sector: Sector, number: int) -> np.ndarray:
    """Series f(t - j EO T / N) of coefficients `[2 h + 1, ...]`, rows mean, cosine 1, sine 1, ..."""
    turned = series.copy()
    for h in range(1, (len(series) - 1) // 2 + 1):
        angle = 2.0 * np.pi * ((h * number * sector.engine_order) % sector.sectors) / sector.sectors
        cosine, sine = series[2 * h - 1], series[2 * h]
        turned[2 * h - 1] = np.cos(angle) * cosine - np.sin(angle) * sine
        turned[2 * h] = np.sin(angle) * cosine + np.cos(angle) * sine
    return turned


def wave_in_wheel(motion: np.ndarray, sector: Sector) -> np.ndarray:
    """Coefficients of the wheel's coordinates `[n, 2 H + 1]` from those of a sector, `[m, 2 H + 1]`."""
    own = sector.own(len(motion))
    sectors = [delayed(motion.T, sector, j)[:, own] for j in range(sector.sectors)]
    return np.hstack([*sectors, motion[sector.along].T, motion[sector.across.ravel()].T]).T
