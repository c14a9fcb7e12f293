"""A response at the frequencies measured.

Derivatives of half a monitor's range by numbers of contact laws, by the last factors on static loads and by damping
(ratio, loss factor, a part of the mass) are exact (`attrito.library.family`); those of its first harmonic, and by
everything else, are differences.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.data import HARMONIC, RANGE, Data
from attrito.fits.design import Fit
from attrito.fits.source import Solved, Source, samples_of
from attrito.job.job import Job
from attrito.library.family import Family
from attrito.library.points import Point
from attrito.library.session import Solver
from attrito.runs.progress import Progress
from attrito.studies.rates import Solvable, amplitude_slopes, rates_of
from attrito.studies.samples import Samples
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Response(Source):
    """Of one monitor at one level."""

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        super().__init__(comm, fit, data, job, progress)
        self._samples = samples_of(Samples, comm, fit, job, progress)

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """See `Source.solve`."""
        keys, frequencies = self._data.keys, self._data.measured.at
        reduced, load_path, options = here = self._at(values)
        exact = derivatives and keys["quantity"] == RANGE
        rates = rates_of(self._fit.parameters, values, here, self._at) if exact else None
        monitor = 0 if keys["monitor"] is None else reduced.monitor_names.index(keys["monitor"])
        found = {name: np.full(len(frequencies), np.nan) for name in self._data.measured.values}
        slopes = self.unknown_rates()
        # No static equilibrium
        with contextlib.suppress(NumericsError), Solver(self._comm, reduced, options) as solver:
            solver.follow_static_path(load_path, self._job["static"]["steps"], frequencies[0])
            family = Family(self._comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
            for i, point in enumerate(solver.solve_at(frequencies.tolist(), keys["level"], 0)):
                if not point.is_solved:
                    continue
                for name, value in self._numbers(point, monitor).items():
                    if name in found:
                        found[name][i] = value
                if rates is not None:
                    slopes["amplitude"][i] = amplitude_slopes(self._comm, family, reduced, monitor, rates)
        return found, slopes

    def _at(self, values: np.ndarray) -> Solvable:
        return self._samples.scene_of(self.changed(values))

    def _numbers(self, point: Point, monitor: int) -> dict[str, float]:
        """What is measured of a point; of q(t) = Re q_1 exp(i omega t) the n-th derivative is (i omega)^n q_1."""
        keys = self._data.keys
        if keys["quantity"] == RANGE:
            return {"amplitude": float(point.amplitude[monitor])}
        power, over_force = HARMONIC[keys["quantity"]]
        _, cosine, sine = point.harmonics[monitor][:3]
        value = (cosine - 1j * sine) * (2j * np.pi * point.frequency_hz) ** power
        size = abs(value) / (keys["force"] if over_force else 1.0)
        return {"amplitude": float(size), "phase_deg": float(np.degrees(np.angle(value)))}
