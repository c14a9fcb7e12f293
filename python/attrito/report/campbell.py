"""What a report says of a Campbell diagram: the picture, and critical speeds."""

from __future__ import annotations

from attrito.plots.campbell import campbell_diagram
from attrito.report import figures as report_figures
from attrito.report.page import Page
from attrito.results.result import Result


def campbell_glance(result: Result) -> list[tuple[str, bool]]:
    """What to know first, one sentence each, and whether it is a warning."""
    speeds, closed = result.array("/speeds/speed_hz"), result.array("/speeds/closed").sum(axis=1)
    lines = [(f"Tangent modes at {len(speeds)} speeds, {speeds.min():g} to {speeds.max():g} Hz.", False)]
    contacts = result.array("/speeds/closed").shape[1]
    lines.append((f"At the static solution {closed.min()} to {closed.max()} of {contacts} contacts are closed.", False))
    warned = [(f"{line[:1].upper()}{line[1:]}.", True) for line in result.attribute("warnings").splitlines()]
    return lines + warned


def campbell(page: Page, result: Result) -> None:
    """The picture, and a line a critical speed."""
    page.section("Campbell diagram")
    caption = "Natural frequencies in the frame that turns; dashed engine orders, circles where they meet a mode."
    page.figures([(campbell_diagram(result, report_figures.LOOK), caption)])
    page.subsection("Critical speeds")
    columns = {"engine order": "engine_order", "mode": "mode"}
    if result.has("/crossings/nodal_diameter"):
        columns |= {"nodal diameter": "nodal_diameter"}
    columns |= {"speed, Hz": "speed_hz", "frequency, Hz": "frequency_hz"}
    values = [result.array(f"/crossings/{name}") for name in columns.values()]
    page.table(list(columns), [[f"{value:.6g}" for value in row] for row in zip(*values, strict=True)])
