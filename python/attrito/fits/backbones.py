"""A nonlinear mode at the amplitudes measured.

Derivatives of modes by EPMC, by what those of responses are exact by, are exact (`attrito.studies.sloped_modes`);
quasi-static ones, of waves, at amplitudes of a sensor, and by everything else are differences.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.fits.data import HARMONIC, RANGE, RULES, Data
from attrito.fits.design import Fit
from attrito.fits.source import Solved, Source
from attrito.job.job import Job
from attrito.job.varied import is_of_model
from attrito.modes.at_monitor import Sensor
from attrito.runs.progress import Progress
from attrito.studies.samples import shared_scene
from attrito.studies.sloped_modes import NAMES, SlopedModes

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Backbone(Source):
    """Of the mode that the job's `[mode]` means."""

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        super().__init__(comm, fit, data, job, progress)
        keeps_places = not any(is_of_model(key) for parameter in fit.parameters for key in parameter.keys)
        base, rom = shared_scene(comm, job, keeps_places, progress, comm.rank == 0)
        self._modes = SlopedModes(comm, base, rom, fit.parameters, self.changed)
        self._sensor = _sensor(data, job)

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """See `Source.solve`."""
        rows = self._modes.at(values, self._data.measured.at.tolist(), derivatives, self._sensor)
        names = RULES[self._data.keys["rule"]]
        numbers = {
            name: np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=float)
            for name in {*names, "tangent_hz", "damping_ratio_structure"}
        }
        frequency, damping = (numbers[name] for name in names)
        found = {
            "frequency_hz": frequency,
            "frequency_ratio": frequency / numbers["tangent_hz"],
            "damping_ratio": damping + numbers["damping_ratio_structure"],
        }
        is_exact = derivatives and self._sensor is None
        rates = self._rates(rows, found, numbers["tangent_hz"]) if is_exact else self.unknown_rates()
        return {name: found[name] for name in self._data.measured.values}, rates

    def _rates(
        self, rows: list[dict[str, Any]], found: dict[str, np.ndarray], tangent_hz: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Derivatives of what is compared, `[n, parameters]` by column."""
        rates = self.unknown_rates()
        nothing = dict.fromkeys(NAMES, np.full(len(self._fit.parameters), np.nan))
        slopes = {name: np.array([row.get("slopes", nothing)[name] for row in rows]) for name in NAMES}
        ratio = slopes["frequency_hz"] / tangent_hz[:, np.newaxis]
        ratio -= (found["frequency_hz"] / tangent_hz**2)[:, np.newaxis] * slopes["tangent_hz"]
        known = {
            "frequency_hz": slopes["frequency_hz"],
            "frequency_ratio": ratio,
            "damping_ratio": slopes["damping_ratio"] + slopes["damping_ratio_structure"],
        }
        return {name: known[name] for name in rates}


def _sensor(data: Data, job: Job) -> Sensor | None:
    """What the amplitudes are of; None: Q."""
    if data.keys["monitor"] is None:
        return None
    names = [monitor["name"] for monitor in job["output"]["monitors"]]
    quantity = data.keys["quantity"]
    return Sensor(names.index(data.keys["monitor"]), None if quantity == RANGE else HARMONIC[quantity][0])
