"""A mass on a spring that rubs against a wall, pressed by a constant force: what is known of it in closed form."""

from __future__ import annotations

import numpy as np

from attrito.library.reduced_scene import ReducedScene

KT, LIMIT, DAMPING = 0.5, 1.0, 0.02


def jenkins() -> ReducedScene:
    """A mass on a spring (both 1) that rubs, pressed by a constant force, mu N = 1."""
    laws = {"tangents": np.ones(1, dtype=np.int32), "tangential_stiffness": np.full(1, KT)}
    laws |= {"normal_stiffness": np.ones(1), "friction_coefficient": np.full(1, LIMIT), "gap": np.zeros(1)}
    laws |= {"preload": np.ones(1)}
    harmonic = np.zeros((3, 2))
    harmonic[1, 0] = 1.0
    # The second coordinate is what the contact presses on; the static load balances its preload.
    return ReducedScene(
        np.eye(2),
        np.eye(2),
        "viscous",
        0.0,
        DAMPING * np.eye(2),
        laws,
        np.eye(2),
        np.array([[0.0, 1.0]]),
        harmonic,
        np.array([[1.0, 0.0]]),
        ["x"],
    )


def element(amplitude: float) -> tuple[float, float]:
    """Stiffness and loss of the Jenkins element for one harmonic: its describing function."""
    limit = LIMIT / KT
    if amplitude <= limit:
        return KT, 0.0
    theta = np.arccos(1.0 - 2.0 * limit / amplitude)
    loss = 4.0 * LIMIT / (np.pi * amplitude) * (1.0 - limit / amplitude)
    return KT / np.pi * (theta - 0.5 * np.sin(2.0 * theta)), loss
