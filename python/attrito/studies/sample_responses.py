"""Frequency responses of a study's samples, each at frequencies that follow its peak.

A sample's response is solved at

    omega_k = Omega_k + b_k (omega_peak - Omega_peak)

where the Omega_k are those of the drawn curve in the middle of all that is varied and b_k falls linearly from 1 at its
peak to 0 at the ends of the band: at the same k samples are at like places of their curves, and what is found there
changes smoothly from sample to sample. Every point begins at the sliders that the static path leaves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.derivatives import Rates
from attrito.library.family import Family
from attrito.library.peak_tracker import Peak
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks.fixed_series import fixed_series
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.design import Study
from attrito.studies.rates import Solvable, inquiry_of_monitor, known_rates
from attrito.studies.sloped_peaks import KINDS, SlopedPeaks
from attrito.support.errors import UnsolvedError
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Frequencies nearer to each other, as part of the band, are one.
CLOSE = 1e-7


@dataclass(frozen=True)
class Reference:
    """The drawn curve in the middle of all that is varied.

    Parameters
    ----------
    frequencies_hz : of its points and its peak, ascending `[K]`
    peak_hz : of the peak
    turns_hz : least and largest frequency at which the curve turns back; empty: it does not
    """

    frequencies_hz: np.ndarray
    peak_hz: float
    turns_hz: tuple[float, ...]

    @property
    def share(self) -> np.ndarray:
        """b_k, `[K]`."""
        low, high = self.frequencies_hz[[0, -1]]
        return np.interp(self.frequencies_hz, [low, self.peak_hz, high], [0.0, 1.0, 0.0])


class SampleResponses(SlopedPeaks):
    """Peaks with the curves about them."""

    def __init__(self, comm: Comm, base: Scene | None, rom: Rom | None, study: Study, job: Job):
        super().__init__(comm, base, rom, study, job)
        self.reference: Reference | None = None

    def scene_of(self, job: Job) -> tuple[ReducedScene, np.ndarray, Options]:
        """See `Samples.scene_of`; every point begins at the load path's sliders."""
        reduced, load_path, options = super().scene_of(job)
        return reduced, load_path, replace(options, reset_slider=True)

    def find_reference(self) -> Reference:
        """The curve in the middle. Collective.

        Raises
        ------
        UnsolvedError : it has no peak
        """
        self.reference = None
        middle = self._study.middle
        changed = self._changed(middle)
        (row,) = self.at(middle, sloped=False)
        if row["frequency_hz"] is None:
            raise UnsolvedError(self._study.file, "no peak in the middle of what is varied")
        # As a run sweeps: sliders that begin again at every point may make the curve jump.
        reduced, load_path, options = super().scene_of(changed)
        level, preload = self._factors(middle, 0)
        sweep = changed["sweep"]
        with Solver(self._comm, reduced, fixed_series(options)[0]) as solver:
            solver.follow_static_path(load_path * preload, changed["static"]["steps"], sweep["start_hz"])
            most = changed["continuation"]["max_points"]
            points = list(solver.sweep(sweep["start_hz"], sweep["stop_hz"], level, 0, most))
        return on_root(self._comm, lambda: _reference(points, row["frequency_hz"], sweep))

    def visit(self, solver: Solver, peak: Peak | None, place: tuple[int, int], here: Solvable) -> dict[str, Any]:
        """See `SamplePeaks.visit`. Collective."""
        more = super().visit(solver, peak, place, here)
        if self.reference is None or peak is None or peak.outcome == "not_converged":
            return more
        return more | {"curve": self._curve(solver, peak, place, here)}

    def _curve(self, solver: Solver, peak: Peak, place: tuple[int, int], here: Solvable) -> dict[str, Any]:
        """The response, a number a frequency; NaN where there is no solution."""
        assert self.reference is not None
        reduced, load_path, _ = here
        monitor, stop = place
        changed = self._changed(self._values)
        frequencies = self.reference.frequencies_hz + self.reference.share * (
            peak.frequency_hz - self.reference.peak_hz
        )
        level, preload = self._factors(self._values, stop)
        rates = self._rates(here, stop) if self._sloped else None
        family = Family(self._comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
        falls = changed["sweep"]["stop_hz"] < changed["sweep"]["start_hz"]
        order = np.arange(len(frequencies))[:: -1 if falls else 1]
        rows: list[dict[str, Any]] = [{}] * len(frequencies)
        solver.follow_static_path(load_path * preload, changed["static"]["steps"], frequencies[order[0]])
        for k, point in zip(order, solver.solve_at(frequencies[order].tolist(), level, 0), strict=True):
            rows[k] = self._at_point(family, point, reduced, monitor, rates)
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        return {"frequency_hz": frequencies.tolist()} | columns

    def _at_point(
        self, family: Family, point: Point, scene: ReducedScene, monitor: int, rates: Rates | None
    ) -> dict[str, Any]:
        """Amplitude, its derivatives by the frequency, per Hz, and by what is varied; contacts' states."""
        count = len(self._study.vary)
        found: dict[str, Any] = {"amplitude": np.nan, "by_frequency": np.nan, "slopes": [np.nan] * count}
        found |= {"outcome": point.outcome, "states": list(point.states)}
        if not point.is_solved:
            return found
        kinds = KINDS[self._job["peak"]["amplitude"]]
        parts = point.amplitude[[monitor]] if len(kinds) == 1 else point.harmonics[monitor, 1:3]
        found["amplitude"] = height = float(np.hypot.reduce(parts))
        known = None if rates is None else known_rates(rates)
        wanted = None if rates is None else rates.at(known)
        family.ask(inquiry_of_monitor(scene, monitor, wanted, kinds))

        def work(family: Family) -> tuple[np.ndarray | None, np.ndarray | None]:
            if family.describe() is None:
                return None, None
            slopes = None if wanted is None else family.differentiate_along(wanted, scene.sector is None)
            return slopes, family.differentiate_by_frequency()

        slopes, by_frequency = self._comm.bcast(family.visit(work))
        weights = parts / height if height > 0.0 else np.zeros(len(parts))
        if by_frequency is not None:
            found["by_frequency"] = float(weights @ by_frequency)
        if slopes is not None:
            found["slopes"] = (weights @ slopes).tolist()
        return found


def _reference(points: list[Point], peak_hz: float, sweep: dict[str, Any]) -> Reference:
    """Of the points of a sweep in their order."""
    frequency = np.array([point.frequency_hz for point in points if point.is_solved])
    way = np.sign(sweep["stop_hz"] - sweep["start_hz"])
    back = np.flatnonzero(np.diff(frequency) * way < 0.0)
    turning = frequency[[*back, *(back + 1)]]
    turns = (float(turning.min()), float(turning.max())) if len(back) else ()
    low, high = sorted((sweep["start_hz"], sweep["stop_hz"]))
    inside = frequency[(frequency > low) & (frequency < high)]
    ordered = np.sort(np.concatenate([[low, high, peak_hz], inside]))
    apart = np.concatenate([[True], np.diff(ordered) > CLOSE * (high - low)])
    return Reference(ordered[apart], peak_hz, turns)
