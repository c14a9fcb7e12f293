"""Faces of a solid seen from outside, without perspective: what looks away is left out, the nearest is drawn last."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# From where models are seen
DIRECTION = np.array([1.0, -1.6, 0.9])


@dataclass(frozen=True)
class Seen:
    """Faces that look at the viewer, from the farthest to the nearest.

    Parameters
    ----------
    polygons : `[corners, 2]` each, to the right and up
    corners : their vertices
    light : `[F]`, cosine of the angle between a face's normal and the direction to the viewer
    face : `[F]`, which of the faces they are
    """

    polygons: list[np.ndarray]
    corners: list[np.ndarray]
    light: np.ndarray
    face: np.ndarray


def seen_faces(points: np.ndarray, faces: np.ndarray, direction: np.ndarray = DIRECTION) -> Seen:
    """Faces `[F, 4]`, rows of points `[V, 3]`, outward, a triangle's last -1, as seen from a direction."""
    across, up, towards = axes_of_view(direction)
    last = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 0])
    a, b, c, d = (points[corner] for corner in (*faces[:, :3].T, last))
    normal = np.cross(c - a, d - b)
    length = np.linalg.norm(normal, axis=1)
    light = normal @ towards / np.where(length > 0, length, 1.0)
    depth = (0.25 * (a + b + c + d)) @ towards
    seen = np.flatnonzero(light > 1e-3)
    seen = seen[np.argsort(depth[seen], kind="stable")]
    corners = [face[face >= 0] for face in faces[seen]]
    flat = points @ np.array([across, up]).T
    return Seen([flat[ring] for ring in corners], corners, light[seen], seen)


def axes_of_view(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """To the right, up and towards the viewer, unit vectors; z is up."""
    towards = direction / np.linalg.norm(direction)
    across = np.cross([0.0, 0.0, 1.0], towards)
    across /= np.linalg.norm(across)
    return across, np.cross(towards, across), towards
