"""The solver of the Fortran library as a Python object. All calls are collective."""

from __future__ import annotations

import ctypes
import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.library import loading
from attrito.library.kernels import slider_width
from attrito.library.names import DAMPING_KINDS, OUTCOMES, REFERENCES, STARTS, STRATEGIES
from attrito.library.points import LinearModes, Point, StoredPoint
from attrito.library.reduced_scene import ReducedScene, Sector
from attrito.library.series import Series
from attrito.library.signatures import SERIES_CALLBACK
from attrito.library.structures import ERRORS, RawOptions, RawPoint, make_laws, omega, pointer
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


@dataclass(frozen=True)
class Options:
    """Choices of the harmonic balance; see docs/reference/job.md.

    `accepted_error`: relative error of the amplitude beyond which a point is `above_tolerance`; 0: not checked. With
    `choose_harmonics` the number given is the one to begin with, and `accepted_error` what it is chosen by.
    `mode_error`: the reduced model's own share of the error.
    `curve_tolerance`: error of the curve drawn through a sweep's points, part of the largest amplitude.
    `integrate_in_time`: may points that are found from no other start be sought from motion integrated in time?
    """

    harmonics: int = 5
    samples: int = 128
    rounds: int = 20
    max_iterations: int = 30
    reset_slider: bool = False
    uncoupled: bool = False
    choose_harmonics: bool = False
    integrate_in_time: bool = True
    tolerance: float = 1e-10
    accepted_error: float = 0.0
    mode_error: float = 0.0
    curve_tolerance: float = 0.01


# Rigid-body modes on a suspension that are looked for; by what part they may lie above its frequency
MOST_SUSPENDED, SUSPENDED = 24, 0.01

_errors_of = operator.attrgetter(*ERRORS)


