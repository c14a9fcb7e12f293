"""Turning points and bifurcations along branches: known frequencies, and what motion in time does beside them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, examined, run, stiff_wedge, swept, table, wedge, write_job

COLUMNS = "branch,point,frequency_hz,kind,real,imag,uncertain_hz,x_amplitude,y_amplitude"


def bifurcations(folder: Path) -> list[tuple[str, float]]:
    """Kinds and frequencies, in the order of the branch."""
    return [(row["kind"], float(row["frequency_hz"])) for row in table(folder, "--bifurcations")]


def test_folds_and_flips_of_the_stiff_wedge_are_located(tmp_path):
    run(tmp_path, examined(swept(stiff_wedge([]), 94.0, 85.0), "monodromy"))
    rows = table(tmp_path, "--bifurcations")
    assert [row["kind"] for row in rows] == ["fold", "fold", "flip"]
    # Folds as the sweep's neighbouring points show them (docs/evidence/stability.md), and the flip before 85 Hz.
    assert [float(row["frequency_hz"]) for row in rows] == pytest.approx([88.30, 91.25, 85.94], abs=0.01)
    multipliers = [complex(float(row["real"]), float(row["imag"])) for row in rows]
    # ln|mu| is brought to zero within 1e-7, or its frequency to rounding; at a fold it is 1.
    assert np.abs(np.array(multipliers) - [1.0, 1.0, -1.0]).max() < 1e-6
    assert all(float(row["uncertain_hz"]) < 1e-5 for row in rows)
    points = table(tmp_path)
    for row in rows:
        # The verdict changes there; the event-exact orbit, which is asked near the circle, folds within two points.
        number = int(row["point"])
        assert points[number - 3]["stable"] != points[number + 2]["stable"]
    assert attrito(tmp_path, "table", "result.h5", "--bifurcations").stdout.splitlines()[0] == COLUMNS


def test_folds_are_the_same_up_and_down(tmp_path):
    found = []
    for start, stop in ((94.0, 86.5), (86.5, 94.0)):
        run(tmp_path, swept(stiff_wedge([], 5), start, stop))
        found.append(bifurcations(tmp_path))
        assert [kind for kind, _ in found[-1]] == ["fold", "fold"]
    down, up = (np.array([frequency for _, frequency in each]) for each in found)
    # A frequency is located to 1e-8 of itself, from what is converged to 1e-10 of the response.
    assert np.abs(down - up[::-1]).max() < 1e-5


def test_a_fold_is_the_same_on_two_ranks(tmp_path):
    found = []
    for ranks in (1, 2):
        run(tmp_path, swept(stiff_wedge([], 5), 90.0, 88.0, max_points=35), ranks=ranks, code=1)
        found += bifurcations(tmp_path)
    assert [kind for kind, _ in found] == ["fold", "fold"]
    assert found[0][1] == pytest.approx(found[1][1], abs=1e-9)


def test_period_two_sets_in_where_the_flip_is(tmp_path):
    job = examined(swept(stiff_wedge([], 5), 100.0, 103.0), "monodromy", orbit="exact")
    run(tmp_path, job)
    ((kind, flip),) = bifurcations(tmp_path)
    assert kind == "flip"
    periods = {}
    for side in (-0.2, 0.2):
        # Event by event, from the balance's point: where it is stable motion stays, where not it comes to two periods.
        job["integrate"] = {"frequency_hz": flip + side, "cycles": 4000, "fewest_cycles": 400}
        done = attrito(tmp_path, "integrate", write_job(tmp_path, job))
        assert done.returncode == 0, done.stdout + done.stderr
        with h5py.File(tmp_path / "result.h5") as file:
            periods[side] = int(file["integration/period"][()])
    assert periods == {-0.2: 1, 0.2: 2}


def lossless(tmp_path: Path) -> Job:
    """The wedge without damping on stiff contacts, whose response closes upon itself near 91 Hz."""
    job = wedge(stiffness=3.0e6, force=40.0)
    job["model"]["damping"] = [[0.0, 0.0], [0.0, 0.0]]
    job["load"][0]["dofs"] = [[1, 20.0]]
    return job


def test_a_fold_where_a_contact_changes_what_it_does_is_located_and_told_apart(tmp_path):
    corners, folds = [], []
    for tolerance in (0.01, 0.001):
        run(tmp_path, swept(lossless(tmp_path), 91.0, 320.0, max_points=70, curve_tolerance=tolerance), code=1)
        found = bifurcations(tmp_path)
        corners.append([frequency for kind, frequency in found if kind == "contact_fold"][:1])
        folds.append([frequency for kind, frequency in found if kind == "fold"][:2])
    # The same though steps fall elsewhere.
    assert len(corners[0]) == 1
    assert corners[0] == pytest.approx(corners[1], abs=1e-5)
    assert len(folds[0]) == 2
    assert folds[0] == pytest.approx(folds[1], abs=1e-5)


def test_no_bifurcation_is_looked_for_if_the_job_says_so(tmp_path):
    run(tmp_path, swept(stiff_wedge([], 5), 90.0, 88.0, max_points=35, locate=False), code=1)
    assert table(tmp_path, "--bifurcations") == []


def test_multipliers_zero_and_one_of_sliders_are_no_bifurcations(tmp_path):
    # Contacts stick at one end and slip at the other: multipliers of sliders are 1 there and 0 here.
    run(tmp_path, examined(swept(wedge(), 132.0, 100.0), "monodromy"))
    kinds = {row["kind"] for row in table(tmp_path, "--multipliers")}
    assert kinds == {"floquet", "slip", "stuck"}
    assert bifurcations(tmp_path) == []
