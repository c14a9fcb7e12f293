"""Nonlinear modes of samples with their exact derivatives by parameters, at the amplitude Q that is held.

As those of `attrito mode` (`python/attrito/modes/mode_slopes.py`), and with the part of the sliders that the static
path leaves, a central difference of that path. Only modes by EPMC, of whole structures, have them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.derivatives import Rates
from attrito.library.family import Family
from attrito.library.points import LinearModes
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.library.structures import omega
from attrito.modes.at_monitor import Sensor
from attrito.modes.frequency_slopes import frequency_slopes, spring_rates
from attrito.modes.mode_point import ModePoint
from attrito.modes.mode_slopes import shape_slopes
from attrito.runs.slider_rates import LoadPath, end_sliders, sliders_at
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.rates import Bounded, Solvable, inquiry_of_monitor, known_rates, rates_of
from attrito.studies.sample_modes import SampleModes

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# What the static path is followed again with to both sides: part of a parameter's range, or of one sought by logarithms
STEP = 1e-3
# What a row has derivatives of
NAMES = ("frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy", "tangent_hz")


class SlopedModes(SampleModes):
    """Rows have `slopes`, by name `[parameters]`; NaN where there are none.

    Parameters
    ----------
    parameters : what derivatives are by
    changed : the job at values of them
    """

    def __init__(
        self,
        comm: Comm,
        base: Scene | None,
        rom: Rom | None,
        parameters: Sequence[Bounded],
        changed: Callable[[np.ndarray], Job],
    ):
        super().__init__(comm, base, rom)
        self._parameters, self._changed = parameters, changed
        self._values: np.ndarray | None = None

    def at(
        self, values: np.ndarray, amplitudes: list[float], derivatives: bool, sensor: Sensor | None = None
    ) -> list[dict[str, Any]]:
        """The mode at values of the parameters and amplitudes Q, or of a sensor, where none are exact. Collective."""
        self._values = values if derivatives and sensor is None else None
        return self.of(self._changed(values), amplitudes, sensor)

    def known(self, values: np.ndarray) -> np.ndarray:
        """Which parameters modes have exact derivatives by, at values of them `[parameters]`. Collective."""
        job = self._changed(values)
        here = self.scene_of(job)
        if not _is_sloped(job, here[0]):
            return np.zeros(len(values), dtype=bool)
        rates = rates_of(self._parameters, values, here, lambda there: self.scene_of(self._changed(there)))
        return known_rates(rates)

    def prepare(self, solver: Solver, job: Job, here: Solvable, modes: LinearModes, index: int) -> None:
        """See `SampleModes.prepare`."""
        self._slopes = None
        reduced = here[0]
        if self._values is None or not _is_sloped(job, reduced):
            return
        rates = self._rates(solver, job, here)
        known = known_rates(rates)
        if np.any(known):
            whole = solver.linear_modes("tangent", len(reduced.mass))
            self._slopes = _ModeSlopes(self._comm, solver, here, rates, whole, index)

    def visit(self, one: ModePoint) -> dict[str, Any]:
        """See `SampleModes.visit`."""
        if self._values is None:
            return {}
        if self._slopes is None:
            return {"slopes": {name: np.full(len(self._parameters), np.nan) for name in NAMES}}
        return {"slopes": self._slopes.at(one)}

    def _rates(self, solver: Solver, job: Job, here: Solvable) -> Rates:
        """What each parameter changes, sliders after the static path with it."""
        assert self._values is not None
        values = self._values

        def at(there: np.ndarray) -> Solvable:
            return self.scene_of(self._changed(there))

        def end(there: Solvable) -> np.ndarray:
            scene, load_path, options = there
            path = LoadPath(options, load_path, job["mode"]["near_hz"] or 1.0)
            return end_sliders(self._comm, job["static"]["steps"], scene, path)

        rates = rates_of(self._parameters, values, here, at)
        own = sliders_at(self._comm, solver, here[0])
        sliders = np.zeros((len(values), *own.shape))
        # Where nothing has slipped on the path nothing does beside it.
        for i in np.flatnonzero(_moves_sliders(rates)) if np.any(own) else ():
            parameter = self._parameters[i]
            step = STEP * parameter.rate(values[i])
            beside = np.clip(values[i] + np.array([-step, step]), parameter.low, parameter.high)
            ends = [end(at(np.where(np.arange(len(values)) == i, value, values))) for value in beside]
            sliders[i] = (ends[1] - ends[0]) / (beside[1] - beside[0])
        return replace(rates, laws=np.concatenate([rates.laws, sliders], axis=2))


def _moves_sliders(rates: Rates) -> np.ndarray:
    """Which parameters change what the static path leaves: known ones of contacts' laws or static loads."""
    changes = np.any(rates.laws, axis=(1, 2)) | np.any(rates.static_factors, axis=1)
    return np.asarray(known_rates(rates) & changes)


def _is_sloped(job: Job, scene: ReducedScene) -> bool:
    """Whether there are derivatives of a job's mode."""
    return job["mode"]["method"] == "epmc" and scene.sector is None


class _ModeSlopes:
    """Derivatives at one point of a mode after another; the solver is at its static solution at first."""

    def __init__(self, comm: Comm, solver: Solver, here: Solvable, rates: Rates, modes: LinearModes, index: int):
        reduced = here[0]
        self._comm, self._solver = comm, solver
        self._known = known_rates(rates)
        self._rates = rates.at(self._known)
        laws = self._rates.laws
        springs = spring_rates(reduced.laws["tangents"], laws, "tangent", solver.closed_contacts().astype(float))
        self._weight = reduced.mass @ modes.shapes[index]
        self._weight_rates = shape_slopes(modes, index, reduced.directions, springs) @ reduced.mass
        self._tangent = frequency_slopes(modes, reduced.directions, springs)[index]
        self._family = Family(comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
        dissipation = ("dissipated_energy", np.ones(len(reduced.laws["tangents"])))
        self._inquiry = replace(inquiry_of_monitor(reduced, 0, self._rates, ()), quantities=[dissipation])

    def at(self, one: ModePoint) -> dict[str, np.ndarray]:
        """By name, `[parameters]`. Collective."""
        motion = self._solver.coordinates()
        first = motion[:, 1] - 1j * motion[:, 2]
        amplitude = self._weight @ first
        own = np.real(amplitude.conj() * (self._weight_rates @ first)) / abs(amplitude)

        def find(family: Family) -> tuple[np.ndarray, np.ndarray] | None:
            is_there = family.describe() is not None
            return family.differentiate_mode(self._rates, self._weight + 0j, own) if is_there else None

        self._family.ask(self._inquiry)
        found = self._comm.bcast(self._family.visit(find)) if one.converged else None
        slopes = {name: np.full(len(self._known), np.nan) for name in NAMES}
        slopes["tangent_hz"][self._known] = self._tangent
        if found is not None:
            (frequency, excitation, structure), (work,) = found
            speed = omega(one.point.frequency_hz)
            drive = excitation / (2.0 * speed) - one.drive["excitation"] * omega(1.0) * frequency / (2.0 * speed**2)
            for name, numbers in zip(NAMES, (frequency, drive - structure, structure, work), strict=False):
                slopes[name][self._known] = numbers
        return slopes
