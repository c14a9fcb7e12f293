"""`attrito fit`: parameters of a job that bring its solutions nearest to measurements, into one HDF5 file.

Every evaluation is kept beside the file until the fit has ended: one that is started again takes the same steps and
solves only what is new.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc

from attrito.fits.design import Fit, read_fit
from attrito.fits.estimate import Estimate, Profile, estimate, profile
from attrito.fits.file import write_fit
from attrito.fits.found import Found
from attrito.fits.measured import Measured
from attrito.fits.solution import solutions_of, start_of
from attrito.fits.source import Solved
from attrito.fits.table import FORMAT
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.results.journal import Journal, Record, check_own, read_journal, remove_journals, set_aside
from attrito.runs.progress import Progress
from attrito.support.errors import NumericsError, UnsolvedError
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Deviations that a number without a solution counts as: so many that no step ends there
UNSOLVED = 1e3


def run_fit(comm: Comm, path: str | Fit) -> str:
    """Fit a job's parameters to measurements; returns the file's path.

    Raises
    ------
    InputError : the fit, a job or a measurement is at fault
    NumericsError : nothing is solved where the search begins
    UnsolvedError : the search did not end at a minimum; what it came to is in the file
    """
    progress = Progress(comm)
    fit = on_root(comm, lambda: read_fit(path))
    jobs = on_root(comm, lambda: [read_job(one.job, excited=one.is_excited) for one in fit.data])
    on_root(comm, lambda: fit.check(jobs))
    with writing_alone(comm, fit.file, fit.picture), contextlib.closing(_Kept(comm, fit, jobs)) as kept:
        found = _Search(comm, fit, jobs, progress, kept).run()
        on_root(comm, lambda: write_fit(fit, jobs, found))
        on_root(comm, lambda: remove_journals(fit.kept, FORMAT))
    for line in found.lines():
        progress.say(line)
    progress.warn(found.warnings())
    progress.say(fit.file)
    if not found.best.converged:
        raise UnsolvedError(fit.file, "the search stopped before it came to a minimum")
    return fit.file


class _Search:
    """The search for the parameters. All ranks take it in step: what decides comes from the root."""

    def __init__(self, comm: Comm, fit: Fit, jobs: list[Job], progress: Progress, kept: _Kept):
        self._comm, self._fit, self._progress = comm, fit, progress
        self._solutions = solutions_of(comm, fit, jobs, progress)
        self._bounds = np.array([[one.scaled(one.low), one.scaled(one.high)] for one in fit.parameters])
        self._kept = kept
        self._count, self._speaks = 0, True

    def run(self) -> Found:
        """The best of the searches from all starts."""
        fit = self._fit
        first = start_of(self._comm, fit, self._solutions)
        best: Estimate | None = None
        for start in self._starts(first):
            if best is None and not all(np.all(np.isfinite(r)) for r in self._found_at(start)):
                where = self._named(start)
                raise NumericsError(f"{fit.path}: some measurements have no solution at {where}; give another start")
            one = estimate(self._residuals, start, self._bounds, fit.noise == "given")
            if best is None or one.residuals @ one.residuals < best.residuals @ best.residuals:
                best = one
        assert best is not None
        profiles: list[Profile] = []
        if fit.profile and len(best.residuals) > len(best.x):
            self._speaks = False
            for i, parameter in enumerate(fit.parameters):
                self._progress.say(f"profile of {parameter.name}, after {self._count} evaluations")
                profiles.append(profile(self._residuals, best, self._bounds, i))
        values = self._values(best.x)
        return Found(fit, first, values, best, profiles, self._bounds, [found for found, _ in self._solve(values)])

    def _starts(self, first: np.ndarray) -> list[np.ndarray]:
        """The fit's own start, then others spread between the bounds; scaled."""
        fit = self._fit
        own = np.array([one.scaled(value) for one, value in zip(fit.parameters, first, strict=True)])
        if fit.starts == 1:
            return [own]
        unit = qmc.LatinHypercube(len(own), seed=np.random.default_rng(fit.seed)).random(fit.starts - 1)
        low, high = self._bounds.T
        return [own, *(low + unit * (high - low))]

    def _found_at(self, x: np.ndarray) -> list[np.ndarray]:
        return [
            one.data.measured.residuals(found, one.data.weight)
            for one, (found, _) in zip(self._solutions, self._solve(self._values(x)), strict=True)
        ]

    def _residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their Jacobian by scaled parameters."""
        values = self._values(self._comm.bcast(x))
        parts, slopes = [], []
        for one, (found, rates) in zip(self._solutions, self._solve(values), strict=True):
            parts.append(one.data.measured.residuals(found, one.data.weight))
            slopes.append(one.data.measured.slopes(found, rates, one.data.weight))
        residuals, jacobian = np.concatenate(parts), np.concatenate(slopes)
        jacobian *= [one.rate(value) for one, value in zip(self._fit.parameters, values, strict=True)]
        lost = ~np.isfinite(residuals)
        residuals[lost], jacobian[lost] = UNSOLVED, 0.0
        jacobian[~np.isfinite(jacobian)] = 0.0
        self._count += 1
        if self._speaks:
            size = np.sqrt(np.mean(residuals**2))
            unsolved = f", {lost.sum()} numbers without a solution" if lost.any() else ""
            self._progress.say(f"{self._count:4d}  {self._named(x)}  residual {size:.4g}{unsolved}")
        return residuals, jacobian

    def _solve(self, values: np.ndarray) -> list[Solved]:
        known = self._kept.find(values)
        if known is None:
            known = [one.at(values) for one in self._solutions]
            self._kept.add(values, known)
        return known

    def _values(self, x: np.ndarray) -> np.ndarray:
        return np.array([one.value(scaled) for one, scaled in zip(self._fit.parameters, x, strict=True)])

    def _named(self, x: np.ndarray) -> str:
        pairs = zip(self._fit.parameters, self._values(x), strict=True)
        return ", ".join(f"{one.name} {value:.5g}" for one, value in pairs)


class _Kept:
    """Evaluations in a journal, a record each, by the values they belong to; that of another fit is set aside."""

    def __init__(self, comm: Comm, fit: Fit, jobs: list[Job]):
        self._comm, self._path = comm, fit.kept
        self._journal: Journal | None = None
        asked = [fit.as_table(), [job.tables for job in jobs], [_plain_measured(one.measured) for one in fit.data]]
        text = json.dumps(asked, sort_keys=True, default=str)
        self._of = hashlib.sha256(text.encode()).hexdigest()
        self._known: dict[str, list[Solved]] = on_root(comm, self._read)

    def find(self, values: np.ndarray) -> list[Solved] | None:
        """What is known of some values, copied."""
        known = self._known.get(_key(values))
        return None if known is None else [_copied(one) for one in known]

    def add(self, values: np.ndarray, solved: list[Solved]) -> None:
        """Keep an evaluation."""
        solved = self._comm.bcast(solved)
        self._known[_key(values)] = [_copied(one) for one in solved]

        note = {"at": _key(values), "solved": [_plain(one) for one in solved]}
        on_root(self._comm, lambda: self._journal.append(Record(note)))

    def close(self) -> None:
        """Closing twice does no harm."""
        if self._journal is not None:
            self._journal.close()

    def _read(self) -> dict[str, list[Solved]]:
        known: dict[str, list[Solved]] = {}
        first = {"attributes": {"format": FORMAT}, "fit": self._of}
        whole = list(read_journal(self._path)) if check_own(self._path, FORMAT) else []
        if not whole or whole[0][0].note != first:
            if whole:
                set_aside(self._path, FORMAT)
            self._journal = Journal(self._path)
            self._journal.append(Record(first))
            return known
        self._journal = Journal(self._path, whole[-1][1])
        for record, _ in whole[1:]:
            solved = record.note["solved"]
            known[record.note["at"]] = [(_arrays(found), _arrays(rates)) for found, rates in solved]
        return known


def _key(values: np.ndarray) -> str:
    return " ".join(float(value).hex() for value in values)


def _copied(solved: Solved) -> Solved:
    found, rates = solved
    return {name: values.copy() for name, values in found.items()}, {name: v.copy() for name, v in rates.items()}


def _plain(solved: Solved) -> list[dict[str, list]]:
    return [{name: values.tolist() for name, values in part.items()} for part in solved]


def _arrays(columns: dict[str, list]) -> dict[str, np.ndarray]:
    return {name: np.array(values, dtype=float) for name, values in columns.items()}


def _plain_measured(measured: Measured) -> list:
    columns = (
        {name: values.tolist() for name, values in part.items()}
        for part in (measured.values, measured.deviations, measured.beside)
    )
    return [measured.at.tolist(), *columns, measured.relative, measured.centred]
