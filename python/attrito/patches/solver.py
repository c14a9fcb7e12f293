"""A solver whose pairs are merged into patches while it solves, and which reports all pairs.

Each point is solved for with patches, and compared with all pairs at its motion (`attrito.patches.comparison`). Where
the error that this shows is above its part of the tolerance, the patches that err most are split and the point is
solved again.
See docs/method.md, "Fewer contacts".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.library.names import OUTCOMES, STATES
from attrito.library.points import Point, StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Options, Solver
from attrito.patches.comparison import (
    Comparison,
    Heard,
    compare,
    errors_of_mode,
    errors_of_point,
    lacking_load,
    unbalanced,
    work_of_loads,
)
from attrito.patches.merged_scene import MergedScene, Merger, StaticState
from attrito.patches.partition import first_partition, kinds_of, refined

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Part of the tolerance that patches may take
PATCHES_SHARE, LEAST_SHARE = 0.5, 0.2
# Error of the contacts' dissipation that is accepted, in units of the tolerance
DAMPING_SHARE = 2.5
# Part of the step along a branch that is kept where patches are refined
STEP_KEPT = 0.5
# Times that the patches of a point are refined at most
MOST_REFINEMENTS = 30
# Times that large patches are halved where none of a frequency's points is found
MOST_FAILURES = 3
# Unknowns of patches up to which linear steps are solved by elimination: as they are few it is the cheaper
MOST_ELIMINATED = 1500
# What a point is reported by pairs, rather than by patches
OF_PAIRS = ("/contacts/", "/points/coordinates", "/points/unique")


@dataclass(frozen=True)
class Places:
    """Where pairs are: table of the job `[nc]`, position `[nc, 3]`, normal `[nc, 3]`; nan where they have none."""

    tables: np.ndarray
    positions: np.ndarray
    normals: np.ndarray


def places_of(tables: np.ndarray, places: dict[str, np.ndarray]) -> Places:
    """Of a scene's contacts."""
    return Places(tables, places["position"], places["frame"][:, 2])


@dataclass(frozen=True)
class Verdict:
    """A point with its errors by patches: of amplitude or frequency, and of what the contacts dissipate."""

    point: Point
    error: float
    error_dissipation: float


@dataclass(frozen=True)
class _Sweep:
    """What a sweep was begun with."""

    start_hz: float
    stop_hz: float
    level: float
    branch: int
    max_points: int


