"""What the benchmarks share: a solver that times its own kernels, the rates of the machine, JSON out.

Times are the least of a few means, so that other work on the machine disturbs them little. Import this module before
numpy: BLAS reads its number of threads, one unless told, when it is loaded.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from mpi4py import MPI

from attrito.library import loading
from attrito.library.names import STATES
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Point, Solver
from attrito.library.structures import make_law, pointer

# A working set of as many bytes is taken to stay in a core's own cache.
CACHE = 2**20 // 2


class TimedSolver(Solver):
    """A solver whose kernels can be timed where it stands."""

    def __init__(self, scene: ReducedScene, options: Options):
        super().__init__(MPI.COMM_WORLD, scene, options)

    def stand_at(self, frequency_hz: float, level: float) -> Point:
        """Walk the static loads, then solve one point from there."""
        self.walk_static_path(np.array([[0.0], [1.0]]), 10, frequency_hz)
        return next(self.solve_at([frequency_hz], level, 0))

    def stand_at_stuck_response(self, frequency_hz: float, level: float) -> None:
        """Stand at the stuck system's response, which no solve has to reach."""
        omega = 2.0 * np.pi * frequency_hz
        if self._library.attrito_stand_at_stuck_response(self._handle, omega, level) != 0:
            raise RuntimeError("the stuck system is singular at this frequency")

    def slip_stuck_response(self, frequency_hz: float, share: float, highest: float) -> None:
        """Stand at the least stuck response at which the stated share of the rows of tangents is active.

        `highest`: a level at which all are.
        """
        tangents = self._scene.laws["tangents"].sum() * (2 * self._options.harmonics + 1)
        low, high = 0.0, 0.0 if share <= 0.0 else highest
        while high - low > 1e-4 * highest:
            middle = 0.5 * (low + high)
            self.stand_at_stuck_response(frequency_hz, middle)
            low, high = (middle, high) if self.active_rows() < share * tangents else (low, middle)
        self.stand_at_stuck_response(frequency_hz, high)

    def active_rows(self) -> int:
        """Rows of the Jacobian here that are not zero."""
        residual, active = ctypes.c_double(), ctypes.c_int()
        self._timed("attrito_time_evaluation", 1, ctypes.byref(residual), ctypes.byref(active))
        return active.value

    def evaluation(self) -> dict[str, float]:
        """Seconds of one residual and Jacobian, the residual relative to the motion, active rows of the Jacobian."""
        residual, active = ctypes.c_double(), ctypes.c_int()

        def mean(repeats: int) -> float:
            return self._timed("attrito_time_evaluation", repeats, ctypes.byref(residual), ctypes.byref(active))

        seconds = least_mean(mean)
        return {"seconds": seconds, "residual": residual.value, "active_rows": active.value}

    def linearised_step(self) -> tuple[float, int]:
        """Seconds of one linearised step, and its iterations of GMRES, 0 where it is eliminated."""
        iterations = ctypes.c_int()
        seconds = least_mean(lambda repeats: self._timed("attrito_time_step", repeats, ctypes.byref(iterations)))
        return seconds, iterations.value

    def linear_frf(self, frequencies_hz: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """A linear response with every contact row recovered, told point by point as a sweep is.

        Frequency, coefficients of the monitors and their amplitudes.
        """
        points = []
        point, handle = self._library.attrito_linear_point, self._handle
        for frequency in frequencies_hz:
            if point(handle, 2.0 * np.pi * frequency, *self._told_at) != 0:
                raise RuntimeError("the stuck system is singular at this frequency")
            harmonics, amplitude = self._told
            points.append((frequency, harmonics.copy(), amplitude.copy()))
        return points

    def linear_response(self, frequency_hz: float) -> float:
        """Seconds of a linear response that recovers every contact row, at one frequency."""

        def mean(repeats: int) -> float:
            seconds, omega = ctypes.c_double(), 2.0 * np.pi * frequency_hz
            if self._library.attrito_time_linear_response(self._handle, omega, repeats, ctypes.byref(seconds)) != 0:
                raise RuntimeError("the stuck system is singular at this frequency")
            return seconds.value

        return least_mean(mean)

    def _timed(self, name: str, repeats: int, *more: object) -> float:
        seconds = ctypes.c_double()
        if getattr(self._library, name)(self._handle, repeats, ctypes.byref(seconds), *more) != 0:
            raise RuntimeError(f"{name}: cannot be evaluated at this point")
        return seconds.value


def contact_kernel(
    laws: dict[str, np.ndarray], motion: np.ndarray, samples: int, by_events: bool, periodic: bool = True
) -> dict[str, float]:
    """Seconds of one contact's forces and Jacobian, and the part of the period that it moves.

    `periodic`: two tangents are marched once, from a slider that is an unknown, rather than twice.

    `motion`: coefficients `[tangents + 1, 2 H + 1]`.
    """
    motion = np.ascontiguousarray(motion, dtype=float)
    seconds, moving = ctypes.c_double(), ctypes.c_double()
    law = make_law(laws, 0)

    def mean(repeats: int) -> float:
        loading.load().attrito_time_contact(
            ctypes.byref(law),
            motion.shape[1],
            samples,
            pointer(motion),
            int(by_events),
            int(periodic),
            repeats,
            ctypes.byref(seconds),
            ctypes.byref(moving),
        )
        return seconds.value

    return {"seconds": least_mean(mean), "moving": moving.value}


def least_mean(mean: Callable[[int], float], batches: int = 5, enough: float = 0.05) -> float:
    """Least of the means over batches of repeats, each long enough for the clock; slow work is done but once more."""
    once = mean(1)
    repeats = max(round(enough / max(once, 1e-7)), 1)
    return min([once, *(mean(repeats) for _ in range(batches if once < 1.0 else 1))])


def repeated(work: Callable[[], object]) -> Callable[[int], float]:
    """Mean seconds of `work` by the number of repeats."""

    def mean(repeats: int) -> float:
        started = time.perf_counter()
        for _ in range(repeats):
            work()
        return (time.perf_counter() - started) / repeats

    return mean


def machine(size: int = 1000) -> dict[str, float]:
    """Rates that bound every kernel: flops of a dense product, bytes of a copy in and out of cache."""
    a, b, c = np.random.default_rng(0).standard_normal((3, size, size))
    product = least_mean(repeated(lambda: np.matmul(a, b, out=c)))
    return {
        "flops_per_second": 2.0 * size**3 / product,
        "cache_bytes_per_second": copy_rate(CACHE // 2),
        "memory_bytes_per_second": copy_rate(256 * CACHE),
    }


def copy_rate(size: int) -> float:
    """Bytes a second of a copy with `size` bytes at either end."""
    source, target = np.ones((2, size // 8))
    return 2.0 * source.nbytes / least_mean(repeated(lambda: np.copyto(target, source)))


def states(point: Point) -> dict[str, int]:
    """Contacts in each state."""
    return dict(zip(STATES, point.states, strict=True))


def report(result: object) -> None:
    """JSON on standard output, from one rank."""
    if MPI.COMM_WORLD.rank == 0:
        json.dump(result, sys.stdout, indent=1)
        print()


def progress(text: str) -> None:
    """A line for whoever waits."""
    if MPI.COMM_WORLD.rank == 0:
        print(text, file=sys.stderr, flush=True)
