"""Quantities of motion, and figures that compare results."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import attrito

import attrito as package
from attrito.plots.labels import names_of
from attrito.results.motion import curve_of_quantity, differentiated, half_range, quantity_of
from attrito.results.result import Result
from attrito.support.errors import InputError

MASS, DAMPING, STIFFNESS = 1.0, 4.0, (2.0 * np.pi * 100.0) ** 2


def receptance(frequency_hz):
    omega = 2.0 * np.pi * np.asarray(frequency_hz)
    return 1.0 / (STIFFNESS - omega**2 * MASS + 1j * omega * DAMPING)


def oscillator(path, force=1.0, friction=0.3, level=1.0, frequency=None):
    """A result of an oscillator under a cosine; q = Re(H exp(i omega t)) has the coefficients 0, Re H, -Im H."""
    frequency = np.linspace(90.0, 110.0, 41) if frequency is None else frequency
    motion = force * receptance(frequency)
    synthetic.write_result(path, frequency, {"tip": np.abs(motion)}, level=np.full(len(frequency), level))
    with edited(path) as file:
        coefficients = np.column_stack([np.zeros(len(frequency)), motion.real, -motion.imag])
        file["monitors/tip/harmonics"] = coefficients
        file["points/path"] = np.arange(len(frequency), dtype=float)
        job = {"output": {"file": str(path), "monitors": [{"name": "tip"}]}, "load": []}
        job["contact_set"] = [{"friction_coefficient": friction, "gap": 0.0}]
        file.attrs["job"] = json.dumps(job)
    return str(path)


def test_half_the_range_of_harmonic_motions_is_that_of_closed_forms():
    # cos + cos 2: from -9/8 to 2; 3 cos: 3; a constant: 0. Extremes that Newton's method has found are exact.
    coefficients = np.array([[0, 1, 0, 1, 0], [5, 0, 3, 0, 0], [7, 0, 0, 0, 0], [np.nan, 0, 0, 0, 0]], dtype=float)
    assert half_range(coefficients)[:3] == pytest.approx([25 / 16, 3.0, 0.0], rel=1e-12, abs=1e-15)
    assert np.isnan(half_range(coefficients)[3])


def test_the_second_derivative_of_a_harmonic_is_minus_its_square():
    coefficients = np.array([[4.0, 1.0, 2.0, 3.0, 5.0]])
    assert differentiated(coefficients, 1).tolist() == [[0.0, 2.0, -1.0, 10.0, -6.0]]
    assert differentiated(coefficients, 2).tolist() == [[0.0, -1.0, -2.0, -12.0, -20.0]]


def test_quantities_of_an_oscillator_are_those_of_its_receptance(tmp_path):
    with Result(oscillator(tmp_path / "a.h5")) as result:
        frequency = result.array("/points/frequency_hz")
        motion, omega = receptance(frequency), 2.0 * np.pi * frequency
        assert quantity_of(result, "tip", "first_harmonic") == pytest.approx(np.abs(motion), rel=1e-12)
        assert quantity_of(result, "tip", "phase") == pytest.approx(np.degrees(np.angle(motion)), abs=1e-9)
        assert quantity_of(result, "tip", "velocity") == pytest.approx(omega * np.abs(motion), rel=1e-12)
        assert quantity_of(result, "tip", "acceleration") == pytest.approx(omega**2 * np.abs(motion), rel=1e-12)
        # At resonance a motion lags by a quarter of a period.
        assert quantity_of(result, "tip", "phase")[20] == pytest.approx(-90.0, abs=1e-6)


def test_the_drawn_curve_of_a_phase_is_that_of_the_receptance_between_points(tmp_path):
    with Result(oscillator(tmp_path / "a.h5", frequency=np.linspace(98.0, 102.0, 41))) as result:
        curve = curve_of_quantity(result, "tip", "phase")
        between = curve.at(np.arange(40) + 0.5)
    exact = np.degrees(np.angle(receptance(between[0])))
    straight = 0.5 * (curve.values[1, 1:] + curve.values[1, :-1])
    # A monotone cubic is nearer than a straight line, nowhere by much worse than its slope allows.
    assert np.max(np.abs(between[1] - exact)) < 0.5 * np.max(np.abs(straight - exact)) < 1.0


def test_results_are_named_by_what_differs_between_their_jobs_or_by_their_files(tmp_path):
    paths = [oscillator(tmp_path / f"{name}.h5", friction=mu) for name, mu in (("a", 0.3), ("b", 0.5))]
    results = [Result(path) for path in paths]
    assert names_of(results) == ["friction coefficient 0.3", "friction coefficient 0.5"]
    assert names_of([results[0], results[0]]) == [paths[0], paths[0]]
    (tmp_path / "c").mkdir()
    same = Result(oscillator(tmp_path / "c" / "d.h5"))
    assert names_of([results[0], same]) == ["a", "d"]


def test_several_results_are_drawn_in_one_figure_with_a_unit(tmp_path):
    paths = [oscillator(tmp_path / f"{name}.h5", 1.0 / (2 * mu), mu) for name, mu in (("a", 0.3), ("b", 0.5))]
    figure = package.plot(*paths, quantity="velocity", xlim=(95, 105), log=False)
    axes = figure.axes[0]
    assert axes.get_legend_handles_labels()[1] == ["friction coefficient 0.3", "friction coefficient 0.5"]
    assert axes.get_ylabel().replace("\n", " ") == "Velocity amplitude of tip (length/s, user units)"
    assert axes.get_xlim() == (95, 105) and axes.get_yscale() == "linear"
    peaks = [np.nanmax(line.get_ydata()) for line in axes.get_lines() if len(line.get_xdata())]
    omega = 2.0 * np.pi * np.linspace(90.0, 110.0, 41)
    expected = np.max(omega * np.abs(receptance(omega / (2.0 * np.pi))))
    # The maximum of a cubic may lie above those of its points, which are 0.5 Hz apart.
    assert peaks == pytest.approx([expected / 0.6, expected], rel=1e-2)


def test_nyquist_is_the_first_harmonic_in_the_complex_plane(tmp_path):
    path = oscillator(tmp_path / "a.h5")
    line = next(one for one in package.plot(path, quantity="nyquist").axes[0].get_lines() if len(one.get_xdata()))
    motion = receptance(np.linspace(90.0, 110.0, 41))
    x, y = line.get_data()
    assert [x[0], y[0], x[-1], y[-1]] == pytest.approx(
        [motion[0].real, motion[0].imag, motion[-1].real, motion[-1].imag]
    )


def test_a_style_of_matplotlib_gives_its_colours_and_one_that_is_not_there_is_refused(tmp_path):
    path = oscillator(tmp_path / "a.h5")
    line = package.plot(path, look=package.plots.style.Look(name="ggplot")).axes[0].get_lines()[0]
    assert line.get_color() == "#E24A33"
    with pytest.raises(InputError, match=r"style = 'nonsense': expected .*ggplot"):
        package.plots.style.Look(name="nonsense")


def test_pictures_of_two_results_in_a_folder_do_not_overwrite_each_other(tmp_path):
    for name in ("a", "b", "result"):
        oscillator(tmp_path / f"{name}.h5")
        assert attrito(tmp_path, "plot", f"{name}.h5").returncode == 0
    assert attrito(tmp_path, "plot", "a.h5", "b.h5", "--quantity", "phase").stdout == "a_b.phase.png\n"
    found = sorted(path.name for path in tmp_path.glob("*.png"))
    assert found == ["a.frf.png", "a_b.phase.png", "b.frf.png", "frf.png"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--point", "999"), "a.h5: --point = 999: expected none but for loops or a map of contacts"),
        (("--contact", "1"), "a.h5: --contact = [1]: expected none but for loops"),
        (("--loops", "--linear"), "a.h5: --linear = 'given': expected none but for frequency responses"),
        (("-o", "x.jpg"), "x.jpg: figure = '.jpg': expected a writable .png, .pdf or .svg file"),
        (("--level", "3"), "a.h5: level = 3.0: expected one of 1"),
        (("--xlim", "3", "2"), "a.h5: --xlim = (3.0, 2.0): expected a frequency and a higher one"),
    ],
)
def test_an_option_that_does_not_apply_is_refused(tmp_path, given, said):
    oscillator(tmp_path / "a.h5")
    done = attrito(tmp_path, "plot", "a.h5", *given)
    assert done.returncode == 2 and done.stderr.strip() == f"attrito: {said}"


def grid_study(path):
    """Peaks over three friction coefficients and two gaps."""
    mu, gap = np.repeat([0.3, 0.5, 0.7], 2), np.tile([0.0, 1.0], 3)
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["parameter"] = "attrito study", "level"
        file.attrs["study"] = json.dumps({"design": "grid", "vary": [{"name": "mu"}, {"name": "gap"}]})
        file["parameter"], file["values/mu"], file["values/gap"] = [1.0], mu, gap
        file["peaks/amplitude"] = (10.0 * mu + gap)[:, None]
        file["peaks/amplitude"].attrs["unit"] = "user length"
        file["peaks/outcome"] = np.zeros((6, 1), dtype=np.int32)
        file["peaks/outcome"].attrs["names"] = ["converged"]
    return str(path)


def test_a_grid_is_drawn_with_a_line_a_value(tmp_path):
    axes = package.plot(grid_study(tmp_path / "study.h5")).axes[0]
    assert [line.get_label() for line in axes.get_lines()] == ["gap 0", "gap 1"]
    assert [line.get_ydata().tolist() for line in axes.get_lines()] == [[3.0, 5.0, 7.0], [4.0, 6.0, 8.0]]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("mu", "Amplitude of the peak (length, user units)")


def test_an_option_of_responses_is_refused_for_a_study(tmp_path):
    grid_study(tmp_path / "study.h5")
    done = attrito(tmp_path, "plot", "study.h5", "--xlim", "1", "2")
    assert done.stderr.strip() == "attrito: study.h5: --xlim = 'given': expected none for a study"
    assert attrito(tmp_path, "plot", "study.h5").stdout == "study.png\n"
