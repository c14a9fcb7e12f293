"""Harmonics that stay the same along a curve of peaks, and are chosen for all of it.

If the job leaves them to its tolerance, the curve is followed with the first of a few series, and again with the next
one while the estimated error of any of its points is above the tolerance. The points of the last one keep that outcome.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from attrito.library.session import Options

LENGTHS = (5, 10, 20, 40)
# Samples that show harmonics up to 3 H, and one more each way
PER_HARMONIC = 6


def fixed_series(options: Options) -> list[Options]:
    """Options of a job with everything fixed, shortest series first; one entry where nothing was to be chosen."""
    if not options.choose_harmonics:
        return [options]
    return list(dict.fromkeys(_fixed(options, length) for length in LENGTHS))


def is_enough(outcomes: Iterable[str]) -> bool:
    """Whether the tolerance is kept at every point of a curve."""
    return "above_tolerance" not in outcomes


def _fixed(options: Options, length: int) -> Options:
    harmonics = max(length, options.harmonics)
    samples = max(options.samples, PER_HARMONIC * harmonics + 2)
    return replace(options, harmonics=harmonics, samples=samples, choose_harmonics=False)
