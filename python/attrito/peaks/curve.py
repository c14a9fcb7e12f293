"""What `attrito peak` finds: peaks along a curve."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from attrito.library.peak_tracker import Peak
from attrito.peaks.higher import Higher

KINDS = ("step", "value", "optimum")


@dataclass(frozen=True)
class Found:
    """A peak on the curve, why it is there (one of `KINDS`), and its derivatives, see `_derivatives` in `run.py`.

    `higher`: what a sweep of the band from there found; None where none was made. `moved`: the curve came to another
    maximum of the same resonance, which is lower.
    """

    peak: Peak
    kind: str
    derivatives: np.ndarray = field(default_factory=lambda: np.empty(0))
    higher: Higher | None = None
    moved: bool = False

    @property
    def converged(self) -> bool:
        """Whether there is a peak to tell of."""
        return self.peak.outcome != "not_converged"


# Change of a peak's logarithm beside what its slopes say, from one to the next, that no step of the curve makes
JUMP = np.log(1.5)
# Why there is no peak farther on, where the reason is physical
REASONS = {
    "leaves_band": "the response is largest at an end of the band of [sweep] there",
    "no_periodic_motion": (
        "about it there is no motion of the loads' period there: mean friction cannot balance the mean forces, "
        "and a body drifts"
    ),
}


@dataclass(frozen=True)
class Ending:
    """How a curve of peaks ends.

    Parameters
    ----------
    kind : `stop`, `max_points`, or a name of `ENDINGS`
    words : a sentence
    """

    kind: str
    words: str

    @property
    def is_physical(self) -> bool:
        """Whether there is no peak to be found farther on."""
        return self.kind in REASONS


def ending_of(found: list[Found], parameter: str, stop: float) -> Ending:
    """How a curve that was followed to a value of its parameter has ended."""
    last = found[-1]
    if last.converged:
        if abs(last.peak.parameter - stop) <= 1e-12 * stop:
            return Ending("stop", "it has come to its stop")
        return Ending("max_points", f"[peak] max_points was reached at {parameter} {last.peak.parameter:g}")
    known = [one.peak.parameter for one in found if one.converged]
    where = f"beyond {parameter} {known[-1]:g}" if known else "at the start"
    kind = last.peak.ending
    if kind in REASONS:
        return Ending(kind, f"the curve ends: there is no peak {where}, since {REASONS[kind]}")
    where = where if known else "from the start"
    return Ending("not_found", f"the peak is lost {where}: no point of the curve was found there")


def jumps(parameter: np.ndarray, height: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Which peaks are not on the curve of the one before, `[n]` bool: another peak was found between.

    Parameters
    ----------
    parameter, height : at the peaks in the order of the curve; NaN where there is no peak
    power : d log(height)/d log(parameter) there; NaN at a corner
    """
    found = np.zeros(len(height), dtype=bool)
    change, step = np.diff(np.log(height)), np.diff(np.log(parameter))
    known = np.isfinite(power)
    slope = 0.5 * (np.where(known, power, 0.0)[1:] + np.where(known, power, 0.0)[:-1])
    # Beside a corner the other end's slope stands for both.
    slope *= np.where(known[1:] != known[:-1], 2.0, 1.0)
    found[1:] = np.abs(change - slope * step) > JUMP
    return found


def elasticity(peak: Peak, parameter: str) -> float:
    """Relative change of the peak per relative change of the parameter: of amplitude per level, or of amplitude."""
    return peak.slope * peak.parameter / peak.amplitude - (1.0 if parameter == "level" else 0.0)
