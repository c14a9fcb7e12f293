"""The motion of the structure's outer surface at a point: a still, and what the page's script draws it from.

The mean is left out, since a scale that shows the vibration would distort the structure by it. Places and coefficients
are whole numbers of 16 bits times a step, so that some thousand vertices take a few hundred kilobytes.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from attrito.export.export import Motion, full_field, motion_of, node_harmonics
from attrito.export.wheel import wheel_of
from attrito.model.model import Model
from attrito.model.outer_surface import outer_surface
from attrito.plots.solid import DIRECTION, axes_of_view, seen_faces
from attrito.plots.style import Look, with_unit
from attrito.report.figures import LOOK
from attrito.report.page import Animation
from attrito.report.view import View
from attrito.support.errors import InputError
from attrito.support.hdf5_reading import UNREADABLE

# Vertices that are drawn, and at least of each sector of a wheel
VERTICES, OF_A_SECTOR = 3000, 320
# Harmonics that are drawn at most, and the part of the largest coefficient below which one is left out
HARMONICS, UNSEEN = 5, 0.01
# Part of the faces whose motion must be known, where the reduction recovers that of some nodes alone
LEAST_KNOWN = 0.5
# Largest displacement that is drawn, part of the structure's extent
LARGEST = 0.08
# Bytes of a recovery basis that a report still reads
MOST_BASIS = 2_000_000_000
# Least and largest height of the view beside its width
SHAPES = 0.45, 0.9
STEPS = 32000
COLOURS = 64


@dataclass(frozen=True)
class Moving:
    """A surface and its motion.

    Parameters
    ----------
    points : `[V, 3]`, user length
    faces : `[F, 4]`, outward; a triangle's last corner is -1
    motion : of the vertices, without mean
    unit : of the displacement
    """

    points: np.ndarray
    faces: np.ndarray
    motion: Motion
    unit: str

    @property
    def scale(self) -> float:
        """Factor on displacements that are drawn."""
        largest = float(self.motion.amplitude.max())
        return LARGEST * float(np.linalg.norm(np.ptp(self.points, axis=0))) / largest if largest > 0 else 0.0

    def still(self, look: Look = LOOK) -> Figure:
        """The surface at the instant of the largest motion, coloured by the amplitude of each place."""
        moved = self.points + self.scale * self.motion.shape_at(self.motion.phase)
        amplitude = self.motion.amplitude
        seen = seen_faces(moved, self.faces)
        colours = ScalarMappable(Normalize(0.0, amplitude.max() or 1.0), "viridis")
        with matplotlib.rc_context(look.style()):
            figure = look.figure((5.1, 5.1 * self.shape))
            axes = figure.subplots()
            mean = np.array([amplitude[corners].mean() for corners in seen.corners])
            outlines = PolyCollection(
                seen.polygons, facecolors=colours.to_rgba(mean), edgecolors="#1e2832", linewidths=0.15
            )
            axes.add_collection(outlines)
            axes.autoscale()
            axes.set_aspect("equal")
            axes.set_axis_off()
            figure.colorbar(colours, ax=axes, label=with_unit("Amplitude", self.unit), shrink=0.8, pad=0.02)
        return figure

    @property
    def shape(self) -> float:
        """Height of the view beside its width, so that it can be turned about the vertical."""
        places = self.points - 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        up = np.abs(places @ axes_of_view(DIRECTION)[1]).max()
        return float(np.clip(up / np.linalg.norm(places, axis=1).max(), *SHAPES))

    def numbers(self) -> str:
        """What `viewer.js` reads, as JSON."""
        middle = 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        places = self.points - middle
        radius = float(np.linalg.norm(places, axis=1).max())
        kept = drawn_harmonics(self.motion.harmonics)
        series = [self.motion.harmonics[row] for h in kept for row in (2 * h - 1, 2 * h)]
        largest = max((float(np.abs(one).max()) for one in series), default=0.0) or 1.0
        towards = DIRECTION / np.linalg.norm(DIRECTION)
        amplitude = self.motion.amplitude
        part = amplitude / amplitude.max() if amplitude.any() else amplitude
        given: dict[str, Any] = {
            "places": _packed(places * (STEPS / radius), np.int16),
            "place_step": radius / STEPS,
            "series": [_packed(one * (STEPS / largest), np.int16) for one in series],
            "series_step": largest / STEPS,
            "harmonics": kept,
            "faces": _packed(self.faces, np.int32),
            "shade": _packed(255 * part, np.uint8),
            "colours": [to_hex(colour) for colour in matplotlib.colormaps["viridis"](np.linspace(0, 1, COLOURS))],
            "scale": self.scale,
            "radius": radius * (1.0 + LARGEST),
            "shape": self.shape,
            "peak": self.motion.phase,
            "across": float(np.arctan2(towards[0], -towards[1])),
            "tilt": float(np.arcsin(towards[2])),
        }
        return json.dumps(given)


def moving(view: View) -> Moving | None:
    """The surface at the point that is shown; None without a mesh, or where the motion of its nodes is not at hand."""
    result, model = view.result, view.model
    if view.point is None or model is None or not result.has("/points/coordinates"):
        return None
    try:
        field = _field(view, model)
    except (InputError, *UNREADABLE):
        # A reduced model that is gone or is another leaves out the view, not the report.
        return None
    if field is None:
        return None
    harmonics = node_harmonics(field, model)
    harmonics[0] = 0.0
    try:
        wheel = wheel_of(result, view.point)
    except InputError:
        wheel = None
    most = VERTICES if wheel is None else max(OF_A_SECTOR, VERTICES // wheel.sectors)
    surface = outer_surface(model, most, _boundaries(view, model))
    points, own = model.coordinates[surface.nodes], harmonics[:, surface.nodes]
    known = np.append(np.isfinite(own).all(axis=(0, 2)), True)
    faces = surface.faces[known[surface.faces].all(axis=1)]
    # Pieces would not show what the structure does.
    if len(faces) < LEAST_KNOWN * len(surface.faces) or not len(faces):
        return None
    own = np.nan_to_num(own)
    if wheel is not None:
        first = len(points) * np.arange(wheel.sectors)
        faces = np.where(faces >= 0, first[:, None, None] + faces, -1).reshape(-1, 4)
        points, own = wheel.points(points), wheel.harmonics(own)
    unit = result.unit(f"/monitors/{view.monitors[0]}/amplitude") if view.monitors else ""
    return Moving(points, faces, motion_of(own), unit)


def animation(found: Moving, place: str) -> tuple[Animation, str]:
    """The figure of a page, and what it shows; `place`: where the point is, in words."""
    words = (
        f"Motion about the mean at {place}, {found.scale:.3g} times as large; colour is the amplitude. Drag, or use the"
        " arrow keys, to turn it; printed at the instant of the largest motion."
    )
    return Animation(found.still(), found.numbers()), words


def drawn_harmonics(harmonics: np.ndarray) -> list[int]:
    """Numbers of those of `[nk, V, 3]` that can be seen."""
    size = np.abs(harmonics[1:]).max(axis=(1, 2)).reshape(-1, 2).max(axis=1)
    large = np.flatnonzero(size >= UNSEEN * size.max(initial=0.0))
    return sorted((large[np.argsort(-size[large], kind="stable")][:HARMONICS] + 1).tolist())


def _field(view: View, model: Model) -> np.ndarray | None:
    rom = view.result.attribute("rom_file") or None
    if rom is not None:
        if not Path(rom).is_file():
            return None
        with h5py.File(rom, "r") as file:
            basis = file.get("recovery/basis")
            if basis is None or 8 * basis.size > MOST_BASIS:
                return None
    return full_field(view.result, view.point, model.size, rom)


def _boundaries(view: View, model: Model) -> tuple[np.ndarray, ...]:
    """Where a sector meets its neighbours, which is within the wheel."""
    cyclic = view.job().get("cyclic") or {}
    names = (cyclic.get(side) for side in ("lower", "upper"))
    return tuple(model.node_sets[name] for name in names if isinstance(name, str) and name in model.node_sets)


def _packed(values: np.ndarray, kind: type) -> str:
    """Whole numbers, little-endian, in base 64."""
    whole = np.rint(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(whole.tobytes()).decode()
