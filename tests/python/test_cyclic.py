"""One sector under a travelling wave moves as in the whole wheel."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import run
from mpi4py import MPI
from wheels import lumped_sector

from attrito.job.reading import read_job
from attrito.library.points import StoredPoint
from attrito.library.session import Options, Solver
from attrito.results.result import Result
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.wheel import delayed, whole_wheel

HARMONICS = 3
FREQUENCIES = [42.0, 36.0, 31.0, 26.0]
# Both are solved to 1e-13 of the motion; the condition of the balance is below 1e3 at these frequencies.
CLOSE = 1e-9


def points_of(scene, level):
    """Points and motion of all coordinates at the frequencies."""
    options = Options(harmonics=HARMONICS, tolerance=1e-13)
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.zeros((1, 0)), 1, FREQUENCIES[0])
        return [(point, solver.coordinates()) for point in solver.solve_at(FREQUENCIES, level, 0)]


def scene_of(sectors, engine_order):
    job = read_job(lumped_sector(sectors, engine_order))
    return reduced_scene(job, build_scene(job))


# Forward, backward, standing, an order beyond the number of sectors
@pytest.mark.parametrize("sectors, engine_order", [(3, 1), (6, 4), (8, 4), (5, -7), (12, 5)])
# They slip; they open, too
@pytest.mark.parametrize("level", [8.0, 40.0])
def test_one_sector_moves_as_in_the_whole_wheel(sectors, engine_order, level):
    scene = scene_of(sectors, engine_order)
    wheel = whole_wheel(scene)
    assert len(wheel.mass) == sectors * (len(scene.mass) - len(scene.sector.upper))
    compared = 0
    for (one, _), (whole, _) in zip(*(points_of(each, level) for each in (scene, wheel)), strict=True):
        assert one.is_solved and whole.is_solved and one.unique == whole.unique
        # Sliders of contacts that stick all along start at other instants of each sector's own time.
        if not one.unique:
            continue
        compared += one.states[2] > 0
        assert np.allclose(one.harmonics, whole.harmonics, rtol=0.0, atol=CLOSE * np.abs(whole.harmonics).max())
    assert compared >= 2, "contacts do not slip: the test is void"


def test_a_wave_that_is_put_round_the_wheel_is_a_solution_there():
    scene = scene_of(5, 2)
    point, motion = points_of(scene, 10.0)[2]
    kept = np.delete(np.arange(len(motion)), scene.sector.upper)
    wave = np.vstack([delayed(motion.T, scene.sector, j).T[kept] for j in range(5)])
    options = Options(harmonics=HARMONICS, tolerance=1e-13)
    with Solver(MPI.COMM_SELF, whole_wheel(scene), options) as solver:
        solver.follow_static_path(np.zeros((1, 0)), 1, FREQUENCIES[0])
        solver.set_excitation(20.0, 45.0, 10.0)
        assert solver.start_from(StoredPoint(point.frequency_hz, wave, np.zeros((10, 2))), 10.0)
        assert np.allclose(solver.coordinates(), wave, rtol=0.0, atol=CLOSE * np.abs(wave).max())


@pytest.mark.parametrize("engine_order", [2, 3])
def test_frequencies_of_the_stuck_sector_are_those_of_the_wheel_at_its_nodal_diameter(engine_order):
    scene = scene_of(5, engine_order)
    natural = []
    for each in (scene, whole_wheel(scene)):
        with Solver(MPI.COMM_SELF, each, Options(harmonics=1)) as solver:
            natural.append(solver.linear_response("stuck", np.array([30.0]), 15)[1])
    own = natural[0][natural[0] > 0.0]
    assert len(own) == 3
    # Diameters 2 and 3 are one another's mirror images: each frequency of theirs comes twice in the wheel.
    for frequency in own:
        assert np.sum(np.abs(natural[1] - frequency) < 1e-9 * frequency) == 2


def test_a_job_of_a_sector_runs_on_one_rank_and_two(tmp_path):
    rows = []
    for ranks in (None, 2):
        run(tmp_path, lumped_sector(5, 2), ranks=ranks)
        with Result(tmp_path / "result.h5") as result:
            assert result.attribute("nodal_diameter") == "2"
            assert set(result.outcome) == {"converged"}
            rows.append(np.array([result.array("points/frequency_hz"), result.monitor("blade", "amplitude")]))
        (tmp_path / "result.h5").unlink()
    # Sums over ranks are rounded otherwise.
    assert rows[0].shape == rows[1].shape and np.allclose(*rows, rtol=1e-9)
