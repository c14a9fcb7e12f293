"""The estimated error is the true one, and a tolerance is kept by as many harmonics as it takes."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from jobs import attrito, attrito_here, chain, run, table, wedge, write_job
from matplotlib.collections import LineCollection
from mpi4py import MPI

from attrito.runs.run import run_job
from attrito.support.errors import UnsolvedError

# Across the resonance of the wedge, where it slips and opens.
FREQUENCIES = np.linspace(136.0, 116.0, 6).tolist()


def rubbing_wedge(**balance) -> dict:
    return wedge(force=14.0) | {"balance": balance, "sweep": {"frequencies_hz": FREQUENCIES}}


def rubbing_chain(**balance) -> dict:
    """Contacts with two tangents, whose friction falls with pressure: their normal forces are some 50 +- 20."""
    job = chain(2, 2)
    for contact in job["contact"]:
        contact |= {"law": "pressure", "friction_coefficient": [[20.0, 0.6], [50.0, 0.4], [80.0, 0.3]], "area": 1.0}
    return job | {
        "balance": balance,
        "sweep": {"frequencies_hz": [107.0, 104.5, 102.0, 99.5, 97.0]},
    }


def solved(folder, job, monitor):
    """Amplitudes, estimates, and harmonics of the points."""
    here(folder, job)
    with h5py.File(folder / "result.h5") as file:
        harmonics = file["points/harmonics"][:]
        amplitude, estimate = file[f"monitors/{monitor}/amplitude"][:], file["points/estimate"][:]
    return amplitude, estimate, harmonics


def series(folder, monitor):
    """Coefficients of a monitor `[points, 2 H + 1]`."""
    with h5py.File(folder / "result.h5") as file:
        return file[f"monitors/{monitor}/harmonics"][:]


def half_ranges(waves):
    """Half the ranges over the period of cosines and sines `[points, 2 H]`."""
    orders = np.arange(1, waves.shape[1] // 2 + 1)
    angles = np.linspace(0.0, 2.0 * np.pi, 65536, endpoint=False)[:, None] * orders
    basis = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(angles), -1)
    return 0.5 * np.ptp(waves @ basis.T, axis=1)


def errors_of(motion, truth):
    """What estimates are estimates of: the error of half the range, or a third of half the range of the motion's error.

    The latter less the shift in time that comes nearest to it. Relative to the true half range; both motions are
    coefficients `[points, k]`.
    """
    motion, truth = (np.pad(c, ((0, 0), (0, truth.shape[1] - c.shape[1])))[:, 1:] for c in (motion, truth))
    orders = np.arange(1, truth.shape[1] // 2 + 1)
    rate = np.stack([orders * truth[:, 1::2], -orders * truth[:, ::2]], axis=2).reshape(truth.shape)
    change = motion - truth
    change = change - rate * (np.sum(rate * change, axis=1) / np.sum(rate**2, axis=1))[:, None]
    moved, coarse, fine = (half_ranges(c) for c in (change, motion, truth))
    return np.maximum(np.abs(coarse - fine), moved / 3.0) / fine


def here(folder, job):
    """Run a job in this process, which is quick."""
    run_job(MPI.COMM_SELF, str(folder / write_job(folder, job)))


@pytest.fixture(scope="module")
def wedge_truth(tmp_path_factory):
    """Coefficients of 60 harmonics, by events: the next ones change the amplitude by less than 1e-6."""
    folder = tmp_path_factory.mktemp("truth")
    _, estimate, _ = solved(folder, rubbing_wedge(harmonics=60), "x")
    assert estimate.max() < 1e-6
    return series(folder, "x")


@pytest.fixture(scope="module")
def wedge_amplitude(wedge_truth):
    """Half the range of that motion."""
    return half_ranges(wedge_truth[:, 1:])


@pytest.mark.parametrize("harmonics", [2, 3, 5, 9])
def test_the_estimate_is_the_error_of_harmonics_left_out(tmp_path, wedge_truth, harmonics):
    job = rubbing_wedge(harmonics=harmonics)
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    _, estimate, _ = solved(tmp_path, job, "x")
    truth = errors_of(series(tmp_path, "x"), wedge_truth)
    # A first-order correction is wrong by the square of itself and by what is beyond 3 H: at nine harmonics at most a
    # few parts in a hundred of it, at two up to half of it. Of errors as small as the truth's own it says nothing.
    known = truth > 1e-5
    assert known.any()
    assert estimate[known] == pytest.approx(truth[known], rel=0.5)


def test_the_estimate_of_a_long_series_is_its_error_where_a_contact_is_far_stiffer_than_its_body(tmp_path):
    # Two masses, one of which rubs on a spring 2e4 times as stiff with a constant limit. By events in time they move by
    truth = np.array([4.058214653573e-5, 4.579929889627e-5])
    spring = (200.0 * np.pi) ** 2
    stiffness = spring * np.array([[2.0, -1.0], [-1.0, 2.0]])
    job = {
        "model": {
            "mass": [[1.0, 0.0], [0.0, 1.0]],
            "stiffness": stiffness.tolist(),
            "damping": (1e-4 / np.pi * stiffness).tolist(),
        },
        "contact": [
            {
                "tangents": [[[1, 1.0]]],
                "tangential_stiffness": 1e10,
                "friction_coefficient": 0.5,
                "preload": 12.0,
            }
        ],
        "load": [
            {"kind": "harmonic", "cosine": [[0, 10.0]]},
            {"kind": "harmonic", "harmonic": 2, "cosine": [[0, 4.0]], "sine": [[0, 4.0]]},
        ],
        "sweep": {"frequencies_hz": [110.0]},
        "output": {
            "file": "result.h5",
            "monitors": [{"name": "x", "dofs": [[0, 1.0]]}, {"name": "y", "dofs": [[1, 1.0]]}],
        },
    }
    # The error of H harmonics falls like 1/H as far as the contact's own frequency, some 140 times that of the load.
    for tolerance in (1e-2, 3e-3):
        amplitude, estimate, harmonics = solved(tmp_path, job | {"balance": {"tolerance": tolerance}}, "x")
        with h5py.File(tmp_path / "result.h5") as file:
            amplitude = np.append(amplitude, file["monitors/y/amplitude"][:])
        error = np.abs(amplitude / truth - 1.0).max()
        assert harmonics[0] > 20
        assert error / 3.0 < estimate[0] < tolerance
        assert error < tolerance


def test_the_first_point_of_a_sweep_is_solved_on_a_longer_series_whatever_its_frequency(tmp_path):
    # A longer series moves the point in its plane, of one frequency here: by rounding, out of the band or into it.
    for start in 132.0 + 0.137 * np.arange(12):
        job = rubbing_wedge(tolerance=1e-3) | {"sweep": {"start_hz": float(start), "stop_hz": float(start) - 0.2}}
        here(tmp_path, job)
        with h5py.File(tmp_path / "result.h5") as file:
            assert file["points/harmonics"][0] > 3
            assert file["points/estimate"][0] < 1e-3


def test_where_long_series_have_no_solution_points_are_solved_on_short_ones_and_say_so(tmp_path):
    job = wedge(force=60.0) | {"balance": {}, "sweep": {"frequencies_hz": [136.0, 132.0]}}
    job["contact"][0] |= {"tangential_stiffness": 3e9, "normal_stiffness": 3e9}
    with pytest.raises(UnsolvedError, match=r"2 point\(s\) is above"):
        here(tmp_path, job)
    with h5py.File(tmp_path / "result.h5") as file:
        assert np.all(np.isnan(file["points/estimate"][:]))


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_tolerance_is_kept_with_fewer_harmonics_where_it_is_loose(tmp_path, wedge_amplitude, tolerance):
    job = rubbing_wedge(tolerance=tolerance)
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    amplitude, estimate, harmonics = solved(tmp_path, job, "x")
    assert np.abs(amplitude / wedge_amplitude - 1.0).max() < tolerance
    assert estimate.max() < tolerance
    # The motion's harmonics fade at least like h^-2, and the estimate may take half of the tolerance.
    assert harmonics.max() <= 3 / tolerance**0.5


def test_a_tolerance_is_kept_where_friction_depends_on_pressure(tmp_path):
    amplitude, estimate, harmonics = solved(tmp_path, rubbing_chain(tolerance=1e-4), "end")
    truth = solved(tmp_path, rubbing_chain(harmonics=40), "end")[0]
    assert np.abs(amplitude / truth - 1.0).max() < 1e-4
    assert estimate.max() < 1e-4
    assert harmonics.max() < 40


def test_a_tolerance_is_kept_along_two_tangents_by_events(tmp_path):
    # Rough panels of estimates leave 2e-5 of the forces in general, and less of these that open nowhere.
    sweep = {"sweep": {"frequencies_hz": [107.0, 104.5, 102.0, 99.5, 97.0]}}
    amplitude, estimate, harmonics = solved(tmp_path, chain(2, 2) | sweep | {"balance": {"tolerance": 1e-5}}, "end")
    truth = solved(tmp_path, chain(2, 2) | sweep | {"balance": {"harmonics": 40}}, "end")[0]
    assert np.abs(amplitude / truth - 1.0).max() < 1e-5
    assert estimate.max() < 1e-5
    assert harmonics.max() < 40


def test_points_on_short_series_read_as_zeros_beyond(tmp_path):
    job = rubbing_wedge(tolerance=1e-3) | {"sweep": {"frequencies_hz": [116.0, 122.0, 126.0, 130.0, 132.0, 140.0]}}
    solved(tmp_path, job, "x")
    with h5py.File(tmp_path / "result.h5") as file:
        harmonics = file["points/harmonics"][:]
        series = {name: file[name][:] for name in ("monitors/x/harmonics", "contacts/force", "points/coordinates")}
    assert harmonics.min() < harmonics.max()
    for values in series.values():
        assert values.shape[-1] == 2 * harmonics.max() + 1
        for point, count in zip(values, harmonics, strict=True):
            assert np.all(point[..., 2 * count + 1 :] == 0.0)
            assert np.any(point[..., 2 * count - 1 : 2 * count + 1] != 0.0)


def test_a_sweep_keeps_its_tolerance_along_the_branch(tmp_path):
    job = wedge(force=14.0) | {"balance": {"tolerance": 1e-3}, "sweep": {"start_hz": 140.0, "stop_hz": 100.0}}
    _, estimate, harmonics = solved(tmp_path, job, "x")
    assert estimate.max() < 1e-3
    # All stick at last, and few harmonics do.
    assert harmonics[-1] < harmonics.max()


def test_a_tolerance_and_two_ranks_give_what_one_gives(tmp_path):
    job = chain(3) | {"balance": {"tolerance": 1e-3}}
    found = []
    for ranks in (None, 2):
        run(tmp_path, job, ranks)
        found.append([float(row["end_amplitude"]) for row in table(tmp_path)])
    assert len(found[0]) == len(found[1])
    # Both solve to a residual of 1e-10, which a resonance with 1 % of damping enlarges fifty times at most.
    assert found[0] == pytest.approx(found[1], rel=1e-8)


def test_error_bars_of_the_plot_reach_as_far_as_the_estimate(tmp_path, capfd, written):
    amplitude, estimate, _ = solved(tmp_path, rubbing_wedge(tolerance=1e-1), "x")
    done = attrito_here(tmp_path, capfd, "plot", "result.h5", "--monitor", "x")
    assert done.returncode == 0
    (figure,) = written
    (bars,) = [one for one in figure.axes[0].collections if isinstance(one, LineCollection)]
    ends = np.array(bars.get_segments())
    assert ends[:, :, 0] == pytest.approx(np.column_stack([FREQUENCIES] * 2), rel=1e-12)
    assert ends[:, 0, 1] == pytest.approx(amplitude * (1.0 - estimate), rel=1e-12)
    assert ends[:, 1, 1] == pytest.approx(amplitude * (1.0 + estimate), rel=1e-12)


def outcomes(folder) -> list[tuple[str, str, str]]:
    return [(row["converged"], row["outcome"], row["stable"]) for row in table(folder)]


def test_a_point_whose_error_is_above_the_tolerance_has_that_outcome_and_the_run_ends_with_1(tmp_path):
    # Three fixed harmonics are wrong by half a percent where the wedge lifts off; nothing is left to choose.
    job = rubbing_wedge(harmonics=3, tolerance=1e-3) | {"stability": {"method": "monodromy"}}
    done = run(tmp_path, job, code=1)
    found = outcomes(tmp_path)
    with h5py.File(tmp_path / "result.h5") as file:
        estimate = file["points/estimate"][:]
    assert [outcome == "above_tolerance" for _, outcome, _ in found] == (estimate > 1e-3).tolist()
    assert (estimate > 1e-3).any()
    # It is solved, and examined as any other.
    assert all(converged == "true" for converged, _, _ in found)
    assert {stable for _, outcome, stable in found if outcome == "above_tolerance"} == {"true"}
    count = int((estimate > 1e-3).sum())
    assert f"the estimated error of {count} point(s) is above [balance] tolerance = 0.001" in done.stderr
    assert f"{count} above_tolerance" in done.stdout


def test_fixed_harmonics_without_a_tolerance_are_never_above_it(tmp_path):
    run(tmp_path, rubbing_wedge(harmonics=1))
    assert {outcome for _, outcome, _ in outcomes(tmp_path)} == {"converged"}


def test_a_job_that_gives_neither_harmonics_nor_tolerance_has_a_tolerance_of_a_hundredth(tmp_path, wedge_amplitude):
    job = rubbing_wedge()
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    amplitude, estimate, harmonics = solved(tmp_path, job, "x")
    assert np.abs(amplitude / wedge_amplitude - 1.0).max() < 0.01
    assert estimate.max() < 0.01
    assert harmonics.min() < harmonics.max()
    with h5py.File(tmp_path / "result.h5") as file:
        balance = json.loads(file.attrs["job"])["balance"]
    assert (balance["tolerance"], balance["harmonics"]) == (0.01, "auto")


def test_samples_are_of_no_account_where_contacts_go_by_events(tmp_path, wedge_amplitude):
    job = rubbing_wedge(harmonics=60, samples=8)
    job["output"]["monitors"] = job["output"]["monitors"][:1]
    amplitude = solved(tmp_path, job, "x")[0]
    assert amplitude == pytest.approx(wedge_amplitude, rel=1e-8)


def test_peaks_by_tolerance_have_the_harmonics_that_it_takes(tmp_path):
    peak = {"parameter": "level", "start": 0.2, "stop": 1.0}
    job = wedge(force=14.0) | {"sweep": {"start_hz": 85.0, "stop_hz": 145.0}, "peak": peak}
    amplitude = []
    for balance in ({"tolerance": 1e-4}, {"harmonics": 40}):
        done = attrito(tmp_path, "peak", write_job(tmp_path, job | {"balance": balance}))
        assert done.returncode == 0, done.stdout + done.stderr
        with h5py.File(tmp_path / "result.peaks.h5") as file:
            amplitude.append(file["peaks/amplitude"][-1])
        if "tolerance" in balance:
            assert "above the tolerance: again with 10 harmonics" in done.stdout
    assert amplitude[0] == pytest.approx(amplitude[1], rel=1e-4)


def ringing(frequency_hz: float, harmonic: int, **balance) -> dict:
    """A slider with a light, hardly damped oscillator on it, tuned to a harmonic of the excitation."""
    own, light = 2 * np.pi * 100.0, 2 * np.pi * harmonic * frequency_hz
    mass, ratio = 0.01, 5e-4
    spring, dashpot = mass * light**2, 2 * ratio * mass * light
    return {
        "model": {
            "mass": np.diag([1.0, mass, 1.0]).tolist(),
            "stiffness": [[own**2 + spring, -spring, 0.0], [-spring, spring, 0.0], [0.0, 0.0, own**2]],
            "damping": [[0.02 * own + dashpot, -dashpot, 0.0], [-dashpot, dashpot, 0.0], [0.0, 0.0, 0.02 * own]],
        },
        "contact": [
            {
                "normal": [[2, 1.0]],
                "tangents": [[[0, 1.0]]],
                "tangential_stiffness": 2.0e5,
                "normal_stiffness": 2.0e5,
                "friction_coefficient": 0.5,
                "preload": 40.0,
            }
        ],
        "load": [{"kind": "harmonic", "cosine": [[0, 60.0]]}],
        "balance": balance,
        "sweep": {"frequencies_hz": [frequency_hz]},
        "output": {"file": "result.h5", "monitors": [{"name": "light", "dofs": [[1, 1.0], [0, -1.0]]}]},
    }


@pytest.mark.parametrize("harmonic", [5, 11, 13, 21])
def test_a_resonance_beyond_three_times_the_harmonics_is_seen(tmp_path, harmonic):
    truth = solved(tmp_path, ringing(70.0, harmonic, harmonics=60), "light")[0]
    blind = solved(tmp_path, ringing(70.0, harmonic, harmonics=3), "light")[0]
    assert abs(blind[0] / truth[0] - 1.0) > 0.03, "the oscillator does not ring: the test is void"
    amplitude, estimate, harmonics = solved(tmp_path, ringing(70.0, harmonic, tolerance=0.01), "light")
    assert abs(amplitude[0] / truth[0] - 1.0) < 0.01
    assert estimate[0] < 0.01
    assert harmonics[0] >= harmonic
