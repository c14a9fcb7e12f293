"""`attrito verify paper`: figures of Zucca & Firrone 2014 as data and picture, numbers of its text beside ours."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from attrito.plots.style import save
from attrito.support.errors import NumericsError
from attrito_verification.paper import claims, schemes, statements
from attrito_verification.paper.figures import paper_figures, write_csv
from attrito_verification.paper.pictures import picture
from attrito_verification.paper.study import Study
from attrito_verification.paper.wedge import PARAMETER_SETS

# The set that figures and claims are made with.
REFERENCE = "unrounded"
PAPER_HARMONICS = 5


def verify_paper(
    folder: str | os.PathLike[str],
    harmonics: int = PAPER_HARMONICS,
    quick: bool = False,
    say: Callable[[str], None] = print,
) -> str:
    """Reproduce the paper into a folder; returns the report's path.

    Parameters
    ----------
    folder : gets `figure_<n>.csv` and `.png`, `numbers.csv` and `report.md`
    harmonics : of both approaches; the paper has 5
    quick : coarse curves, and without what needs many harmonics
    say : receives a line for each step

    Raises
    ------
    NumericsError : a claim does not hold, though harmonics are as many as the paper's; everything is written before
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    studies = {name: Study(parameters, harmonics) for name, parameters in PARAMETER_SETS.items()}
    for number, make in paper_figures(studies[REFERENCE], quick).items():
        started = time.perf_counter()
        columns = make()
        write_csv(place / f"figure_{number}.csv", columns)
        save(picture(number, columns), place / f"figure_{number}.png")
        say(f"figure {number:>2}: {place / f'figure_{number}.png'} ({time.perf_counter() - started:.1f} s)")
    orders = schemes.measure(studies[REFERENCE].parameters)
    save(schemes.picture(orders), place / "schemes.png")
    say(f"   schemes: {place / 'schemes.png'}")
    names, ours = list(studies), statements.values(list(studies.values()))
    measured = claims.measure(studies[REFERENCE], quick)
    (place / "numbers.csv").write_text(statements.csv(names, ours))
    report = place / "report.md"
    report.write_text(
        f"# Zucca & Firrone 2014 (doi:10.1016/j.jsv.2013.09.032), {harmonics} harmonics\n\n"
        f"## Numbers of the text\n\n{statements.markdown(names, ours)}\n"
        f"## What must show (parameters: {REFERENCE})\n\n{claims.markdown(measured)}\n"
        f"## Schemes of time integration\n\n{schemes.table(orders)}"
    )
    agreed = [
        sum(s.agrees(row[i]) for s, row in zip(statements.STATEMENTS, ours, strict=True)) for i in range(len(names))
    ]
    for name, count in zip(names, agreed, strict=True):
        say(f"{name}: {count} of {len(ours)} numbers of the text to their printed digits")
    failed = [f"{claim.what}: {value:.5g}" for claim, value in measured if not claims.holds(claim, value)]
    say(f"{len(measured) - len(failed)} of {len(measured)} claims hold: {report}")
    if failed and harmonics >= PAPER_HARMONICS:
        raise NumericsError(f"{report}: " + "; ".join(failed))
    return str(report)
