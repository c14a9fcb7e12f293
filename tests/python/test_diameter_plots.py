"""The nodal-diameter diagram of a wheel: engine orders folded onto nodal diameters, and the modes that they meet."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from jobs import attrito_here, write_job
from wheels import lumped_sector

from attrito.plots.diameters import MARGIN, diameter_diagram, folded, meetings, speed_of, zigzag
from attrito.results.result import Result


@pytest.mark.parametrize("sectors", [1, 2, 5, 12])
def test_an_engine_order_folds_to_the_nodal_diameter_whose_wave_it_is_round_the_wheel(sectors):
    """The phases of forces cos(e j 2 pi / N) on the sectors j are those of the diameter it folds to."""
    angle = 2.0 * np.pi * np.arange(sectors) / sectors
    for order in range(-3, 3 * sectors + 2):
        number = int(folded(order, sectors))
        assert 0 <= number <= sectors // 2
        assert np.cos(order * angle) == pytest.approx(np.cos(number * angle), abs=1e-12)


@pytest.mark.parametrize("sectors", [5, 12])
def test_the_zigzag_line_passes_every_engine_order_at_its_diameter_and_frequency(sectors):
    line = zigzag(sectors, 50.0, 1234.5)
    assert line[0].tolist() == [0.0, 0.0] and line[-1, 1] == pytest.approx(1234.5)
    for order in range(int(1234.5 / 50.0) + 1):
        at = np.interp(50.0 * order, line[:, 1], line[:, 0])
        assert at == pytest.approx(float(folded(order, sectors)), abs=1e-12)


def test_modes_are_met_by_engine_orders_of_their_own_diameter_alone():
    diameter, frequency = np.array([0, 1, 1, 2, 2, 2]), np.array([500.0, 103.0, 300.0, 200.0, 303.0, 690.0])
    # Of 5 sectors: orders 1, 4, 6, ... excite diameter 1; 2, 3, 7, ... diameter 2; 5 diameter 0.
    met = meetings(diameter, frequency, 5, 100.0)
    found = [(one.engine_order, one.diameter, one.frequency_hz) for one in met]
    assert found == [(5, 0, 500.0), (1, 1, 103.0), (2, 2, 200.0), (3, 2, 303.0), (7, 2, 690.0)]
    assert MARGIN == 0.05 and not meetings(np.array([1]), np.array([106.0]), 5, 100.0)


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    """A folder with linear modes of a lumped wheel of five sectors, engine order 2."""
    folder = tmp_path_factory.mktemp("modes")
    write_job(folder, lumped_sector())
    return folder


def prepared(folder, capfd):
    done = attrito_here(folder, capfd, "linear-modes", "job.toml", "--state", "stuck")
    assert done.returncode == 0, done.stderr
    return folder / "result.stuck.modes.h5"


def test_without_a_speed_the_job_s_engine_order_is_drawn_where_it_is_critical(modes, capfd):
    path = prepared(modes, capfd)
    with Result(path) as result:
        speed, words = speed_of(result)
        of_two = result.array("/points/frequency_hz")[result.array("/points/nodal_diameter") == 2]
    assert 2.0 * speed == pytest.approx(of_two.min()) and words == "where engine order 2 is critical"


def test_the_diagram_shows_all_modes_the_line_and_what_it_meets(modes, capfd, written):
    prepared(modes, capfd)
    done = attrito_here(modes, capfd, "plot", "result.stuck.modes.h5", "--dpi", "50")
    assert done.returncode == 0 and done.stdout.strip() == "result.stuck.modes.diameters.png", done.stderr
    (figure,) = written
    (axes,) = figure.axes
    assert axes.get_xlabel() == "Nodal diameter" and axes.get_ylabel() == "Frequency (Hz)"
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert "modes, stuck" in lines and any("where engine order 2 is critical" in label for label in lines)
    circles = next(line for label, line in lines.items() if label.startswith("within"))
    with Result(modes / "result.stuck.modes.h5") as result:
        first = result.array("/points/frequency_hz")[result.array("/points/nodal_diameter") == 2].min()
    assert (2, pytest.approx(first)) in list(zip(*circles.get_data(), strict=True))
    assert "2" in [text.get_text() for text in axes.texts]


def test_a_given_speed_is_the_line_s(modes, capfd):
    path = prepared(modes, capfd)
    with Result(path) as result:
        figure = diameter_diagram(result, 7.0)
    line = next(line for line in figure.axes[0].get_lines() if line.get_label() == "engine orders at 7 Hz")
    assert line.get_xydata().tolist() == [[0.0, 0.0], [2.5, 17.5]]
    assert isinstance(figure, matplotlib.figure.Figure)


def test_a_speed_is_of_a_wheel_s_modes_alone(modes, capfd, tmp_path):
    path = prepared(modes, capfd)
    with pytest.raises(SystemExit) as ended:
        attrito_here(modes, capfd, "plot", str(path), "--speed-hz", "0")
    assert ended.value.code == 2 and "--speed-hz: '0': expected a speed in Hz above 0" in capfd.readouterr().err
    job = lumped_sector()
    del job["cyclic"], job["contact"][0]
    job["model"]["mass"][3][3] = 1.0
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    done = attrito_here(tmp_path, capfd, "plot", "result.modes.h5", "--speed-hz", "3")
    assert done.returncode == 2
    assert "--speed-hz = 3.0: expected a file of `attrito linear-modes` of a job with [cyclic]" in done.stderr
