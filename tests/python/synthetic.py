"""Small meshes and result files for the tests, made without a mesher and without the solver."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from edited import summed
from scipy.optimize import brentq

from attrito.library.names import STATES
from attrito.model.model import Model

OUTCOMES = ("converged", "unstable", "indeterminate", "no_period_one_orbit", "not_converged", "above_tolerance")

HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
# Six positively oriented tetrahedra about the diagonal 0-6; faces of neighbouring cells match.
HEX_TO_TETS = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


@dataclass
class Body:
    """One meshed block: points [N, 3], connectivity in rows of points, element type."""

    kind: str
    points: np.ndarray
    connectivity: np.ndarray


def block(
    kind: str,
    counts: Sequence[int] = (2, 2, 1),
    size: Sequence[float] = (1.0, 1.0, 1.0),
    shape: Callable[[np.ndarray], np.ndarray] = lambda points: points,
) -> Body:
    """A box of `counts` cells, `kind` C3D4, C3D8, C3D10 or C3D20; `shape` maps all its nodes, mid-side ones too."""
    axes = [np.linspace(0, length, count + 1) for length, count in zip(size, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([count + 1 for count in counts])
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack(
        [number[tuple(slice(o, o + n) for o, n in zip(at, counts, strict=True))].ravel() for at in corner], axis=1
    )
    if kind in ("C3D4", "C3D10"):
        cells = cells[:, np.array(HEX_TO_TETS)].reshape(-1, 4)
    if kind in ("C3D10", "C3D20"):
        edges = np.sort(cells[:, np.array(TET_EDGES if kind == "C3D10" else HEX_EDGES)], axis=2)
        unique, place = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        cells = np.hstack([cells, len(points) + place.reshape(edges.shape[:2])])
        points = np.vstack([points, points[unique].mean(axis=1)])
    return Body(kind, shape(points), cells)


def assemble(
    bodies: Sequence[Body],
    sets: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]],
    held: Callable[[np.ndarray], np.ndarray] = lambda points: np.zeros(len(points), dtype=bool),
    seed: int | None = None,
) -> Model:
    """One model of several bodies; node ids start at 101, shuffled if a seed is given.

    `sets` maps a name to a function of (points, body number of each point) that chooses nodes; `held` chooses the
    nodes without dofs.
    """
    points = np.vstack([body.points for body in bodies])
    owner = np.repeat(np.arange(len(bodies)), [len(body.points) for body in bodies])
    ids = np.arange(len(points)) + 101
    if seed is not None:
        ids = np.random.default_rng(seed).permutation(ids)
    elements: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    start = 0
    for body in bodies:
        own = ids[start + body.connectivity]
        if body.kind in elements:
            own = np.vstack([elements[body.kind][1], own])
        elements[body.kind] = (np.arange(len(own)) + 1, own)
        start += len(body.points)
    free = np.sort(ids[~held(points)])
    return Model(
        stiffness=None,
        mass=None,
        size=3 * len(free),
        dof_node=np.repeat(free, 3),
        dof_direction=np.tile(np.array([1, 2, 3], dtype=np.int8), len(free)),
        node_ids=ids,
        coordinates=points,
        elements=elements,
        node_sets={name: np.sort(ids[choose(points, owner)]) for name, choose in sets.items()},
    )


def joint(kind: str, counts: Sequence[int] = (2, 2, 1), shape: Callable = lambda points: points, **options) -> Model:
    """Two unit boxes, one on the other, which meet at z = 1 before `shape`: sets `top` (of the lower) and `bottom`."""
    flat = [block(kind, counts), block(kind, counts, shape=lambda points: points + np.array([0, 0, 1]))]
    interface = np.concatenate([np.abs(body.points[:, 2] - 1) < 1e-9 for body in flat])
    bodies = [Body(body.kind, shape(body.points), body.connectivity) for body in flat]
    sets = {
        "top": lambda points, owner: interface & (owner == 0),
        "bottom": lambda points, owner: interface & (owner == 1),
    }
    return assemble(bodies, sets, **options)


def slider_response(frequency_hz: np.ndarray, force: float) -> np.ndarray:
    """Amplitude of a mass on a spring with one friction contact, one harmonic; for pictures only."""
    stiffness, contact, limit, damping = (2 * np.pi * 100) ** 2, 1.5e5, 30.0, 6.0

    def imbalance(amplitude: float, omega: float) -> float:
        ratio = limit / contact / amplitude
        if ratio >= 1:
            real, imaginary = contact, 0.0
        else:
            angle = np.arccos(1 - 2 * ratio)
            real = contact / np.pi * (angle - np.sin(2 * angle) / 2)
            imaginary = 4 * limit * (1 - ratio) / (np.pi * amplitude)
        return abs(stiffness + real - omega**2 + 1j * (damping * omega + imaginary)) * amplitude - force

    return np.array([brentq(imbalance, 1e-9, 1.0, args=(2 * np.pi * hertz,)) for hertz in frequency_hz])


def write_result(
    path: Path,
    frequency_hz: Sequence[float],
    monitors: dict[str, Sequence[float]],
    *,
    contacts: dict[str, np.ndarray] | None = None,
    parameters: dict[str, np.ndarray] | None = None,
    linear: dict[str, tuple[np.ndarray, np.ndarray]] | None = None,
    multipliers: dict[str, np.ndarray] | None = None,
    coordinates: np.ndarray | None = None,
    **points: Sequence,
) -> Path:
    """A `result.h5` by the schema of docs/reference/files.md.

    `monitors` gives amplitudes; means are a tenth of them, bounds NaN unless `points` carries `<name>_low`, `_high`.
    `points` overrides `level`, `branch`, `outcome` (names), `unique`, `stable`, `period`, `iterations`, `estimate`.
    """
    count = len(frequency_hz)
    filled = {
        "frequency_hz": np.asarray(frequency_hz, dtype=float),
        "level": np.asarray(points.get("level", np.ones(count)), dtype=float),
        "residual": np.full(count, 1e-11),
        "estimate": np.asarray(points.get("estimate", np.full(count, np.nan)), dtype=float),
    }
    for name, default in (("branch", 0), ("iterations", 3), ("period", 1), ("unique", -1), ("stable", -1)):
        filled[name] = np.asarray(points.get(name, np.full(count, default)), dtype=np.int32)
    outcome = points.get("outcome", ["converged"] * count)
    with summed(path) as file:
        file.attrs["format"] = "attrito result"
        file.attrs["format_version"] = 1
        file.attrs["job"] = json.dumps({"output": {"monitors": [{"name": name} for name in monitors]}})

        def put(name: str, values: np.ndarray, unit: str = "1", names: Sequence[str] = ()) -> None:
            dataset = file.create_dataset(name, data=values)
            dataset.attrs["description"] = name
            dataset.attrs["unit"] = unit
            if names:
                # Fixed-length and padded, as Fortran writes them.
                dataset.attrs["names"] = np.array([text.ljust(24) for text in names], dtype="S24")

        for name, values in filled.items():
            put(f"points/{name}", values, "Hz" if name == "frequency_hz" else "1")
        put("points/outcome", np.array([OUTCOMES.index(name) for name in outcome], dtype=np.int32), names=OUTCOMES)
        if coordinates is not None:
            put("points/coordinates", coordinates, "user length")
        for name, amplitude in monitors.items():
            amplitude = np.asarray(amplitude, dtype=float)
            put(f"monitors/{name}/amplitude", amplitude, "user length")
            put(f"monitors/{name}/mean", amplitude / 10, "user length")
            for side in ("low", "high"):
                bound = np.asarray(points.get(f"{name}_{side}", np.full(count, np.nan)), dtype=float)
                put(f"monitors/{name}/{side}", bound, "user length")
        for name, values in (contacts or {}).items():
            put(f"contacts/{name}", values, names=STATES if name == "state" else ())
        for name, values in (parameters or {}).items():
            put(f"contacts/parameters/{name}", values)
        for kind, (hertz, amplitude) in (linear or {}).items():
            put(f"linear/{kind}/frequency_hz", hertz, "Hz")
            for name in monitors:
                put(f"linear/{kind}/{name}", amplitude, "user length")
        for name, values in (multipliers or {}).items():
            names = {"method": ("monodromy", "hill"), "kind": ("floquet", "slip", "stuck")}.get(name, ())
            put(f"multipliers/{name}", values, names=names)
    return path


def contact_data(count: int, contacts: int, tangents: int = 1, seed: int = 3) -> dict[str, np.ndarray]:
    """Datasets of `/contacts`, with every state present if there is room."""
    random = np.random.default_rng(seed)
    shape = (count, contacts)
    data = {name: random.uniform(1, 2, shape) for name in ("n_mean", "n_min", "dissipated_energy")}
    for index in range(1, tangents + 1):
        data[f"t{index}_mean"] = random.uniform(-1, 1, shape)
    for name in ("n", "t1", "t2")[: tangents + 1]:
        data[f"{name}_low"], data[f"{name}_high"] = np.full(shape, np.nan), np.full(shape, np.nan)
    data["state"] = (np.arange(count * contacts).reshape(shape) % len(STATES)).astype(np.int32)
    data["open"] = np.where(data["state"] == 3, 1.0, 0.0)
    data["slip"] = np.where(data["state"] == 2, random.uniform(0.1, 1, shape), 0.0)
    data["stick"] = 1 - data["open"] - data["slip"]
    data["unique"] = np.full(shape, -1, dtype=np.int32)
    return data
