"""Hysteresis loops of a solved point: relative displacement and tangential force over a period, from the structure.

When the record begins is not known, nor what its zeros are: the solution is turned until the first harmonics of both
displacements have one phase, and both columns are compared up to a constant.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.data import Data
from attrito.fits.design import Fit
from attrito.fits.source import Solved, Source, samples_of
from attrito.job.job import Job
from attrito.library.kernels import contact_at_instants
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.library.structures import make_law
from attrito.results.loops import main_direction
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene
from attrito.studies.samples import Samples
from attrito.support.errors import NumericsError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Of a period, between which forces are taken as straight: errors near (pi / SAMPLES)^2 / 2 of their size
SAMPLES = 2048


class PointLoop(Source):
    """Of one contact, or of all of a set together, at one frequency and level."""

    def __init__(self, comm: Comm, fit: Fit, data: Data, job: Job, progress: Progress):
        super().__init__(comm, fit, data, job, progress)
        self._samples = samples_of(Samples, comm, fit, job, progress)
        table, index = data.place()
        row = index + (len(job["contact"]) if table == "contact_set" else 0)
        self._contacts = on_root(comm, lambda: np.flatnonzero(build_scene(job).contacts.tables == row))

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """See `Source.solve`."""
        keys, measured = self._data.keys, self._data.measured
        reduced, load_path, options = self._samples.scene_of(self.changed(values))
        found = {name: np.full(len(measured.at), np.nan) for name in measured.values}
        # No static equilibrium
        with contextlib.suppress(NumericsError), Solver(self._comm, reduced, options) as solver:
            frequency = keys["frequency_hz"]
            solver.follow_static_path(load_path, self._job["static"]["steps"], frequency)
            (point,) = solver.solve_at([frequency], keys["level"], 0)
            if point.is_solved:
                found = self._loop(solver, reduced, point)
        return found, self.unknown_rates()

    def _loop(self, solver: Solver, reduced: ReducedScene, point: Point) -> dict[str, np.ndarray]:
        """At the instants of the record. Collective."""
        heard: dict[str, np.ndarray] = {}
        solver.report_point((lambda path, _, values: heard.update({path: values})) if self._comm.rank == 0 else None)

        def work() -> dict[str, np.ndarray]:
            displacement, force = self._over_a_period(reduced, heard)
            monitor = self._data.keys["monitor"]
            if monitor is not None:
                displacement = _series(point.harmonics[reduced.monitor_names.index(monitor)])
            measured = self._data.measured
            turns = measured.beside["turns"]
            ahead = _phase(measured.values["displacement"], turns) - _phase(displacement, _grid())
            there = (turns + ahead) % 1.0
            names = ("displacement", "tangential_force")
            return {
                name: np.interp(there, _grid(), whole, period=1.0)
                for name, whole in zip(names, (displacement, force), strict=True)
            }

        return on_root(self._comm, work)

    def _over_a_period(self, reduced: ReducedScene, heard: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Mean displacement and summed force of the contacts, along the direction they move in most, `[SAMPLES]`."""
        laws = reduced.laws
        tangents = int(laws["tangents"][self._contacts[0]])
        motion, force = np.zeros((tangents, SAMPLES)), np.zeros((tangents, SAMPLES))
        for contact in self._contacts:
            coefficients = heard["/contacts/displacement"][contact][[*range(tangents), 2]]
            slider = heard["/contacts/slider"][contact]
            u, t = contact_at_instants(make_law(laws, contact), coefficients, slider, SAMPLES)
            motion, force = motion + u[:tangents] / len(self._contacts), force + t[:tangents]
        along = main_direction(motion)
        return along @ motion, along @ force


def _grid() -> np.ndarray:
    """Instants of a period as parts of it."""
    return np.arange(SAMPLES) / SAMPLES


def _series(coefficients: np.ndarray) -> np.ndarray:
    """Values `[SAMPLES]` of coefficients `[2 H + 1]`."""
    harmonics = np.arange(1, len(coefficients) // 2 + 1)
    angles = 2.0 * np.pi * np.outer(harmonics, _grid())
    return np.asarray(coefficients[0] + coefficients[1::2] @ np.cos(angles) + coefficients[2::2] @ np.sin(angles))


def _phase(values: np.ndarray, turns: np.ndarray) -> float:
    """Phase of the first harmonic, parts of a period, by least squares."""
    angles = 2.0 * np.pi * turns
    basis = np.column_stack([np.ones(len(turns)), np.cos(angles), np.sin(angles)])
    _, cosine, sine = np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(np.arctan2(-sine, cosine) / (2.0 * np.pi))
