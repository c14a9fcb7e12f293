"""The first lines of a report, and the picture of the model."""

from __future__ import annotations

import json

import numpy as np
import pytest
import synthetic
from edited import edited
from matplotlib.collections import PolyCollection

from attrito.plots.solid import axes_of_view
from attrito.report.outcome import half_power_width, outcome
from attrito.report.structure import model_picture, structure
from attrito.report.view import View
from attrito.results.result import Result

RATIO, NATURAL = 0.01, 100.0


def response(hertz):
    x = np.asarray(hertz) / NATURAL
    return 1.0 / np.abs(1.0 - x**2 + 2j * RATIO * x)


def test_the_half_power_width_of_an_oscillator_gives_its_damping_ratio():
    hertz = np.linspace(90.0, 110.0, 4001)
    # 2 zeta f, up to terms of relative size zeta^2; a straight line between points 0.005 Hz apart errs by less.
    assert half_power_width(hertz, response(hertz)) == pytest.approx(2 * RATIO * NATURAL, rel=3 * RATIO**2 + 1e-4)


def test_a_peak_that_does_not_come_down_has_no_width():
    hertz = np.linspace(99.5, 110.0, 401)
    assert half_power_width(hertz, response(hertz)) is None


@pytest.fixture
def damped(tmp_path):
    """A response a quarter as high by level as the stuck one, at 98 Hz; two sets dissipate 3 and 1."""
    hertz = np.linspace(90.0, 110.0, 4001)
    data = synthetic.contact_data(3, 3)
    data["dissipated_energy"] = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    quarter = float(response(hertz).max()) / 4
    return synthetic.write_result(
        tmp_path / "r.h5", [97.0, 98.0, 99.0], {"tip": [1.0, 2 * quarter, 1.0]}, level=[2.0] * 3, contacts=data,
        parameters={"set": np.array([b"root", b"root", b"shroud"], dtype="S24")},
        linear={"stuck": (hertz, response(hertz))},
    )  # fmt: skip


def test_the_first_lines_are_the_peak_its_reduction_its_damping_and_what_dissipates(damped):
    with Result(damped) as result:
        peak, against, dissipated = outcome(View(result))
    assert peak.startswith("tip moves by at most 25 (length, user units), half its range, at 98 Hz at level 2.")
    # The stuck response peaks at sqrt(1 - 2 zeta^2) of 100 Hz; points are 0.005 Hz apart.
    assert "the peak is 75 % lower by level and lies 1.99 % below that of theirs, 99.99 Hz" in against
    assert "damped by 4 % of critical, stuck 1 %" in against
    assert dissipated == "The contacts dissipate 4 a period there: 75 % in root, 25 % in shroud."


def test_the_model_is_drawn_by_the_faces_that_look_at_the_viewer(tmp_path):
    model = synthetic.assemble([synthetic.block("C3D8", (2, 3, 4))], {"tip": lambda points, owner: points[:, 2] == 1.0})
    path = synthetic.write_result(tmp_path / "r.h5", [1.0], {"tip": [1.0]})
    load = {"kind": "harmonic", "cosine": [[["node", int(model.node_ids[0]), "x"], 1.0]], "sine": []}
    monitor = {"name": "tip", "dofs": [[["node", "tip", "x"], 1.0]]}
    with edited(path) as file:
        file.attrs["job"] = json.dumps({"load": [load], "output": {"monitors": [monitor]}})
    with Result(path) as result:
        figure = model_picture(View(result), model)
    (axes,) = figure.axes
    (faces,) = [one for one in axes.collections if isinstance(one, PolyCollection)]
    # Of a box three sides are seen: 2 x 3 of the top, 3 x 4 and 2 x 4 faces.
    assert len(faces.get_paths()) == 6 + 12 + 8
    places = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    across, up, _ = axes_of_view(np.array([1.0, -1.6, 0.9]))
    first = model.coordinates[0]
    assert places["harmonic loads"] == pytest.approx(np.array([[first @ across, first @ up]]))
    assert len(places["monitors"]) == 12


def test_directions_of_the_picture_are_at_right_angles_and_z_is_up():
    across, up, towards = axes_of_view(np.array([1.0, -1.6, 0.9]))
    frame = np.array([across, up, towards])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(frame) == pytest.approx(1.0)
    assert across[2] == pytest.approx(0.0, abs=1e-15) and up[2] > 0


def test_a_model_that_is_not_there_leaves_out_its_picture(tmp_path):
    from attrito.report.page import Page

    path = synthetic.write_result(tmp_path / "r.h5", [1.0], {"tip": [1.0]})
    page = Page("a")
    with Result(path) as result:
        structure(page, View(result))
    assert "Model" in page.html() and "<svg" not in page.html()
