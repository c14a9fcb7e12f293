"""What the sections of a report ask of a result: which point is shown, where peaks, stretches and intervals are."""

from __future__ import annotations

import json
from functools import cached_property
from typing import Any

import numpy as np

from attrito.model.model import Model
from attrito.plots.contact_surfaces import Surface, surfaces
from attrito.results.mesh import mesh_of
from attrito.results.result import MODE, Result

# Stretches of frequency that are named; more are counted.
MOST_RANGES = 4
# An interval narrower than this part of the largest force is none.
NO_WIDTH = 1e-8


class View:
    """A result and the point of it that is shown.

    Parameters
    ----------
    result : an open result
    point : the point; None: that of the largest amplitude of the first monitor, of a mode the last

    Attributes
    ----------
    solved : bool [np], whether a point holds a solution
    level, frequency : [np], factor on the harmonic loads; Hz
    is_mode : whether the result is a nonlinear mode
    peaks : the point of the largest amplitude of the first monitor by level; None where a level has no solution
    point : None where no point has a solution
    """

    def __init__(self, result: Result, point: int | None = None) -> None:
        self.result = result
        self.solved = result.converged
        self.level, self.frequency = result.array("/points/level"), result.array("/points/frequency_hz")
        self._branch = result.array("/points/branch")
        self.monitors = result.monitors
        everywhere = np.ones(result.points, dtype=bool)
        first = self.monitors[0] if self.monitors else None
        self.peaks = {level: self.peak(first, self.level == level) for level in np.unique(self.level)}
        self.is_mode = result.attribute("format") == MODE
        if point is None and self.is_mode:
            point = int(np.flatnonzero(self.solved)[-1]) if self.solved.any() else None
        self.point = self.peak(first, everywhere) if point is None else point

    @cached_property
    def model(self) -> Model | None:
        """The mesh of the model, where its file is there."""
        return mesh_of(self.result)

    @cached_property
    def surfaces(self) -> list[Surface]:
        """Where contacts lie, one a contact set."""
        return surfaces(self.result, self.model)

    def job(self) -> dict[str, Any]:
        """Tables of the job; none where the file does not tell them."""
        try:
            tables = json.loads(self.result.attribute("job"))
        except ValueError:
            return {}
        return tables if isinstance(tables, dict) else {}

    def peak(self, monitor: str | None, among: np.ndarray) -> int | None:
        """The point of the largest amplitude of a monitor among some."""
        if monitor is None:
            return None
        values = self.result.monitor(monitor, "amplitude")
        own = np.flatnonzero(among & self.solved & np.isfinite(values))
        return int(own[np.argmax(values[own])]) if len(own) else None

    def sweep(self, point: int | None = None) -> np.ndarray:
        """bool [np], the points of the level of a point (None: the one that is shown)."""
        return self.level == self.level[self.point if point is None else point]

    def place(self, point: int) -> str:
        """Where a point is, in words."""
        if self.is_mode:
            amplitude = self.result.array("/points/amplitude")[point]
            return f"point {point}, Q = {amplitude:.4g}, {self.frequency[point]:.6g} Hz"
        return f"point {point}, {self.frequency[point]:.6g} Hz, level {self.level[point]:.4g}"

    def approach(self) -> str:
        """`coupled` or `uncoupled`; empty where the file does not tell its job."""
        try:
            return json.loads(self.result.attribute("job"))["balance"]["approach"]
        except (ValueError, TypeError, KeyError):
            return ""

    def ranges(self, chosen: np.ndarray) -> str:
        """Where some points are, as stretches of frequency of one level and branch, the longest first."""
        cuts = np.flatnonzero((np.diff(self.level) != 0) | (np.diff(self._branch) != 0)) + 1
        pieces = np.split(np.arange(len(chosen)), cuts)
        runs = [run for piece in pieces for run in _runs(piece[0], chosen[piece])] if len(chosen) else []
        runs.sort(key=lambda run: run[0] - run[1])
        words = []
        for first, last in runs[:MOST_RANGES]:
            low, high = sorted(self.frequency[[first, last]])
            hertz = f"{low:.5g} Hz" if first == last else f"{low:.5g} to {high:.5g} Hz"
            words.append(hertz + (f" at level {self.level[first]:.4g}" if len(self.peaks) > 1 else ""))
        rest = f" and {len(runs) - MOST_RANGES} more stretches" if len(runs) > MOST_RANGES else ""
        return "; ".join(words) + rest

    def amplitude_widths(self) -> np.ndarray:
        """[np], widest interval of a monitor's amplitude relative to it; NaN: unique, or not known of all monitors."""
        widest = np.where(self.result.array("/points/unique") == 0, 0.0, np.nan)
        for name in self.monitors:
            low, high, amplitude = (self.result.monitor(name, quantity) for quantity in ("low", "high", "amplitude"))
            width = high - low
            # Of what does not move nothing is known but that no member moves it.
            width = np.divide(width, amplitude, out=np.where(width > 0, np.nan, width), where=amplitude > 0)
            widest = np.maximum(widest, width)
        # Where the search for bounds was cut off one other member may have been visited all the same.
        if self.result.has("/points/amplitude_change"):
            change = self.result.array("/points/amplitude_change")
            widest = np.where(np.isfinite(widest) | (self.result.array("/points/unique") != 0), widest, change)
        return widest

    def widest_force(self) -> tuple[int, int, float] | None:
        """Point, contact and width of the widest known interval of a mean tangential force; None without any."""
        best = None
        for name in ("t1", "t2"):
            if not self.result.has(f"/contacts/{name}_low"):
                continue
            low, high, mean = (self.result.array(f"/contacts/{name}_{side}") for side in ("low", "high", "mean"))
            width = np.where(np.isfinite(low + high), high - low, 0.0)
            least = NO_WIDTH * np.max(np.abs(np.nan_to_num(mean)), initial=0.0)
            if width.max(initial=0.0) > max(least, best[2] if best else 0.0):
                point, contact = np.unravel_index(np.argmax(width), width.shape)
                best = int(point), int(contact), float(width.max())
        return best


def _runs(start: int, chosen: np.ndarray) -> list[tuple[int, int]]:
    """First and last number of each run of true, numbered from `start`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]]))) + start
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))
