"""Derivatives of peaks from two points beside them, of amplitudes that are known."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from attrito.library.derivatives import Rates
from attrito.library.family import Family
from attrito.runs.peak_slopes import NEAREST, of_peak

# A and its derivatives by a parameter and by the frequency, at a frequency
Response = Callable[[float], tuple[float, float, float]]


class Known:
    """What a family is asked for, of a response that is known."""

    tolerance = 1e-10

    def __init__(self, response: Response, frequency_hz: float):
        self.response, self.frequency_hz, self.kept = response, frequency_hz, frequency_hz

    def keep(self, place: int) -> None:
        assert place == 0
        self.kept = self.frequency_hz

    def go_back(self, place: int) -> None:
        assert place == 0
        self.frequency_hz = self.kept

    def move_to(self, frequency_hz: float) -> bool:
        self.frequency_hz = frequency_hz
        return True

    def describe(self) -> SimpleNamespace:
        return SimpleNamespace(amplitude=np.array([self.response(self.frequency_hz)[0]]))

    def differentiate_by_frequency(self) -> np.ndarray:
        return np.array([self.response(self.frequency_hz)[2]])

    def differentiate_peak_frequency(self, monitor: int, rates: Rates) -> np.ndarray:
        """By samples there is none."""
        return np.full(1, np.nan)


def slopes_of(response: Response, near: float, at_corner: bool) -> np.ndarray | None:
    """By the parameter, of height and frequency."""
    known: Any = Known(response, near)

    def find(family: Family) -> np.ndarray:
        return np.array(response(known.frequency_hz)[1:])

    found = of_peak(cast(Family, known), 0, near, at_corner, find, cast(Rates, None))
    assert known.frequency_hz == near
    return None if found is None else found[:, 0]


def corner(frequency: float) -> tuple[float, float, float]:
    """A = min(1 + 3 (f - 100) + 2 p, 1 - 5 (f - 100) + 7 p) at p = 0: they meet at f = 100 + 5/8 p, A = 1 + 31/8 p."""
    above = frequency - 100.0
    return (1.0 + 3.0 * above, 2.0, 3.0) if above < 0.0 else (1.0 - 5.0 * above, 7.0, -5.0)


@pytest.mark.parametrize("near", [100.0, 100.0 * (1 + 0.1 * NEAREST), 100.0 * (1 - 3e-8), 100.0 * (1 + 1e-6)])
def test_a_corner_moves_to_where_both_branches_are_equal(near: float) -> None:
    assert slopes_of(corner, near, at_corner=True) == pytest.approx([31.0 / 8.0, 5.0 / 8.0], rel=1e-12)


def test_derivatives_of_a_corner_are_those_where_points_are_sure_of_their_side() -> None:
    """Nearer to it than points are solved to, a contact that begins to slip is taken for either."""

    def unsure(frequency: float) -> tuple[float, float, float]:
        # So flat that the nearest points are within what points are solved to
        amplitude, by_parameter, by_frequency = corner(100.0 + 1e-3 * (frequency - 100.0))
        is_sure = amplitude < (1.0 - 10.0 * Known.tolerance) * corner(100.0)[0]
        return amplitude, by_parameter if is_sure else 1e3, 1e-3 * by_frequency

    assert slopes_of(unsure, 100.0, at_corner=True) == pytest.approx([31.0 / 8.0, 5e3 / 8.0], rel=1e-12)


def test_the_height_of_a_smooth_peak_is_what_is_left_where_the_slope_vanishes() -> None:
    """A = 1 + 2 p - (f - 100 - 4 p)^2, found a little off: A_p = 2 + 8 (f - 100), 2 at the peak."""

    def smooth(frequency: float) -> tuple[float, float, float]:
        above = frequency - 100.0
        return 1.0 - above**2, 2.0 + 8.0 * above, -2.0 * above

    height, frequency = slopes_of(smooth, 100.0 + 1e-5, at_corner=False)
    # The place is off by 1e-5: without the points beside it the derivative would be off by 8e-5. Frequencies are exact
    # to 1e-16 of 100.
    assert height == pytest.approx(2.0, abs=1e-12)
    assert np.isnan(frequency)


def test_a_response_that_jumps_has_no_corner() -> None:
    def jumping(frequency: float) -> tuple[float, float, float]:
        amplitude, *slopes = corner(frequency)
        return (amplitude + 1e-4 * (frequency > 100.0), *slopes)

    assert slopes_of(jumping, 100.0, at_corner=True) is None


def test_there_is_none_where_the_amplitude_only_rises() -> None:
    assert slopes_of(lambda frequency: (1.0 + 3.0 * (frequency - 100.0), 2.0, 3.0), 100.0, at_corner=True) is None
