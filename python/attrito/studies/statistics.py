"""What is said of all samples of a study together."""

from __future__ import annotations

import numpy as np

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
# Relative difference of a model from solved samples beyond which it is said not to hold
ACCEPTED = 0.05


def latin_hypercube(samples: int, count: int, seed: int) -> np.ndarray:
    """Places from 0 to 1, `[samples, count]`: along each axis one in each of as many equal parts.

    M. D. McKay, R. J. Beckman and W. J. Conover, Technometrics 21 (1979) 239-245, doi:10.2307/1268522. The numbers are
    those of `scipy.stats.qmc.LatinHypercube`, whose import takes longer than a small study.
    """
    random = np.random.default_rng(seed)
    within = random.uniform(size=(samples, count))
    parts = np.tile(np.arange(1, samples + 1), (count, 1))
    for row in parts:
        random.shuffle(row)
    return np.asarray((parts.T - within) / samples)


def quantiles_of(values: np.ndarray) -> np.ndarray:
    """`QUANTILES` over the samples `[samples, n]` that have a number, `[quantiles, n]`; NaN where none has."""
    found = np.full((len(QUANTILES), values.shape[1]), np.nan)
    known = np.isfinite(values).any(axis=0)
    found[:, known] = np.nanquantile(values[:, known], QUANTILES, axis=0)
    return found


def moments_of(values: np.ndarray) -> dict[str, np.ndarray]:
    """`mean` and standard `deviation` over the samples `[samples, n]`, `[n]`; NaN where fewer than two have one."""
    found = {name: np.full(values.shape[1], np.nan) for name in ("mean", "deviation")}
    known = np.isfinite(values).sum(axis=0) > 1
    found["mean"][known] = np.nanmean(values[:, known], axis=0)
    found["deviation"][known] = np.nanstd(values[:, known], axis=0, ddof=1)
    return found


def spans(at_hz: np.ndarray, which: np.ndarray) -> list[tuple[float, float]]:
    """Where frequencies are marked, from and to."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], which, [False]])))
    return [(float(at_hz[i]), float(at_hz[j - 1])) for i, j in zip(edges[::2], edges[1::2], strict=True)]