class Solver:
    """A session of the library on a reduced scene; close it, or use it in a `with` block."""

    def __init__(self, comm: Comm, scene: ReducedScene, options: Options):
        self._library = loading.load()
        self._scene, self._options = scene, options
        # A row of the last point
        self.coefficients = 2 * options.harmonics + 1
        # Counted up to the end of the last static load path
        self.static_work, self.static_states = 0.0, (0, 0, 0, 0)
        self._make_room(options.harmonics)
        m = len(scene.mass)
        damping = None if scene.damping is None else pointer(scene.damping)
        self._handle: ctypes.c_void_p | None = ctypes.c_void_p(
            self._library.attrito_create(
                comm.py2f(),
                m,
                pointer(scene.mass),
                pointer(scene.stiffness),
                DAMPING_KINDS[scene.damping_kind],
                scene.damping_value,
                damping,
            )
        )
        if scene.damping_ratios is not None:
            self._library.attrito_set_damping_ratios(self._handle, m, pointer(scene.damping_ratios))
        if scene.gyroscopic is not None:
            self._library.attrito_set_gyroscopic(self._handle, m, pointer(scene.gyroscopic))
        self._library.attrito_set_loads(
            self._handle,
            len(scene.static),
            pointer(scene.static),
            len(scene.harmonic),
            pointer(scene.harmonic),
            len(scene.monitors),
            pointer(scene.monitors),
        )
        laws = make_laws(scene.laws)
        rows = len(scene.directions)
        self._library.attrito_set_contacts(self._handle, len(laws), laws, rows, pointer(scene.directions))
        if scene.sector is not None:
            self._set_sector(scene.sector)
        given = RawOptions(**{name: getattr(options, name) for name, *_ in RawOptions._fields_})
        self._call("attrito_prepare", ctypes.byref(given))

    def _set_sector(self, sector: Sector) -> None:
        lower, upper, along, across = (
            pointer(np.ascontiguousarray(places, dtype=np.int32))
            for places in (sector.lower, sector.upper, sector.along, sector.across)
        )
        self._library.attrito_set_sector(
            self._handle,
            sector.sectors,
            sector.engine_order,
            len(sector.lower),
            lower,
            upper,
            len(sector.along),
            along,
            len(sector.across),
            across,
            len(sector.next_directions),
            pointer(np.ascontiguousarray(sector.next_directions, dtype=float)),
        )

    def take(self, scene: ReducedScene) -> bool:
        """Go on with a scene that differs in friction, gaps and preloads of contacts alone; False if in more.

        The modes stay. Its static path is to be followed next.
        """
        if not self._scene.has_the_modes_of(scene):
            return False
        self._scene = scene
        laws = make_laws(scene.laws)
        self._library.attrito_change_laws(self._handle, len(laws), laws)
        return True

    def coordinates(self) -> np.ndarray:
        """Fourier coefficients of the model's coordinates at the last point, `[m, 2 H + 1]`."""
        motion = np.zeros((len(self._scene.mass), self.coefficients))
        self._library.attrito_coordinates(self._handle, self.coefficients, pointer(motion))
        return motion

    def follow_static_path(self, path: np.ndarray, steps: int, frequency_hz: float) -> np.ndarray:
        """Follow the static load path, `[corners, loads]`; returns the means of the monitors."""
        path = np.ascontiguousarray(path, dtype=float).reshape(len(path), len(self._scene.static))
        raw = RawPoint()
        sizes = path.shape[1], path.shape[0]
        self._call("attrito_follow_static_path", *sizes, pointer(path), steps, omega(frequency_hz), ctypes.byref(raw))
        self.static_work, self.static_states = raw.work, tuple(raw.states)
        return self._monitors(raw.harmonic_count)[0][:, 0]

    def sweep(
        self,
        start_hz: float,
        stop_hz: float,
        level: float,
        branch: int,
        max_points: int,
        within_hz: tuple[float, float] | None = None,
    ) -> Iterator[Point]:
        """Follow the branch from one frequency to another, a point at a time.

        Steps are parts of this range, or of a wider one `within_hz`.
        """
        self.set_excitation(start_hz, stop_hz, level, branch, max_points)
        if within_hz is not None:
            self._library.attrito_scale_sweep(self._handle, omega(within_hz[0]), omega(within_hz[1]))
        yield from self.go_on()

    def go_on(self) -> Iterator[Point]:
        """The points of a sweep that are left after the last."""
        raw = RawPoint()
        told_at, next_point = ctypes.byref(raw), self._library.attrito_next_point
        while not raw.finished:
            next_point(self._handle, told_at)
            yield self.point_of(raw, followed=True)

    def set_excitation(
        self, start_hz: float, stop_hz: float, level: float, branch: int = 0, max_points: int = 0
    ) -> None:
        """Harmonic loads at a level, and scales for a range of frequency; a sweep may begin."""
        self._library.attrito_begin_sweep(self._handle, omega(start_hz), omega(stop_hz), level, branch, max_points)

    def follow(self, start_hz: float, stop_hz: float, branch: int, max_points: int, way: int) -> Iterator[Point]:
        """Follow the one branch of the solver's present point until it leaves a range, closes, or is lost.

        Towards growing (1) or falling (-1) frequency, or (0) back from where the last sweep has come to; the first
        point is the present one.
        """
        self._library.attrito_begin_branch(self._handle, omega(start_hz), omega(stop_hz), way, branch, max_points)
        yield from self.go_on()

    @property
    def tolerance(self) -> float:
        """What points are solved to."""
        return self._options.tolerance

    @property
    def slider_width(self) -> int:
        """How many numbers the sliders of a contact take."""
        return slider_width(self._scene.laws)

    def start_from(self, point: StoredPoint, level: float) -> bool:
        """Solve at a point of a result, from its motion; it is then the solver's point."""
        return bool(
            self.call(
                "attrito_start_from_motion",
                point.coordinates.shape[1],
                pointer(np.ascontiguousarray(point.coordinates, dtype=float)),
                pointer(np.ascontiguousarray(point.slider, dtype=float)),
                omega(point.frequency_hz),
                level,
            )
        )

    def seek(self, way: str, frequency_hz: float, factor: float) -> bool:
        """Look for a point at a frequency by one of `STARTS`; it is then the solver's point."""
        return bool(self.call("attrito_seek", STARTS.index(way), omega(frequency_hz), factor))

    def solve_at(self, frequencies_hz: list[float], level: float, branch: int) -> Iterator[Point]:
        """Solve frequencies one by one, each starting from the one before."""
        low, high = min(frequencies_hz), max(frequencies_hz)
        self._library.attrito_begin_sweep(self._handle, omega(low), omega(high), level, branch, 0)
        yield from self.go_on_at(frequencies_hz, branch)

    def go_on_at(self, frequencies_hz: list[float], branch: int) -> Iterator[Point]:
        """The frequencies of a list that are left after the last point."""
        raw = RawPoint()
        for frequency in frequencies_hz:
            self._library.attrito_solve_at(self._handle, omega(frequency), branch, ctypes.byref(raw))
            yield self.point_of(raw)

    def solve_by_strategy(self, strategy: str, frequency_hz: float) -> Point:
        """A point by one of `STRATEGIES` alone; the session's last point stays the one before, whatever it finds.

        After `solve_at` or `sweep` have begun, which set the level of the loads.
        """
        raw = RawPoint()
        if (
            self._library.attrito_solve_by_strategy(
                self._handle, strategy.encode(), omega(frequency_hz), ctypes.byref(raw)
            )
            != 0
        ):
            raise ValueError(f"{strategy!r} is none of the strategies: {', '.join(STRATEGIES)}")
        return self.point_of(raw)

    def linear_response(
        self, reference: str, frequencies_hz: np.ndarray, natural: int
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Amplitudes `[monitors, frequencies]` at level 1 of one of `REFERENCES`; `tangent` after the static path.

        Also the lowest `natural` natural frequencies of its elastic modes, Hz, and how many rigid-body modes it has,
        those on a suspension among them.
        """
        angular = np.ascontiguousarray(2.0 * np.pi * np.asarray(frequencies_hz, dtype=float))
        amplitude = np.zeros((len(self._scene.monitors), len(angular)))
        listed = natural + MOST_SUSPENDED if self._scene.suspension_hz and natural else natural
        lowest, rigid = np.zeros(listed), ctypes.c_int()
        self._call(
            "attrito_linear_response",
            REFERENCES.index(reference),
            len(angular),
            pointer(angular),
            pointer(amplitude),
            listed,
            pointer(lowest),
            ctypes.byref(rigid),
        )
        lowest = lowest[: max(len(self._scene.mass) - rigid.value, 0)]
        suspended = self._suspended(lowest)
        return amplitude, lowest[suspended : suspended + natural], rigid.value + suspended

    def _suspended(self, natural_hz: np.ndarray) -> int:
        """How many of some frequencies, ascending, are of motions that nothing but the suspension holds.

        Nothing is lower than these; (2 pi f)^2 M rounds beside the largest eigenvalue of K, hence the part added.
        """
        highest = (1.0 + SUSPENDED) * self._scene.suspension_hz
        return int(np.count_nonzero(natural_hz <= highest)) if highest > 0.0 else 0

    @property
    def sector(self) -> Sector | None:
        """What makes the scene one of N sectors; None: it is whole."""
        return self._scene.sector

    @property
    def has_coriolis(self) -> bool:
        """Whether there are Coriolis forces."""
        return self._scene.gyroscopic is not None

    def linear_modes(self, reference: str, count: int) -> LinearModes:
        """The lowest modes, at most `count`, of one of `REFERENCES`; `tangent` after the static path."""
        if self._scene.sector is not None:
            raise ValueError("modes of a sector are those of a nodal diameter: take diameter_modes")
        count = min(count, len(self._scene.mass))
        natural, ratio, rigid = np.zeros(count), np.zeros(count), ctypes.c_int()
        shapes = np.zeros((count, len(self._scene.mass)))
        arrays = pointer(natural), pointer(ratio), pointer(shapes)
        self._call("attrito_linear_modes", REFERENCES.index(reference), count, *arrays, ctypes.byref(rigid))
        first = max(rigid.value, self._suspended(natural))
        ratio[:first] = 0.0
        return LinearModes(natural, ratio, shapes, first)

    def diameter_modes(self, reference: str, diameter: int, count: int) -> LinearModes:
        """Those of a sector at a nodal diameter, `linear_modes` being of a structure by itself.

        Shapes are complex, x = cosine - i sine and x^H M x = 1, in the sector's own coordinates.
        """
        if self._scene.sector is None:
            raise ValueError("nodal diameters are those of a sector's wheel: take linear_modes")
        m = len(self._scene.mass)
        count = min(count, self._scene.sector.expansion(m, diameter).shape[1])
        natural, ratio, rigid = np.zeros(count), np.zeros(count), ctypes.c_int()
        cosine, sine = np.zeros((count, m)), np.zeros((count, m))
        arrays = (pointer(values) for values in (natural, ratio, cosine, sine))
        self._call("attrito_diameter_modes", REFERENCES.index(reference), diameter, count, *arrays, ctypes.byref(rigid))
        return LinearModes(natural, ratio, cosine - 1j * sine, rigid.value)

    def closed_contacts(self) -> np.ndarray:
        """Which contacts touch at the static solution, `[nc]`; after the static path."""
        closed = np.zeros(len(self._scene.laws["tangents"]), dtype=np.int32)
        self._library.attrito_closed_contacts(self._handle, pointer(closed))
        touching: np.ndarray = closed != 0
        return touching

    def outcome(self) -> str:
        """Outcome of the last point by all that has been found of it: its examination, motion in time."""
        return OUTCOMES[self.call("attrito_outcome")]

    def set_period_in_time(self, period: int) -> None:
        """Note the period of motion in time at the last point, which has no solution; 0: none. On every rank."""
        self._library.attrito_set_period_in_time(self._handle, period)

    def report_point(self, hear: Callable[[str, Series, np.ndarray], None] | None) -> None:
        """Hand the last point to `hear`, series by series: path, what it is, and the entry. None but at the root."""
        monitors = "\n".join(self._scene.monitor_names).encode()
        if hear is None:
            self._library.attrito_report_point(self._handle, monitors, SERIES_CALLBACK())
            return

        def series(
            path: bytes,
            kind: bytes,
            dimensions: int,
            extent: Any,
            values: Any,
            description: bytes,
            unit: bytes,
            names: bytes,
        ) -> None:
            shape = tuple(extent[:dimensions])
            entry = np.array(values[: math.prod(shape)]).reshape(shape)
            what = Series(
                kind.decode(), description.decode(), unit.decode(), tuple(filter(None, names.decode().split(",")))
            )
            hear(path.decode(), what, entry.astype(np.int32) if what.kind == "int32" else entry)

        self._library.attrito_report_point(self._handle, monitors, SERIES_CALLBACK(series))

    def save_state(self) -> np.ndarray:
        """What the last point leaves for the next on this rank: numbers that `load_state` understands."""
        numbers = np.zeros(self._library.attrito_save_state(self._handle))
        self._library.attrito_fetch_state(self._handle, pointer(numbers))
        return numbers

    def load_state(self, numbers: np.ndarray) -> bool:
        """Go on from what was put down on as many ranks; False if it is not of this kind."""
        numbers = np.ascontiguousarray(numbers)
        return bool(self._library.attrito_load_state(self._handle, len(numbers), pointer(numbers)))

    def take_sliders(self, slider: np.ndarray, coefficients: int) -> None:
        """Leave the contacts as they are at the point that was loaded, a row of which has so many coefficients.

        `slider`: at the start of its period, `[nc, width]`.
        """
        self.coefficients = coefficients
        self.call("attrito_take_sliders", pointer(np.ascontiguousarray(slider, dtype=float)))

    def work_of_visits(self) -> float:
        """Floating-point operations since other members were begun to be visited; see `attrito.library.family`."""
        operations: float = self._library.attrito_family_work(self._handle)
        return operations

    @property
    def handle(self) -> ctypes.c_void_p | None:
        """The session as entries of libraries take it; None once it is closed."""
        return self._handle

    def call(self, name: str, *arguments: object) -> int:
        """A function of the library that takes this session and returns a number; see `attrito.library.family`."""
        answer: int = getattr(self._library, name)(self._handle, *arguments)
        return answer

    def close(self) -> None:
        """Give everything back."""
        if self._handle:
            self._library.attrito_destroy(self._handle)
            self._handle = None

    def __enter__(self) -> Solver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _monitors(self, harmonic_count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self._told[0].shape[1] != 2 * harmonic_count + 1:
            self._make_room(harmonic_count)
        self._library.attrito_monitors(self._handle, *self._told_at)
        harmonics, amplitude, rate = self._told
        return harmonics.copy(), amplitude.copy(), rate.copy()

    def _make_room(self, harmonic_count: int) -> None:
        """For what the library reports of the monitors; kept from point to point."""
        count = len(self._scene.monitors)
        self._told = np.zeros((count, 2 * harmonic_count + 1)), np.zeros(count), np.zeros(count)
        self._told_at = tuple(pointer(array) for array in self._told)

    def point_of(self, raw: RawPoint, followed: bool = False) -> Point:
        """The solver's present point, of which the library has given these numbers.

        Raises
        ------
        NumericsError : PETSc failed
        """
        if raw.petsc_error:
            raise NumericsError(f"PETSc failed (error {raw.petsc_error}) while solving a point")
        self.coefficients = 2 * raw.harmonic_count + 1
        return Point(
            raw.frequency_hz,
            raw.level,
            raw.branch,
            raw.iterations,
            raw.linear_iterations,
            OUTCOMES[raw.outcome],
            raw.unique == 1,
            raw.residual,
            raw.estimate,
            _errors_of(raw),
            raw.samples,
            raw.work,
            tuple(raw.states),
            *self._monitors(raw.harmonic_count),
            bool(raw.finished),
            bool(raw.reached_stop),
            followed,
        )

    def _call(self, name: str, *arguments: object) -> None:
        message = loading.message_buffer()
        status = getattr(self._library, name)(self._handle, *arguments, message, len(message))
        loading.check(status, message)
