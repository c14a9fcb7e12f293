"""The two-dof wedge of Zucca & Firrone 2014 (doi:10.1016/j.jsv.2013.09.032), as the solver sees it.

A mass on two springs against a wall at an angle a, eq. (11): x along the level wall, y towards it, pressed by 420 N
along y. By virtual work with eq. (12) the relative displacements are u = -x cos a + y sin a and v = x sin a + y cos a
(the second row of eq. (13) is a misprint). The excitation acts along x on the level wall and along the contact's
tangent at 45 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from attrito.library.kernels import contact_at_instants
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.library.structures import make_law
from attrito.results.loops import Loop
from attrito.support.errors import NumericsError

PRELOAD = 420.0
FRICTION = 0.5
FORCES = (1.0, 4.0, 6.0, 18.0, 24.0, 30.0, 42.0, 60.0)
MONITORS = ["x", "y", "u", "v"]
STATIC_STEPS = 20
LOOP_INSTANTS = 16384
# The band that holds all peaks, swept downwards, Hz; and how finely their frequency is located.
BAND = (150.0, 85.0, 66)
FREQUENCY_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Parameters:
    """Spring stiffnesses, N/m, and damping, N s/m; `overshoot` is the load path of U2 that its figure suggests."""

    name: str
    stiffness: tuple[float, float]
    damping: float
    contact_stiffness: float
    overshoot: float


PARAMETER_SETS = {
    parameters.name: parameters
    for parameters in (
        Parameters("rounded", (3.9e5, 2.5e6), 62.8, 3.0e5, 2.5),
        Parameters("unrounded", ((200 * np.pi) ** 2, (500 * np.pi) ** 2), 20 * np.pi, 3.0e5, 2.5),
        Parameters("stiffer", ((200 * np.pi) ** 2, (500 * np.pi) ** 2), 20 * np.pi, 3.04e5, 2.365),
    )
}


@dataclass(frozen=True)
class Mean:
    """Mean contact forces, N, and displacements, m."""

    tangential: float
    normal: float
    x: float
    y: float


@dataclass(frozen=True)
class Contact:
    """The contact over one period: its loop, and the fractions of the period in slip and lift-off."""

    loop: Loop
    slip: float
    open: float

    @property
    def least_normal(self) -> float:
        """Smallest normal force, N."""
        return float(self.loop.normal.min())


@dataclass(frozen=True)
class Peak:
    """The largest pseudo-FRF of x, m/N, of a force, N."""

    force: float
    frequency_hz: float
    response: float
    point: Point


class Wedge:
    """The wedge with one set of parameters, one wall and one approach: `C`, `U1` or `U2`.

    Parameters
    ----------
    degrees : inclination of the wall
    harmonics : of the balance; forces by events, so that nothing is lost to sampling
    """

    def __init__(self, parameters: Parameters, degrees: float, approach: str, harmonics: int):
        self.parameters, self.approach = parameters, approach
        self.path = load_path(parameters, approach)
        self.scene = wedge_scene(parameters, degrees)
        self._options = Options(
            harmonics=harmonics,
            uncoupled=approach != "C",
            samples=max(128, 8 * harmonics),
            tolerance=1e-12,
        )
        self._peaks: dict[float, Peak] = {}

    def respond(self, frequencies_hz: np.ndarray, force: float) -> list[Point]:
        """Points at listed frequencies, each from the one before, after the static path."""
        with self._solver() as solver:
            return self._solve(solver, list(frequencies_hz), force)

    def peak(self, force: float) -> Peak:
        """The peak of a force: the largest of a sweep, then located by solving between its neighbours."""
        if force not in self._peaks:
            self._peaks[force] = self._locate(force)
        return self._peaks[force]

    def static(self, path: list[float]) -> Mean:
        """Equilibrium at the end of a load path."""
        with self._solver(path) as solver:
            return self._mean(solver.static_mean)

    def mean(self, point: Point) -> Mean:
        """Means of a point; its contact forces from the equilibrium of harmonic 0."""
        return self._mean(point.harmonics[:, 0])

    def contact(self, point: Point, name: str = "") -> Contact:
        """The contact over a period of a point."""
        kt = self.parameters.contact_stiffness
        slider = np.array([point.harmonics[2, 0] - self.mean(point).tangential / kt, 0.0])
        law = make_law(self.scene.laws, 0)
        motion, force = contact_at_instants(law, point.harmonics[2:], slider, LOOP_INSTANTS)
        opened = force[1] <= 0.0
        limit = FRICTION * force[1]
        slips = ~opened & (np.abs(force[0]) >= limit - 1e-12 * limit.max())
        loop = Loop(name, motion[0], force[0], force[1], FRICTION)
        return Contact(loop, float(slips.mean()), float(opened.mean()))

    @cached_property
    def stuck_peak(self) -> tuple[float, float]:
        """Frequency, Hz, and value, m/N, of the peak of x with the contact stuck."""
        with self._solver() as solver:

            def amplitude(frequency: float) -> float:
                return -float(solver.linear_response("stuck", np.array([frequency]), 0)[0][0, 0])

            found = minimize_scalar(amplitude, bounds=BAND[1::-1], method="bounded", options={"xatol": 1e-7})
        return float(found.x), -float(found.fun)

    def _mean(self, means: np.ndarray) -> Mean:
        q = means[:2]
        force = np.linalg.solve(self.scene.directions.T, self.scene.static[0] - self.scene.stiffness @ q)
        return Mean(float(force[0]), float(force[1]), float(q[0]), float(q[1]))

    def _locate(self, force: float) -> Peak:
        grid = np.linspace(*BAND)
        with self._solver() as solver:
            response = [point.amplitude[0] for point in self._solve(solver, grid.tolist(), force)]
            largest = int(np.argmax(response))
            if largest in (0, len(grid) - 1):
                raise NumericsError(f"wedge, {force:g} N: no peak between {BAND[1]:g} and {BAND[0]:g} Hz")
            found = minimize_scalar(
                lambda frequency: -self._solve(solver, [frequency], force)[0].amplitude[0],
                bounds=(grid[largest + 1], grid[largest - 1]),
                method="bounded",
                options={"xatol": FREQUENCY_TOLERANCE},
            )
            point = self._solve(solver, [float(found.x)], force)[0]
        return Peak(force, point.frequency_hz, float(point.amplitude[0]) / force, point)

    def _solver(self, path: list[float] | None = None) -> _Walked:
        return _Walked(self.scene, self._options, self.path if path is None else path)

    @staticmethod
    def _solve(solver: Solver, frequencies_hz: list[float], force: float) -> list[Point]:
        points = list(solver.solve_at(frequencies_hz, force, 0))
        failed = [point.frequency_hz for point in points if point.outcome != "converged"]
        if failed:
            raise NumericsError(f"wedge, {force:g} N: not converged at {', '.join(f'{hz:g}' for hz in failed)} Hz")
        return points


def load_path(parameters: Parameters, approach: str) -> list[float]:
    """Factors on the preload that an approach takes; C ends where it must, whatever the path."""
    return [0.0, parameters.overshoot, 1.0] if approach == "U2" else [0.0, 1.0]


class _Walked(Solver):
    """A solver at the end of its static path; `static_mean` are the monitors there."""

    def __init__(self, scene: ReducedScene, options: Options, path: list[float]):
        super().__init__(MPI.COMM_SELF, scene, options)
        self.static_mean = self.follow_static_path(np.array(path)[:, None], STATIC_STEPS, BAND[0])


def wedge_scene(parameters: Parameters, degrees: float) -> ReducedScene:
    """The wedge at unit excitation; monitors x, y, u, v."""
    angle = np.radians(degrees)
    cosine, sine = (np.cos(angle), np.sin(angle)) if degrees else (1.0, 0.0)
    directions = np.array([[-cosine, sine], [sine, cosine]])
    harmonic = np.zeros((3, 2))
    harmonic[1] = directions[0] if degrees else (1.0, 0.0)
    contact = np.full(1, parameters.contact_stiffness)
    laws = {"tangents": np.ones(1, dtype=np.int32), "tangential_stiffness": contact, "normal_stiffness": contact}
    laws |= {"friction_coefficient": np.full(1, FRICTION), "gap": np.zeros(1), "preload": np.zeros(1)}
    return ReducedScene(
        np.eye(2),
        np.diag(parameters.stiffness),
        "viscous",
        0.0,
        parameters.damping * np.eye(2),
        laws,
        directions,
        np.array([[0.0, PRELOAD]]),
        harmonic,
        np.vstack([np.eye(2), directions]),
        MONITORS,
    )
