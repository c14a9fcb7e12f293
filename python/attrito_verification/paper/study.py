"""One set of the wedge's parameters: walls, approaches and runs in time that figures ask for, each computed once."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from attrito.library.integrator import Integrator, Orbit, Run
from attrito.support.errors import NumericsError
from attrito_verification.paper.wedge import (
    BAND,
    FORCES,
    FREQUENCY_TOLERANCE,
    Parameters,
    Wedge,
    load_path,
    wedge_scene,
)

LEVEL_WALL, INCLINED_WALL = 0.0, 45.0
WALLS = (LEVEL_WALL, INCLINED_WALL)
ORBIT_SAMPLES = 1024
HISTORY_SAMPLES = 64
# Harmonics that place a peak for integration in time to be located around, and how far around, Hz.
FINE_HARMONICS, PEAK_WIDTH = 20, 0.2
PERIODICITY = 1e-12
# Fig. 9: the preload changes slowly against the slowest mode, along half a cosine, and then rests.
RAMP_SECONDS, REST_SECONDS, RAMP_KNOTS = 0.4, 0.2, 65


class Study:
    """The wedge with one set of parameters at a number of harmonics."""

    def __init__(self, parameters: Parameters, harmonics: int):
        self.parameters, self.harmonics = parameters, harmonics
        self.wedge = cache(self._wedge)
        self.orbit = cache(self._orbit)
        self.exact_peak = cache(self._exact_peak)

    def _wedge(self, degrees: float, approach: str, harmonics: int | None = None) -> Wedge:
        return Wedge(self.parameters, degrees, approach, harmonics or self.harmonics)

    def lock_up(self) -> float:
        """Largest Fpl/Fexc at which the contact on the level wall slips at the peak: kt |u| reaches mu N there."""
        wedge = self.wedge(LEVEL_WALL, "C")
        law = {name: float(values[0]) for name, values in wedge.scene.laws.items()}
        limit = law["friction_coefficient"] * wedge.static(wedge.path).normal
        return float(wedge.scene.static[0, 1]) * law["tangential_stiffness"] * wedge.stuck_peak[1] / limit

    def _orbit(self, degrees: float, force: float, frequency_hz: float, start: str = "U1") -> Orbit:
        """The steady orbit that integration in time ends in, from the end of a load path."""
        with Integrator(wedge_scene(self.parameters, degrees)) as integrator:
            integrator.start_static(np.array(load_path(self.parameters, start))[:, None])
            choices = Run(
                frequency_hz,
                level=force,
                cycles=2000,
                periodicity_tolerance=PERIODICITY,
                samples=ORBIT_SAMPLES,
            )
            orbit = integrator.run(choices)
        if orbit.outcome != "converged":
            raise NumericsError(f"wedge, {force:g} N at {frequency_hz:g} Hz: integration in time ends {orbit.outcome}")
        return orbit

    def transient(self, force: float, frequency_hz: float, cycles: int, start: str) -> Orbit:
        """The first cycles at the inclined wall after a load path; the excitation grows over five of them (Fig. 13)."""
        with Integrator(wedge_scene(self.parameters, INCLINED_WALL)) as integrator:
            integrator.start_static(np.array(load_path(self.parameters, start))[:, None])
            growth = np.array([[0.0, 0.0], [5.0 / frequency_hz, 1.0]])
            return integrator.run(_history(frequency_hz, cycles, level=force, harmonic_profile=growth))

    def preloading(self, start: str) -> tuple[Orbit, np.ndarray]:
        """The preload alone, from rest, along a load path (Fig. 9); also its profile, `[knots, 2]`, time and factor."""
        path = load_path(self.parameters, start)
        profile = load_profile(path)
        hertz = 100.0
        cycles = int(np.ceil((profile[-1, 0] + REST_SECONDS) * hertz))
        with Integrator(wedge_scene(self.parameters, INCLINED_WALL)) as integrator:
            integrator.start(np.zeros(2), np.zeros(2), np.zeros((1, 2)), np.ones(1))
            orbit = integrator.run(_history(hertz, cycles, level=0.0, static_profile=profile))
        return orbit, profile

    def _exact_peak(self, degrees: float, force: float) -> tuple[float, float]:
        """Frequency, Hz, and value, m/N, of the peak of x by integration in time, located beside that of C."""
        near = self.wedge(degrees, "C", FINE_HARMONICS).peak(force).frequency_hz
        found = minimize_scalar(
            lambda frequency: -self._orbit(degrees, force, frequency).amplitude[0],
            bounds=(near - PEAK_WIDTH, near + PEAK_WIDTH),
            method="bounded",
            options={"xatol": FREQUENCY_TOLERANCE},
        )
        return float(found.x), -float(found.fun) / force

    def worst_peak_errors(self, degrees: float, harmonics: int) -> tuple[float, float]:
        """Largest relative differences, over the forces of Table 1, of C's peaks from those of integration in time.

        Returns that of the amplitude and that of the frequency.
        """
        wedge = self.wedge(degrees, "C", harmonics)
        errors = []
        for force in FORCES:
            peak, (frequency, response) = wedge.peak(force), self.exact_peak(degrees, force)
            errors.append((abs(peak.response / response - 1.0), abs(peak.frequency_hz / frequency - 1.0)))
        return tuple(np.max(errors, axis=0).tolist())

    def worst_difference_of_uncoupled(self) -> float:
        """Largest relative difference of U from C on the level wall, at C's peaks of the forces of Table 1."""
        coupled, uncoupled = self.wedge(LEVEL_WALL, "C"), self.wedge(LEVEL_WALL, "U1")
        differences = []
        for force in FORCES:
            peak = coupled.peak(force)
            # From the same side as the peak was found from.
            point = uncoupled.respond(np.array([BAND[0], peak.frequency_hz]), force)[-1]
            differences.append(abs(point.amplitude[0] / force / peak.response - 1.0))
        return max(differences)


def load_profile(path: list[float]) -> np.ndarray:
    """A load path in time, `[knots, 2]`: from corner to corner along half a cosine."""
    knots = [np.zeros((1, 2))]
    part = np.linspace(0.0, 1.0, RAMP_KNOTS)[1:]
    for i, (begin, end) in enumerate(pairwise(path)):
        factor = begin + (end - begin) * 0.5 * (1.0 - np.cos(np.pi * part))
        knots.append(np.column_stack([RAMP_SECONDS * (i + part), factor]))
    return np.vstack(knots)


def _history(frequency_hz: float, cycles: int, **choices: object) -> Run:
    """A run of so many cycles, steady or not, recorded from the start."""
    return Run(
        frequency_hz,
        cycles=cycles,
        fewest_cycles=cycles,
        samples=HISTORY_SAMPLES,
        whole_run=True,
        **choices,
    )
