"""Labels beside the marks of a chart keep apart from each other and from marks, and stay in their panel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.transforms import Bbox

from attrito.charts.file import Chart, Way, stored_table, write
from attrito.charts.plot import SIZE, picture, picture_of_chart
from attrito.plots.style import Look

# Error, seconds and counted work of ways: two near each other, two at one error, one at the right-hand end of the panel
NEAR = [
    (0.0215, 9.2, 8e10),
    (0.0146, 9.6, 1.02e11),
    (0.0094, 10.4, 9.8e10),
    (0.0246, 14.1, 1.34e11),
    (0.0015, 304.0, 7.3e11),
]
CROWDED = [(0.01, 10.0, 1e11), (0.0102, 10.1, 1.01e11), (0.0098, 10.2, 1.02e11)]


def chart_of(ways: list[tuple[float, float, float]]) -> Chart:
    series = ["meshes", "meshes", "points", "points", "points"]
    marks = [
        Way(
            series[i],
            f"way {i} with a long name",
            contacts=100 + i,
            error=error,
            seconds=seconds,
            work=work,
            own=i == len(ways) - 1,
        )
        for i, (error, seconds, work) in enumerate(ways)
    ]
    return Chart(
        marks, {"frequency_hz": 1.0, "level": 1.0}, "title", "Relative error of the peak", Way("meshes", "reference")
    )


@pytest.mark.parametrize("ways", [NEAR, CROWDED], ids=["near each other", "almost on each other"])
def test_labels_meet_no_other_label_and_no_mark(ways):
    figure = picture(chart_of(ways))
    figure.draw_without_rendering()
    for axes in figure.axes:
        extents = [Bbox(text.get_window_extent()) for text in axes.texts]
        assert len(extents) == len(ways)
        reach = 0.5 * SIZE * figure.dpi / 72.0
        places = axes.transData.transform([text.xy for text in axes.texts])
        marks = [Bbox.from_extents(x - reach, y - reach, x + reach, y + reach) for x, y in places]
        for i, extent in enumerate(extents):
            assert not any(extent.overlaps(other) for other in extents[:i] + marks), axes.texts[i].get_text()
            assert Bbox.intersection(extent, axes.get_window_extent()).bounds == pytest.approx(extent.bounds)


def test_a_series_of_an_older_chart_stays_in_its_table_and_is_not_drawn(tmp_path):
    ways = [Way("tolerance", "0.1", error=0.1, seconds=1.0, work=1e9), Way("patches", "0.1", error=0.2, seconds=2.0)]
    path = str(tmp_path / "chart.h5")
    write(replace(chart_of(NEAR), ways=ways), path, "job.toml")
    assert [line.split(",")[0] for line in stored_table(path).splitlines()] == ["series", "tolerance", "patches"]
    labels = [text.get_text() for text in picture_of_chart(path, Look()).axes[-1].get_legend().get_texts()]
    assert "harmonics by tolerance" in labels and not any("patches" in label for label in labels)


def test_labels_are_next_to_their_marks():
    figure = picture(chart_of(NEAR))
    figure.draw_without_rendering()
    for axes in figure.axes:
        for text in axes.texts:
            mark = axes.transData.transform(text.xy)
            extent = Bbox(text.get_window_extent())
            nearest = np.clip(mark, (extent.x0, extent.y0), (extent.x1, extent.y1))
            # The farthest place is 15 points above or below the rim of a mark.
            assert np.hypot(*(nearest - mark)) < 20.0 * figure.dpi / 72.0


def test_marks_below_the_reference_s_own_error_are_left_out():
    chart = replace(chart_of(NEAR), reference=Way("tolerance", "1e-8", harmonics=20, estimate=0.012))
    panel = picture(chart).axes[0]
    drawn = [
        y
        for line in panel.get_lines()
        if line.get_linestyle() == "None" and line.get_marker() != "*"
        for y in line.get_ydata()
    ]
    assert sorted(drawn) == sorted(error for error, _, _ in NEAR if error > 0.012)
