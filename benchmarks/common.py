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

import bench_library
import numpy as np
from mpi4py import MPI

from attrito.library.names import STATES
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.library.structures import make_law, pointer

# A working set of as many bytes is taken to stay in a core's own cache.
CACHE = 2**20 // 2


class TimedSolver(Solver):
    """A solver whose kernels can be timed at its present point."""

    def __init__(self, scene: ReducedScene, options: Options):
        super().__init__(MPI.COMM_WORLD, scene, options)
        self._bench = bench_library.load()

    def solve_from_static(self, frequency_hz: float, level: float) -> Point:
        """Apply the static loads, then solve one point from there."""
        self.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency_hz)
        return next(self.solve_at([frequency_hz], level, 0))

    def set_stuck_response(self, frequency_hz: float, level: float) -> None:
        """Make the stuck system's response the present point, which no solve has to reach."""
        self._ask("set_stuck_response", 2.0 * np.pi * frequency_hz, level)

    def slip_stuck_response(self, frequency_hz: float, share: float, highest: float) -> None:
        """Make the least stuck response the present point at which the stated share of the rows of tangents is active.

        `highest`: a level at which all are.
        """
        tangents = self._scene.laws["tangents"].sum() * (2 * self._options.harmonics + 1)
        low, high = 0.0, 0.0 if share <= 0.0 else highest
        while high - low > 1e-4 * highest:
            middle = 0.5 * (low + high)
            self.set_stuck_response(frequency_hz, middle)
            low, high = (middle, high) if self.active_rows() < share * tangents else (low, middle)
        self.set_stuck_response(frequency_hz, high)

    def active_rows(self) -> int:
        """Rows of the Jacobian at the present point that are not zero."""
        seconds, residual, active = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
        self._ask("time_residual", 1, ctypes.byref(seconds), ctypes.byref(residual), ctypes.byref(active))
        return active.value

    def evaluation(self) -> dict[str, float]:
        """Seconds of one residual and Jacobian, the residual relative to the motion, active rows of the Jacobian."""
        seconds, residual, active = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()

        def mean(repeats: int) -> float:
            self._ask("time_residual", repeats, ctypes.byref(seconds), ctypes.byref(residual), ctypes.byref(active))
            return seconds.value

        least = least_mean(mean)
        return {"seconds": least, "residual": residual.value, "active_rows": active.value}

    def linearised_step(self) -> tuple[float, int]:
        """Seconds of one linearised step, and its iterations of GMRES, 0 where it is eliminated."""
        seconds, iterations = ctypes.c_double(), ctypes.c_int()

        def mean(repeats: int) -> float:
            self._ask("time_newton_step", repeats, ctypes.byref(seconds), ctypes.byref(iterations))
            return seconds.value

        return least_mean(mean), iterations.value

    def linear_points(self, frequencies_hz: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """A linear response with every contact row recovered, reported point by point as a sweep is.

        Frequency, coefficients of the monitors and their amplitudes.
        """
        points = []
        for frequency in frequencies_hz:
            self._ask("linear_response", 2.0 * np.pi * frequency, *self._told_at)
            harmonics, amplitude = self._told
            points.append((frequency, harmonics.copy(), amplitude.copy()))
        return points

    def seconds_of_linear_response(self, frequency_hz: float) -> float:
        """Seconds of a linear response that recovers every contact row, at one frequency."""
        seconds = ctypes.c_double()

        def mean(repeats: int) -> float:
            self._ask("time_linear_response", 2.0 * np.pi * frequency_hz, repeats, ctypes.byref(seconds))
            return seconds.value

        return least_mean(mean)

    def _ask(self, name: str, *arguments: object) -> None:
        """Call an entry of the benchmarks' library; `RuntimeError` where its system is singular."""
        if getattr(self._bench, f"attrito_bench_{name}")(self.handle, *arguments) != 0:
            raise RuntimeError(f"{name}: the system is singular at this point")


def contact_kernel(laws: dict[str, np.ndarray], motion: np.ndarray, periodic: bool = True) -> dict[str, float]:
    """Seconds of one contact's forces and Jacobian, and the part of the period that it moves.

    `periodic`: two tangents are marched once, from a slider that is an unknown, rather than twice.

    `motion`: coefficients `[tangents + 1, 2 H + 1]`.
    """
    motion = np.ascontiguousarray(motion, dtype=float)
    seconds, moving = ctypes.c_double(), ctypes.c_double()
    law = make_law(laws, 0)

    def mean(repeats: int) -> float:
        bench_library.load().attrito_bench_time_contact(
            ctypes.byref(law),
            motion.shape[1],
            pointer(motion),
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
