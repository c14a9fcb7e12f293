"""Figures: what is drawn, and how it is told apart."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from figures import marks
from matplotlib import image
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.figure import Figure

from attrito.plots.contact_maps import contact_map
from attrito.plots.contact_surfaces import surfaces
from attrito.plots.contacts import hysteresis
from attrito.plots.response import frequency_response
from attrito.plots.style import Look, legend_below, save
from attrito.results.loops import Loop
from attrito.results.result import Result
from attrito.support.errors import InputError


def lines(axes, label):
    return [line for line in axes.get_lines() if line.get_label() == label]


def drawn(axes):
    """The lines with data."""
    return [line for line in axes.get_lines() if len(line.get_xdata())]


def labels(axes):
    return axes.get_legend_handles_labels()[1]


def response(tmp_path, amplitude, **options):
    frequency = np.linspace(90, 110, len(amplitude))
    return Result(synthetic.write_result(tmp_path / "r.h5", frequency, {"tip": amplitude}, **options))


def test_several_levels_are_divided_by_the_level(tmp_path):
    level = np.repeat([1.0, 10.0], 5)
    with response(tmp_path, 3 * level, level=level) as result:
        axes = frequency_response(result, "tip").axes[0]
    assert [set(line.get_ydata()) for line in drawn(axes)] == [{3.0}, {3.0}]
    assert labels(axes) == ["level 1", "level 10"]
    assert axes.get_ylabel() == "Amplitude of tip / level (length, user units)"
    assert axes.get_xlabel() == "Frequency (Hz)"


def test_one_level_is_shown_as_it_is_and_scales_the_linear_responses(tmp_path):
    linear = {
        kind: (np.array([90.0, 110.0]), np.array([1.0, end])) for kind, end in (("stuck", 2), ("frictionless", 3))
    }
    with response(tmp_path, [1.0, 2.0, 3.0], level=[5.0] * 3, linear=linear) as result:
        axes = frequency_response(result, "tip").axes[0]
    assert lines(axes, "linear, stuck")[0].get_ydata().tolist() == [5.0, 10.0]
    assert len(lines(axes, "linear, frictionless")) == 1
    assert [line.get_ydata().tolist() for line in drawn(axes)][-1] == [1.0, 2.0, 3.0]


def test_only_the_unstable_stretch_is_dashed(tmp_path):
    with response(tmp_path, [1.0, 2.0, 3.0, 2.0, 1.0, 1.0], stable=[1, 1, 0, 0, 1, 1]) as result:
        axes = frequency_response(result, "tip").axes[0]
    runs = {(line.get_linestyle(), tuple(line.get_ydata())) for line in drawn(axes)}
    assert runs == {("-", (1.0, 2.0)), ("--", (2.0, 3.0, 2.0, 1.0)), ("-", (1.0, 1.0))}
    assert "unstable" in labels(axes)


def test_points_not_examined_for_stability_are_solid(tmp_path):
    with response(tmp_path, [1.0, 2.0, 3.0]) as result:
        axes = frequency_response(result, "tip").axes[0]
    assert {line.get_linestyle() for line in drawn(axes)} == {"-"} and "unstable" not in labels(axes)


def test_points_without_a_solution_break_the_line_and_are_marked(tmp_path):
    outcome = ["converged"] * 2 + ["not_converged", "no_period_one_orbit"] + ["converged"]
    with response(tmp_path, [1.0, 2.0, 9.0, np.nan, 1.0], outcome=outcome) as result:
        axes = frequency_response(result, "tip").axes[0]
    marked = [line for line in drawn(axes) if line.get_marker() in "xD"]
    assert {(line.get_marker(), tuple(line.get_ydata())) for line in marked} == {("x", (9.0,)), ("D", (0.0,))}
    curve = [line for line in drawn(axes) if line.get_linestyle() == "-"]
    assert np.isnan(np.concatenate([line.get_ydata() for line in curve])).sum() == 2
    # The last point has no neighbour, and shows all the same.
    assert any(line.get_marker() == "o" and line.get_ydata().tolist() == [1.0] for line in drawn(axes))
    assert {"not converged", "no period one orbit"} <= set(labels(axes))


def test_bounds_are_shaded_where_the_point_is_not_unique(tmp_path):
    bounds = {"tip_low": [0.9, 1.8, np.nan], "tip_high": [1.1, 2.2, np.nan]}
    with response(tmp_path, [1.0, 2.0, 3.0], unique=[0, 0, 1], **bounds) as result:
        axes = frequency_response(result, "tip").axes[0]
    (band,) = [item for item in axes.collections if isinstance(item, PolyCollection)]
    heights = band.get_paths()[0].vertices[:, 1]
    assert heights.min() == pytest.approx(0.9) and heights.max() == pytest.approx(2.2)


def test_amplitudes_over_a_wide_range_are_logarithmic_unless_asked(tmp_path):
    with response(tmp_path, [1.0, 1000.0, 2.0]) as result:
        assert frequency_response(result, "tip").axes[0].get_yscale() == "log"
        assert frequency_response(result, "tip", log=False).axes[0].get_yscale() == "linear"


def test_branches_have_their_own_colours_and_names(tmp_path):
    with response(tmp_path, [1.0, 2.0, 3.0, 4.0], branch=[0, 0, 1, 1]) as result:
        axes = frequency_response(result, "tip").axes[0]
    assert labels(axes) == ["branch 0", "branch 1"]
    assert len({line.get_color() for line in drawn(axes)}) == 2


def test_many_levels_are_read_off_a_colour_bar(tmp_path):
    level = np.repeat(np.arange(1.0, 13.0), 2)
    with response(tmp_path, level, level=level) as result:
        figure = frequency_response(result, "tip")
    assert len(figure.axes) == 2 and figure.axes[1].get_ylabel() == "Level"
    assert labels(figure.axes[0]) == []


@pytest.mark.parametrize("amplitude", ([], [np.nan], [0.0, 0.0]))
def test_results_with_nothing_to_show_still_make_a_figure(tmp_path, amplitude):
    outcome = ["not_converged"] * len(amplitude)
    with response(tmp_path, amplitude, outcome=outcome) as result:
        figure = frequency_response(result, "tip")
    save(figure, tmp_path / "frf.png", dpi=100)
    assert image.imread(tmp_path / "frf.png").shape[:2] == (400, 660)
    assert figure.axes[0].get_xlabel() == "Frequency (Hz)"
    # Points without a solution are marked on the axis, and no curve is drawn.
    assert [np.count_nonzero(marks(figure.axes[0], "x")[:, 1])] == [0]
    assert len(marks(figure.axes[0], "x")) == len(amplitude)
    assert np.isfinite(marks(figure.axes[0], "None")[:, 1]).sum() == 0


def test_hysteresis_loops_are_closed_and_carry_their_limits():
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    loop = Loop("contact 0", np.cos(angle), np.sin(angle), 2 + np.cos(angle), friction_coefficient=0.5)
    figure = hysteresis([loop] * 3, "mm", "N")
    assert [axes.get_title() for axes in figure.axes] == ["contact 0"] * 3 + [""]
    upper, lower, force = figure.axes[0].get_lines()
    assert force.get_xdata()[0] == force.get_xdata()[-1] and len(force.get_xdata()) == 41
    assert upper.get_ydata()[:40] == pytest.approx(0.5 * (2 + np.cos(angle)))
    assert lower.get_ydata() == pytest.approx(-upper.get_ydata())


def test_two_tangents_are_two_lines_in_a_panel():
    values = np.random.default_rng(0).normal(size=(16, 2))
    figure = hysteresis([Loop("contact 3", values, values, np.ones(16))])
    assert [line.get_label() for line in figure.axes[0].get_lines()] == ["T1", "T2"]


def test_no_loop_is_a_fault():
    with pytest.raises(InputError, match="at least one contact"):
        hysteresis([])


def flank_result(tmp_path, contacts=20):
    parameters = {
        "set": np.array([b"left"] * 10 + [b"right"] * 10),
        "position": np.random.default_rng(1).uniform(size=(contacts, 3)),
        "frame": np.broadcast_to(np.eye(3), (contacts, 3, 3)),
    }
    data = synthetic.contact_data(2, contacts)
    return synthetic.write_result(tmp_path / "r.h5", [1.0, 2.0], {}, contacts=data, parameters=parameters)


def test_the_contact_map_shows_every_contact_once_in_the_panel_of_its_set(tmp_path):
    with Result(flank_result(tmp_path)) as result:
        figure = contact_map(result, 1)
    panels = figure.axes[:2]
    assert [axes.get_title().splitlines()[0] for axes in panels] == ["left", "right"]
    for axes in panels:
        assert sum(len(item.get_offsets()) for item in axes.collections if isinstance(item, PathCollection)) == 10


def test_a_map_of_contacts_without_positions_is_a_fault(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [1.0], {}, contacts=synthetic.contact_data(1, 1))
    with Result(path) as result, pytest.raises(InputError, match="contacts between node sets"):
        contact_map(result, 0)


def test_a_figure_that_cannot_be_written_is_a_fault(tmp_path):
    figure = hysteresis([Loop("c", np.arange(3), np.arange(3), np.arange(3))])
    for path in (tmp_path / "none" / "a.png", tmp_path / "a.nonsense"):
        with pytest.raises(InputError, match="a writable"):
            save(figure, path)


def tilted(tmp_path, places, normal):
    """A result whose contacts lie at some places of a plane through (1, 2, 3) that is tilted about z, then x."""
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
        [[1.0, 0.0, 0.0], [0.0, 0.28, -0.96], [0.0, 0.96, 0.28]]
    )
    flat = np.column_stack([places, np.zeros(len(places))])
    frame = np.broadcast_to(np.array([turn[:, 0], turn[:, 1], normal * turn[:, 2]]), (len(places), 3, 3))
    parameters = {"set": np.array([b"one"] * len(places)), "position": flat @ turn.T + [1.0, 2.0, 3.0], "frame": frame}
    parameters["area"] = np.full(len(places), 0.5)
    data = synthetic.contact_data(1, len(places))
    return synthetic.write_result(tmp_path / "r.h5", [1.0], {}, contacts=data, parameters=parameters), turn


@pytest.mark.parametrize("normal", [1.0, -1.0])
def test_a_surface_is_seen_along_the_normal_of_its_plane_without_distortion(tmp_path, normal):
    places = np.random.default_rng(5).uniform(size=(12, 2)) * [5.0, 2.0]
    path, turn = tilted(tmp_path, places, normal)
    with Result(path) as result:
        (surface,) = surfaces(result)
    apart = [np.linalg.norm(points[:, None] - points[None, :], axis=2) for points in (places, surface.seen)]
    assert apart[1] == pytest.approx(apart[0], abs=1e-12)
    across = np.cross(*surface.axes)
    # Seen from outside: the normal of the contacts points away from who looks.
    assert across == pytest.approx(-normal * turn[:, 2], abs=1e-12)
    assert np.ptp(surface.seen[:, 0]) > np.ptp(surface.seen[:, 1])


def test_contacts_in_a_row_are_seen_along_their_own_normal(tmp_path):
    path, turn = tilted(tmp_path, np.column_stack([np.linspace(0.0, 3.0, 5), np.zeros(5)]), 1.0)
    with Result(path) as result:
        (surface,) = surfaces(result)
    assert np.cross(*surface.axes) == pytest.approx(-turn[:, 2], abs=1e-12)
    assert surface.seen[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_maps_of_energy_are_per_area_and_maps_of_states_name_them(tmp_path):
    path, _ = tilted(tmp_path, np.random.default_rng(5).uniform(size=(12, 2)), 1.0)
    with Result(path) as result:
        energy = result.array("/contacts/dissipated_energy")[0]
        bar = contact_map(result, 0, "energy").axes[1]
        assert bar.get_ylim()[1] == pytest.approx(energy.max() / 0.5)
        assert "per area" in bar.get_ylabel()
        axes = contact_map(result, 0, "state").axes[0]
        assert sorted(text.get_text() for text in axes.get_legend().get_texts()) == [
            "open",
            "shaken down",
            "slipping",
            "stuck",
        ]


def test_a_look_sets_size_and_letters(tmp_path):
    with response(tmp_path, [1.0, 2.0, 3.0]) as result:
        figure = frequency_response(
            result, "tip", look=Look(width=85.0, height=60.0, font="DejaVu Serif", font_size=7.0)
        )
    assert figure.get_size_inches() * 25.4 == pytest.approx([85.0, 60.0])
    ticks = figure.axes[0].get_xticklabels()[0]
    assert ticks.get_fontsize() == pytest.approx(7.0) and ticks.get_fontfamily() == ["DejaVu Serif"]
    assert Look(width=127.0).size((10.0, 4.0)) == pytest.approx((5.0, 2.0))
    assert Look(height=50.8).size((10.0, 4.0)) == pytest.approx((5.0, 2.0))
    with pytest.raises(InputError, match="font = 'No Such Font'"):
        Look(font="No Such Font")


def test_a_pdf_keeps_its_letters_as_letters(tmp_path):
    save(hysteresis([Loop("contact 7", np.arange(3), np.arange(3), np.arange(3))]), tmp_path / "loops.pdf")
    written = (tmp_path / "loops.pdf").read_bytes()
    # Fonts of type 42 are embedded TrueType; type 3 would be outlines, which journals refuse.
    assert written.startswith(b"%PDF") and b"/Type3" not in written
    assert b"/TrueType" in written or b"/CIDFontType2" in written


def test_a_legend_below_has_as_many_columns_as_its_figure_has_room_for():
    for width, columns in ((8.0, 3), (5.0, 2), (2.5, 1), (0.5, 1)):
        axes = Figure(figsize=(width, 3.0)).add_subplot()
        for number in range(3):
            axes.plot([0.0, 1.0], label=f"a label of some length {number}")
        legend_below(axes, 3)
        assert axes.get_legend()._ncols == columns
