"""Derivatives of a run's points by parameters of its job: found as each point is solved.

At a point's frequency, with the sliders of contacts that never slip held where they are, directly or by the adjoint:
`src/sensitivity/parameter_derivatives.f90`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.job.laws import LAW_KEYS
from attrito.job.sensitivity import Parameter, parameters_of
from attrito.library.family import Family
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Point, Solver
from attrito.runs.recorder import Recorder
from attrito.scene.build import laws_of
from attrito.scene.scene import Scene
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# What a parameter changes: laws `[nc, 5]` in the order of `LAW_KEYS`, factors on static loads, the level
Rates = tuple[np.ndarray, np.ndarray, float]

SOLVED = ("converged", "above_tolerance", "unstable", "indeterminate")
SERIES = {
    name: Series(
        "real64",
        f"derivative of the monitors' {name} by each parameter of [sensitivity] to, at the point's frequency and with"
        " the sliders of contacts that never slip held; NaN: none",
        f"{name} per unit of the parameter",
    )
    for name in ("amplitude", "mean")
} | {
    "value": Series(
        "real64", "the parameters, in the order of [sensitivity] to; NaN: its contacts differ", "each its own"
    ),
    "frequency_hz": Series(
        "real64",
        "derivative of the frequency by each parameter of [sensitivity] to; NaN: none, as of rigid-body modes",
        "Hz per unit of the parameter",
    ),
}


class Differentiator:
    """Derivatives at one point after another.

    Parameters
    ----------
    comm, solver : what solves
    job, scene, reduced : what is solved; `scene` at the root
    """

    def __init__(self, comm: Comm, solver: Solver, job: Job, scene: Scene | None, reduced: ReducedScene):
        self._solver, self._root, self._monitors = solver, comm.rank == 0, len(reduced.monitors)
        self._family = Family(comm, solver, len(reduced.laws["tangents"]), self._monitors)
        parameters = parameters_of(job)
        self._values = np.array([one.value(job) for one in parameters])
        rates: list[Rates] = on_root(comm, lambda: [rates_of(job, scene, one) for one in parameters])
        self._rates = [np.array(column) for column in zip(*rates, strict=True)]

    def visit(self, point: Point, recorder: Recorder) -> None:
        """Add the derivatives at the point where the solver stands to its record. Collective."""
        if not self._rates:
            return
        amplitude, mean = self.derivatives(point)
        if self._root:
            here = np.where(self._rates[2] != 0.0, point.level, self._values)
            for name, values in (("amplitude", amplitude), ("mean", mean), ("value", here)):
                recorder.add(f"/sensitivity/{name}", SERIES[name], values)

    def derivatives(self, point: Point, preload: float = 1.0) -> np.ndarray:
        """Of amplitudes and means at the point where the solver stands, `[2, parameters, monitors]` on the root.

        `preload`: factor on the load path. NaN where the point is not solved, or is singular. Collective.
        """
        found = np.full((2, len(self._values), self._monitors), np.nan)
        if self._rates and point.outcome in SOLVED:
            self._family.visit(lambda family: self._fill(family, preload, *found))
        return found

    def _fill(self, family: Family, preload: float, amplitude: np.ndarray, mean: np.ndarray) -> None:
        """Directly or by the adjoint, whichever takes fewer linear systems."""
        if family.describe() is None:
            return
        laws, factors, level = self._rates
        factors = preload * factors
        if len(level) <= 2 * self._monitors:
            if (direct := family.differentiate_directly(laws, factors, level)) is not None:
                amplitude[:], mean[:] = direct
        elif (gradient := family.differentiate_by_adjoint(factors.shape[1])) is not None:
            by_laws, by_factors, by_level = gradient
            amplitude[:], mean[:] = (
                np.tensordot(laws, by_laws[kind], axes=([1, 2], [1, 2]))
                + factors @ by_factors[kind].T
                + np.outer(level, by_level[kind])
                for kind in range(2)
            )


def rates_of(job: Job, scene: Scene, parameter: Parameter) -> Rates:
    """What a parameter changes of a scene."""
    here = scene.contacts.laws
    laws = np.zeros((len(here["tangents"]), len(LAW_KEYS)))
    factors = np.zeros(len(scene.static))
    if parameter.places:
        # Laws are linear in each of their numbers: any change gives the rate.
        change = abs(parameter.value(job)) if parameter.value(job) else 1.0
        change = change if np.isfinite(change) else 1.0
        there = laws_of(parameter.moved(job, change), scene.contacts)
        laws[:] = np.column_stack([(there[key] - here[key]) / change for key in LAW_KEYS])
    elif parameter.key:
        number = list(scene.static).index(parameter.key)
        factors[number] = scene.load_path[-1, number] if len(scene.load_path) else 1.0
    return laws, factors, float(parameter.name == "level")
