"""Time integration of a (reduced) scene with contacts: the library's session as a Python object."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from attrito.library import loading
from attrito.library.names import DAMPING_KINDS, OUTCOMES, REASONS, SCHEMES
from attrito.library.reduced_scene import ReducedScene
from attrito.library.structures import RawOrbit, RawRun, RawScene, make_laws, pointer

DEFAULT_STEPS = {"exponential": 1000}
# Why a motion has not converged, in words
WORDS = {
    "none": "",
    "settling": "the motion is still settling: give it more [integrate] cycles",
    "step": "a step of the scheme could not be solved: take more [integrate] steps_per_period",
    "diverged": "the motion diverges: it grows from period to period, or beyond what numbers hold",
}


@dataclass(frozen=True)
class Run:
    """Choices of a run; see docs/reference/job.md, [integrate].

    Parameters
    ----------
    frequency_hz, level : of the harmonic load
    scheme, steps_per_period : one of `SCHEMES`; steps for all but `event`
    dissipation : HHT: -alpha; generalised_alpha: spectral radius; None: 0.1 and 0.8
    static_profile, harmonic_profile : `[knots, 2]`, time in s and factor; None: constantly 1
    cycles, fewest_cycles : most cycles, and how many to march steady or not
    samples : per period, of the recorded history: the whole run if `whole_run`, else its last period
    """

    frequency_hz: float
    level: float = 1.0
    scheme: str = "event"
    steps_per_period: int | None = None
    dissipation: float | None = None
    static_profile: np.ndarray | None = None
    harmonic_profile: np.ndarray | None = None
    cycles: int = 400
    fewest_cycles: int = 0
    periodicity_tolerance: float = 1e-10
    max_period_multiple: int = 4
    samples: int = 256
    whole_run: bool = False


@dataclass(frozen=True)
class Orbit:
    """What a run has come to: measures over its last period (a multiple of the excitation's where `period` says so).

    Parameters
    ----------
    outcome : converged, no_period_one_orbit, not_converged
    reason : why it has not converged, in words; else empty
    period : multiple of the excitation's period, 0: none recognised
    defect, contraction : relative change over the period, and its ratio to the one before
    motion_amplitude : half range in the norm of the mass matrix, what the defect is relative to
    events, chatter : events in the period; instants of the run at which they had to be cut short
    work, damping_energy : work of the loads and energy dissipated by damping, per period of the excitation
    amplitude, mean, low, high : of the monitors `[monitors]`
    force_mean : of the rows of B `[rows]`
    normal_min, stick, slip, open, friction_energy : of the contacts `[nc]`; energy per period of the excitation
    time, monitors, displacement, force, regime : samples `[ns]`, `[ns, monitors]`, twice `[ns, rows]`, `[ns, nc]`
    seconds : time taken
    """

    outcome: str
    reason: str
    period: int
    cycles: int
    defect: float
    contraction: float
    motion_amplitude: float
    events: int
    chatter: int
    work: float
    damping_energy: float
    amplitude: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    force_mean: np.ndarray
    normal_min: np.ndarray
    stick: np.ndarray
    slip: np.ndarray
    open: np.ndarray
    friction_energy: np.ndarray
    time: np.ndarray
    monitors: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    regime: np.ndarray
    seconds: float


class Integrator:
    """A session of the library on a reduced scene: start it, run it, run it on. Use it in a `with` block."""

    def __init__(self, scene: ReducedScene):
        self._library = loading.load()
        self._scene = scene
        self._handle: ctypes.c_void_p | None = ctypes.c_void_p()
        self._factors = np.ones(len(scene.static))
        self.size, self.contacts = len(scene.mass), len(scene.laws["tangents"])
        laws = make_laws(scene.laws)
        arrays = [
            scene.mass,
            scene.stiffness,
            scene.directions,
            scene.static,
            scene.harmonic,
            scene.monitors,
        ]
        mass, stiffness, *vectors = (np.ascontiguousarray(array, dtype=float) for array in arrays)
        damping, gyroscopic, ratios = (
            None if array is None else np.ascontiguousarray(array, dtype=float)
            for array in (scene.damping, scene.gyroscopic, scene.damping_ratios)
        )
        raw = RawScene(
            len(mass),
            self.contacts,
            len(scene.directions),
            len(scene.static),
            len(scene.harmonic),
            len(scene.monitors),
            DAMPING_KINDS[scene.damping_kind],
            scene.damping_value,
            mass.ctypes.data,
            stiffness.ctypes.data,
            *(None if array is None else array.ctypes.data for array in (damping, gyroscopic, ratios)),
            ctypes.cast(laws, ctypes.c_void_p),
            *(vector.ctypes.data for vector in vectors),
        )
        message = loading.message_buffer()
        status = self._library.attrito_integrator_create(
            ctypes.byref(raw), ctypes.byref(self._handle), message, len(message)
        )
        loading.check(status, message)

    def start_static(
        self,
        path: np.ndarray,
        steps: int = 20,
        sliders: np.ndarray | None = None,
        static_factors: np.ndarray | None = None,
    ) -> None:
        """Stand still at the end of a static load path, `[corners, loads]`, followed from sliders `[nc, 2]` (zero).

        Runs multiply their static profile by `static_factors`, or by the end of the path.
        """
        path = np.ascontiguousarray(path, dtype=float).reshape(len(path), len(self._scene.static))
        given = None if sliders is None else np.ascontiguousarray(sliders, dtype=float)
        self._factors = np.array(path[-1] if static_factors is None else static_factors, dtype=float)
        self._call(
            "attrito_integrator_start_static",
            len(self._scene.static),
            len(path),
            pointer(path),
            steps,
            None if given is None else pointer(given),
        )

    def start(
        self,
        displacement: np.ndarray,
        velocity: np.ndarray,
        sliders: np.ndarray,
        static_factors: np.ndarray | None = None,
    ) -> None:
        """Stand at a state: displacement and velocity `[m]`, sliders `[nc, 2]`; factors on the static loads of runs."""
        arrays = [np.ascontiguousarray(array, dtype=float) for array in (displacement, velocity, sliders)]
        if static_factors is not None:
            self._factors = np.array(static_factors, dtype=float)
        self._library.attrito_integrator_start(self._handle, len(self._scene.mass), *map(pointer, arrays))

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement `[m]`, velocity `[m]`, sliders `[nc, 2]` as the session is."""
        m = len(self._scene.mass)
        arrays = np.zeros(m), np.zeros(m), np.zeros((self.contacts, 2))
        self._library.attrito_integrator_state(self._handle, m, *map(pointer, arrays))
        return arrays

    def touching(self) -> int:
        """How many contacts carry a normal force as the session is."""
        touching: int = self._library.attrito_integrator_touching(self._handle)
        return touching

    def run(self, choices: Run) -> Orbit:
        """Integrate from the session's state until steady; its state is then that of the end."""
        profiles = [
            np.ascontiguousarray(np.zeros((0, 2)) if profile is None else profile, dtype=float).reshape(-1, 2)
            for profile in (choices.static_profile, choices.harmonic_profile)
        ]
        steps = choices.steps_per_period or DEFAULT_STEPS.get(choices.scheme, 100)
        raw = RawRun(
            SCHEMES.index(choices.scheme),
            steps,
            choices.cycles,
            choices.fewest_cycles,
            choices.max_period_multiple,
            choices.samples,
            choices.whole_run,
            *(len(profile) for profile in profiles),
            2.0 * np.pi * choices.frequency_hz,
            choices.level,
            -1.0 if choices.dissipation is None else choices.dissipation,
            choices.periodicity_tolerance,
            self._factors.ctypes.data,
            *(profile.ctypes.data for profile in profiles),
        )
        report = RawOrbit()
        self._call("attrito_integrator_run", ctypes.byref(raw), ctypes.byref(report))
        return self._orbit(report)

    def _orbit(self, report: RawOrbit) -> Orbit:
        rows, count = len(self._scene.directions), len(self._scene.monitors)
        ns = report.samples
        measures = np.zeros((count, 3)), np.zeros(rows), np.zeros((self.contacts, 5))
        time = np.zeros(ns)
        monitors, displacement, force = (np.zeros((ns, n)) for n in (count, rows, rows))
        regime = np.zeros((ns, self.contacts), dtype=np.int32)
        if report.outcome != OUTCOMES.index("not_converged") or ns:
            self._fetch("attrito_integrator_measures", *measures)
            self._fetch("attrito_integrator_samples", time, monitors, displacement, force, regime)
        (mean, low, high), forces, contacts = measures[0].T, measures[1], measures[2].T
        stick, slip, opened, normal_min, friction = contacts
        multiple = max(1, report.period)
        return Orbit(
            OUTCOMES[report.outcome],
            WORDS[REASONS[report.reason]],
            report.period,
            report.cycles,
            report.defect,
            report.contraction,
            report.amplitude,
            report.events,
            report.chatter,
            report.work / multiple,
            report.damping / multiple,
            0.5 * high - 0.5 * low,  # which may be as large as numbers go
            mean,
            low,
            high,
            forces,
            normal_min,
            stick,
            slip,
            opened,
            friction,
            time,
            monitors,
            displacement,
            force,
            regime,
            report.seconds,
        )

    def close(self) -> None:
        """Give everything back."""
        if self._handle:
            self._library.attrito_integrator_destroy(self._handle)
            self._handle = None

    def __enter__(self) -> Integrator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _fetch(self, name: str, *arrays: np.ndarray) -> None:
        getattr(self._library, name)(self._handle, *map(pointer, arrays))

    def _call(self, name: str, *arguments: object) -> None:
        message = loading.message_buffer()
        status = getattr(self._library, name)(self._handle, *arguments, message, len(message))
        loading.check(status, message)
