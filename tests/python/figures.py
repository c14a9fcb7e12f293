"""What was drawn: the figures that are written while a test looks on, and what is in them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

# Pixels of a colour in a picture of a curve: more than those of a mark in a legend.
LEAST_PIXELS = 500


@contextlib.contextmanager
def written_figures() -> Iterator[list[Figure]]:
    """Figures that this process writes, in their order."""
    written: list[Figure] = []
    write = Figure.savefig

    def remember(figure: Figure, *arguments: object, **options: object) -> None:
        write(figure, *arguments, **options)
        written.append(figure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", remember)
        yield written


def line(axes: Axes, label: str) -> Line2D:
    """The one line of axes with a label."""
    (found,) = [one for one in axes.get_lines() if one.get_label() == label]
    return found


def marks(axes: Axes, marker: str | None = None) -> np.ndarray:
    """Places of all points of lines, `[n, 2]`, of one marker if that is given."""
    chosen = [one for one in axes.get_lines() if marker in (None, one.get_marker())]
    return np.concatenate([np.empty((0, 2)), *(one.get_xydata() for one in chosen)])


def pixels(path: Path, colour: object) -> int:
    """Pixels of a PNG that have a colour."""
    return int(np.all(np.abs(image.imread(path)[..., :3] - to_rgb(colour)) < 0.02, axis=-1).sum())
