"""What the comparison of approaches must show, measured: claims of the paper's text, and of the design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from attrito_verification.paper.figures import PEAK_84_HZ, RATIOS
from attrito_verification.paper.study import FINE_HARMONICS, INCLINED_WALL, LEVEL_WALL, Study
from attrito_verification.paper.wedge import BAND, PRELOAD

FINEST_HARMONICS = 60


@dataclass(frozen=True)
class Claim:
    """A number between bounds; `heavy` ones are left out of a quick verification."""

    what: str
    low: float
    high: float
    measure: Callable[[Study], float]
    heavy: bool = False


def _force(ratio: float) -> float:
    return PRELOAD / ratio


def _slip(approach: str, ratio: float) -> Callable[[Study], float]:
    def measure(study: Study) -> float:
        wedge = study.wedge(INCLINED_WALL, approach)
        return wedge.contact(wedge.peak(_force(ratio)).point).slip

    return measure


def _open(approach: str, ratio: float) -> Callable[[Study], float]:
    def measure(study: Study) -> float:
        wedge = study.wedge(INCLINED_WALL, approach)
        return wedge.contact(wedge.peak(_force(ratio)).point).open

    return measure


def _least_normal(study: Study) -> float:
    wedge = study.wedge(INCLINED_WALL, "U1")
    return wedge.contact(wedge.peak(_force(RATIOS[1])).point).least_normal


def _above(approach: str, ratio: float) -> Callable[[Study], float]:
    def measure(study: Study) -> float:
        peaks = [study.wedge(INCLINED_WALL, name).peak(_force(ratio)).response for name in (approach, "C")]
        return peaks[0] / peaks[1] - 1.0

    return measure


def _below_stuck(study: Study) -> float:
    wedge = study.wedge(INCLINED_WALL, "U1")
    return 1.0 - wedge.peak(_force(RATIOS[0])).response / wedge.stuck_peak[1]


def _difference_of_starts(force: float) -> Callable[[Study], float]:
    """Difference of mean T between the orbits that start from U1 and U2, N."""

    def measure(study: Study) -> float:
        means = [study.orbit(INCLINED_WALL, force, PEAK_84_HZ, start).force_mean[0] for start in ("U1", "U2")]
        return abs(means[0] - means[1])

    return measure


def _steady_error(study: Study) -> float:
    """Largest relative error of C's mean T, N, x, y and amplitude of x at many harmonics, against time integration."""
    wedge = study.wedge(INCLINED_WALL, "C", FINEST_HARMONICS)
    point = wedge.respond(np.array([BAND[0], PEAK_84_HZ]), _force(RATIOS[0]))[-1]
    mean = wedge.mean(point)
    orbit = study.orbit(INCLINED_WALL, _force(RATIOS[0]), PEAK_84_HZ)
    exact = np.array([*orbit.force_mean, *orbit.mean[:2], orbit.amplitude[0]])
    ours = np.array([mean.tangential, mean.normal, mean.x, mean.y, point.amplitude[0]])
    return float(np.abs(ours / exact - 1.0).max())


def _peak_error(degrees: float, harmonics: int | None = None, of: int = 0) -> Callable[[Study], float]:
    """Error of the peaks: `of` 0 their amplitude, 1 their frequency."""
    return lambda study: study.worst_peak_errors(degrees, harmonics or study.harmonics)[of]


CLAIMS = (
    Claim(
        "level wall: largest relative difference of U from C, 8 forces", 0.0, 1e-12, Study.worst_difference_of_uncoupled
    ),
    Claim("level wall: Fpl/Fexc of lock-up", 105.71, 105.81, Study.lock_up),
    *(
        Claim(
            f"{wall}: largest relative error of C's peak {('amplitude', 'frequency')[of]}, 8 forces, {count} harmonics",
            0.0,
            bar,
            _peak_error(degrees, harmonics, of),
            heavy=True,
        )
        for wall, degrees in (("level wall", LEVEL_WALL), ("inclined wall", INCLINED_WALL))
        for count, harmonics, bar in (("the chosen", None, 3e-4), (FINE_HARMONICS, FINE_HARMONICS, 3e-6))
        for of in (0, 1)
    ),
    Claim("84: part of the period that U1 slips", 0.035, 0.045, _slip("U1", RATIOS[0])),
    Claim("84: U1's peak below that of the stuck response", 0.0135, 0.0145, _below_stuck),
    Claim("84: U1's peak above C's", 0.135, 0.145, _above("U1", RATIOS[0])),
    Claim("84: U2's peak above C's", -0.04, 0.04, _above("U2", RATIOS[0])),
    Claim("30: smallest N of U1, N", 4.25, 4.35, _least_normal),
    Claim("30: part of the period that U1 is open", 0.0, 0.0, _open("U1", RATIOS[1])),
    Claim("30: U1's peak above C's", -0.195, -0.185, _above("U1", RATIOS[1])),
    Claim("30: part of the period that C is open", 0.235, 0.245, _open("C", RATIOS[1])),
    Claim("30: part of the period that U2 is open", 0.235, 0.245, _open("U2", RATIOS[1])),
    Claim("30: U2's peak above C's", -0.005, 0.005, _above("U2", RATIOS[1])),
    Claim(
        "Fig. 13: difference of mean T between both starts, time integration, N", 0.0, 1e-9, _difference_of_starts(5.0)
    ),
    Claim("Fig. 13: relative error of C's steady state at 60 harmonics", 0.0, 1e-6, _steady_error, heavy=True),
    Claim(
        "inclined wall, 1 N, 132 Hz: difference of mean T between both starts, N",
        19.20,
        19.30,
        _difference_of_starts(1.0),
    ),
    Claim(
        "inclined wall, 4 N, 132 Hz: difference of mean T between both starts, N",
        0.85,
        0.92,
        _difference_of_starts(4.0),
    ),
)


def measure(study: Study, quick: bool) -> list[tuple[Claim, float]]:
    """The claims and what is measured."""
    return [(claim, claim.measure(study)) for claim in CLAIMS if not (quick and claim.heavy)]


def holds(claim: Claim, value: float) -> bool:
    """Whether a value is between its bounds."""
    return bool(claim.low <= value <= claim.high)


def markdown(measured: list[tuple[Claim, float]]) -> str:
    """The table of claims."""
    lines = ["| what | expected | measured | holds |", "|---|---|---|---|"]
    for claim, value in measured:
        expected = f"{claim.low:g}" if claim.low == claim.high else f"{claim.low:g} to {claim.high:g}"
        lines.append(f"| {claim.what} | {expected} | {value:.5g} | {'yes' if holds(claim, value) else 'NO'} |")
    return "\n".join(lines) + "\n"
