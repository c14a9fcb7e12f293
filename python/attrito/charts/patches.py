"""The series of a chart in which pairs are merged into patches: error against the number of contacts that are left.

Patches are refined until their own estimate is within a tolerance (`attrito.patches.solver`), which is varied;
harmonics and samples are chosen for the same small error in all of them, and in the one of all pairs, so that what
differs is the patches alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.file import SOLVED, Way
from attrito.charts.limited import within
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.patches.partition import kinds_of
from attrito.patches.solver import PatchedSolver, Places

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

TOLERANCES = (3e-1, 1e-1, 3e-2, 1e-2, 3e-3, 1e-3)


def can_merge(scene: ReducedScene, places: Places) -> bool:
    """Whether there are pairs that patches could be made of."""
    if scene.sector is not None or scene.damping_kind == "loss_factor":
        return False
    closed = np.ones(len(places.tables), dtype=bool)
    kinds = kinds_of(scene.laws, places.tables, closed, places.positions)
    return bool(np.bincount(kinds).max() > 1)


def patched_ways(
    comm: Comm,
    scene: ReducedScene,
    options: Options,
    places: Places,
    frequencies_hz: list[float],
    come_to_rest: Callable[[Solver], None],
    level: float,
    error: Callable[[np.ndarray], float],
    limit: float = np.inf,
) -> Iterator[Way]:
    """Solve the frequencies with ever more patches, and with all pairs.

    Parameters
    ----------
    comm, scene, options : as of a `Solver`, on one process
    places : of the contacts
    frequencies_hz, level : of the points; the last one is charted
    come_to_rest : follows the static path
    error : of the amplitudes of the monitors `[monitors]`
    limit : seconds of a run after which there is none with more patches; twice as late it is given up
    """
    band = min(frequencies_hz), max(frequencies_hz)
    for tolerance in TOLERANCES:

        def by_patches(tolerance: float = tolerance) -> Way:
            with PatchedSolver(comm, scene, options, places, tolerance, band) as solver:
                seconds, points = _solved(solver, frequencies_hz, come_to_rest, level)
                count = int(solver.partition.max()) + 1
            return replace(_way(f"{tolerance:g}", points, seconds, error), tolerance=tolerance, contacts=count)

        way = within(2.0 * limit, by_patches)
        if way is None:
            yield Way("patches", f"{tolerance:g}", tolerance=tolerance, note=_note(limit), too_long=True)
            return
        yield way
        if way.seconds > limit:
            return

    def by_pairs() -> Way:
        with Solver(comm, scene, options) as solver:
            seconds, points = _solved(solver, frequencies_hz, come_to_rest, level)
            work = points[-1].work - solver.static_work
        return replace(_way("all pairs", points, seconds, error), contacts=len(places.tables), work=work)

    whole = within(2.0 * limit, by_pairs)
    yield whole or Way("patches", "all pairs", contacts=len(places.tables), note=_note(limit), too_long=True)


def _solved(
    solver: Solver, frequencies_hz: list[float], come_to_rest: Callable[[Solver], None], level: float
) -> tuple[float, list[Point]]:
    come_to_rest(solver)
    started = time.process_time()
    points = list(solver.solve_at(frequencies_hz, level, 0))
    return time.process_time() - started, points


def _note(limit: float) -> str:
    return f"given up after {2.0 * limit:.0f} s"


def _way(label: str, points: list[Point], seconds: float, error: Callable[[np.ndarray], float]) -> Way:
    last = points[-1]
    series = {"harmonics": (last.harmonics.shape[1] - 1) // 2, "samples": last.samples}
    if any(point.outcome not in SOLVED for point in points):
        return Way("patches", label, **series, seconds=seconds, note="a point did not converge")
    return Way("patches", label, **series, seconds=seconds, error=error(last.amplitude), estimate=last.estimate)
