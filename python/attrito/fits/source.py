"""What measurements are compared with: solutions of a job at values of a fit's parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.data import Data
from attrito.fits.design import Fit
from attrito.job.job import Job
from attrito.job.varied import is_of_model, with_values
from attrito.runs.progress import Progress
from attrito.studies.samples import Samples, shared_scene

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# By column: values `[n]`, NaN where there is no solution; derivatives `[n, parameters]`, NaN where none is exact
Solved = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]


class Source:
    """Of one set of measurements.

    Parameters
    ----------
    comm : ranks
    fit, data : what is looked for, and what was measured
    job : of the data
    progress : takes the messages of the reduction
    """

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        self._comm, self._fit, self._data, self._job = comm, fit, data, job

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """At values of the parameters, exact derivatives where they are asked for and known. Collective."""
        raise NotImplementedError

    def changed(self, values: np.ndarray) -> Job:
        """The job there."""
        pairs = list(zip(self._fit.parameters, values.tolist(), strict=True))
        return with_values(self._job, pairs, self._fit.path, "parameter", self._data.is_excited)

    def unknown_rates(self) -> dict[str, np.ndarray]:
        """NaN in place of derivatives."""
        measured = self._data.measured
        return {name: np.full((len(measured.at), len(self._fit.parameters)), np.nan) for name in measured.values}


def samples_of(kind: type[Samples], comm: Comm, fit: Fit, job: Job, progress: Progress) -> Samples:
    """Solves jobs that differ in a fit's parameters, reduced once for all where these leave the model alone."""
    keeps_places = not any(is_of_model(key) for parameter in fit.parameters for key in parameter.keys)
    base, rom = shared_scene(comm, job, keeps_places, progress, comm.rank == 0)
    return kind(comm, base, rom)
