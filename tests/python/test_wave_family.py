"""Bounds of a wave that is one of a family, in the sector's own time: all sectors start alike, each a little later."""

from __future__ import annotations

import numpy as np
import pytest
from jobs import everything, run
from mpi4py import MPI
from wheels import lumped_sector

from attrito.job.reading import read_job
from attrito.library.points import StoredPoint
from attrito.library.session import Solver
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.solver_options import solver_options

# At the first every contact sticks; at the second the contact across slips a little.
STUCK, SLIPPING = 30.0, 38.0
NAMES = ("contacts/t1", "contacts/n", "monitors/blade/mean")


def pushed(frequency, top=1.0, bounds="auto"):
    """The lumped sector under a static load that has been higher, or the other way round."""
    push = {"name": "push", "kind": "static", "dofs": [[1, 1.0], [0, 0.5]]}
    job = lumped_sector() | {"sweep": {"frequencies_hz": [frequency]}}
    return job | {"load": [*job["load"], push], "static": {"load_path": [0.0, top, 1.0], "bounds": bounds}}


def bounds_of(data):
    return np.concatenate([data[f"{name}_{side}"].ravel() for name in NAMES for side in ("low", "high")])


def means_of(folder, job, sliders):
    """Mean forces `[starts, contacts, t1 and n]` of the point, started from its own motion and other sliders."""
    run(folder, job)
    checked = read_job(folder / "job.toml")
    scene = build_scene(checked)
    reduced = reduced_scene(checked, scene)
    (frequency,) = job["sweep"]["frequencies_hz"]
    means = []
    with Solver(MPI.COMM_SELF, reduced, solver_options(checked, None)) as solver:
        solver.follow_static_path(scene.load_path, 20, frequency)
        solver.set_excitation(frequency, frequency, 1.0)
        (point,) = solver.solve_at([frequency], 1.0, 0)
        motion = solver.coordinates()
        for slider in sliders:
            assert solver.start_from(StoredPoint(frequency, motion, slider), 1.0)
            heard = {}
            solver.report_point(lambda path, _, values, into=heard: into.update({path: values}))
            means.append(np.column_stack([heard[f"/contacts/{name}_mean"] for name in ("t1", "n")]))
    return np.array(means)


def test_linear_programs_and_members_that_are_visited_say_the_same_after_any_load_path(tmp_path):
    # Members are visited where residuals are 1e-10 of forces of some 3; monitors' means are some 1e-5.
    exact = everything(tmp_path, pushed(STUCK))
    assert exact["points/bounds"] == [1]
    for top in (1.0, -40.0):
        visited = everything(tmp_path, pushed(STUCK, top, "sampled"))
        assert visited["points/bounds"] == [2]
        assert bounds_of(visited) == pytest.approx(bounds_of(exact), rel=1e-6, abs=1e-8)
    assert visited["contacts/t1_mean"] != pytest.approx(exact["contacts/t1_mean"], abs=0.1)


@pytest.mark.parametrize("frequency", [STUCK, SLIPPING])
def test_waves_from_any_sliders_are_within_the_bounds_and_reach_them(tmp_path, frequency):
    job = pushed(frequency, bounds="sampled")
    data = everything(tmp_path, job)
    starts = np.random.default_rng(1).uniform(-1e-3, 1e-3, (40, 2, 2))
    found = means_of(tmp_path, job, starts)
    for i, name in enumerate(("t1", "n")):
        low, high = (data[f"contacts/{name}_{side}"][0] for side in ("low", "high"))
        assert np.all(found[..., i] >= low - 1e-6) and np.all(found[..., i] <= high + 1e-6)
    # The contact to the ground sticks: sliders far off end at either of its limits.
    low, high = (data[f"contacts/t1_{side}"][0, 1] for side in ("low", "high"))
    assert (found[:, 1, 0].min(), found[:, 1, 0].max()) == pytest.approx((low, high), abs=1e-2 * (high - low))
