"""A nonlinear mode at the amplitudes measured; its derivatives are differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.data import RULES, Data
from attrito.fits.design import Fit
from attrito.fits.source import Solved, Source, samples_of
from attrito.job.job import Job
from attrito.runs.progress import Progress
from attrito.studies.sample_modes import SampleModes

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


class Backbone(Source):
    """Of the mode that the job's `[mode]` means."""

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        super().__init__(comm, fit, data, job, progress)
        self._modes = samples_of(SampleModes, comm, fit, job, progress)

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """See `Source.solve`."""
        assert isinstance(self._modes, SampleModes)
        rows = self._modes.of(self.changed(values), self._data.measured.at.tolist())
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
        return {name: found[name] for name in self._data.measured.values}, self.unknown_rates()
