"""A response at the frequencies measured.

Derivatives by numbers of contact laws, by the last factors on static loads and by damping (ratio, loss factor, a part
of the mass) are exact (`attrito.library.family`), those by everything else differences. Of a first harmonic
q(t) = c cos(omega t) + s sin(omega t), q_1 = c - i s,

    d|q_1| = (c dc + s ds) / |q_1|,     d arg q_1 = (s dc - c ds) / |q_1|^2.
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
from attrito.studies.rates import Solvable, monitor_slopes, rates_of
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
        rates = rates_of(self._fit.parameters, values, here, self._at) if derivatives else None
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
                if rates is None:
                    continue
                kinds = ("amplitude",) if keys["quantity"] == RANGE else ("first_cosine", "first_sine")
                parts = monitor_slopes(self._comm, family, reduced, monitor, rates, kinds)
                for name, slope in self._slopes(point, monitor, parts).items():
                    if name in slopes:
                        slopes[name][i] = slope
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

    def _slopes(self, point: Point, monitor: int, parts: np.ndarray) -> dict[str, np.ndarray]:
        """Derivatives of these, `[parameters]` each, `parts` being those of the half range, or of c and s."""
        if len(parts) == 1:
            return {"amplitude": parts[0]}
        _, c, s = point.harmonics[monitor][:3]
        size = self._numbers(point, monitor)["amplitude"]
        relative, turn = (np.array(row) @ parts / (c**2 + s**2) for row in ((c, s), (s, -c)))
        return {"amplitude": size * relative, "phase_deg": np.degrees(turn)}
