"""An option of a session that no job has: where starts may come from."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from attrito.library.points import Point
from attrito.library.session import Options, Solver
from attrito_verification.scene_grid.scenes import Family

FREQUENCY = 80.0


def solved(strategy: str, **options: float) -> Point:
    """The slipping wedge by a strategy alone."""
    scene = Family(1, 10.0, 0.3, "small", 45.0).scene()
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=10, **options)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 20, FREQUENCY)
        solver.set_excitation(FREQUENCY, FREQUENCY, 1.0)
        return solver.solve_by_strategy(strategy, FREQUENCY)


def test_starts_come_from_integration_in_time_only_where_that_is_allowed():
    allowed, refused = solved("time_integration"), solved("time_integration", integrate_in_time=False)
    assert allowed.is_solved and allowed.iterations > 0
    assert not refused.is_solved and refused.iterations == 0
