"""The map of verdicts, and of what each method solves."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

from attrito_verification.scene_grid.grid import VERDICTS, Grid
from attrito_verification.scene_grid.methods import METHODS, OUTCOME_CODES
from attrito_verification.scene_grid.scenes import ANGLES, BAND, FRICTIONS, PRELOADS, RATIOS, frequencies

COLOURS = ("#d9ead3", "#f6b26b", "#ffe599", "#6fa8dc", "#990000", "#434343")
WORDS = (
    "stable orbit",
    "unstable orbit",
    "orbit, stability indeterminate",
    "no orbit of period one (in time: longer or none)",
    "not converged (in time: period one, or still settling)",
    "no static solution",
)


def verdict_map(grid: Grid) -> Figure:
    """Verdicts of the wedge: frequency across, stiffness and angle up, friction and preload by panel."""
    figure = Figure(figsize=(13, 11), layout=ConstrainedLayoutEngine(rect=(0.0, 0.07, 1.0, 0.93)))
    axes = figure.subplots(len(FRICTIONS), len(PRELOADS), sharex=True, sharey=True)
    colours = ListedColormap(COLOURS)
    norm = BoundaryNorm(np.arange(len(VERDICTS) + 1) - 0.5, len(VERDICTS))
    rows = [(ratio, degrees) for ratio in RATIOS for degrees in ANGLES]
    at = {(f.ratio, f.degrees, f.friction, f.preload): i for i, f in enumerate(grid.families) if f.masses == 1}
    width = (BAND[1] - BAND[0]) / (len(frequencies()) - 1)
    extent = (BAND[0] - 0.5 * width, BAND[1] + 0.5 * width, -0.5, len(rows) - 0.5)
    for i, friction in enumerate(FRICTIONS):
        for j, preload in enumerate(PRELOADS):
            image = np.full((len(rows), len(frequencies())), np.nan)
            for k, (ratio, degrees) in enumerate(rows):
                family = at.get((ratio, degrees, friction, preload))
                if family is not None:
                    image[k] = grid.data["verdict"][family]
            panel = axes[i, j]
            panel.imshow(
                image, cmap=colours, norm=norm, extent=extent, origin="lower", aspect="auto", interpolation="none"
            )
            for line in range(len(ANGLES), len(rows), len(ANGLES)):
                panel.axhline(line - 0.5, color="black", linewidth=0.4)
            panel.set_yticks(1 + len(ANGLES) * np.arange(len(RATIOS)), [f"{ratio:g}" for ratio in RATIOS])
            if i == 0:
                panel.set_title(f"preload: {preload}")
            if j == 0:
                panel.set_ylabel(f"friction {friction:g}\nkn/k; in each 0, 45, 80 degrees")
            if i == len(FRICTIONS) - 1:
                panel.set_xlabel("Hz")
    patches = [Patch(color=colour, label=word) for colour, word in zip(COLOURS, WORDS, strict=True)]
    figure.legend(handles=patches, loc="lower center", ncols=3, frameon=False)
    return figure


def method_map(grid: Grid) -> Figure:
    """Part of the scenes that each method solves, by stiffness and preload, in per cent."""
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    axes = figure.subplots(1, len(PRELOADS), sharey=True)
    image = None
    for panel, preload in zip(axes, PRELOADS, strict=True):
        table = solved(grid, preload)
        image = panel.imshow(table, cmap="cividis", vmin=0.0, vmax=100.0, aspect="auto")
        for i, j in np.ndindex(*table.shape):
            if np.isfinite(table[i, j]):
                colour = "black" if table[i, j] > 50.0 else "white"
                panel.text(j, i, f"{table[i, j]:.0f}", ha="center", va="center", fontsize=8, color=colour)
        panel.set_xticks(range(len(RATIOS)), [f"$10^{{{np.log10(ratio):.0f}}}$" for ratio in RATIOS])
        panel.set_yticks(range(len(METHODS)), [method.replace("_", " ") for method in METHODS])
        panel.set_xlabel("kn/k")
        panel.set_title(f"preload: {preload}")
    figure.colorbar(image, ax=list(axes), label="Points solved, %", shrink=0.9)
    return figure


def solved(grid: Grid, preload: str | None = None) -> np.ndarray:
    """Per cent of points that each method solves, `[methods, ratios]`; NaN where none was tried."""
    table = np.full((len(METHODS), len(RATIOS)), np.nan)
    for j, ratio in enumerate(RATIOS):
        chosen = [i for i, f in enumerate(grid.families) if f.ratio == ratio and preload in (None, f.preload)]
        for i, method in enumerate(METHODS):
            outcome = grid.data[f"{method}_outcome"][chosen]
            if np.any(np.isfinite(outcome)):
                table[i, j] = 100.0 * np.mean(outcome[np.isfinite(outcome)] == OUTCOME_CODES["converged"])
    return table
