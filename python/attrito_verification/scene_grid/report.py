"""The report of the torture grid: counts, what each method solves, verdicts and what bears them out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from attrito_verification.scene_grid.grid import EXPLANATIONS, NEAR, VERDICTS, Grid
from attrito_verification.scene_grid.methods import METHODS, OUTCOME_CODES
from attrito_verification.scene_grid.pictures import solved
from attrito_verification.scene_grid.scenes import RATIOS

# Difference of the uncoupled amplitude from the coupled one beyond which it counts as another.
OTHER = 0.05
WRONG_LISTED = 40


def markdown(grid: Grid) -> str:
    """The whole report."""
    return "\n".join(
        [
            f"# {grid.scenes} scenes, {len(grid.families)} families\n",
            *_counts(grid),
            *_solved(grid),
            *_uncoupled(grid),
            *_verdicts(grid),
        ]
    )


def figures(grid: Grid) -> dict[str, float]:
    """The numbers that are asked for."""
    data = grid.data
    iterations, tried = data["coupled_iterations"], np.isfinite(data["coupled_outcome"])
    checked = data["right"] >= 0
    unexplained = data["explanation"] == EXPLANATIONS.index("unexplained")
    solved_points = data["coupled_outcome"] == OUTCOME_CODES["converged"]
    return {
        "scenes": float(grid.scenes),
        "median_iterations": float(np.median(iterations[tried])) if tried.any() else np.nan,
        "median_iterations_solved": float(np.median(iterations[solved_points])) if solved_points.any() else np.nan,
        "verdicts_checked": float(checked.sum()),
        "verdicts_right": float((data["right"] == 1).sum()),
        "verdicts_right_percent": 100.0 * float((data["right"] == 1).sum()) / max(1, int(checked.sum())),
        "verdicts_unexplained": float(unexplained.sum()),
        "seconds_verdicts": float(np.nansum(data["seconds_verdict"])),
        "seconds_check": float(np.nansum(data["seconds_check"])),
        "seconds_methods": float(np.nansum(data["seconds_methods"])),
    }


def _counts(grid: Grid) -> list[str]:
    numbers = figures(grid)
    ratios = [f"{ratio:g}" for ratio in RATIOS]
    lines = [
        f"Processor time: {numbers['seconds_verdicts']:.0f} s for solutions and verdicts, with motion in time where"
        f" there are none, {numbers['seconds_check']:.0f} s to hold verdicts against motion in time,"
        f" {numbers['seconds_methods']:.0f} s for the other methods. Newton iterations, median over all scenes:"
        f" {numbers['median_iterations']:g}; over those solved: {numbers['median_iterations_solved']:g}.\n",
        "## Verdicts by contact stiffness\n",
        *_table(
            ["verdict", *ratios, "all"],
            (
                [name, *(str(_count(grid, name, ratio)) for ratio in RATIOS), str(int(grid.verdict(name).sum()))]
                for name in VERDICTS
            ),
        ),
    ]
    period = grid.data["time_period"][grid.verdict("no_period_one_orbit") | grid.verdict("unstable")]
    counts = {int(k): int((period == k).sum()) for k in np.unique(period[np.isfinite(period)])}
    text = ", ".join(f"{'none' if k == 0 else k}: {n}" for k, n in counts.items())
    return [*lines, f"Periods in time where no orbit of period one is stable or found: {text or 'no such scene'}.\n"]


def _count(grid: Grid, verdict: str, ratio: float) -> int:
    chosen = [i for i, family in enumerate(grid.families) if family.ratio == ratio]
    return int(grid.verdict(verdict)[chosen].sum())


def _solved(grid: Grid) -> list[str]:
    table = solved(grid)
    rows = (
        [method, *("" if np.isnan(value) else f"{value:.1f}" for value in row), _iterations(grid, method)]
        for method, row in zip(METHODS, table, strict=True)
    )
    head = ["method", *(f"{ratio:g}" for ratio in RATIOS), "median iterations"]
    return ["## Points that each method solves by itself, %\n", *_table(head, rows)]


def _iterations(grid: Grid, method: str) -> str:
    values = grid.data[f"{method}_iterations"]
    return f"{np.nanmedian(values):g}" if np.isfinite(values).any() else ""


def _uncoupled(grid: Grid) -> list[str]:
    ours, theirs = grid.data["coupled_amplitude"], grid.data["uncoupled_amplitude"]
    both = np.isfinite(ours) & np.isfinite(theirs)
    other = both & (np.abs(theirs - ours) > OTHER * np.abs(ours))
    rows = []
    for preload in dict.fromkeys(family.preload for family in grid.families):
        chosen = [i for i, family in enumerate(grid.families) if family.preload == preload]
        count = int(both[chosen].sum())
        far = np.abs(theirs / ours - 1.0)[chosen][both[chosen]]
        worst = f"{100 * far.max():.0f}" if count else ""
        rows.append([preload, str(count), str(int(other[chosen].sum())), worst])
    head = [
        "preload",
        "points of both",
        f"amplitudes that differ by more than {100 * OTHER:g} %",
        "largest difference, %",
    ]
    return ["## The uncoupled approach beside the coupled one\n", *_table(head, rows)]


def _verdicts(grid: Grid) -> list[str]:
    numbers = figures(grid)
    data = grid.data
    lines = [
        "## What bears verdicts out\n",
        f"The balance's motion, pushed by 1e-6 and integrated event by event, stays within {NEAR:g} of it (stable) or"
        f" does not (unstable) in {numbers['verdicts_right']:.0f} of {numbers['verdicts_checked']:.0f} scenes,"
        f" {numbers['verdicts_right_percent']:.2f} %.\n",
    ]
    wrong = np.argwhere(data["right"] == 0)
    counts = {name: int((data["explanation"] == i).sum()) for i, name in enumerate(EXPLANATIONS) if i}
    lines.append(
        "Those that do not, by cause: " + ", ".join(f"{name} {count}" for name, count in counts.items()) + ".\n"
    )
    rows = (
        [
            grid.families[i].name,
            f"{data['frequency_hz'][i, k]:.4f}",
            VERDICTS[int(data["verdict"][i, k])],
            f"{data['largest_multiplier'][i, k]:.4f}",
            f"{data['estimate'][i, k]:.1e}",
            f"{data['orbit_distance'][i, k]:.1e}",
            f"{data['time_period'][i, k]:.0f}",
            f"{data['time_distance'][i, k]:.1e}",
            EXPLANATIONS[int(data["explanation"][i, k])],
        ]
        for i, k in wrong[:WRONG_LISTED]
    )
    head = ["scene", "Hz", "verdict", "largest multiplier", "truncation", "exact orbit", "period", "distance", "cause"]
    return [*lines, *(_table(head, rows) if len(wrong) else [])]


def _table(head: list[str], rows: Iterable[list[str]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows), ""]
