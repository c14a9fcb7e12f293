"""Stability of a travelling wave: all perturbations of the wheel, from one sector."""

from __future__ import annotations

import numpy as np
import pytest
from cyclic_scenes import random_sector
from jobs import run, table
from mpi4py import MPI
from multipliers import HILL, MONODROMY, examined, farthest
from wheels import lumped_sector

from attrito.library.points import StoredPoint
from attrito.library.session import Options, Solver
from attrito.scene.wheel import wave_in_wheel, whole_wheel

FREQUENCY, LEVEL = 0.15, 1.0


def solver_of(scene):
    solver = Solver(MPI.COMM_SELF, scene, Options(harmonics=5, tolerance=1e-12))
    solver.follow_static_path(np.array([[0.0], [1.0]]), 10, FREQUENCY)
    return solver


def in_wheel(sectors, engine_order, seed, tangents=1, level=LEVEL, methods=MONODROMY):
    """Examinations of a sector's wave, and of the same motion in the whole wheel by the engine of structures."""
    scene = random_sector(seed, sectors, engine_order, tangents=tangents)
    with solver_of(scene) as solver:
        (point,) = solver.solve_at([FREQUENCY], level, 0)
        assert point.is_solved and point.states[2] > 0, "no contact slips: the test is void"
        motion, sector = solver.coordinates(), examined(solver, methods)
    with solver_of(whole_wheel(scene)) as solver:
        solver.set_excitation(0.9 * FREQUENCY, 1.1 * FREQUENCY, level)
        start = StoredPoint(FREQUENCY, wave_in_wheel(motion, scene.sector), np.zeros((2 * sectors, 2)))
        assert solver.start_from(start, level)
        return sector, examined(solver, MONODROMY)


# The fourth and fifth leave the wave as it is by rotations of two and of three sectors; unstable: all but the third.
@pytest.mark.parametrize("sectors, order, stable", [(3, 1, 0), (4, 2, 0), (5, 2, 1), (6, 4, 0), (9, 6, 0), (12, 5, 0)])
def test_multipliers_of_all_wavenumbers_are_those_of_the_whole_wheel(sectors, order, stable):
    (verdict, reason, _, found), (whole_verdict, _, _, whole) = in_wheel(sectors, order, 20 + sectors)
    assert verdict == whole_verdict == stable and bool(reason) == (not stable)
    multipliers, waves, kinds = found[MONODROMY]
    assert np.array_equal(kinds, whole[MONODROMY][2])
    # A multiplier may be defective: its distance is the root of the rounding of both matrices.
    assert farthest(multipliers, whole[MONODROMY][0]) < 1e-6
    # Conjugates are of opposite wavenumbers.
    for value, wave in zip(multipliers, waves, strict=True):
        if abs(value) < 0.05 or abs(np.angle(value)) > 3.0 or abs(np.angle(value)) < 0.1:
            continue
        partner = np.argmin(np.abs(multipliers - np.conj(value)) + 10.0 * (waves != -wave % sectors))
        assert abs(multipliers[partner] - np.conj(value)) < 1e-6


# The second has a negative multiplier, and a pair whose exponents are 5e-4 of the strip's height from its edge. The
# third has multipliers that 120 harmonics of a perturbation leave 2e-5 away.
@pytest.mark.parametrize(("sectors", "order", "seed", "stable"), [(4, 2, 24, 0), (3, 1, 23, 0), (4, 1, 26, 1)])
def test_hills_problem_and_the_flow_agree_in_multipliers_and_wavenumbers(sectors, order, seed, stable):
    (verdict, reason, _, found), _ = in_wheel(sectors, order, seed, methods=MONODROMY | HILL)
    assert verdict == stable and ("grows at" in reason) == (not stable)
    (flow, flow_waves, _), (hill, hill_waves, _) = found[MONODROMY], found[HILL]
    assert len(hill) == len(flow) == 14 * sectors
    if sectors == 3:
        edge = np.abs(np.angle(flow)) / (2.0 * np.pi)
        assert np.any(edge > 0.5 - 1e-9) and np.any((edge > 0.499) & (edge < 0.4999)), "the test is void"
    for wave in range(sectors):
        # What 40 harmonics of a perturbation leave out, 1e-3 at most, falls like their cube: 1e-3 (40/1023)^3 = 6e-8,
        # times 2 pi.
        assert farthest(hill[hill_waves == wave], flow[flow_waves == wave]) < 1e-6


def test_contacts_with_two_tangents_are_examined_on_enough_samples():
    (verdict, reason, change, found), (whole_verdict, _, whole_change, whole) = in_wheel(4, 2, 24, tangents=2)
    assert verdict == whole_verdict == 0 and "breaks the wave" in reason
    largest = [abs(each[MONODROMY][0]).max() for each in (found, whole)]
    # A doubling of samples changes three times what is left, of both.
    assert abs(largest[0] - largest[1]) < (change + whole_change) / 3.0 + 1e-6
    assert change < 1e-3


@pytest.mark.parametrize("method", ["hill", "both"])
def test_contacts_of_two_tangents_that_hill_s_problem_leaves_out_are_warned_of(tmp_path, method):
    job = lumped_sector(5, 2) | {"stability": {"method": method}, "sweep": {"frequencies_hz": [31.0]}}
    job["contact"][1]["tangents"] = [[[2, 1.0]], [[0, 1.0]]]
    said = run(tmp_path, job).stdout
    assert (
        f"warning: [stability] method = {method}: Hill's problem knows slip along one tangent, and 1 contacts" in said
    )


def test_the_table_has_wavenumbers_of_a_sector_alone(tmp_path):
    job = lumped_sector(5, 2) | {"stability": {"method": "monodromy"}, "sweep": {"frequencies_hz": [31.0]}}
    run(tmp_path, job)
    rows = table(tmp_path, "--multipliers")
    dynamic = [row for row in rows if row["kind"] == "floquet"]
    # Three coordinates a sector without its upper boundary
    assert len(dynamic) == 2 * 3 * 5 and {row["wavenumber"] for row in dynamic} == set("01234")
    assert {row["wavenumber"] for row in rows if row["kind"] != "floquet"} <= {""}
    del job["cyclic"], job["contact"][0]
    job["model"]["mass"][3][3] = 1.0
    (tmp_path / "result.h5").unlink()
    run(tmp_path, job)
    assert "wavenumber" not in table(tmp_path, "--multipliers")[0]
