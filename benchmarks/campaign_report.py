"""What a campaign has found: shares by class, every failure, a line for a point."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np

# Errors below are not held against their estimate, nor those below so many uncertainties of the truth
LEAST_ERROR, UNCERTAINTIES = 1e-6, 3.0
# What counts as a gross error, in tolerances; an estimate is good if it is at least this part of the error
GROSS, LEAST_ESTIMATE = 3.0, 1.0 / 3.0
COLUMNS = (
    *("failure", "seed", "scene", "frequency_hz", "structure", "ratio", "lifted", "tuned", "error", "estimate"),
    *("harmonics", "samples", "states", "truth", "reason"),
)
UNSOLVED = ("above_tolerance", "not_converged", "no_period_one_orbit")


def summary(rows: list[dict], tolerance: float) -> dict:
    """Shares, by class and of all."""
    points = [row for row in rows if row["kind"] == "point"]
    classes = sorted({name for row in points for name in row["classes"]}, key=lambda name: (name != "all", name))
    ended = Counter(row["kind"] for row in rows)
    times: dict[int, float] = {}
    for row in points:
        times[row["scene"]] = times.get(row["scene"], 0.0) + row["solve_seconds"]
    return {
        "scenes": ended["scene"],
        "skipped": ended["skipped"],
        "without a static solution": ended["unsolved"],
        "median time of a sweep": float(np.median(list(times.values()))) if times else None,
        "classes": {name: shares([row for row in points if name in row["classes"]], tolerance) for name in classes},
    }


def shares(points: list[dict], tolerance: float) -> dict:
    """Of the points of a class."""
    converged = [row for row in points if row["outcome"] == "converged"]
    judged = [row for row in converged if row["error"] is not None]
    errors = np.array([row["error"] for row in judged])
    checked = [row for row in judged if can_hold(row)]
    ratios = np.array([estimate_over_error(row) for row in checked])
    large = np.array([row["error"] >= 0.1 * tolerance for row in checked], dtype=bool)
    outcomes = Counter(row["outcome"] for row in points)
    return {
        "points": len(points),
        "converged": len(converged),
        "truths": dict(Counter(row["truth"]["how"] for row in judged)),
        "unstable": sum((row["truth"]["multiplier"] or 0.0) > 1.0 for row in judged),
        "no truth": len(converged) - len(judged),
        "within the tolerance, %": share(errors <= tolerance),
        "beyond it": int((errors > tolerance).sum()),
        "beyond three times": int((errors > GROSS * tolerance).sum()),
        "largest error": float(errors.max(initial=0.0)),
        "estimates to check": len(checked),
        "estimate at least a third of the error, %": share(ratios >= LEAST_ESTIMATE),
        "the same, errors of a tenth of the tolerance and more, %": share(ratios[large] >= LEAST_ESTIMATE),
        **{f"{name}, %": 100.0 * outcomes[name] / max(len(points), 1) for name in UNSOLVED},
    }


def share(holds: np.ndarray) -> float | None:
    """Per cent of those that hold."""
    return 100.0 * float(np.mean(holds)) if len(holds) else None


def can_hold(row: dict) -> bool:
    """Whether the error is known well enough for its estimate to be held against it."""
    return row["error"] > max(LEAST_ERROR, UNCERTAINTIES * row["truth"]["uncertainty"])


def estimate_over_error(row: dict) -> float:
    """Of a point with a truth; an estimate that is not known is none."""
    return row["estimate"] / row["error"] if row["estimate"] == row["estimate"] else float("inf")


def why_failed(row: dict, tolerance: float) -> str:
    """In a word, or nothing."""
    if row["kind"] != "point" or row["outcome"] != "converged":
        return ""
    if row["error"] is None:
        return "no truth"
    if row["error"] > tolerance:
        return "gross error" if row["error"] > GROSS * tolerance else "error"
    return "estimate" if can_hold(row) and estimate_over_error(row) < LEAST_ESTIMATE else ""


def write_failures(path: Path, rows: list[dict], tolerance: float) -> None:
    """CSV: every point that fails, and every scene that was skipped."""
    scenes = {(row["seed"], row["scene"]): row for row in rows if row["kind"] == "scene"}
    with path.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for row in rows:
            failure = row["kind"] if row["kind"] in ("skipped", "unsolved") else why_failed(row, tolerance)
            if not failure:
                continue
            scene = scenes.get((row["seed"], row["scene"]), {})
            tuned = f"{scene.get('tuned')} {scene.get('tuned_state')}" if scene.get("tuned") else ""
            about = [scene.get("structure"), f"{scene.get('ratio', 0.0):.1e}", scene.get("lifted"), tuned]
            if row["kind"] != "point":
                table.writerow([failure, row["seed"], row["scene"], "", *about, *[""] * 6, row["reason"]])
                continue
            error = "" if row["error"] is None else f"{row['error']:.2e}"
            truth = "" if row["truth"] is None else row["truth"]["how"]
            states = "/".join(map(str, row["states"]))
            table.writerow([failure, row["seed"], row["scene"], f"{row['frequency_hz']:.6g}", *about, error,
                            f"{row['estimate']:.1e}", row["harmonics"], row["samples"], states, truth,
                            "; ".join(row["failures"])])  # fmt: skip


def line_of(row: dict) -> str:
    """A scene or point in words."""
    if row["kind"] == "scene":
        tuned = f", a mode at {row['tuned']} times the excitation, {row['tuned_state']}" if row["tuned"] else ""
        lifted = f", {row['lifted']}" if row["lifted"] else ""
        return (
            f"scene {row['scene']} of seed {row['seed']}: {row['structure']}, contacts {row['ratio']:.2g} times as"
            f" stiff{lifted}{tuned}, damping {row['damping']}, loads up to harmonic {row['loads']}"
        )
    if row["kind"] != "point":
        return f"scene {row['scene']}: {row['kind']}: {row['reason']}"
    states = "/".join(map(str, row["states"]))
    text = (f"  {row['frequency_hz']:.6g} Hz: {row['outcome']}, estimate {row['estimate']:.1e}, H {row['harmonics']},"
            f" samples {row['samples']}, contacts {states}")  # fmt: skip
    if row["outcome"] != "converged":
        return text
    found = [row["truth"], *row["others"]] if row["truth"] else []
    for truth in found:
        error = row["amplitude"] / truth["amplitude"] - 1.0
        multiplier = f", multiplier {truth['multiplier']:.4f}" if truth["multiplier"] is not None else ""
        text += (f"\n      {truth['how']}: error {error:+.2e} (known to {truth['uncertainty']:.0e}), sliders moved"
                 f" {truth['shift']:.0e}{multiplier}")  # fmt: skip
    return "\n      ".join([text, *row["failures"]])
