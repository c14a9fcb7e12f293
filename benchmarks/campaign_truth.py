"""The referee of the campaign: the periodic motion near a point, by integration in time from the point's own state.

The integration is exact between located events. Nothing of the harmonic balance, nor of its estimate, enters but the
start: displacement, velocity and sliders of the point where its period begins.

There are three ways to the periodic motion, by integration all but the last:

- `shooting`: Newton's method on the period map z -> P(z), z = (q, q', w), its derivative by differences. Sliders of
  contacts that stick throughout stay the point's own, so it is the same member of its family; unstable motions are
  found like stable ones.
- `march`: period after period until nothing changes.
- `harmonics`: the balance with 60 fixed harmonics from the point's motion and sliders, and how far 40 are from it.

The first that finds a motion on the same member, near the point, is the truth. Where it is not near all are asked, and
the nearest motion found is the truth: a point whose error is large is so by every way. A motion that keeps a slider
elsewhere than the point does is another member of the family, and no truth, unless two ways come to the same one: then
the point's sliders are not where they stay.
"""

from __future__ import annotations

import os
import pickle
import resource
import time
from dataclasses import dataclass

import numpy as np
import scenes
from mpi4py import MPI

from attrito.integration.attractors import State
from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.points import StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.support.errors import NumericsError
from attrito_verification.scene_grid.methods import state_of

# Newton's method on the period map: most steps, a step, relative to the motion, that counts as none, halvings of a step
# that does not lower the change, reduction above which the derivative is made again; step of the differences
MOST_STEPS, SETTLED, MOST_HALVINGS, SLOW = 30, 1e-10, 6, 0.05
DIFFERENCE = 1e-7
# A last step of this length is accepted if the change does not fall any more: that is rounding
NEAR = 1e-6
# What a truth may be off by, and how far sliders that are kept may have moved, parts of what they can carry
WORST_UNCERTAINTY, SAME_MEMBER = 1e-3, 0.05
# Of a march: periods between two looks, most periods, change a period that counts as none
LOOK, MOST_PERIODS, PERIODICITY = 25, 4000, 1e-8
# Harmonics of the balance that stands in, those it is compared with
HARMONICS, FEWER_HARMONICS = 60, 40
PATH = np.array([[0.0], [1.0]])


@dataclass(frozen=True)
class Solved:
    """A point as the sweep has it: the start of every truth.

    Parameters
    ----------
    frequency_hz, amplitude : the latter of the first monitor
    coordinates, slider : `[m, 2 H + 1]`, `[nc, 2]`
    """

    frequency_hz: float
    amplitude: float
    coordinates: np.ndarray
    slider: np.ndarray

    @property
    def state(self) -> State:
        """Where its period begins."""
        return state_of(self.coordinates, self.frequency_hz, self.slider)


@dataclass(frozen=True)
class Truth:
    """A periodic motion found by one of the ways.

    Parameters
    ----------
    how : shooting, march, harmonics
    amplitude : of the first monitor
    uncertainty : relative, of the amplitude
    shift : the largest change of a slider that is kept throughout, from the point's, times kt over mu N
    mean_shift : change of the first monitor's mean, parts of the amplitude
    multiplier : of shooting: largest modulus of the period map's multipliers; else NaN
    """

    how: str
    amplitude: float
    uncertainty: float
    shift: float
    mean_shift: float
    multiplier: float = float("nan")


@dataclass(frozen=True)
class Verdict:
    """What the ways have come to at a point.

    Parameters
    ----------
    truth : the one that decides; None: none could be had
    error : relative, of the point's amplitude; NaN without truth
    others : the other motions found
    failures : why ways found none, a sentence each
    """

    truth: Truth | None
    error: float
    others: list[Truth]
    failures: list[str]


class NoTruthError(Exception):
    """A way has not come to a periodic motion; says why."""


