"""How the sliders that a static load path leaves change with parameters of a job: for points that begin at them.

The path is followed again with each parameter a little smaller and larger. It is a sequence of equilibria, each
beginning with the sliders of the one before; as long as the same contacts slip in the same steps its end is smooth in
the parameters, and two central differences, extrapolated, leave the fourth power of the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.job.sensitivity import Parameter
from attrito.library.family import Family
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.scene.build import laws_of
from attrito.scene.scene import Scene
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Part of a parameter that it is changed by: with residuals of 1e-13 rounding is 1e-9 of the change
STEP, RESIDUAL = 1e-4, 1e-13


@dataclass(frozen=True)
class LoadPath:
    """How a job comes to its static solution.

    Parameters
    ----------
    options : of the solver
    corners : factors on the static loads, `[corners, loads]`
    frequency_hz : that its points begin at
    """

    options: Options
    corners: np.ndarray
    frequency_hz: float


def slider_rates(
    comm: Comm, job: Job, scene: Scene | None, reduced: ReducedScene, parameters: list[Parameter], path: LoadPath
) -> np.ndarray:
    """Derivatives of the sliders by parameters, `[parameters, nc, width]`. Collective; `scene` at the root."""
    found = []
    for parameter in parameters:
        slopes = []
        for step in (STEP, 2.0 * STEP):
            ends, change = [], 1.0
            for side in (-1.0, 1.0):
                there, corners, change = on_root(
                    comm,
                    lambda: _moved(job, scene, reduced, parameter, path.corners, side * step),  # noqa: B023
                )
                ends.append(end_sliders(comm, job["static"]["steps"], there, path, corners))
            slopes.append((ends[1] - ends[0]) / (2.0 * change))
        found.append((4.0 * slopes[0] - slopes[1]) / 3.0)
    return np.array(found)


def _moved(
    job: Job, scene: Scene, reduced: ReducedScene, parameter: Parameter, corners: np.ndarray, part: float
) -> tuple[ReducedScene, np.ndarray, float]:
    """What is solved where a parameter differs by a part of its scale; the absolute change."""
    if parameter.key in scene.static:
        corners = corners.copy()
        corners[:, list(scene.static).index(parameter.key)] *= 1.0 + part
        return reduced, corners, abs(part)
    if not parameter.places:
        return reduced, corners, abs(part)
    value = parameter.value(job)
    scale = abs(value) if value and np.isfinite(value) else _scale(reduced, parameter)
    laws = laws_of(parameter.moved(job, part * scale), scene.contacts)
    return replace(reduced, laws=laws), corners, abs(part) * scale


def _scale(reduced: ReducedScene, parameter: Parameter) -> float:
    """Of a parameter that is zero, or not alike everywhere: of gaps and preloads, by the forces."""
    force = max([1e-30, *np.abs(reduced.static).ravel(), *np.abs(reduced.laws["preload"])])
    if parameter.key == "preload":
        return float(force)
    if parameter.key == "gap":
        return float(force / np.max(reduced.laws["normal_stiffness"]))
    numbers = reduced.laws.get(parameter.key)
    return 1.0 if numbers is None else float(np.min(np.abs(numbers[numbers != 0.0]), initial=1.0))


def end_sliders(
    comm: Comm, steps: int, scene: ReducedScene, path: LoadPath, corners: np.ndarray | None = None
) -> np.ndarray:
    """Sliders at the end of a path taken in so many steps, `[nc, width]`; at other `corners`, if given. Collective."""
    corners = path.corners if corners is None else corners
    options = replace(path.options, tolerance=min(path.options.tolerance, RESIDUAL))
    with Solver(comm, scene, options) as solver:
        solver.follow_static_path(corners, steps, path.frequency_hz)
        return sliders_at(comm, solver, scene)


def sliders_at(comm: Comm, solver: Solver, scene: ReducedScene) -> np.ndarray:
    """Sliders of the solver's last point, `[nc, width]`. Collective."""
    family = Family(comm, solver, len(scene.laws["tangents"]), len(scene.monitors))
    member = family.visit(lambda family: family.describe())
    return on_root(comm, lambda: np.array(member.slider))  # type: ignore[union-attr]
