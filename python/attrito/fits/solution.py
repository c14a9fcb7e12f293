"""Solutions beside measurements, with their derivatives by the parameters of a fit.

What a kind of measurements does not differentiate exactly is differentiated by differences.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.backbones import Backbone
from attrito.fits.data import Data
from attrito.fits.design import Fit
from attrito.fits.loops import Loop
from attrito.fits.point_loops import PointLoop
from attrito.fits.responses import Response
from attrito.fits.source import Solved
from attrito.job.job import Job
from attrito.job.varied import places
from attrito.runs.progress import Progress
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Part of a parameter, or of the width between its bounds, that differences move it by: above what points are solved to
STEP = 1e-4
KINDS = {"response": Response, "mode": Backbone}


class Solution:
    """What one set of measurements is compared with, at any values of the parameters.

    Parameters
    ----------
    comm : ranks
    fit, data : what is looked for, and what was measured
    job : of the data
    progress : takes the messages of the reduction, and says which derivatives are differences
    """

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        of_loop = PointLoop if data.is_excited else Loop
        self._source = KINDS.get(data.of, of_loop)(comm, fit, data, job, progress)
        self._fit, self._data, self._job, self._progress = fit, data, job, progress
        self._speaks = True

    @property
    def data(self) -> Data:
        """What it is compared with."""
        return self._data

    def start(self) -> list[float | None]:
        """The parameters as the job has them; None where its places differ, or where they are factors: 1."""
        found: list[float | None] = []
        for parameter in self._fit.parameters:
            values = {container[index] for key in parameter.keys for container, index in places(self._job.tables, key)}
            found.append(1.0 if parameter.factor else float(values.pop()) if len(values) == 1 else None)
        return found

    def found(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """What is compared, by column `[n]`, without derivatives. Collective."""
        return self._source.solve(values, derivatives=False)[0]

    def at(self, values: np.ndarray) -> Solved:
        """Solve at values of the parameters; differences fill in what is not exact. Collective."""
        found, rates = self._source.solve(values, derivatives=True)
        by_differences = []
        for i, parameter in enumerate(self._fit.parameters):
            if all(np.all(np.isfinite(columns[:, i]) | ~np.isfinite(found[name])) for name, columns in rates.items()):
                continue
            by_differences.append(parameter.name)
            step = STEP * (abs(values[i]) if parameter.log else parameter.high - parameter.low)
            beside = values.copy()
            # Into the bounds
            beside[i] += step if values[i] + step <= parameter.high else -step
            there, _ = self._source.solve(beside, derivatives=False)
            for name, columns in rates.items():
                columns[:, i] = (there[name] - found[name]) / (beside[i] - values[i])
        self._say(by_differences)
        return found, rates

    def _say(self, by_differences: list[str]) -> None:
        """Once which derivatives take further solutions; a loop's cost nothing."""
        if self._speaks and by_differences and not isinstance(self._source, Loop):
            words = f"derivatives by {', '.join(by_differences)} are differences, a further solution each"
            self._progress.say(f"{self._data.name}: {words}")
        self._speaks = False


def solutions_of(comm: Comm, fit: Fit, jobs: list[Job], progress: Progress) -> list[Solution]:
    """One for each set of measurements."""
    return [Solution(comm, fit, data, job, progress) for data, job in zip(fit.data, jobs, strict=True)]


def start_of(comm: Comm, fit: Fit, solutions: list[Solution]) -> np.ndarray:
    """Where the search begins: a parameter's own start, what the first job has, or the middle between its bounds."""

    def work() -> np.ndarray:
        own = solutions[0].start()
        values = []
        for parameter, given in zip(fit.parameters, own, strict=True):
            value = given if parameter.start is None else parameter.start
            if value is None or not parameter.low <= value <= parameter.high:
                value = parameter.value(0.5 * (parameter.scaled(parameter.low) + parameter.scaled(parameter.high)))
            values.append(value)
        return np.array(values)

    return on_root(comm, work)
