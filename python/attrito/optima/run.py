"""`attrito optimise`: values of a job's keys at which its largest peak is least, into one HDF5 file.

A peak's derivative by a parameter is that of the amplitude at the peak's frequency: along the frequency response the
amplitude does not change there to first order.
"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.job.varied import is_of_model, with_values
from attrito.library.family import Family
from attrito.library.peak_tracker import Peak
from attrito.library.session import Solver
from attrito.optima.design import Optimum, read_optimum
from attrito.optima.search import Least, least
from attrito.optima.table import FORMAT
from attrito.runs.progress import Progress
from attrito.studies.rates import Solvable, amplitude_slopes, known_rates, rates_of
from attrito.studies.sample_peaks import SamplePeaks
from attrito.studies.samples import shared_scene
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import UnsolvedError
from attrito.support.hdf5_writing import described
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


def run_optimum(comm: Comm, path: str | Optimum) -> str:
    """Search; returns the file's path.

    Raises
    ------
    InputError : the file or the job is at fault
    UnsolvedError : the search did not end by its tolerance; what it came to is in the file
    """
    progress = Progress(comm)
    asked = on_root(comm, lambda: read_optimum(path))
    job = on_root(comm, lambda: read_job(asked.job))
    on_root(comm, lambda: asked.check(job))
    with writing_alone(comm, asked.file), contextlib.closing(_Peaks(comm, asked, job, progress)) as peaks:
        found = least(peaks.at, len(asked.parameters), asked.most, asked.tolerance, asked.seed)
        values = peaks.values(found.x)
        on_root(comm, lambda: _write(asked, job, found, peaks))
    for parameter, value in zip(asked.parameters, values, strict=True):
        at_end = {parameter.low: " (its bound low)", parameter.high: " (its bound high)"}
        progress.say(f"{parameter.name}  {value:.6g}{at_end.get(value, '')}")
    progress.say(f"largest {asked.objective} {found.value:.6g}, after {len(found.tried)} samples")
    if peaks.inexact:
        progress.warn(
            [
                f"peaks of {peaks.inexact} of {len(found.tried)} samples have an estimated error above [balance]"
                f" tolerance = {job['balance']['tolerance']:g}"
            ]
        )
    progress.say(asked.file)
    if not found.converged:
        raise UnsolvedError(asked.file, f"the search did not come to its end within {asked.most} samples")
    return asked.file


class _Peaks(SamplePeaks):
    """Peaks at all levels with their derivatives by scaled parameters."""

    def __init__(self, comm: Comm, asked: Optimum, job: Job, progress: Progress):
        keeps_places = not any(is_of_model(key) for parameter in asked.parameters for key in parameter.keys)
        base, rom = shared_scene(comm, job, keeps_places, progress, comm.rank == 0)
        super().__init__(comm, base, rom)
        self._asked, self._job, self._progress = asked, job, progress
        self._values = np.empty(0)
        self.count = 0
        self._has_spoken = False
        # Samples with a peak whose estimated error is above the tolerance
        self.inexact = 0

    def values(self, x: np.ndarray) -> np.ndarray:
        """Parameters at a point between 0 and 1."""
        ends = [(one.scaled(one.low), one.scaled(one.high)) for one in self._asked.parameters]
        return np.array(
            [
                one.value(low + part * (high - low))
                for one, part, (low, high) in zip(self._asked.parameters, x, ends, strict=True)
            ]
        )

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Objective by level, and its gradients."""
        asked = self._asked
        values = self.values(self._comm.bcast(x))
        self._values = values
        rows = self.of(self._changed(values), list(asked.levels))
        amplitude = np.array([np.nan if row["amplitude"] is None else row["amplitude"] for row in rows])
        ends = np.array([one.scaled(one.high) - one.scaled(one.low) for one in asked.parameters])
        slopes = np.array([row["slopes"] for row in rows]) * ends
        slopes *= [one.rate(value) for one, value in zip(asked.parameters, values, strict=True)]
        scale = np.array(asked.levels) if asked.objective == "amplitude_per_level" else np.ones(len(rows))
        self.count += 1
        self.inexact += any(row["outcome"] == "above_tolerance" for row in rows)
        named = ", ".join(f"{one.name} {value:.5g}" for one, value in zip(asked.parameters, values, strict=True))
        self._progress.say(f"{self.count:4d}  {named}  {asked.objective} {np.max(amplitude / scale):.6g}")
        return amplitude / scale, slopes / scale[:, np.newaxis]

    def visit(self, solver: Solver, peak: Peak | None, place: tuple[int, int], here: Solvable) -> dict[str, Any]:
        """Derivatives of a peak, the solver being there."""
        count = len(self._asked.parameters)
        if peak is None or count == 1:
            return {"slopes": np.full(count, np.nan)}
        reduced = here[0]
        family = Family(self._comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
        rates = rates_of(
            self._asked.parameters, self._values, here, lambda values: self.scene_of(self._changed(values))
        )
        slopes = amplitude_slopes(self._comm, family, reduced, place[0], rates)
        unknown = [one.name for one, known in zip(self._asked.parameters, known_rates(rates), strict=True) if not known]
        if unknown and not self._has_spoken:
            words = f"derivatives by {', '.join(unknown)} are differences, a further sample each"
            self._progress.say(words)
        self._has_spoken = True
        return {"slopes": slopes}

    def _changed(self, values: np.ndarray) -> Job:
        pairs = list(zip(self._asked.parameters, values.tolist(), strict=True))
        return with_values(self._job, pairs, self._asked.path, "parameter")


def _write(asked: Optimum, job: Job, found: Least, peaks: _Peaks) -> None:
    Path(asked.file).parent.mkdir(parents=True, exist_ok=True)
    tried = np.array([peaks.values(row[:-1]) for row in found.tried])
    own = "that of the job's key, or a factor on it"
    with whole_hdf5(asked.file) as file:
        file.attrs["format"], file.attrs["format_version"] = FORMAT, 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = (
            "Parameters of a job at which its largest peak is least; see docs/how-to/optima.md of attrito"
        )
        file.attrs.update(job.attributes)
        keys: dict[str, Any] = {name: value for name, value in vars(asked).items() if name not in ("parameters", "job")}
        file.attrs["optimum"] = json.dumps(keys | {"parameters": [vars(one) for one in asked.parameters]}, default=str)
        unit = "user length"
        described(file, "value", f"largest {asked.objective} there", unit, data=found.value)
        described(file, "tried/value", f"largest {asked.objective}, NaN: no peak", unit, data=found.tried[:, -1])
        for i, (parameter, value) in enumerate(zip(asked.parameters, peaks.values(found.x), strict=True)):
            described(file, f"parameters/{parameter.name}", ", ".join(parameter.keys), own, data=value)
            described(file, f"tried/parameters/{parameter.name}", "in the order of the search", own, data=tried[:, i])
