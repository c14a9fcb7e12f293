"""One family of scenes by every method: what each comes to, the verdict, and what motion in time says of it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from attrito.integration.attractors import State, pushed
from attrito.library.family import Family as Members
from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.names import ENGINES, MULTIPLIER_KINDS, ORBITS, OUTCOMES, STRATEGIES
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.runs.stability import examine_point, fetch_multipliers
from attrito.support.errors import NumericsError
from attrito_verification.scene_grid.scenes import Family, frequencies

HARMONICS = 10
PATH = np.array([[0.0], [1.0]])
STATIC_STEPS = 20
LONGEST_PERIOD = 32
# After so long motion in time is what it is, damping being exp(-10 pi t): twice the longest period looked for, and
# seconds in which it falls by 1e11. Samples of its last period; change a period that counts as none.
CYCLES, SECONDS, SAMPLES, PERIODICITY = 2 * LONGEST_PERIOD, 0.8, 128, 1e-8
# At most so many where a verdict of stable says that perturbations fade more slowly.
MOST_CYCLES = 10_000
# Every so many frequencies each fallback strategy is tried by itself.
METHODS_EVERY = 8
METHODS = ("coupled", "uncoupled", *STRATEGIES)
# Why a verdict is missing, or what decided it, by a part of the library's sentence.
REASONS = {
    0: "",
    1: "no event-exact orbit",
    2: "decided by integration",
    3: "grazes",
    4: "1 in modulus",
    5: "not found",
    6: "of the amplitude",
}
OUTCOME_CODES = {name: code for code, name in enumerate(OUTCOMES)}


@dataclass
class Columns:
    """What is kept of a family, by name: arrays over its frequencies."""

    count: int
    data: dict[str, np.ndarray] = field(default_factory=dict)

    def put(self, name: str, index: int, value: float) -> None:
        """One value; missing ones are NaN."""
        if name not in self.data:
            self.data[name] = np.full(self.count, np.nan)
        self.data[name][index] = value

    @contextmanager
    def timed(self, name: str, index: int) -> Iterator[None]:
        """Add the processor time that passes meanwhile."""
        started = time.process_time()
        yield
        self.data[name][index] += time.process_time() - started


def solve_family(family: Family, harmonics: int = HARMONICS) -> dict[str, np.ndarray]:
    """Columns `[frequencies]` of one family; see `grid.py` for what they mean."""
    scene, grid = family.scene(), frequencies()
    columns = Columns(len(grid))
    options = Options(harmonics=harmonics, samples=max(128, 8 * harmonics))
    with Integrator(scene) as session, Solver(MPI.COMM_SELF, scene, options) as solver:
        _coupled(columns, scene, session, solver, grid)
    started = time.process_time()
    _uncoupled(columns, scene, harmonics, grid)
    columns.data["seconds_methods"] += (time.process_time() - started) / len(grid)
    return columns.data


def _coupled(columns: Columns, scene: ReducedScene, session: Integrator, solver: Solver, grid: np.ndarray) -> None:
    for name in ("static_failed", "seconds_verdict", "seconds_check", "seconds_methods"):
        columns.data[name] = np.zeros(len(grid))
    try:
        solver.follow_static_path(PATH, STATIC_STEPS, grid[0])
    except NumericsError:
        columns.data["static_failed"][:] = 1.0
        return
    members = Members(MPI.COMM_SELF, solver, session.contacts, len(scene.monitors))
    points = solver.solve_at(list(grid), 1.0, 0)
    for i in range(len(grid)):
        # Attempts start from the point before, which the first has not.
        if i % METHODS_EVERY == METHODS_EVERY - 1:
            with columns.timed("seconds_methods", i):
                _try_each(columns, solver, i, grid[i])
        with columns.timed("seconds_verdict", i):
            point = next(points)
            decided = point.outcome == "converged" and _examine(columns, solver, i)
        _keep(columns, "coupled", i, point)
        columns.put("estimate", i, point.estimate)
        # Where there is a verdict motion in time is the check of it, elsewhere it is what is known.
        with columns.timed("seconds_check" if decided else "seconds_verdict", i):
            if point.outcome == "converged":
                state = _state(point, members)
                session.start(*_tuple(pushed(state, point.amplitude.max(), 2.0 * np.pi * grid[i])), PATH[-1])
            else:
                session.start_static(PATH)
            _in_time(columns, session, point, i, grid[i])


def _examine(columns: Columns, solver: Solver, index: int) -> bool:
    """Keep what is found of a point's stability; returns whether it has a verdict."""
    report, reason = examine_point(solver, ENGINES["monodromy"], ORBITS["auto"])
    columns.put("stable", index, report.verdict)
    columns.put("orbit_distance", index, report.distance if report.distance >= 0.0 else np.nan)
    columns.put("reason", index, next((code for code, text in REASONS.items() if text and text in reason), 0))
    if report.monodromy:
        real, imaginary, kind = fetch_multipliers(solver, ENGINES["monodromy"], report.monodromy)
        dynamic = kind == MULTIPLIER_KINDS.index("floquet")
        columns.put("largest_multiplier", index, np.hypot(real, imaginary)[dynamic].max(initial=0.0))
    return report.verdict in (0, 1)


