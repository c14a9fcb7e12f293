"""Labels beside the marks of a chart: each at the first place next to its mark where it meets no other and no mark.

A label that finds no such place takes the one where it covers least. Lines behind labels are hidden by them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

# Offset in points from the mark's rim, and which side of the text is there: from the best place to the worst
PLACES = (
    ((4, 0), "left", "center"),
    ((-4, 0), "right", "center"),
    ((2, 3), "left", "bottom"),
    ((2, -3), "left", "top"),
    ((-2, 3), "right", "bottom"),
    ((-2, -3), "right", "top"),
    ((2, 15), "left", "bottom"),
    ((2, -15), "left", "top"),
)


def label_marks(
    figure: Figure, axes: Axes, marks: Sequence[tuple[float, float]], sizes: Sequence[float], texts: Sequence[str]
) -> list[Annotation]:
    """Write each mark's text next to it; to be called when axes have their final scales, limits and place.

    Parameters
    ----------
    figure, axes : which is drawn, and the panel in it
    marks, sizes, texts : places of the marks in data, their diameters in points, and what is written beside each
    """
    pixels = figure.dpi / 72.0
    taken = []
    for (x, y), size in zip(axes.transData.transform(marks), sizes, strict=True):
        reach = 0.5 * size * pixels
        taken.append(Bbox.from_extents(x - reach, y - reach, x + reach, y + reach))
    inside = axes.get_window_extent()
    written = []
    for mark, size, text in zip(marks, sizes, texts, strict=True):
        label = axes.annotate(text, mark, textcoords="offset points", xytext=(0, 0), fontsize=8)
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.5})
        # The panel is not to make way for it.
        label.set_in_layout(False)
        covered = []
        for place in PLACES:
            covered.append(_covered(_put(label, place, size), taken, inside))
            if covered[-1] <= 0.0:
                break
        taken.append(_put(label, PLACES[int(np.argmin(covered))], size))
        written.append(label)
    return written


def _put(label: Annotation, place: tuple[tuple[int, int], str, str], size: float) -> Bbox:
    """The label's extent at a place next to a mark of a diameter."""
    offset, horizontal, vertical = place
    from_centre = np.array(offset) + 0.5 * size * np.sign(offset)
    label.set(position=tuple(from_centre), horizontalalignment=horizontal, verticalalignment=vertical)
    return Bbox(label.get_window_extent())


def _covered(extent: Bbox, taken: list[Bbox], inside: Bbox) -> float:
    """Area of an extent that others have, or that is outside of the panel."""
    common = [Bbox.intersection(extent, other) for other in taken]
    area = sum(box.width * box.height for box in common if box is not None)
    own = Bbox.intersection(extent, inside)
    return float(area + extent.width * extent.height - (0.0 if own is None else own.width * own.height))
