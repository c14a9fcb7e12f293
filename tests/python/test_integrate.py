"""`attrito integrate`: what it writes, what it refuses, and how it ends."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import attrito_here, toml, wedge


def write(folder, **integrate):
    job = wedge()
    job["integrate"] = {"frequency_hz": 132.0} | integrate
    (folder / "job.toml").write_text(toml(job))
    return job


def integrate(folder, capfd, **keys):
    write(folder, **keys)
    return attrito_here(folder, capfd, "integrate", "job.toml")


def output(folder):
    import tomllib

    return folder / tomllib.loads((folder / "job.toml").read_text())["output"]["file"]


def test_the_wedge_becomes_steady_and_its_file_describes_itself(tmp_path, capfd):
    done = integrate(tmp_path, capfd, cycles=300)
    assert done.returncode == 0, done.stderr
    assert "converged" in done.stdout
    with h5py.File(output(tmp_path)) as file:
        assert file.attrs["format"] == "attrito integration"
        group = file["integration"]
        assert group.attrs["outcome"] == "converged"
        assert group["period"][()] == 1
        assert group["defect"][()] <= 1e-10
        assert group["contacts/t1_mean"][0] == pytest.approx(-6.045, abs=5e-4)
        assert group["contacts/n_mean"][0] == pytest.approx(23.724, abs=5e-4)
        work = group["damping_energy"][()] + group["contacts/dissipated_energy"][()].sum()
        assert work == pytest.approx(group["work"][()], rel=1e-8)
        w = group["contacts/history/w1"][:, 0]
        stuck = group["contacts/history/regime"][:, 0] == 0
        assert len(np.unique(np.round((w[stuck] - w.min()) / np.ptp(w), 6))) == 2
        missing = []
        group.visititems(
            lambda name, item: (
                missing.append(name)
                if isinstance(item, h5py.Dataset) and not {"description", "unit"} <= set(item.attrs)
                else None
            )
        )
        assert not missing


def test_a_result_of_run_keeps_its_points_and_can_be_started_from(tmp_path, capfd):
    write(tmp_path)
    assert attrito_here(tmp_path, capfd, "run", "job.toml").returncode == 0
    with h5py.File(output(tmp_path)) as file:
        points = file["points/frequency_hz"][:]
    for start in ("static", f"point:{len(points) // 2}"):
        done = integrate(tmp_path, capfd, start=start)
        assert done.returncode == 0, done.stderr
        with h5py.File(output(tmp_path)) as file:
            assert file.attrs["format"] == "attrito result"
            assert np.array_equal(file["points/frequency_hz"][:], points)
            assert file["integration/contacts/n_mean"][0] == pytest.approx(23.7236, abs=1e-4)


def test_a_run_that_is_too_short_exits_with_1_and_still_writes(tmp_path, capfd):
    done = integrate(tmp_path, capfd, cycles=20)
    assert done.returncode == 1
    assert "did not become steady" in done.stderr
    with h5py.File(output(tmp_path)) as file:
        assert file["integration"].attrs["outcome"] == "not_converged"


@pytest.mark.parametrize("steps", [5, 6], ids=["beyond what numbers hold", "slowly"])
def test_motion_that_diverges_has_not_converged_and_says_so(tmp_path, capfd, steps):
    # Stuck, the highest frequency asks for more than 6 steps a period: central differences grow without bound.
    done = integrate(tmp_path, capfd, scheme="central_difference", steps_per_period=steps)
    assert done.returncode == 1, done.stdout
    assert "the motion diverges" in done.stderr
    with h5py.File(output(tmp_path)) as file:
        assert file["integration"].attrs["outcome"] == "not_converged"
        assert "diverges" in file["integration"].attrs["reason"]


@pytest.mark.parametrize(("damping", "diverges"), [(-200.0, True), (-20.0, False)], ids=["unbounded", "bounded"])
def test_motion_that_grows_is_told_from_one_of_several_frequencies(tmp_path, capfd, damping, diverges):
    # Negative damping of 20 is made up for by friction, whatever the amplitude comes to; one of 200 is not.
    job = write(tmp_path)
    job["model"]["damping"] = [[damping, 0.0], [0.0, damping]]
    (tmp_path / "job.toml").write_text(toml(job))
    done = attrito_here(tmp_path, capfd, "integrate", "job.toml")
    with h5py.File(output(tmp_path)) as file:
        outcome = file["integration"].attrs["outcome"]
    assert outcome == ("not_converged" if diverges else "no_period_one_orbit")
    assert ("the motion diverges" in done.stderr) == diverges
    assert done.returncode == (1 if diverges else 0)


def test_the_history_of_the_whole_run_begins_at_zero(tmp_path, capfd):
    profile = [[0.0, 0.0], [0.1, 1.0]]
    done = integrate(tmp_path, capfd, history="run", start="rest", static_profile=profile, samples=32)
    assert done.returncode == 0, done.stderr
    with h5py.File(output(tmp_path)) as file:
        group = file["integration"]
        time = group["history/time"][:]
        assert time[0] == 0.0
        assert np.allclose(np.diff(time), 1.0 / 132.0 / 32)
        assert len(time) == 32 * (group["cycles"][()] + 1)
        assert group["contacts/history/n"].shape == (len(time), 1)


@pytest.mark.parametrize("scheme", ["central_difference", "newmark", "hht", "generalised_alpha", "exponential"])
def test_every_scheme_comes_close_to_the_events(tmp_path, capfd, scheme):
    done = integrate(tmp_path, capfd, scheme=scheme, steps_per_period=1000)
    assert done.returncode == 0, done.stderr
    with h5py.File(output(tmp_path)) as file:
        assert file["integration/contacts/t1_mean"][0] == pytest.approx(-6.045, abs=1e-3)


@pytest.mark.parametrize(
    ("keys", "damping", "part"),
    [
        ({}, {"loss_factor": 0.01}, "time-domain twin"),
        ({"frequency_hz": None}, {}, "[integrate] frequency_hz is missing"),
        ({"start": "somewhere"}, {}, '"static", "rest" or "point:<number>"'),
        ({"start": "point:3"}, {}, "a result of `attrito run`"),
        ({"sliders": [0.0, 0.0]}, {}, "1 sliders, one a contact"),
        ({"static_profile": [[1.0, 0.0], [0.5, 1.0]]}, {}, "times that rise"),
    ],
)
def test_what_cannot_be_integrated_exits_with_2_and_says_why(tmp_path, capfd, keys, damping, part):
    job = write(tmp_path)
    if damping:
        job["model"].pop("damping", None)
        job["damping"] = damping
    job["integrate"] |= keys
    job["integrate"] = {key: value for key, value in job["integrate"].items() if value is not None}
    (tmp_path / "job.toml").write_text(toml(job))
    done = attrito_here(tmp_path, capfd, "integrate", "job.toml")
    assert done.returncode == 2
    assert part in done.stderr


def test_a_loss_factor_is_integrated_as_viscous_damping_where_asked(tmp_path, capfd):
    job = write(tmp_path, equivalent_viscous=True, cycles=2000)
    job["model"].pop("damping", None)
    job["damping"] = {"loss_factor": 0.1}
    (tmp_path / "job.toml").write_text(toml(job))
    done = attrito_here(tmp_path, capfd, "integrate", "job.toml")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("scheme", ["event", "hht", "exponential"])
def test_motion_that_grows_beyond_all_numbers_is_not_converged(tmp_path, capfd, scheme):
    job = write(tmp_path, scheme=scheme, cycles=20)
    # The velocity grows like e^(3e4 t), by e^227 in a period.
    job["model"]["damping"] = [[-3.0e4, 0.0], [0.0, -3.0e4]]
    (tmp_path / "job.toml").write_text(toml(job))
    done = attrito_here(tmp_path, capfd, "integrate", "job.toml")
    assert done.returncode == 1, done.stdout
    with h5py.File(output(tmp_path)) as file:
        assert file["integration"].attrs["outcome"] == "not_converged"
