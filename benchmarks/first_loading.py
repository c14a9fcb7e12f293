r"""First loading of a mode by its inertia forces, by an independent dense solution: what Masing's rule starts from.

    K x + B^T lambda(B x, w) = f_0 + alpha M phi,   q = phi^T M (x - x_0),

alpha grows from 0 by small steps, each with the sliders w of the one before. The equations are condensed onto the
contacts about the springs of those that are closed at rest, d = d_0 + alpha d_1 - R (lambda - S d), and solved by
Newton's method on the contacts that slip, open or close. Nothing of the library is used but the static solution and the
tangent mode; contacts are Coulomb's, with two tangents. With q(alpha),

    omega^2 = alpha / q,   D = 8 integral_0^q alpha dq - 4 alpha q,   zeta = D / (2 pi omega^2 q^2)

is Masing's rule on the whole; on each contact by itself, with T the tangential force since the start,

    D = sum over contacts of (8 integral T . du - 4 T . u),

which leaves out what normal springs store and give back.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import common  # isort: skip  # noqa: F401 (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI
from scipy.linalg import cho_factor, cho_solve

from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.modes.nonlinear import chosen_mode
from attrito.modes.scene_at_rest import prepare, solver_at_rest
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene

TOLERANCE, MOST_ITERATIONS, LEAST_PART = 1e-11, 60, 2e-3


@dataclass(frozen=True)
class Curve:
    """Of the first loading at each step: q, omega, both damping ratios, how many contacts have slipped or are open."""

    amplitude: np.ndarray
    omega: np.ndarray
    masing: np.ndarray
    by_contacts: np.ndarray
    slipped: np.ndarray
    open: np.ndarray


def at_rest(path: Path | Job) -> dict[str, np.ndarray]:
    """What is loaded: the reduced scene of a job, its static solution, and the tangent mode that `[mode]` means.

    Its first monitor moves in its positive direction: contacts that open make both ways differ.
    """
    comm, job = MPI.COMM_SELF, path if isinstance(path, Job) else read_job(str(path), excited=False)
    progress = Progress(comm)
    prepared = prepare(comm, job, build_scene(job), progress)
    with solver_at_rest(comm, job, prepared, progress) as solver:
        displacements, closed = solver.coordinates()[:, 0], solver.closed_contacts()
        number, modes = chosen_mode(comm, job, solver)
    scene, shape = prepared.reduced, modes.shapes[number - 1].real
    names = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap")
    return {name: scene.laws[name] for name in names} | {
        "mass": scene.mass,
        "stiffness": scene.stiffness,
        "directions": scene.directions,
        "load": prepared.load_path[-1] @ scene.static,
        "displacements": displacements,
        "closed": np.asarray(closed, dtype=bool),
        "shape": shape if scene.monitors[0] @ shape >= 0.0 else -shape,
        "omega": np.array(2.0 * np.pi * modes.natural_hz[number - 1]),
    }


class Loading:
    """The condensed equations of what `at_rest` returns; contacts stuck at rest have not slipped there."""

    def __init__(self, model: dict[str, np.ndarray]):
        rows, mass = model["directions"], model["mass"]
        self._kt, self._kn, self._mu = (
            model[name] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient")
        )
        self._gap, self.omega = model["gap"], float(model["omega"])
        springs = np.stack([self._kt, self._kt, self._kn], 1)
        self._springs = np.where(model["closed"][:, None], springs, 0.0).ravel()
        factor = cho_factor(model["stiffness"] + (rows.T * self._springs) @ rows)
        push = mass @ model["shape"]
        answers = cho_solve(factor, np.column_stack([push, rows.T]))
        self._per_load, self._coordinate_per_load = rows @ answers[:, 0], float(push @ answers[:, 0])
        self._flexibility = rows @ answers[:, 1:]
        self._motion = rows @ model["displacements"]
        tangential = self._motion.reshape(-1, 3)[:, :2]
        self._sliders = np.where(model["closed"][:, None], 0.0, tangential)
        force, _ = self._force(self._motion, self._sliders)
        self._rest = self._motion + self._flexibility @ (force - self._springs * self._motion)

    def _force(self, motion: np.ndarray, sliders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """lambda `[rows]` and its derivative by the contact's own rows `[contacts, 3, 3]`."""
        d = motion.reshape(-1, 3)
        normal = np.maximum(self._kn * (d[:, 2] - self._gap), 0.0)
        pull = self._kt[:, None] * (d[:, :2] - sliders)
        size, limit = np.linalg.norm(pull, axis=1), self._mu * normal
        is_open, slips = normal <= 0.0, size > limit
        direction = pull / np.maximum(size, 1e-300)[:, None]
        tangential = np.where(slips[:, None], limit[:, None] * direction, pull)
        jacobian = np.zeros((len(d), 3, 3))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = self._kt
        turned = np.eye(2) - direction[:, :, None] * direction[:, None, :]
        part = (self._kt * limit / np.maximum(size, 1e-300))[:, None, None] * turned
        jacobian[slips, :2, :2] = part[slips]
        jacobian[slips, :2, 2] = ((self._mu * self._kn)[:, None] * direction)[slips]
        jacobian[:, 2, 2] = self._kn
        jacobian[is_open] = 0.0
        tangential[is_open] = 0.0
        return np.column_stack([tangential, normal]).ravel(), jacobian

    def _solve(self, load: float, motion: np.ndarray, sliders: np.ndarray) -> np.ndarray | None:
        """The motion at a load from that before it; None: there is none."""
        aim = self._rest + load * self._per_load

        def residual(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            force, jacobian = self._force(at, sliders)
            return aim - self._flexibility @ (force - self._springs * at) - at, jacobian

        rest, jacobian = residual(motion)
        for _ in range(MOST_ITERATIONS):
            if np.abs(rest).max() <= TOLERANCE * np.abs(aim).max():
                return motion
            jacobian[:, [0, 1, 2], [0, 1, 2]] -= self._springs.reshape(-1, 3)
            active = np.flatnonzero(np.abs(jacobian).max(axis=(1, 2)) > 1e-9 * self._kt)
            rows = (3 * active[:, None] + np.arange(3)).ravel()
            block = self._flexibility[np.ix_(rows, rows)].reshape(len(rows), len(active), 3)
            matrix = np.einsum("raj,ajk->rak", block, jacobian[active]).reshape(len(rows), len(rows))
            change = np.linalg.solve(matrix + np.eye(len(rows)), rest[rows]).reshape(-1, 3)
            step = rest - self._flexibility[:, rows] @ np.einsum("ajk,ak->aj", jacobian[active], change).ravel()
            part, before = 1.0, np.linalg.norm(rest)
            while True:
                rest, jacobian = residual(motion + part * step)
                if np.linalg.norm(rest) < (1.0 - 1e-4 * part) * before or part < LEAST_PART:
                    break
                part *= 0.5
            motion = motion + part * step
        return None

    def curve(self, loads: np.ndarray) -> Curve:
        """Load step by step to loads that ascend in size, as far as the contacts carry them."""
        motion, sliders = self._motion, self._sliders
        start = motion.reshape(-1, 3)[:, :2]
        before, moved = self._force(motion, sliders)[0].reshape(-1, 3)[:, :2], start
        first = before
        alpha, q, area, own = 0.0, 0.0, 0.0, np.zeros(len(start))
        rest = self._per_load @ (self._force(motion, sliders)[0] - self._springs * motion)
        found = []
        for load in loads:
            solved = self._solve(load, motion, sliders)
            if solved is None:
                break
            motion = solved
            force, _ = self._force(motion, sliders)
            u, now = motion.reshape(-1, 3)[:, :2], force.reshape(-1, 3)[:, :2]
            sliders = u - now / self._kt[:, None]
            coordinate = load * self._coordinate_per_load - (self._per_load @ (force - self._springs * motion) - rest)
            area += 0.5 * (load + alpha) * (coordinate - q)
            own += 0.5 * ((now + before - 2.0 * first) * (u - moved)).sum(axis=1)
            alpha, q, before, moved = load, coordinate, now, u
            work = 2.0 * np.pi * alpha * q
            by_contacts = (8.0 * own - 4.0 * ((now - first) * (u - start)).sum(axis=1)).sum() / work
            slipped = int((np.abs(sliders - self._sliders).max(axis=1) > 1e-9 * np.abs(u - start).max()).sum())
            counts = slipped, int((force[2::3] <= 0.0).sum())
            found.append((abs(q), np.sqrt(alpha / q), (8.0 * area - 4.0 * alpha * q) / work, by_contacts, *counts))
        return Curve(*np.array(found).T)
