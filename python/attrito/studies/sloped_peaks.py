"""Peaks of a study's samples with their exact derivatives by what is varied.

Along the frequency response the amplitude does not change at a peak to first order, so the height's derivative is that
of the amplitude at the peak's frequency; the frequency's takes the second derivative of contact forces, which there is
by events alone (docs/how-to/sensitivity.md). A sample's sliders are those that the static path leaves, which changes
with what is varied: the path's own part is a central difference.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.derivatives import Rates
from attrito.library.family import Family
from attrito.library.peak_tracker import Peak
from attrito.library.session import Solver
from attrito.peaks.first import factors
from attrito.runs.peak_slopes import of_peak
from attrito.runs.slider_rates import LoadPath, end_sliders
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.design import Study
from attrito.studies.rates import Solvable, inquiry_of_monitor, known_rates, monitor_slopes, rates_of
from attrito.studies.sample_peaks import SamplePeaks

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# What a peak's amplitude follows from, and how, by `[peak] amplitude`
KINDS = {"half_range": ("amplitude",), "first_harmonic": ("first_cosine", "first_sine")}
# Of a quantity's range: what the static path is followed again with to both sides
STEP = 1e-3


class SlopedPeaks(SamplePeaks):
    """Peaks with derivatives per unit of each quantity that a study varies, `slopes` of amplitude and frequency, Hz."""

    def __init__(self, comm: Comm, base: Scene | None, rom: Rom | None, study: Study, job: Job):
        super().__init__(comm, base, rom)
        self._study, self._job = study, job
        self._values = np.empty(0)
        self._sloped = True
        # Of the present sample and beside it, by values
        self._jobs: dict[bytes, Job] = {}
        # By place among the values of the parameter
        self._known_rates: dict[int, Rates] = {}

    def at(self, values: np.ndarray, sloped: bool = True) -> list[dict[str, Any]]:
        """The peaks at values of the quantities; `sloped`: with derivatives."""
        self._values, self._known_rates, self._sloped = values, {}, sloped
        self._jobs.clear()
        changed = self._changed(values)
        return self.of(changed, self._study.stops(changed))

    def _changed(self, values: np.ndarray) -> Job:
        """The job there; checks of a long one take longer than much that is solved."""
        key = values.tobytes()
        if key not in self._jobs:
            self._jobs[key] = self._study.changed(self._job, values)
        return self._jobs[key]

    def unknown(self) -> list[str]:
        """Names of the quantities that there are no exact derivatives by, in the middle of all. Collective."""
        study = self._study
        low, high = study.bounds
        middle = 0.5 * (low + high)
        here = self.scene_of(self._changed(middle))
        rates = rates_of(study.vary, middle, here, lambda values: self.scene_of(self._changed(values)))
        return [vary.name for vary, known in zip(study.vary, known_rates(rates), strict=True) if not known]

    def visit(self, solver: Solver, peak: Peak | None, place: tuple[int, int], here: Solvable) -> dict[str, Any]:
        """See `SamplePeaks.visit`. Collective."""
        if not self._sloped:
            return {}
        count = len(self._values)
        none = [np.nan] * count
        if peak is None or peak.outcome == "not_converged":
            return {"slopes": {"amplitude": none, "frequency_hz": none}}
        reduced, (monitor, stop) = here[0], place
        rates = self._rates(here, stop)
        family = Family(self._comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
        kinds = KINDS[self._job["peak"]["amplitude"]]
        slopes = monitor_slopes(self._comm, family, reduced, monitor, rates, kinds)
        if len(kinds) > 1:
            parts = peak.point.harmonics[monitor, 1:3]
            slopes = (parts @ slopes)[np.newaxis] / np.hypot(*parts)
        found = np.vstack([slopes[0], np.full(count, np.nan)])
        known = known_rates(rates)
        if np.any(known) and self._has_frequency_slopes(here):
            found[:, known] = self._by_events(family, peak, here, monitor, rates.at(known))
        return {"slopes": {"amplitude": found[0].tolist(), "frequency_hz": found[1].tolist()}}

    def _has_frequency_slopes(self, here: Solvable) -> bool:
        """Whether derivatives of a peak's frequency may be asked for: of a whole structure."""
        return here[0].sector is None and self._job["peak"]["amplitude"] == "half_range"

    def _by_events(self, family: Family, peak: Peak, here: Solvable, monitor: int, rates: Rates) -> np.ndarray:
        """Of height and frequency, Hz, `[2, parameters]`; NaN where there are none. Collective."""

        def find(family: Family) -> np.ndarray | None:
            slopes = None if family.describe() is None else family.differentiate_directly(rates)
            by_frequency = None if slopes is None else family.differentiate_by_frequency()
            return None if by_frequency is None else np.append(slopes[0], by_frequency[0])

        def work(family: Family) -> np.ndarray | None:
            return of_peak(family, monitor, peak.frequency_hz, peak.at_corner, find, rates)

        family.ask(inquiry_of_monitor(here[0], monitor, rates, ("amplitude",)))
        found = self._comm.bcast(family.visit(work))
        return np.full((2, len(rates)), np.nan) if found is None else found

    def _rates(self, here: Solvable, stop: int) -> Rates:
        """Of each quantity at one of the parameter's values, kept from peak to peak of a sample. Collective."""
        if stop not in self._known_rates:
            self._known_rates[stop] = self._find_rates(here, stop)
        return self._known_rates[stop]

    def _find_rates(self, here: Solvable, stop: int) -> Rates:
        """Level and preload may change with a quantity, too, and the sliders that the static path leaves."""
        study = self._study

        def at(values: np.ndarray) -> Solvable:
            return self.scene_of(self._changed(values))

        rates = rates_of(study.vary, self._values, here, at)
        level, preload = self._factors(self._values, stop)
        rates = rates.with_preload(preload)
        for i, vary in enumerate(study.vary):
            step = 0.5 * (vary.high - vary.low)
            beside = self._values.copy()
            beside[i] += step if beside[i] + step <= vary.high else -step
            other_level, other_preload = self._factors(beside, stop)
            change = beside[i] - self._values[i]
            rates.level[i] = (other_level - level) / change
            rates.static_factors[i] += (other_preload - preload) / change * here[1][-1]
        sliders = self._slider_rates(known_rates(rates), stop)
        return replace(rates, laws=np.concatenate([rates.laws, sliders], axis=2))

    def _slider_rates(self, known: np.ndarray, stop: int) -> np.ndarray:
        """How the sliders that the static path leaves change, `[parameters, nc, width]`; zero of those not `known`."""
        here = self._sliders_at(0, 0.0, stop)
        found = np.zeros((len(known), *here.shape))
        # Where nothing has slipped on the path nothing does beside it.
        for i in np.flatnonzero(known) if np.any(here) else ():
            vary = self._study.vary[i]
            step = STEP * (vary.high - vary.low)
            ends = [self._sliders_at(i, side * step, stop) for side in (-1.0, 1.0)]
            found[i] = (ends[1] - ends[0]) / (2.0 * step)
        return found

    def _sliders_at(self, quantity: int, step: float, stop: int) -> np.ndarray:
        """Those that the static path leaves a step away."""
        values = self._values.copy()
        values[quantity] += step
        changed = self._changed(values)
        scene, load_path, options = self.scene_of(changed)
        _, preload = self._factors(values, stop)
        path = LoadPath(options, load_path * preload, min(changed["sweep"]["start_hz"], changed["sweep"]["stop_hz"]))
        return end_sliders(self._comm, changed["static"]["steps"], scene, path)

    def _factors(self, values: np.ndarray, stop: int) -> tuple[float, float]:
        """Level and preload of a peak: linear in what is varied."""
        changed = self._changed(values)
        return factors(changed, self._study.stops(changed)[stop])
