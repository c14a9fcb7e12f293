"""A nonlinear mode of each of a study's samples, at the amplitudes of the job.

A sample's mode is that of `attrito mode`. It begins at the tangent mode of the sample's static solution and depends on
no other sample.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from attrito.job.job import Job
from attrito.library.points import LinearModes
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.modes.at_monitor import AtMonitor, Sensor
from attrito.modes.mode_point import ModePoint
from attrito.modes.nonlinear import chosen_mode, contact_work, new_tracker, series_of_mode
from attrito.modes.scene_at_rest import come_to_rest
from attrito.studies.samples import Samples
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    import numpy as np


class SampleModes(Samples):
    """Follows the modes of samples; every session is closed with its sample."""

    def of(self, job: Job, amplitudes: list[float], sensor: Sensor | None = None) -> list[dict[str, Any]]:
        """The mode of a job at amplitudes Q, or of a sensor; from the one on at which it is lost, `not_converged`."""
        reduced, load_path, options = self.scene_of(job)
        found: list[dict[str, Any]] = []
        tangent: dict[str, float | None] = {"tangent_hz": None, "tangent_damping_ratio": None}
        with Solver(self._comm, reduced, series_of_mode(options)) as solver:
            # No static equilibrium, or the mode is lost
            with contextlib.suppress(NumericsError):
                come_to_rest(solver, job, load_path)
                number, modes = chosen_mode(self._comm, job, solver)
                tangent = {
                    "tangent_hz": float(modes.natural_hz[number - 1]),
                    "tangent_damping_ratio": float(modes.damping_ratio[number - 1]),
                }
                self.prepare(solver, job, (reduced, load_path, options), modes, number - 1)
                at = new_tracker(job, solver, reduced, modes, number - 1).at
                if sensor is not None:
                    entry = complex(reduced.monitors[sensor.monitor] @ modes.shapes[number - 1])
                    at = AtMonitor(at, sensor, sensor.of_shape(entry, tangent["tangent_hz"] or 0.0)).at
                self._follow(solver, at, amplitudes, found)
            touches = any(solver.static_states[:3])
        found += [_row(None, 0.0)] * (len(amplitudes) - len(found))
        return [row | tangent | {"touches": touches} for row in found]

    def prepare(
        self,
        solver: Solver,
        job: Job,
        here: tuple[ReducedScene, np.ndarray, Options],
        modes: LinearModes,
        index: int,
    ) -> None:
        """Before a mode is followed, the solver being at its static solution.

        Parameters
        ----------
        here : the scene, its load path, the solver's options
        modes, index : the tangent modes, and which is followed, from 0
        """

    def visit(self, one: ModePoint) -> dict[str, Any]:
        """What the row of a mode's point has beside: the solver is at it."""
        return {}

    def _follow(
        self,
        solver: Solver,
        at: Callable[[float], ModePoint],
        amplitudes: list[float],
        found: list[dict[str, Any]],
    ) -> None:
        for amplitude in amplitudes:
            one = at(amplitude)
            if not one.converged:
                return
            row = _row(one, contact_work(self._comm, solver, one))
            found.append(row | self.visit(one))


def _row(one: ModePoint | None, work: float) -> dict[str, Any]:
    return {
        "frequency_hz": None if one is None else one.point.frequency_hz,
        "damping_ratio": None if one is None else one.damping_ratio(work),
        "damping_ratio_structure": None if one is None else one.structural_ratio,
        "dissipated_energy": None if one is None else work,
        "states": [0, 0, 0, 0] if one is None else list(one.point.states),
        "outcome": "not_converged" if one is None else one.point.outcome,
        "masing_hz": None if one is None else one.drive.get("masing_hz"),
        "masing_damping_ratio": None if one is None else one.drive.get("masing_damping_ratio"),
    }
