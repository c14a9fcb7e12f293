"""Peaks of a random scene, their derivatives, and where they are in a scene beside.

There a peak is where the derivative of the amplitude by the frequency vanishes, or jumps through zero. That derivative
is compared by itself, at points. Polynomials through amplitudes are no measure: where a contact begins to slip or to
open between them, the second derivative jumps or has a pole, and the place of that moves with the peak.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import common  # noqa: F401  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq
from sensitivity_looks import (
    Look,
    NothingFoundError,
    family_of,
    follow_loads,
    inquiry_of,
    inside_point,
    member_of,
    options_of,
    rates_of,
    solved_point,
)
from sensitivity_scenes import Case, Parameter

from attrito.library.family import Family
from attrito.library.peak_tracker import Peak, PeakTracker
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.runs.peak_slopes import of_peak

# Parts of the frequency: the first step from where the peak was, and how far it is looked for; from step to step
FIRST, FARTHEST, GROWTH = 1e-9, 1e-2, 4.0
# So near to each other two points have tangents that meet at the corner between them to 1e-12
NEAREST = 1e-8
# What a height is found to, part of it
EXACT = 1e-13


def look_at_peak(case: Case, random: np.random.Generator, parameters: list[Parameter]) -> Look:
    """The peak of the first monitor near the frequency with the largest amplitude."""
    del random
    scene = case.scene
    frequencies = sorted(case.frequencies_hz, reverse=True)
    with Solver(MPI.COMM_WORLD, scene, options_of(case)) as solver:
        peak, start = located_peak(solver, case, frequencies)
        member = member_of(solver, scene)
        found = derivatives_of_peak(solver, scene, peak, parameters)
    kinds = {"height": slice(0, 1), "frequency": slice(1, 2)}
    if peak.at_corner:
        kinds = {f"{kind} at a corner": place for kind, place in kinds.items()}

    def at(beside: ReducedScene, higher: float) -> np.ndarray | None:
        del higher
        return peak_beside(case, beside, start, frequencies, peak.at_corner)

    least = np.array([EXACT * peak.amplitude, EXACT * peak.frequency_hz])
    # A contact that begins to slip at the corner holds its slider on one side of it.
    free = np.zeros_like(member.free) if peak.at_corner else member.free
    return Look(found, kinds, np.zeros(2), at, free, least, corner=peak.at_corner)


def derivatives_of_peak(solver: Solver, scene: ReducedScene, peak: Peak, parameters: list[Parameter]) -> np.ndarray:
    """Of height and frequency, Hz, as of a job: `[2, parameters]`."""
    family, inquiry = family_of(solver, scene), inquiry_of(scene, parameters, None)
    family.ask(inquiry)
    rates = rates_of(scene, parameters, inquiry.zeros(solver, len(parameters)))

    def find(family: Family) -> np.ndarray | None:
        if family.describe() is None:
            return None
        found = family.differentiate_along(rates, scene.sector is None)
        by_frequency = family.differentiate_by_frequency()
        return None if found is None or by_frequency is None else np.append(found[0], by_frequency[0])

    found = family.visit(lambda family: of_peak(family, 0, peak.frequency_hz, peak.at_corner, find, rates))
    if found is None:
        raise NothingFoundError("no derivatives of the peak: singular, or the response jumps")
    return found


def located_peak(solver: Solver, case: Case, frequencies: list[float]) -> tuple[Peak, StoredPoint]:
    """The peak where the solver then is."""
    scene = case.scene
    follow_loads(solver, scene, frequencies[0])
    points = list(solver.solve_at(frequencies, 1.0, 0))
    solved = [point for point in points if point.is_solved]
    if not solved:
        raise NothingFoundError("no point")
    largest = max(solved, key=lambda point: point.amplitude[0]).frequency_hz
    solved_point(solver, case, largest)
    # Far beyond the frequencies of the case
    band = 0.3 * min(case.frequencies_hz), 3.0 * max(case.frequencies_hz)
    tracker = PeakTracker(solver, 0, "half_range", band, np.ones(len(case.scene.static)))
    near = largest
    for last in (False, False, True):
        peak = tracker.begin_near(tracker.start(near), 1.0)
        if not peak.point.is_solved:
            raise NothingFoundError("no peak")
        near = peak.frequency_hz
        if not last:
            inside_point(solver, scene, near)
    if not peak.at_corner and not peak.curvature < 0.0:
        raise NothingFoundError("no maximum")
    return peak, StoredPoint(peak.frequency_hz, solver.coordinates(), member_of(solver, scene).slider)


def peak_beside(
    case: Case, scene: ReducedScene, start: StoredPoint, frequencies: list[float], at_corner: bool
) -> np.ndarray | None:
    """Height and frequency of the peak uphill from a point."""
    inquiry = inquiry_of(scene, [], None)
    with Solver(MPI.COMM_WORLD, scene, options_of(case)) as solver:
        follow_loads(solver, scene, start.frequency_hz)
        solver.set_excitation(min(frequencies), max(frequencies), 1.0)
        family = family_of(solver, scene)
        family.ask(inquiry)

        def at(part: float) -> tuple[float, float]:
            """Amplitude, and its derivative by the frequency."""
            if not solver.start_from(replace(start, frequency_hz=start.frequency_hz * (1.0 + part)), 1.0):
                raise NothingFoundError("no point beside")
            member, slopes = family.visit(lambda family: (family.describe(), family.differentiate_by_frequency()))
            if member is None or slopes is None:
                raise NothingFoundError("singular")
            return float(member.amplitude[0]), float(slopes[0])

        try:
            ends = uphill(lambda part: at(part)[1])
            if ends is None:
                return None
            if not case.is_smooth or at_corner:
                height, part = corner_between(at, *ends, start.frequency_hz)
            else:
                part = brentq(lambda part: at(part)[1], *ends, xtol=1e-16, rtol=1e-15, maxiter=200)
                height = at(part)[0]
            return np.array([height, start.frequency_hz * (1.0 + part)])
        except NothingFoundError:
            return None


def corner_between(
    at: Callable[[float], tuple[float, float]], low: float, high: float, frequency_hz: float
) -> tuple[float, float]:
    """Height and place of the peak between a rising and a falling point: where their tangents meet, once they are near.

    Where the slope is continuous there that is the peak, too.
    """
    ends = [(part, *at(part)) for part in sorted((low, high))]

    def meet() -> float:
        """How far from the first end the tangents meet."""
        (a, height, rise), (b, top, fall) = ends
        width = b - a
        way = (top - height - fall * frequency_hz * width) / ((rise - fall) * frequency_hz)
        return min(max(way, 0.0), width)

    def take(part: float) -> None:
        if ends[0][0] < part < ends[1][0]:
            there = at(part)
            ends[there[1] <= 0.0] = (part, *there)

    while (width := ends[1][0] - ends[0][0]) > NEAREST:
        corner = ends[0][0] + meet()
        take(corner - 0.4 * NEAREST)
        take(corner + 0.4 * NEAREST)
        if ends[1][0] - ends[0][0] > 0.5 * width:
            take(0.5 * (ends[0][0] + ends[1][0]))
    way = meet()
    return ends[0][1] + ends[0][2] * frequency_hz * way, ends[0][0] + way


def uphill(slope: Callable[[float], float]) -> tuple[float, float] | None:
    """Two places between which a slope changes from above zero to below it, from zero on; None: nowhere near."""
    side, last, reach = (1.0 if slope(0.0) > 0.0 else -1.0), 0.0, FIRST
    while reach <= FARTHEST:
        if side * slope(side * reach) <= 0.0:
            return side * last, side * reach
        last, reach = reach, GROWTH * reach
    return None