class Referee:
    """Truths of one scene's points; use it in a `with` block.

    `seconds`: of the processor, for each way and point; `seconds_in_all`: for all points, after which no way begins.
    """

    def __init__(self, scene: ReducedScene, seconds: float, seconds_in_all: float = np.inf):
        self._scene, self._seconds = scene, seconds
        self._end = time.process_time() + seconds_in_all
        self._session = Integrator(scene)

    def __enter__(self) -> Referee:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()

    def judge(self, point: Solved, near: float, every: bool = False) -> Verdict:
        """Hold a point against the ways until one is nearer than `near`; against all of them with `every`."""
        ways = (self.shooting, self.march, self.harmonics)
        found: list[Truth] = []
        failures: list[str] = []
        for way in ways:
            try:
                if time.process_time() > self._end:
                    raise NoTruthError(f"{way.__name__}: not begun, the scene's time is up")
                truth = way(point)
            except (NoTruthError, NumericsError) as error:
                failures.append(str(error))
                continue
            if truth.uncertainty > WORST_UNCERTAINTY:
                failures.append(f"{truth.how}: uncertain by {truth.uncertainty:.0e}")
                continue
            found.append(truth)
            if not every and truth.shift <= SAME_MEMBER and error_of(point, truth) <= near:
                break
        found = [truth for truth in found if truth.shift <= SAME_MEMBER] or agreeing(found, failures)
        if not found:
            return Verdict(None, float("nan"), [], failures)
        nearest = min(found, key=lambda truth: error_of(point, truth))
        others = [truth for truth in found if truth is not nearest]
        return Verdict(nearest, error_of(point, nearest), others, failures)

    def shooting(self, point: Solved) -> Truth:
        """By Newton's method on the period map."""
        deadline = time.process_time() + self._seconds
        period = _PeriodMap(self._session, self._scene, point)
        at = period.pack(point.state)
        end, orbit = period(at)
        size, jacobian, fresh = np.linalg.norm(end - at), None, False
        for _ in range(MOST_STEPS):
            if jacobian is None:
                moving = period.moving(end - at, orbit)
                jacobian, fresh = period.differentiate(at, end, moving, deadline), True
            try:
                step = period.newton_step(jacobian, moving, end - at)
            except np.linalg.LinAlgError:
                raise NoTruthError("shooting: singular") from None
            length, before = np.linalg.norm(step), size
            if length <= SETTLED:
                break
            for halving in range(MOST_HALVINGS):
                if time.process_time() > deadline:
                    raise NoTruthError("shooting: out of time")
                trial = at + 0.5**halving * step
                trial_end, trial_orbit = period(trial)
                if np.linalg.norm(trial_end - trial) < size:
                    at, end, orbit = trial, trial_end, trial_orbit
                    size = np.linalg.norm(end - at)
                    break
            if size > SLOW * before:
                # A derivative made here that gains nothing: this is as near as it gets.
                if fresh and size >= 0.9 * before:
                    break
                jacobian = None
            fresh = False
        if length > NEAR:
            raise NoTruthError(f"shooting: {length:.0e} from a periodic motion")
        moving = period.moving(end - at, orbit)
        multipliers = np.linalg.eigvals(period.differentiate(at, end, moving, deadline))
        multiplier = float(np.abs(multipliers).max())
        state = period.unpack(at)
        return self._truth("shooting", point, orbit, state.sliders, length, multiplier)

    def march(self, point: Solved) -> Truth:
        """Period after period."""
        deadline = time.process_time() + self._seconds
        start = point.state
        self._session.start(start.displacement, start.velocity, start.sliders, PATH[-1])
        orbit, stretch, cycles = None, LOOK, 0
        while time.process_time() < deadline and cycles < MOST_PERIODS:
            choices = Run(point.frequency_hz, 1.0, cycles=stretch, periodicity_tolerance=PERIODICITY, samples=1)
            orbit = self._session.run(choices)
            cycles += orbit.cycles
            if orbit.period:
                break
            stretch = min(2 * stretch, 400)
        if orbit is None or orbit.period == 0:
            raise NoTruthError(f"march: changes by {orbit.defect if orbit else np.nan:.0e} after {cycles} periods")
        if orbit.period > 1:
            raise NoTruthError(f"march: period {orbit.period}")
        _, _, sliders = self._session.state()
        # What is left of a geometric approach
        left = orbit.defect / max(1.0 - orbit.contraction, 1e-3) if orbit.contraction < 1.0 else orbit.defect
        return self._truth("march", point, orbit, sliders, left)

    def harmonics(self, point: Solved) -> Truth:
        """By many harmonics."""
        fine, contacts, mean = self._balance_within(point, HARMONICS)
        coarse, _, _ = self._balance_within(point, FEWER_HARMONICS)
        kept = contacts["stick"] >= 1.0 - 1e-9
        shift = self._shift(point, contacts["slider"], kept, contacts["n_mean"])
        return Truth("harmonics", fine, abs(coarse / fine - 1.0), shift, self._mean_shift(point, mean))

    def _truth(
        self, how: str, point: Solved, orbit: Orbit, sliders: np.ndarray, defect: float, multiplier: float = np.nan
    ) -> Truth:
        rows = int(self._scene.laws["tangents"][0]) + 1
        shift = self._shift(point, sliders, orbit.stick >= 1.0 - 1e-9, orbit.force_mean.reshape(-1, rows)[:, -1])
        mean_shift = self._mean_shift(point, float(orbit.mean[0]))
        return Truth(how, float(orbit.amplitude[0]), float(defect), shift, mean_shift, multiplier)

    def _shift(self, point: Solved, sliders: np.ndarray, kept: np.ndarray, pressed: np.ndarray) -> float:
        """Of sliders that are kept, in parts of what the mean normal force lets them carry."""
        laws = self._scene.laws
        moved = laws["tangential_stiffness"] * np.linalg.norm(sliders - point.slider, axis=1)
        limit = laws["friction_coefficient"] * np.maximum(pressed, 1e-300)
        return float((moved / limit)[kept].max(initial=0.0))

    def _mean_shift(self, point: Solved, mean: float) -> float:
        return (mean - float(self._scene.monitors[0] @ point.coordinates[:, 0])) / max(point.amplitude, 1e-300)

    def _balance_within(self, point: Solved, harmonics: int) -> tuple[float, dict[str, np.ndarray], float]:
        """The same as `_balance` in a process of its own, which ends when its time is up."""
        answer, question = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(answer)
            limit = int(time.process_time() + self._seconds) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            try:
                found = self._balance(point, harmonics)
            except NoTruthError as error:
                found = error
            with os.fdopen(question, "wb") as stream:
                pickle.dump(found, stream)
            os._exit(0)
        os.close(question)
        with os.fdopen(answer, "rb") as stream:
            written = stream.read()
        os.waitpid(child, 0)
        if not written:
            raise NoTruthError(f"{harmonics} harmonics: out of time")
        found = pickle.loads(written)
        if isinstance(found, NoTruthError):
            raise found
        return found

    def _balance(self, point: Solved, harmonics: int) -> tuple[float, dict[str, np.ndarray], float]:
        """Amplitude, contacts and mean by so many harmonics from the point's motion and sliders."""
        heard: dict[str, np.ndarray] = {}

        def hear(path: str, _what: object, entry: np.ndarray) -> None:
            heard[path.removeprefix("/contacts/")] = entry

        options = Options(harmonics=harmonics)
        stored = StoredPoint(point.frequency_hz, point.coordinates, point.slider)
        with Solver(MPI.COMM_SELF, self._scene, options) as solver:
            try:
                solver.follow_static_path(PATH, 10, point.frequency_hz)
            except NumericsError as error:
                raise NoTruthError(f"{harmonics} harmonics: {error}") from None
            solver.set_excitation(point.frequency_hz, point.frequency_hz, 1.0)
            if not solver.start_from(stored, 1.0):
                raise NoTruthError(f"{harmonics} harmonics: not converged")
            found = next(solver.go_on_at([point.frequency_hz], 0))
            if found.outcome == "not_converged":
                raise NoTruthError(f"{harmonics} harmonics: not converged")
            solver.report_point(hear)
            mean = float(self._scene.monitors[0] @ solver.coordinates()[:, 0])
        return float(found.amplitude[0]), heard, mean


