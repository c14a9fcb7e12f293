"""The peer's half of `peer.py`: pyHarm-os on a problem in a file, run by the Python of its own environment.

JAX_ENABLE_X64=1 out/peer/bin/python benchmarks/peer_pyharm.py problem.npz
"""

from __future__ import annotations

import json
import logging
import sys
import time

import numpy as np
from pyHarm.Systems.FactorySystem import generateSystem

REPEATS = 3
ITERATIONS = 20


class Load:
    """All loads as one vector, in place of an element for each coordinate."""

    def __init__(self, vector: np.ndarray):
        self.vector, self.indices = vector, np.flatnonzero(vector)

    def evalResidual(self, x: np.ndarray, omega: float) -> np.ndarray:  # noqa: N802 (the peer's name)
        """Minus the load: residuals are inner minus outer forces."""
        return -self.vector[self.indices]

    def evalJacobian(self, x: np.ndarray, omega: float) -> tuple[np.ndarray, np.ndarray]:  # noqa: N802 (the peer's name)
        """None."""
        count = len(self.indices)
        return np.zeros((count, count)), np.zeros(count)


def node_major(contacts: int, size: int) -> np.ndarray:
    """Order of coordinates in which the two dofs of a contact's node come together, internal ones last."""
    pairs = np.stack([np.arange(contacts), contacts + np.arange(contacts)], axis=1).ravel()
    return np.concatenate([pairs, np.arange(2 * contacts, size)])


def build(data: dict[str, np.ndarray]):
    """The peer's system."""
    contacts, size = len(data["kt"]), len(data["mass"])
    order = node_major(contacts, size)
    matrices = {
        name: np.ascontiguousarray(data[key][np.ix_(order, order)])
        for name, key in (("M", "mass"), ("C", "damping"), ("K", "stiffness"))
    }
    preload = 1e-12 * abs(data["load"][:, 0]).max()
    connectors = {
        f"contact{i}": {
            "type": "Penalty3D",
            "connect": {"block": [i]},
            "dirs": [1, 0, 0],
            "mu": data["mu"][i] / np.sqrt(2.0),
            "k_t": data["kt"][i] / 2.0,
            "k_n": data["kn"][i],
            "g": 0.0,
            "N0": preload,
        }
        for i in range(contacts)
    }
    block = {"matrix": matrices, "ndofs": 2, "nmodes": size - 2 * contacts, "nnodes": contacts}
    harmonics = (data["load"].shape[1] - 1) // 2
    logger = logging.getLogger("peer")
    system = generateSystem(
        "Base",
        {
            "system": {"type": "Base", "nh": harmonics, "nti": int(data["samples"])},
            "substructures": {"block": block},
            "connectors": connectors,
        },
        logger=logger,
    )
    system.LE_extforcing.append(Load(vector_of(data["load"], order)))
    return system, order


def vector_of(coefficients: np.ndarray, order: np.ndarray) -> np.ndarray:
    """The peer's unknowns, harmonics outermost, of coefficients `[m, 2 H + 1]`."""
    return coefficients[order].T.ravel()


def timed(work) -> float:
    """Least seconds of a few calls, the first, which compiles, apart."""
    work()
    seconds = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def newton(system, start: np.ndarray, scale: float) -> tuple[np.ndarray, int, float]:
    """Newton's method on the peer's residual and Jacobian, frequency held."""
    x = start.copy()
    residual = system.Residual(x)
    iterations = 0
    while np.linalg.norm(residual) > 1e-10 * scale and iterations < ITERATIONS:
        x[:-1] -= np.linalg.solve(system.Jacobian(x)[0], residual)
        residual = system.Residual(x)
        iterations += 1
    return x, iterations, float(np.linalg.norm(residual) / scale)


def main() -> None:
    """Times, residual at the given solution, own solution."""
    data = dict(np.load(sys.argv[1]))
    system, order = build(data)
    omega = float(data["omega"])
    x = np.append(vector_of(data["solution"], order), omega)
    scale = float(np.linalg.norm(data["load"]))
    jacobian = system.Jacobian(x)[0]
    found, iterations, residual = newton(system, np.append(vector_of(data["nearby"], order), omega), scale)
    coefficients = found[:-1].reshape(data["load"].shape[1], -1)
    monitor = coefficients @ data["monitor"][order]
    result = {
        "residual_seconds": timed(lambda: system.Residual(x)),
        "jacobian_seconds": timed(lambda: system.Jacobian(x)),
        "step_seconds": timed(lambda: np.linalg.solve(jacobian, x[:-1])),
        "residual_at_our_solution": float(np.linalg.norm(system.Residual(x)) / scale),
        "iterations": iterations,
        "residual": residual,
        "amplitude": float(np.hypot(monitor[1], monitor[2])),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
