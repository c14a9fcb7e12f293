"""All sectors of a wheel from the motion of one: q_j(t) = q_0(t - j EO T / N), turned by 2 pi j / N about the axis."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from attrito.model.sector import Axis, axis_of
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError


def along_own_axes(result: Result, coordinates: np.ndarray) -> np.ndarray:
    """Coordinates as solved `[m', nk]` along the model's own axes `[m, nk]`."""
    if not result.has("/cyclic/axes/row"):
        return coordinates
    row, column, value = (result.array(f"/cyclic/axes/{name}") for name in ("row", "column", "value"))
    size = len(coordinates)
    if not len(row) or column.max() >= size or min(row.min(), column.min()) < 0:
        raise InputError(Fault(result.path, "/cyclic/axes/column", column, f"coordinates 0 to {size - 1}"))
    axes = coo_matrix((value, (row, column)), shape=(row.max() + 1, size))
    own: np.ndarray = axes.tocsr() @ coordinates
    return own


@dataclass(frozen=True)
class Wheel:
    """The wheel that a result's model is a sector of."""

    sectors: int
    engine_order: int
    axis: Axis

    def points(self, points: np.ndarray) -> np.ndarray:
        """Nodes of all sectors, sector by sector, `[sectors N, 3]`, from those of one."""
        return np.concatenate([self.axis.turned(points, self.angle(j)) for j in range(self.sectors)])

    def cells(self, cells: list[tuple[str, np.ndarray]], nodes: int) -> list[tuple[str, np.ndarray]]:
        """Cells of all sectors, of `nodes` each."""
        first = nodes * np.arange(self.sectors)
        return [(name, (first[:, None, None] + rows).reshape(-1, rows.shape[1])) for name, rows in cells]

    def harmonics(self, harmonics: np.ndarray) -> np.ndarray:
        """Coefficients `[nk, sectors N, 3]` of all sectors from those of one, `[nk, N, 3]`."""
        return np.concatenate([self.of_sector(harmonics, j) for j in range(self.sectors)], axis=1)

    def of_sector(self, harmonics: np.ndarray, j: int) -> np.ndarray:
        """Coefficients `[nk, N, 3]` of sector j from those of sector 0."""
        later = harmonics.copy()
        for h in range(1, (len(harmonics) + 1) // 2):
            delay = h * self.engine_order * self.angle(j)
            cosine, sine = harmonics[2 * h - 1], harmonics[2 * h]
            later[2 * h - 1] = np.cos(delay) * cosine - np.sin(delay) * sine
            later[2 * h] = np.sin(delay) * cosine + np.cos(delay) * sine
        return later @ self.axis.turn(self.angle(j)).T

    def angle(self, j: int) -> float:
        """Angle of sector j about the axis, rad."""
        return 2.0 * np.pi * j / self.sectors


def wheel_of(result: Result, point: int = 0) -> Wheel:
    """The wheel of a result; of linear modes that of a mode, whose nodal diameter stands for the engine order.

    Raises
    ------
    InputError : a result of a whole model, or of a job that does not say where the axis is
    """
    if not result.attribute("sectors"):
        raise InputError(
            Fault("export", "--wheel", "given", f"a result of a job with [cyclic], which {result.path} is not")
        )
    keys = json.loads(result.attribute("job"))["cyclic"]
    if keys["axis_point"] is None or keys["axis_direction"] is None:
        expected = "axis_point and axis_direction in [cyclic], about which the sectors are drawn"
        raise InputError(Fault(result.path, "[cyclic] axis_direction", "missing", expected))
    axis = axis_of(keys["axis_point"], keys["axis_direction"])
    order = int(result.attribute("engine_order"))
    if result.has("/points/nodal_diameter"):
        order = int(result.array("/points/nodal_diameter")[point])
    return Wheel(int(result.attribute("sectors")), order, axis)