def _try_each(columns: Columns, solver: Solver, index: int, frequency_hz: float) -> None:
    for name in STRATEGIES:
        _keep(columns, name, index, solver.solve_by_strategy(name, frequency_hz))


def _uncoupled(columns: Columns, scene: ReducedScene, harmonics: int, grid: np.ndarray) -> None:
    options = Options(harmonics=harmonics, samples=max(128, 8 * harmonics), uncoupled=True)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        try:
            solver.follow_static_path(PATH, STATIC_STEPS, grid[0])
        except NumericsError:
            return
        for i, point in enumerate(solver.solve_at(list(grid), 1.0, 0)):
            _keep(columns, "uncoupled", i, point)


def _keep(columns: Columns, method: str, index: int, point: Point) -> None:
    solved = point.outcome in ("converged", "indeterminate")
    columns.put(f"{method}_outcome", index, OUTCOME_CODES[point.outcome])
    columns.put(f"{method}_iterations", index, point.iterations)
    columns.put(f"{method}_amplitude", index, point.amplitude[0] if solved else np.nan)


def _in_time(columns: Columns, session: Integrator, point: Point, index: int, frequency_hz: float) -> None:
    """Motion in time from the solution, pushed a little, or from the static solution: where it goes."""
    choices = Run(
        frequency_hz,
        cycles=max(CYCLES + round(SECONDS * frequency_hz), _cycles_to_fade(columns, index)),
        fewest_cycles=2,
        periodicity_tolerance=PERIODICITY,
        max_period_multiple=LONGEST_PERIOD,
        samples=SAMPLES,
    )
    orbit = session.run(choices)
    columns.put("time_outcome", index, OUTCOME_CODES[orbit.outcome])
    columns.put("time_period", index, orbit.period)
    columns.put("time_amplitude", index, orbit.amplitude[0])
    columns.put("time_cycles", index, orbit.cycles)
    if point.outcome == "converged":
        columns.put("time_distance", index, distance(point, orbit))


def _cycles_to_fade(columns: Columns, index: int) -> int:
    """Cycles in which a stable orbit's perturbations fall by `PERIODICITY` and a tenth of it."""
    largest = columns.data.get("largest_multiplier", np.zeros(columns.count))[index]
    if columns.data.get("stable", np.zeros(columns.count))[index] != 1 or not 0.0 < largest < 1.0:
        return 0
    return min(MOST_CYCLES, math.ceil(math.log(0.1 * PERIODICITY) / math.log(largest)))


def distance(point: Point, orbit: Orbit) -> float:
    """Largest difference over a period of the harmonics of a motion from another, part of its range, means left out."""
    ours, theirs = motion(point.harmonics, SAMPLES), orbit.monitors[-SAMPLES:]
    ours, theirs = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    return float(np.abs(ours - theirs).max() / max(np.abs(ours).max(), 1e-300))


def motion(coefficients: np.ndarray, samples: int) -> np.ndarray:
    """Values `[samples, rows]` over a period of Fourier series `[rows, 2 H + 1]`."""
    theta = 2.0 * np.pi * np.arange(samples) / samples
    harmonics = np.arange(1, (coefficients.shape[1] - 1) // 2 + 1)
    basis = np.empty((samples, coefficients.shape[1]))
    basis[:, 0] = 1.0
    basis[:, 1::2], basis[:, 2::2] = np.cos(np.outer(theta, harmonics)), np.sin(np.outer(theta, harmonics))
    return basis @ coefficients.T


def _state(point: Point, members: Members) -> State:
    """The state at the beginning of the period; monitors are the coordinates."""
    slider = members.visit(lambda family: family.describe().slider)
    return state_of(point.harmonics, point.frequency_hz, slider)


def state_of(coordinates: np.ndarray, frequency_hz: float, slider: np.ndarray) -> State:
    """The state at the beginning of the period of Fourier series `[m, 2 H + 1]`."""
    harmonics = np.arange(1, (coordinates.shape[1] - 1) // 2 + 1)
    displacement = coordinates[:, 0] + coordinates[:, 1::2].sum(axis=1)
    return State(displacement, 2.0 * np.pi * frequency_hz * coordinates[:, 2::2] @ harmonics, slider)


def _tuple(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return state.displacement, state.velocity, state.sliders
