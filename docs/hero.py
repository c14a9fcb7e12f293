"""The picture of README.md, out of what `script/demo` leaves: .venv/bin/python docs/hero.py"""

from __future__ import annotations

from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from attrito.plots.contact_maps import draw_surface, finish_map
from attrito.plots.response import Drawing, responses
from attrito.plots.style import Look, save
from attrito.report.motion import moving
from attrito.report.view import View
from attrito.results.result import Result

DOCS = Path(__file__).resolve().parent


def hero(result: Result) -> Figure:
    """The blade's motion at its highest peak, the response of its tip, and where its contacts slip at that peak."""
    view = View(result)
    with matplotlib.rc_context(Look().style()):
        figure = Figure(figsize=(9.4, 4.8), constrained_layout=True)
        body, right = figure.subfigures(1, 2, width_ratios=(3.0, 6.4))
        curve, flanks = right.subfigures(2, 1, height_ratios=(3.3, 1.5))
        moving(view).still(Look(on=body))
        responses([result], "tip", Look(width=1.0, on=curve), Drawing(references=("stuck", "frictionless")))
        maps = flanks.subplots(1, 2)
        for axes, surface, side in zip(maps, view.surfaces, ("left", "right"), strict=True):
            draw_surface(axes, result, view.point, surface, "slip")
            axes.set_title(f"{side} flank of the root")
            axes.set_axis_off()
        finish_map(flanks, maps, result, view.point, "slip")
    return figure


if __name__ == "__main__":
    with Result(DOCS.parent / "out" / "blade" / "result.h5") as result:
        save(hero(result), DOCS / "pictures" / "hero.png", dpi=150)
