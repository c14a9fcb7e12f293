"""The linear systems that a response is compared with: natural frequencies and responses over the band of the job."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.job.job import Job
from attrito.library.names import REFERENCES
from attrito.library.session import Solver

LINEAR_POINTS = 400
NATURAL_FREQUENCIES = 20
MEANINGS = {
    "stuck": "every contact stuck",
    "frictionless": "contacts closed, no friction",
    "tangent": "contacts that are open at the static solution open, the others stuck",
}


@dataclass(frozen=True)
class LinearReference:
    """A linear system's response at level 1.

    Parameters
    ----------
    frequency_hz : of the response, `[n]`
    amplitude : of the monitors, `[monitors, n]`, user length
    natural_hz : lowest natural frequencies of elastic modes
    rigid : how many rigid-body modes it has
    """

    frequency_hz: np.ndarray
    amplitude: np.ndarray
    natural_hz: np.ndarray
    rigid: int


def linear_references(solver: Solver, job: Job) -> dict[str, LinearReference]:
    """Each of `REFERENCES` over the job's band. The solver has followed the static load path. Collective."""
    sweep = job["sweep"]
    given = sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]]
    low, high = min(given), max(given)
    found = {}
    for name in REFERENCES:
        grid = np.linspace(low, high, LINEAR_POINTS) if high > low else np.array([low])
        _, natural, rigid = solver.linear_response(name, grid[:1], NATURAL_FREQUENCIES)
        # Resonances are drawn by points of their own, close enough for the sharpest.
        inside = natural[(natural > low) & (natural < high)]
        near = [inside * (1.0 + sign * width) for width in np.geomspace(1e-5, 1e-2, 16) for sign in (-1, 1)]
        grid = np.unique(np.concatenate([grid, inside, *near]))
        grid = grid[(grid >= low) & (grid <= high)]
        found[name] = LinearReference(grid, solver.linear_response(name, grid, 0)[0], natural, rigid)
    return found


def band_without_mode(job: Job, linear: dict[str, LinearReference]) -> list[str]:
    """A warning where no mode can resonate in the band that is swept, at whatever state its contacts are in.

    A mode's natural frequency lies between those that it has in the linear systems, which are counted from the first
    rigid-body mode on. Listed frequencies are what somebody asks for, and a wheel's harmonics have modes of their own.
    """
    sweep = job["sweep"]
    if sweep["frequencies_hz"] or job["cyclic"]["sectors"] is not None:
        return []
    low, high = sorted((sweep["start_hz"], sweep["stop_hz"]))
    modes = [np.concatenate([np.zeros(one.rigid), one.natural_hz]) for one in linear.values()]
    count = min(map(len, modes))
    if count == 0:
        return []
    least, most = (pick([one[:count] for one in modes], axis=0) for pick in (np.min, np.max))
    driven = {load["harmonic"] for load in job["load"] if load["kind"] == "harmonic"}
    reached = any(np.any((least / harmonic <= high) & (most / harmonic >= low)) for harmonic in driven)
    unknown = count >= NATURAL_FREQUENCIES and most[-1] < low
    if reached or unknown or not driven:
        return []
    nearest = "; ".join(
        f"{name} {in_words(_nearest(one.natural_hz, low, high), one.rigid, 2)}" for name, one in linear.items()
    )
    return [
        f"no natural frequency from {low:g} to {high:g} Hz, so no resonance is swept; nearest, in Hz: {nearest};"
        " check [sweep] and the units of the model"
    ]


def _nearest(natural_hz: np.ndarray, low: float, high: float) -> np.ndarray:
    """The last one below a band and the first one above it."""
    return np.concatenate([natural_hz[natural_hz < low][-1:], natural_hz[natural_hz > high][:1]])


def in_words(natural_hz: np.ndarray, rigid: int, count: int, digits: int = 4) -> str:
    """The lowest elastic natural frequencies, and how many rigid-body modes there are besides."""
    words = ", ".join(f"{frequency:.{digits}g}" for frequency in natural_hz[:count]) or "none"
    return words + (f" (and {rigid} rigid-body mode{'s' if rigid > 1 else ''})" if rigid else "")
