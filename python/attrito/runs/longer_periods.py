"""What becomes of a point that the balance has no solution at: motion in time from the static one, and its period.

Event-exact integration under the point's loads until a period is recognised, up to 32 of the excitation's, or for
400 cycles. If it is one there is an orbit after all, which the balance has not found (`not_converged`); if it is
another, or none, that is the evidence of `no_period_one_orbit`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.library.integrator import Integrator, Run
from attrito.library.laws import are_coulomb
from attrito.library.names import NO_SOLUTION
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.scene.stiff_contacts import PRECISION, contact_stiffness_ratio
from attrito.support.errors import NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.job.job import Job

LONGEST, CYCLES, PERIODICITY = 32, 400, 1e-8
# Beyond so many contacts a point would cost minutes.
MOST_CONTACTS = 12


class LongerPeriods:
    """Follows a run and integrates where it found no orbit, if stability is examined; only the root does anything.

    Parameters
    ----------
    comm, solver : what solves
    job : says whether stability is examined
    scene : at the root
    path : static load path, `[corners, loads]`, at the root
    """

    def __init__(self, comm: Comm, solver: Solver, job: Job, scene: ReducedScene | None, path: np.ndarray | None):
        self._comm, self._solver, self._scene, self._path = comm, solver, scene, path
        self._steps = job["static"]["steps"]
        self._asks = job["stability"]["method"] != "none" and comm.rank == 0 and can_integrate(scene)

    def visit(self, point: Point) -> Point:
        """The point with its outcome by what motion in time does; it is the solver's last. Collective."""
        if point.outcome not in NO_SOLUTION:
            return point
        period = self._comm.bcast(self._period(point) if self._asks else None)
        if period is None:
            return point
        self._solver.set_period_in_time(period)
        return point._replace(outcome=self._solver.outcome())

    def _period(self, point: Point) -> int | None:
        # Rounding of the contact forces hides whether a period repeats.
        if PRECISION * contact_stiffness_ratio(self._scene, point.frequency_hz) > PERIODICITY:
            return None
        choices = Run(
            point.frequency_hz,
            point.level,
            cycles=CYCLES,
            periodicity_tolerance=PERIODICITY,
            max_period_multiple=LONGEST,
            samples=1,
        )
        with Integrator(self._scene) as session:
            try:
                session.start_static(self._path, self._steps)
            except NumericsError:
                return None
            orbit = session.run(choices)
        # What still settles after all has no period yet, and none is claimed.
        return orbit.period if orbit.outcome != "not_converged" else None


def can_integrate(scene: ReducedScene) -> bool:
    """Whether event-exact integration takes a scene, and soon is done."""
    soon = len(scene.laws) <= MOST_CONTACTS
    whole = scene.sector is None
    return whole and scene.damping_kind != "loss_factor" and are_coulomb(scene.laws) and soon
