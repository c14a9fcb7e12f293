r"""A nonlinear mode of a scene whose pairs are merged into patches, refined until the mode feels no more of them.

The mode is followed by the extended periodic motion concept with the patches, which are split where all pairs, at the
same motion, would change its frequency or the contacts' work. A mode is its own dual, so to first order

    delta omega / omega = sum_i d_i^H (lambda_i - lambda_i') / (2 omega^2 sum_h h^2 q_h^H M q_h),

lambda_i being the force of pair i at the motion d_i, and lambda_i' what the patch stands for: the real part. The
moduli of pairs are added up instead, since either part, and different pairs, may cancel by chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from attrito.modes.mode_point import ModePoint
from attrito.modes.tracker import ModeTracker
from attrito.patches.solver import PatchedSolver
from attrito.runs.tangent_modes import equal_modes


class PatchedModeTracker:
    """Follows one mode with patches. The solver has followed its static path. On one process.

    Parameters
    ----------
    solver : of all pairs and of patches; stays the caller's
    frequency_hz : of the tangent mode, which patches share

    Attributes
    ----------
    known : of the last two points, as of a `ModeTracker`
    """

    def __init__(self, solver: PatchedSolver, frequency_hz: float):
        self._solver, self._frequency_hz = solver, frequency_hz
        self._found: dict[str, np.ndarray] = {"mode_known": np.empty((0, 2))}
        self._begin()

    def _begin(self) -> None:
        """Track the mode with the solver's present patches."""
        patches = self._solver.patches
        modes = patches.linear_modes("tangent", len(self._solver.scene_of_patches.mass))
        index = int(np.argmin(abs(modes.natural_hz - self._frequency_hz)))
        scene, hz = self._solver.scene_of_patches, float(modes.natural_hz[index])
        equal = [number - 1 for number in equal_modes(modes.natural_hz, index + 1)]
        self._tracker = ModeTracker(patches, scene, modes.shapes[equal], hz)

    @property
    def known(self) -> list[tuple[float, float]]:
        """Of the last two points, the stuck mode's coordinate and Q."""
        return self._tracker.known

    @known.setter
    def known(self, values: list[tuple[float, float]]) -> None:
        self._tracker.known = values

    def prepare(self) -> None:
        """Let states that are loaded find the solver ready for them."""

        def ready() -> None:
            self._begin()
            self._tracker.prepare()
            self._tracker.load_state(self._found)

        self._solver.on_new_patches = ready

    def save_state(self) -> dict[str, np.ndarray]:
        """What the next point starts from, beside the solver's state."""
        return self._tracker.save_state()

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this; the solver's state is loaded next."""
        self._found = found

    def at(self, amplitude: float) -> ModePoint:
        """The point of an amplitude, with patches that are fine enough there."""
        iterations = 0
        self._solver.refinements = 0
        while True:
            one = self._tracker.at(amplitude)
            iterations += one.iterations
            change = self._tracker.change_by_force
            judged, finer = self._solver.judge_mode(one.point, one.kinetic, one.structural_ratio, change)
            one = replace(one, point=judged.point, iterations=iterations)
            if finer is None:
                break
            self._solver.change_patches(finer)
            self._begin()
        return replace(one, error_contacts=judged.error)
