"""How far to trust a result, in sentences: solved, error, stability, uniqueness, reduction, warnings."""

from __future__ import annotations

from collections import Counter

import numpy as np

from attrito.library.names import NO_SOLUTION
from attrito.report.view import View
from attrito.results.mesh import reduction_errors

# An estimated error beyond this is reported as a warning.
LARGE_ERROR = 0.05
# Amplitudes that differ by less than this part of them are the same.
NO_WIDTH = 1e-9
# Natural frequencies up to this many times the highest frequency matter to a sweep, and the first at any rate.
NEAR = 1.5


def glance(view: View) -> list[tuple[str, bool]]:
    """The sentences of `trust` without what they are about."""
    return [(words, warn) for _, words, warn in trust(view)]


def trust(view: View) -> list[tuple[str, str, bool]]:
    """What to know first: of each sentence what it is about, the sentence, and whether it is a warning."""
    count = view.result.points
    if count == 0:
        return [("Solved", "No point was solved.", True)]
    levels = len(view.peaks)
    span = f"{view.frequency.min():.6g} to {view.frequency.max():.6g} Hz"
    solved = [(f"{count} points, {levels} level{'s' * (levels > 1)}, {span}.", False), _solutions(view)]
    if incomplete := view.result.attributes("/points").get("incomplete", ""):
        solved.append((incomplete, True))
    warned = [(f"{line[:1].upper()}{line[1:]}.", True) for line in view.result.attribute("warnings").splitlines()]
    uncoupled = "Uncoupled: the mean is that of the static solution; no estimate includes what this leaves out."
    parts = {
        "Solved": solved,
        "Error": _errors(view) + ([(uncoupled, True)] if view.approach() == "uncoupled" else []),
        "Stability": [*_verdicts(view), *_bifurcations(view)],
        "Uniqueness": _families(view),
        "Reduction": _reduction(view),
        "Warnings": warned,
    }
    return [(about, words, warn) for about, lines in parts.items() for words, warn in lines]


def _errors(view: View) -> list[tuple[str, bool]]:
    """Where the tolerance is not kept, the largest estimate, and of how many points there is none."""
    above = _with_outcome(view, "above_tolerance")
    lines = []
    if above.any():
        words = f"{_points(above)} above the tolerance, or of unknown error: {view.ranges(above)}."
        lines.append((words, True))
    estimate = np.where(view.solved, view.result.array("/points/estimate"), np.nan)
    known = np.isfinite(estimate)
    if not known.any():
        return lines
    worst = int(np.nanargmax(estimate))
    words = f"Estimated error of the amplitude: at most {estimate[worst]:.1e} of it ({view.place(worst)})."
    lines.append((words, bool(estimate[worst] > LARGE_ERROR)))
    unknown = view.solved & ~known
    if unknown.any():
        lines.append((f"{_points(unknown)} without an estimated error: {view.ranges(unknown)}.", True))
    return lines


def _reduction(view: View) -> list[tuple[str, bool]]:
    """What the reduced model leaves out: of the amplitudes, and of natural frequencies near what was swept."""
    lines = []
    if view.result.has("/points/error_modes"):
        parts = np.where(view.solved, view.result.array("/points/error_modes"), np.nan)
        if (left_out := np.nanmax(parts, initial=0.0)) > 0.0:
            lines.append((f"Error of the amplitude by modes that are left out: at most {left_out:.1e} of it.", False))
    found = reduction_errors(view.result)
    if found is not None:
        hertz, errors = found
        near = hertz <= max(NEAR * view.frequency.max(), hertz.min())
        worst = float(errors[near].max())
        words = (
            f"Natural frequencies of the reduced model without contacts, up to {hertz[near].max():.5g} Hz, are too high"
        )
        lines.append((f"{words} by at most {worst:.1e} of them, as estimated.", worst > LARGE_ERROR))
    return lines


def _solutions(view: View) -> tuple[str, bool]:
    missing = int((~view.solved).sum())
    if not missing:
        return "Every point has a solution.", False
    outcomes = Counter(view.result.outcome)
    names = ", ".join(f"{outcomes[name]} {name}" for name in NO_SOLUTION if outcomes[name])
    return f"{missing} points have no solution: {names}.", True


def _verdicts(view: View) -> list[tuple[str, bool]]:
    """A point is indeterminate for a reason that its examination gives, or, not examined, since its sliders drift."""
    stable, indeterminate = view.result.array("/points/stable"), _with_outcome(view, "indeterminate")
    reasoned = np.zeros(len(stable), dtype=bool)
    if view.result.has("/stability/reason"):
        reasoned = np.array([len(reason) > 0 for reason in view.result.array("/stability/reason")], dtype=bool)
    undecided, drifting = indeterminate & reasoned, indeterminate & ~reasoned
    lines = []
    if not ((stable >= 0) | undecided).any():
        lines.append(("Stability was not examined ([stability] method).", False))
    else:
        where = view.ranges((stable == 0) & view.solved)
        verdict = f"Unstable: {where}." if where else "No point that was examined is unstable."
        lines.append((f"{(stable == 1).sum()} points are stable. {verdict}", bool(where)))
    if undecided.any():
        lines.append((f"{undecided.sum()} points have no verdict on their stability.", True))
    if drifting.any():
        words = f"{_points(drifting)} indeterminate: sliders still move from period to period."
        lines.append((words, True))
    return lines


def _with_outcome(view: View, outcome: str) -> np.ndarray:
    """bool [np], points of an outcome."""
    return np.array([name == outcome for name in view.result.outcome], dtype=bool)


def _points(chosen: np.ndarray) -> str:
    """`1 point is`, `2 points are`."""
    count = int(chosen.sum())
    return f"{count} point is" if count == 1 else f"{count} points are"


def _bifurcations(view: View) -> list[tuple[str, bool]]:
    if not view.result.has("/bifurcations/kind"):
        return []
    names = view.result.names("/bifurcations/kind")
    counts = Counter(names[kind].replace("_", " ") for kind in view.result.array("/bifurcations/kind"))
    words = ", ".join(f"{count} {name}" for name, count in counts.items())
    return [(f"Located along sweeps: {words}.", False)] if counts else []


def _families(view: View) -> list[tuple[str, bool]]:
    unique = view.result.array("/points/unique")
    if not (unique == 0).any():
        return [("Every point examined is unique.", False)] if (unique == 1).any() else []
    where, count = view.ranges(unique == 0), int((unique == 0).sum())
    words = f"mean contact forces are not unique at {count} of {view.result.points} points, each one of a family"
    words += f" of solutions ({where})"
    reach = _reach(view)
    # What matters of it goes first, where it is known.
    parts = (reach, words) if np.isfinite(view.amplitude_widths()).any() else (words, reach)
    line = "; ".join(parts)
    return [(f"{line[:1].upper()}{line[1:]}.", False)]


def _reach(view: View) -> str:
    """How far the families' amplitudes reach, as far as that was examined."""
    widths = view.amplitude_widths()
    unknown = int(((view.result.array("/points/unique") == 0) & ~np.isfinite(widths)).sum())
    if not np.isfinite(widths).any():
        return "what that changes in the amplitude was not examined"
    widest = widths[np.isfinite(widths)].max()
    # Only members that are visited differ in amplitude; others may differ more.
    if widest > NO_WIDTH:
        reach = f"amplitudes of the members that were visited differ by at most {100 * widest:.2g} %"
    else:
        reach = "the amplitude is that of all members that were visited"
    return f"{reach}, {unknown} points not examined" if unknown else reach