class PatchedSolver(Solver):
    """A session of all pairs, which follows static paths and reports, and one of their patches, which solves.

    Parameters
    ----------
    comm, scene, options : as of a `Solver`; on one process
    places : of the contacts
    tolerance : relative error of the amplitude that a point may have
    band_hz : lowest and highest frequency that is asked for
    partition : patches to keep to `[nc]`; None: chosen, and refined
    """

    def __init__(
        self,
        comm: Comm,
        scene: ReducedScene,
        options: Options,
        places: Places,
        tolerance: float,
        band_hz: tuple[float, float],
        partition: np.ndarray | None = None,
    ):
        super().__init__(comm, scene, options)
        self._comm, self._places, self._tolerance = comm, places, tolerance
        self._band = 2.0 * np.pi * band_hz[0], 2.0 * np.pi * band_hz[1] * options.harmonics
        self._given = partition
        self._partition: np.ndarray | None = partition
        self._merger: Merger | None = None
        self._merged: MergedScene | None = None
        self._patches: Solver | None = None
        self._static: StaticState | None = None
        # Of all pairs, at the start of the next point
        self._sliders = np.zeros((len(scene.laws["tangents"]), self.slider_width))
        self._sweep_of_point = _Sweep(*band_hz, 1.0, 0, 0)
        self._path, self._taken, self._last_hz = 0.0, 0, band_hz[0]
        # What is reported of the last point, and of the static solution
        self._heard: Heard = {}
        self._outcome = "converged"
        self.refinements = 0
        self.on_new_patches: Callable[[], None] | None = None

    @property
    def patches(self) -> Solver:
        """The session of the patches."""
        return self._patches

    @property
    def scene_of_patches(self) -> ReducedScene:
        """What it solves."""
        return self._merged.scene

    def change_patches(self, partition: np.ndarray) -> None:
        """Go on with other patches, at the static solution."""
        self.refinements += 1
        self._begin_patches(partition)

    @property
    def partition(self) -> np.ndarray:
        """The patch of each pair, `[nc]`, after the static path."""
        return self._partition

    def follow_static_path(self, path: np.ndarray, steps: int, frequency_hz: float) -> np.ndarray:
        """Of all pairs; they are merged at the solution."""
        means = super().follow_static_path(path, steps, frequency_hz)
        displacements = super().coordinates()[:, 0]
        self._heard = self._hear(super().report_point)
        self._sliders = self._heard["/contacts/slider"][1].copy()
        load = path[-1] @ self._scene.static if len(path) else np.zeros(len(displacements))
        state = StaticState(displacements, self._sliders, self.closed_contacts(), load)
        if self._static is None or not _same(self._static, state):
            self._static = state
            stuck = self.linear_modes("stuck", len(displacements)) if self._scene.damping_kind == "ratio" else None
            self._merger = Merger(self._scene, state, stuck, self._band)
            if self._given is None:
                laws, at = self._scene.laws, self._places
                kinds = kinds_of(laws, at.tables, state.closed, at.positions)
                self._partition = first_partition(kinds, at.positions, at.normals)
        self._begin_patches(self._partition)
        return means

    def _begin_patches(self, partition: np.ndarray, harmonics: int = 0, samples: int = 0) -> None:
        """A session of these patches at the static solution; harmonics and samples of the options where not given."""
        if self._patches is not None:
            self._patches.close()
        self._partition = partition
        self._merged = self._merger.merge(partition)
        # A point that patches do not reach is for finer ones, not for motion in time.
        options = replace(self._options, dense_limit=MOST_ELIMINATED, integrate_in_time=False)
        if harmonics:
            options = replace(options, harmonics=harmonics, samples=samples)
        self._patches = Solver(self._comm, self._merged.scene, options)
        displacements = self._merged.reduce(self._static.displacements)
        slider = self._merged.means(self._static.slider)
        self._patches.take_static_state(displacements, slider, self._band[0] / (2.0 * np.pi))
        sweep = self._sweep_of_point
        self._patches.set_excitation(sweep.start_hz, sweep.stop_hz, sweep.level, sweep.branch, sweep.max_points)

    def set_excitation(
        self, start_hz: float, stop_hz: float, level: float, branch: int = 0, max_points: int = 0
    ) -> None:
        """As of a `Solver`."""
        self._sweep_of_point = _Sweep(start_hz, stop_hz, level, branch, max_points)
        self._path, self._taken, self._last_hz = 0.0, 0, start_hz
        self._patches.set_excitation(start_hz, stop_hz, level, branch, max_points)

    def solve_at(self, frequencies_hz: list[float], level: float, branch: int) -> Iterator[Point]:
        """As of a `Solver`."""
        self.set_excitation(min(frequencies_hz), max(frequencies_hz), level, branch)
        yield from self.go_on_at(frequencies_hz, branch)

    def go_on_at(self, frequencies_hz: list[float], branch: int) -> Iterator[Point]:
        """As of a `Solver`."""
        for frequency in frequencies_hz:
            self.refinements, iterations, failures = 0, 0, 0
            before = self._merged.expand(self._patches.coordinates())
            while True:
                point = next(self._patches.go_on_at([frequency], branch))
                iterations += point.iterations
                if not point.is_solved and failures < MOST_FAILURES and self._halve_patches():
                    failures += 1
                    if self._taken:
                        self._start(before, self._last_hz)
                    continue
                point, finer = self._judged(point._replace(iterations=iterations))
                if finer is None:
                    break
                self._start_again(point, finer)
            self._last_hz, self._taken = frequency, self._taken + 1
            yield point

    def _halve_patches(self) -> bool:
        """Halve the large patches, where the solver finds no point; False if there are none."""
        if self._given is not None:
            return False
        alike = np.zeros(len(self._partition), dtype=int)
        finer = refined(self._partition, np.ones(len(alike)), alike, self._places.positions)
        if np.array_equal(finer, self._partition):
            return False
        self._begin_patches(finer)
        return True

    def go_on(self) -> Iterator[Point]:
        """As of a `Solver`: where patches are refined the branch is followed on from the same point."""
        points = self._patches.go_on()
        self.refinements, iterations = 0, 0
        while True:
            point = next(points, None)
            if point is None:
                return
            iterations += point.iterations
            path = float(self._report_of_patches()["/points/path"][1])
            point, finer = self._judged(point._replace(iterations=iterations))
            if finer is not None:
                way, step = self._way(point), self._patches.step_size()
                if self._start_again(point, finer):
                    if not self._taken:
                        # At its start a sweep begins anew: a branch that is followed from there would end at once.
                        self._patches.set_excitation(*astuple(self._sweep_of_point))
                        points = self._patches.go_on()
                        continue
                    self._path += np.nan_to_num(path)
                    sweep = self._sweep_of_point
                    left = sweep.max_points - self._taken if sweep.max_points else 0
                    points = self._followed(way, left, STEP_KEPT * step)
                    continue
            self._last_hz, self._taken = point.frequency_hz, self._taken + 1
            yield point
            if point.finished:
                return
            self.refinements, iterations = 0, 0

    def _followed(self, way: int, left: int, step: float) -> Iterator[Point]:
        """The branch from the patches' present point on, that point first."""
        sweep = self._sweep_of_point
        points = self._patches.follow(sweep.start_hz, sweep.stop_hz, sweep.branch, left, way)
        present = next(points)
        # Before the point is reported: a run may end there, and go on from what was saved.
        self._patches.step_size(step)
        yield present
        yield from points

    def _way(self, point: Point) -> int:
        """Whether frequency grows (1) or falls (-1) along the branch here."""
        ahead = point.frequency_hz - self._last_hz
        if ahead == 0.0:
            ahead = self._sweep_of_point.stop_hz - self._sweep_of_point.start_hz
        return 1 if ahead > 0.0 else -1

    def _start_again(self, point: Point, partition: np.ndarray) -> bool:
        """Solve a point again with other patches; False if that fails: the solver is then at their static solution."""
        coordinates = self._merged.expand(self._patches.coordinates())
        self._begin_patches(partition, (coordinates.shape[1] - 1) // 2, point.samples)
        self.refinements += 1
        return self._start(coordinates, point.frequency_hz)

    def _start(self, coordinates: np.ndarray, frequency_hz: float) -> bool:
        """Solve the patches at a motion of the model `[m, nk]`, which is then their point; False if that fails."""
        motion, slider = self._merged.reduce(coordinates), self._merged.means(self._sliders)
        return self._patches.start_from(StoredPoint(frequency_hz, motion, slider), self._sweep_of_point.level)

    def _judged(self, point: Point) -> tuple[Point, np.ndarray | None]:
        """A point of the patches with its error, and finer patches if that is too large; it is noted if not."""
        if not point.is_solved:
            self._note_unsolved(point)
            return point, None
        found = self._compare(point)
        motion = self._patches.coordinates()
        change = self._patches.change_by_force(unbalanced(self._merged, point, motion, found.force))
        errors = errors_of_point(found, change, work_of_loads(self._merged, point, motion))
        return self._concluded(Verdict(point, *errors), found, self._accepted(point.estimate))

    def judge_mode(
        self, point: Point, kinetic: float, structural_ratio: float, change_by_force: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[Verdict, np.ndarray | None]:
        """The same of a point of a mode whose kinetic sum and damping ratio by the structure are given.

        `change_by_force`: what a force on the patches' coordinates changes of omega and xi.
        """
        if not point.is_solved:
            self._note_unsolved(point)
            return Verdict(point, np.nan, np.nan), None
        found = self._compare(point)
        change = change_by_force(lacking_load(self._merged, found))
        omega = 2.0 * np.pi * point.frequency_hz
        verdict = Verdict(point, *errors_of_mode(found, omega, kinetic, structural_ratio, change))
        point, finer = self._concluded(verdict, found, PATCHES_SHARE * self._tolerance)
        return replace(verdict, point=point), finer

    def _concluded(self, verdict: Verdict, found: Comparison, accepted: float) -> tuple[Point, np.ndarray | None]:
        """The point as it is reported, which is noted; or finer patches, if its errors are above what is accepted."""
        within = verdict.error <= accepted and verdict.error_dissipation <= DAMPING_SHARE * self._tolerance
        if not within and self._given is None and self.refinements < MOST_REFINEMENTS:
            finer = refined(self._partition, found.indicated, found.states, self._places.positions)
            if not np.array_equal(finer, self._partition):
                return verdict.point, finer
        estimate = np.nan_to_num(verdict.point.estimate) + verdict.error
        outcome = verdict.point.outcome
        if outcome == "converged" and not estimate <= self._tolerance and self._options.accepted_error > 0.0:
            outcome = "above_tolerance"
        counts = np.bincount(found.states, minlength=len(STATES))
        states = tuple(int(count) for count in counts)
        point = verdict.point._replace(estimate=estimate, outcome=outcome, states=states)
        self._sliders = self._heard["/contacts/slider"][1].copy()
        self._note(point, verdict.error, verdict.error_dissipation)
        return point, None

    def _accepted(self, others: float) -> float:
        """The error that patches may have beside that of other causes; where these leave nothing, a small part."""
        most, least = PATCHES_SHARE * self._tolerance, LEAST_SHARE * self._tolerance
        return max(min(most, self._tolerance - np.nan_to_num(others)), least)

    def _compare(self, point: Point) -> Comparison:
        """All pairs at a point of the patches, of which they are reported from here on."""
        motion = self._patches.coordinates()
        of_patches = self._report_of_patches()
        self.evaluate_motion(self._merged.expand(motion), self._sliders, point)
        self._heard = self._hear(super().report_point)
        found = compare(self._merger, self._merged, motion, self._heard, of_patches)
        self._heard |= {name: what for name, what in of_patches.items() if not name.startswith(OF_PAIRS)}
        return found

    def _hear(self, report: Callable) -> Heard:
        heard: Heard = {}
        report(lambda path, what, values: heard.update({path: (what, values)}))
        return heard

    def _report_of_patches(self) -> Heard:
        return self._hear(self._patches.report_point)

    def _note(self, point: Point, error: float, error_dissipation: float) -> None:
        """What is reported of a point beside what both sessions do."""
        what = Series("real64", "part of the estimate: pairs merged into patches", "1")
        self._heard["/points/error_contacts"] = what, np.array(error)
        what = Series("real64", "estimated error by patches of what all contacts dissipate", "1")
        self._heard["/points/error_dissipation"] = what, np.array(error_dissipation)
        what = Series("int32", "patches that pairs were merged into", "1")
        self._heard["/points/patches"] = what, np.array(int(self._partition.max()) + 1)
        values = {"estimate": point.estimate, "outcome": OUTCOMES.index(point.outcome), "iterations": point.iterations}
        values["path"] = float(self._heard["/points/path"][1]) + self._path
        for name, value in values.items():
            what, before = self._heard[f"/points/{name}"]
            self._heard[f"/points/{name}"] = what, np.array(value, dtype=before.dtype)
        self._outcome = point.outcome

    def _note_unsolved(self, point: Point) -> None:
        """Of a point without a solution nothing is known of pairs."""
        blank = {
            name: (what, np.full_like(values, -1 if what.kind == "int32" else np.nan))
            for name, (what, values) in self._heard.items()
            if name.startswith(OF_PAIRS)
        }
        of_patches = self._report_of_patches()
        self._heard = blank | {name: what for name, what in of_patches.items() if not name.startswith(OF_PAIRS)}
        self._note(point, np.nan, np.nan)

    def report_point(self, hear: Callable[[str, Series, np.ndarray], None] | None) -> None:
        """As of a `Solver`, of all pairs."""
        for path, (what, values) in self._heard.items():
            hear(path, what, values)

    def outcome(self) -> str:
        """As of a `Solver`."""
        return self._outcome

    def save_state(self) -> np.ndarray:
        """As of a `Solver`."""
        sweep = self._sweep_of_point
        numbers = [sweep.start_hz, sweep.stop_hz, sweep.level, sweep.branch, sweep.max_points]
        numbers += [self._path, self._taken, self._last_hz, self._patches.coefficients]
        state = self._partition, self._sliders.ravel(), numbers, self._patches.save_state()
        return np.concatenate([np.asarray(part, dtype=float) for part in state])

    def load_state(self, numbers: np.ndarray) -> bool:
        """As of a `Solver`."""
        count, width = self._sliders.shape
        ends = np.cumsum([count, count * width, 9])
        if len(numbers) < ends[-1]:
            return False
        partition, sliders, rest, patches = np.split(numbers, ends)
        self._sweep_of_point = _Sweep(rest[0], rest[1], rest[2], int(rest[3]), int(rest[4]))
        self._path, self._taken, self._last_hz = rest[5], int(rest[6]), rest[7]
        self._begin_patches(partition.astype(np.int64))
        self._sliders = sliders.reshape(count, width).copy()
        if self.on_new_patches is not None:
            self.on_new_patches()
        self._patches.coefficients = int(rest[8])
        return self._patches.load_state(patches)

    def close(self) -> None:
        """Give everything back."""
        if self._patches is not None:
            self._patches.close()
            self._patches = None
        super().close()


def _same(a: StaticState, b: StaticState) -> bool:
    names = "displacements", "slider", "closed", "load"
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)