def agreeing(moved: list[Truth], failures: list[str]) -> list[Truth]:
    """Motions that have moved sliders which they then keep: none, unless two ways have come to the same one."""
    for truth in moved:
        same = [other for other in moved if abs(other.amplitude / truth.amplitude - 1.0) <= WORST_UNCERTAINTY]
        if len(same) > 1:
            return same
    failures += [f"{truth.how}: another member, sliders moved by {truth.shift:.0e}" for truth in moved]
    return []


def error_of(point: Solved, truth: Truth) -> float:
    """Relative error of the point's amplitude."""
    return abs(point.amplitude / truth.amplitude - 1.0) if truth.amplitude > 0.0 else float("inf")


class _PeriodMap:
    """One period of the integration as a map of states, in parts of the point's motion.

    Coordinates and velocities go by stuck modes, so weighed that equal numbers are equal energies: a difference in a
    mode of stiff contacts is then no greater a change of forces than one in the lowest mode.
    """

    def __init__(self, session: Integrator, scene: ReducedScene, point: Solved):
        self._session = session
        self._choices = Run(point.frequency_hz, 1.0, cycles=0, samples=1)
        stuck = scenes.stuck_system(scene)
        natural = 2.0 * np.pi * stuck.frequencies_hz
        omega = 2.0 * np.pi * point.frequency_hz
        projection = stuck.modes.T @ scene.mass
        self._to_state = [stuck.modes * (omega / np.maximum(natural, omega)), omega * stuck.modes]
        self._from_state = [np.maximum(natural / omega, 1.0)[:, None] * projection, projection / omega]
        self._size = max(float(np.linalg.norm(projection @ point.coordinates[:, 1:])), 1e-300)
        self._slider_size = max(float(np.linalg.norm(scene.directions @ point.coordinates[:, 1:])), 1e-300)
        self._has_slider = np.stack([np.ones(session.contacts), scene.laws["tangents"] == 2], axis=1).ravel() > 0

    def pack(self, state: State) -> np.ndarray:
        """Displacement, velocity over omega, sliders."""
        p, v = (a @ b for a, b in zip(self._from_state, (state.displacement, state.velocity), strict=True))
        return np.concatenate([p / self._size, v / self._size, state.sliders.ravel() / self._slider_size])

    def unpack(self, at: np.ndarray) -> State:
        """And back."""
        m = self._session.size
        p, v, w = np.split(at, [m, 2 * m])
        q, rate = (self._size * (a @ b) for a, b in zip(self._to_state, (p, v), strict=True))
        return State(q, rate, self._slider_size * w.reshape(-1, 2))

    def __call__(self, at: np.ndarray) -> tuple[np.ndarray, Orbit]:
        """The state a period later, and what happens meanwhile."""
        state = self.unpack(at)
        self._session.start(state.displacement, state.velocity, state.sliders, PATH[-1])
        orbit = self._session.run(self._choices)
        if not np.all(np.isfinite(orbit.amplitude)) or orbit.time.size == 0:
            raise NoTruthError("shooting: the integration broke off")
        return self.pack(State(*self._session.state())), orbit

    @staticmethod
    def newton_step(jacobian: np.ndarray, moving: np.ndarray, change: np.ndarray) -> np.ndarray:
        """The step to where nothing changes, were the map linear."""
        step = np.zeros(len(change))
        step[moving] = np.linalg.solve(np.eye(len(moving)) - jacobian, change[moving])
        return step

    def moving(self, change: np.ndarray, orbit: Orbit) -> np.ndarray:
        """Numbers of the unknowns: all but the sliders that a period leaves where they are."""
        m = self._session.size
        slides = self._has_slider & (np.repeat(orbit.stick < 1.0 - 1e-12, 2) | (np.abs(change[2 * m :]) > 1e-12))
        return np.concatenate([np.arange(2 * m), 2 * m + np.flatnonzero(slides)])

    def differentiate(self, at: np.ndarray, end: np.ndarray, moving: np.ndarray, deadline: float) -> np.ndarray:
        """Derivative of the map with respect to its unknowns."""
        columns = []
        for unknown in moving:
            if time.process_time() > deadline:
                raise NoTruthError("shooting: out of time")
            nearby = at.copy()
            nearby[unknown] += DIFFERENCE
            columns.append((self(nearby)[0] - end)[moving] / DIFFERENCE)
        return np.array(columns).T
