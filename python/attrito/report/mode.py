"""What a report says of a nonlinear mode: its curves, its points, its contacts at one of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from attrito.plots.contact_maps import contact_map
from attrito.plots.modes import mode_curve
from attrito.report import figures as report_figures
from attrito.report.motion import animation, moving
from attrito.report.page import Animation, Page
from attrito.report.view import View

METHODS = {
    "epmc": "periodic motion without excitation (extended periodic motion concept)",
    "quasi_static": "cycles of quasi-static loading by the tangent mode's inertia forces",
}

ERRORS = {
    "epmc": "of frequency, negative damping or monitors, by harmonics and samples",
    "quasi_static": "of the contacts' work, from the steps of a cycle",
}

LIMIT_CYCLES = {
    "attracts": "motion from smaller amplitudes grows to it, from larger ones it decays to it",
    "repels": "motion of larger amplitudes grows without end",
}


def mode_glance(view: View) -> list[tuple[str, bool]]:
    """What to know first of a mode, one sentence each, and whether it is a warning."""
    result, solved = view.result, np.flatnonzero(view.solved)
    warned = [(f"{line[:1].upper()}{line[1:]}.", True) for line in result.attribute("warnings").splitlines()]
    if len(solved) == 0:
        return [("No point was solved.", True), *warned]
    amplitude, damping = result.array("/points/amplitude"), result.array("/points/damping_ratio")
    frequency, tangent = view.frequency[solved], result.attribute("tangent_hz")
    # A mode that is not finished has them in its job alone.
    asked = view.job().get("mode") or {}
    kind = result.attribute("method") or str(asked.get("method", "epmc"))
    number = result.attribute("mode") or asked.get("number") or f"near {asked.get('near_hz')} Hz"
    largest = int(solved[np.nanargmax(damping[solved])])
    lines = [
        (f"Tangent mode {number}, followed by {METHODS[kind]}.", False),
        (
            f"{len(solved)} points, Q from {amplitude[solved].min():.4g} to {amplitude[solved].max():.4g}:"
            f" {frequency.min():.6g} to {frequency.max():.6g} Hz"
            + (f", tangent {float(tangent):.6g} Hz." if tangent else "."),
            False,
        ),
        (f"Contacts damp most at Q = {amplitude[largest]:.4g}: damping ratio {damping[largest]:.3e}.", False),
    ]
    lines += [(sentence, False) for sentence in _limit_cycles(view)]
    if missing := int((~view.solved).sum()):
        lines.append((f"The mode was lost: {missing} amplitude without a solution.", True))
    if open_cycles := result.outcome.count("indeterminate"):
        lines.append(
            (f"{open_cycles} points are indeterminate: sliders still move from period to period{_drift(view)}.", True)
        )
    estimate = result.array("/points/estimate")[solved]
    if np.isfinite(estimate).any():
        worst = float(np.nanmax(estimate))
        lines.append((f"Estimated error {ERRORS[kind]}: at most {worst:.1e}.", False))
    if unknown := int(np.isnan(estimate).sum()):
        lines.append((f"At {unknown} points the error is not known.", True))
    return lines + warned


def _drift(view: View) -> str:
    """By how much sliders of a mode by periodic motion drift at most, in words; of another nothing."""
    if not view.result.has("/points/drift"):
        return ""
    return f", by at most {np.nanmax(view.result.array('/points/drift')):.2e} a period"


def _limit_cycles(view: View) -> Iterator[str]:
    """A sentence for each limit cycle of a mode that its structure's damping feeds."""
    result = view.result
    if not result.has("/points/limit_cycle"):
        return
    for i, name in enumerate(result.named("/points/limit_cycle")):
        if view.solved[i] and name in LIMIT_CYCLES:
            amplitude, frequency = result.array("/points/amplitude")[i], view.frequency[i]
            yield f"Limit cycle at Q = {amplitude:.4g}, {frequency:.6g} Hz (point {i}): {LIMIT_CYCLES[name]}."


def mode(page: Page, view: View) -> None:
    """The curves, a table of all points, and what contacts do at the point that is shown."""
    result = view.result
    page.section("Nonlinear mode")
    words = "Frequency and damping ratios against the amplitude Q. Dashed: the tangent mode."
    drawn: list[tuple[Figure | Animation, str]] = [(mode_curve(result, report_figures.LOOK), words)]
    if (found := moving(view)) is not None:
        drawn.append(animation(found, view.place(view.point)))
    page.figures(drawn)
    page.subsection("Points")
    names = ("amplitude", "frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy", "estimate")
    columns = [result.array(f"/points/{name}") for name in names]
    rows = [
        [str(i), *("-" if column[i] != column[i] else f"{column[i]:.6g}" for column in columns), result.outcome[i]]
        for i in range(result.points)
    ]
    header = ["point", "amplitude Q", "Hz", "damping ratio, contacts", "structure", "work a period", "estimated error"]
    page.table([*header, "outcome"], rows)
    if view.point is None or not view.surfaces:
        return
    page.subsection(f"Contacts at point {view.point}, Q = {result.array('/points/amplitude')[view.point]:.4g}")
    captions = {"state": "What each contact does over the period.", "energy": "What each contact dissipates a period."}
    page.figures(
        [
            (contact_map(result, view.point, kind, report_figures.LOOK, titled=False, panels=view.surfaces), words)
            for kind, words in captions.items()
        ]
    )
