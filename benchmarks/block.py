"""A plane-stress block on friction contacts: cost of a sweep against the number of contacts.

A steel block of four-node elements stands on one-tangent contacts to ground along its lower edge, is pressed from above
and shaken along its upper edge. It is reduced onto its contact dofs and some fixed-interface modes, and swept through
its first stuck resonance at a force that makes part of the contacts slip.

    .venv/bin/python benchmarks/block.py --contacts 10 30 100 --harmonics 5 > block.json

Prints JSON: for each size the milliseconds a point and a Newton iteration, and the states of the contacts at the peak.
"""

from __future__ import annotations

import argparse
import json
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from attrito.solver import Options, ReducedScene, Solver

YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0
LENGTH, HEIGHT, THICKNESS = 1.0, 0.25, 0.01
CONTACT_STIFFNESS, FRICTION = 2.0e9, 0.3
PRELOAD = 1.0e5


def element() -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass `[8, 8]` of a unit-square four-node element in plane stress, per thickness and density."""
    gauss = np.array([-1.0, 1.0]) / np.sqrt(3.0)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    law = np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]]) * YOUNG / (1 - POISSON**2)
    stiffness, mass = np.zeros((2, 8, 8))
    for r in gauss:
        for s in gauss:
            shape = 0.25 * (1 + signs[:, 0] * r) * (1 + signs[:, 1] * s)
            gradient = 0.5 * np.array([signs[:, 0] * (1 + signs[:, 1] * s), signs[:, 1] * (1 + signs[:, 0] * r)])
            strain = np.zeros((3, 8))
            strain[0, 0::2], strain[1, 1::2] = gradient
            strain[2, 0::2], strain[2, 1::2] = gradient[1], gradient[0]
            stiffness += 0.25 * strain.T @ law @ strain
            mass += 0.25 * np.kron(np.outer(shape, shape), np.eye(2))
    return stiffness, mass


def block(contacts: int, modes: int) -> ReducedScene:
    """The reduced block with `contacts` contacts; square elements, so `contacts - 1` along its length."""
    along = contacts - 1
    size = LENGTH / along
    up = max(round(HEIGHT / size), 2)
    number = np.arange((along + 1) * (up + 1)).reshape(up + 1, along + 1)
    corners = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    dofs = np.stack([2 * corners, 2 * corners + 1], axis=-1).reshape(-1, 8)
    rows, columns = np.repeat(dofs, 8, axis=1).ravel(), np.tile(dofs, 8).ravel()
    unit_stiffness, unit_mass = element()
    stiffness, mass = (
        coo_matrix((np.tile(values.ravel(), len(dofs)), (rows, columns))).tocsc()
        for values in (THICKNESS * unit_stiffness, THICKNESS * DENSITY * size**2 * unit_mass)
    )
    boundary = np.concatenate([2 * number[0], 2 * number[0] + 1])
    top = number[-1]
    pressing, shaking, monitor = np.zeros((3, stiffness.shape[0]))
    pressing[2 * top + 1] = -PRELOAD / len(top)
    shaking[2 * top] = 1.0 / len(top)
    monitor[2 * top[-1]] = 1.0
    basis = craig_bampton(stiffness, mass, boundary, modes, [pressing, shaking, monitor])
    directions = np.zeros((2 * contacts, basis.shape[1]))
    directions[0::2, :contacts] = np.eye(contacts)
    directions[1::2, contacts : 2 * contacts] = -np.eye(contacts)
    share = CONTACT_STIFFNESS / contacts
    laws = {"tangents": np.ones(contacts, dtype=np.int32)}
    laws |= {name: np.full(contacts, share) for name in ("tangential_stiffness", "normal_stiffness")}
    laws |= {
        "friction_coefficient": np.full(contacts, FRICTION),
        "gap": np.zeros(contacts),
        "preload": np.zeros(contacts),
    }
    harmonic = np.zeros((3, basis.shape[1]))
    harmonic[1] = shaking @ basis
    project = lambda matrix: np.ascontiguousarray(basis.T @ (matrix @ basis))  # noqa: E731
    return ReducedScene(
        project(mass),
        project(stiffness),
        "ratio",
        0.005,
        None,
        laws,
        directions,
        (pressing @ basis)[None, :],
        harmonic,
        (monitor @ basis)[None, :],
        ["top"],
    )


def craig_bampton(stiffness, mass, boundary, modes, vectors) -> np.ndarray:
    """Basis `[n, m]`: constraint modes, fixed-interface modes, static corrections."""
    n = stiffness.shape[0]
    inside = np.setdiff1d(np.arange(n), boundary)
    factors = splu(stiffness[inside][:, inside])
    dense = eigh(
        stiffness[inside][:, inside].toarray(), mass[inside][:, inside].toarray(), subset_by_index=[0, modes - 1]
    )
    corrections = np.array([factors.solve(vector[inside]) for vector in vectors]).T
    local = np.linalg.qr(np.hstack([dense[1], corrections / np.linalg.norm(corrections, axis=0)]))[0]
    basis = np.zeros((n, len(boundary) + local.shape[1]))
    basis[boundary, : len(boundary)] = np.eye(len(boundary))
    basis[inside, : len(boundary)] = -factors.solve(stiffness[inside][:, boundary].toarray())
    basis[inside, len(boundary) :] = local
    return basis


def measure(contacts: int, harmonics: int, modes: int, options: dict) -> dict:
    """Sweep through the first stuck resonance; times of this rank's wall clock."""
    scene = block(contacts, modes)
    with Solver(MPI.COMM_WORLD, scene, Options(harmonics=harmonics, **options)) as solver:
        first = solver.linear_response(True, np.ones(1), 1)[1][0]
        peak = solver.linear_response(True, np.array([first]), 0)[0][0, 0]
        # At the stuck peak the contacts' tangents carry some kt times the motion; this level makes part of them slip.
        level = 0.5 * FRICTION * PRELOAD / (CONTACT_STIFFNESS * peak)
        solver.walk_static_path(np.array([[0.0], [1.0]]), 10, first)
        started = time.perf_counter()
        points = list(solver.sweep(0.8 * first, 1.2 * first, level, 0, 400))
        seconds = time.perf_counter() - started
    iterations = sum(point.iterations for point in points)
    highest = max(points, key=lambda point: point.amplitude[0])
    return {
        "contacts": contacts,
        "coordinates": len(scene.mass),
        "unknowns": 2 * contacts * (2 * harmonics + 1),
        "harmonics": harmonics,
        "ranks": MPI.COMM_WORLD.size,
        **options,
        "points": len(points),
        "not_converged": sum(point.outcome == "not_converged" for point in points),
        "iterations": iterations,
        "ms_per_point": 1e3 * seconds / len(points),
        "ms_per_iteration": 1e3 * seconds / iterations,
        "states_at_peak": dict(zip(("stuck", "shaken_down", "slipping", "open"), highest.states, strict=True)),
    }


def main() -> None:
    """Measure the sizes asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 30, 100])
    parser.add_argument("--harmonics", type=int, default=5)
    parser.add_argument("--modes", type=int, default=10)
    parser.add_argument("--samples", type=int, default=128)
    arguments = parser.parse_args()
    rows = [
        measure(contacts, arguments.harmonics, arguments.modes, options)
        for contacts in arguments.contacts
        for options in ({"by_events": True}, {"by_events": False, "samples": arguments.samples})
    ]
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
