"""Solutions beside measurements: a response at the frequencies measured, a mode at the amplitudes measured.

Derivatives of a response by numbers of contact laws and by the last factors on static loads are exact
(`attrito.library.family`); everything else is differentiated by differences.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.design import Data, Fit
from attrito.fits.rates import Solvable, amplitude_slopes, rates_of
from attrito.job.job import Job
from attrito.job.varied import is_of_model, places, with_values
from attrito.library.family import Family
from attrito.library.session import Solver
from attrito.runs.progress import Progress
from attrito.studies.sample_modes import SampleModes
from attrito.studies.samples import shared_scene
from attrito.support.errors import NumericsError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Part of a parameter, or of the width between its bounds, that differences move it by: above what points are solved to
STEP = 1e-4

# By column: values `[n]`, NaN where there is no solution; derivatives `[n, parameters]`, NaN where none is exact
Solved = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]


class Solution(SampleModes):
    """What one set of measurements is compared with, at any values of the parameters.

    Parameters
    ----------
    comm : ranks
    fit, data : what is looked for, and what was measured
    job : of the data
    progress : takes the messages of the reduction
    """

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        keeps_places = not any(is_of_model(key) for parameter in fit.parameters for key in parameter.keys)
        base, rom = shared_scene(comm, job, keeps_places, progress, comm.rank == 0)
        super().__init__(comm, base, rom)
        self._fit, self._data, self._job = fit, data, job

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

    def at(self, values: np.ndarray) -> Solved:
        """Solve at values of the parameters; differences fill in what is not exact. Collective."""
        found, rates = self._solve(values, derivatives=True)
        for i, parameter in enumerate(self._fit.parameters):
            if all(np.all(np.isfinite(columns[:, i]) | ~np.isfinite(found[name])) for name, columns in rates.items()):
                continue
            step = STEP * (abs(values[i]) if parameter.log else parameter.high - parameter.low)
            beside = values.copy()
            # Into the bounds
            beside[i] += step if values[i] + step <= parameter.high else -step
            there, _ = self._solve(beside, derivatives=False)
            for name, columns in rates.items():
                columns[:, i] = (there[name] - found[name]) / (beside[i] - values[i])
        return found, rates

    def _solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        data, count = self._data, len(self._fit.parameters)
        rates = {name: np.full((len(data.measured.at), count), np.nan) for name in data.measured.values}
        if data.of == "mode":
            return self._mode(values), rates
        found, exact = self._response(values, derivatives)
        if exact is not None:
            rates["amplitude"] = exact
        return {"amplitude": found}, rates

    def _changed(self, values: np.ndarray) -> Job:
        pairs = list(zip(self._fit.parameters, values.tolist(), strict=True))
        return with_values(self._job, pairs, self._fit.path, "parameter", self._data.is_excited)

    def _at(self, values: np.ndarray) -> Solvable:
        return self.scene_of(self._changed(values))

    def _mode(self, values: np.ndarray) -> dict[str, np.ndarray]:
        rows = self.of(self._changed(values), self._data.measured.at.tolist())
        numbers = {
            name: np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float)
            for name in ("frequency_hz", "tangent_hz", "damping_ratio", "damping_ratio_structure")
        }
        return {
            "frequency_hz": numbers["frequency_hz"],
            "frequency_ratio": numbers["frequency_hz"] / numbers["tangent_hz"],
            "damping_ratio": numbers["damping_ratio"] + numbers["damping_ratio_structure"],
        }

    def _response(self, values: np.ndarray, derivatives: bool) -> tuple[np.ndarray, np.ndarray | None]:
        data, frequencies = self._data, self._data.measured.at
        reduced, load_path, options = self._at(values)
        here = reduced, load_path, options
        rates = rates_of(self._fit.parameters, values, here, self._at) if derivatives else None
        monitor = 0 if data.monitor is None else reduced.monitor_names.index(data.monitor)
        found = np.full(len(frequencies), np.nan)
        exact = None if rates is None else np.full((len(frequencies), len(values)), np.nan)
        # No static equilibrium
        with contextlib.suppress(NumericsError), Solver(self._comm, reduced, options) as solver:
            solver.follow_static_path(load_path, self._job["static"]["steps"], frequencies[0])
            family = Family(self._comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
            for i, point in enumerate(solver.solve_at(frequencies.tolist(), data.level, 0)):
                if not point.is_solved:
                    continue
                found[i] = point.amplitude[monitor]
                if exact is not None and rates is not None:
                    exact[i] = amplitude_slopes(self._comm, family, reduced, monitor, rates)
        return found, exact


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
