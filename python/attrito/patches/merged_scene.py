r"""A scene whose pairs are merged into patches, in few coordinates.

Pair i of patch P has the share a_i = k_i / k_P, k_P the sum of k_i. The patch has the mean of their rows and offsets,

    d_P = sum a_i d_i,    k_P = sum k_i,    N_P = sum N_p,i,    g_P = sum a_i g_i,

so while its pairs are closed its force is the sum of theirs, lambda_P = sum lambda_i, and so is its limit mu N_P. What
the pairs move by beside the mean their springs hold as at the static solution: where they are closed, in K' and f',

    K' = K + sum_i k_i b_i b_i^T - sum_P k_P b_P b_P^T,    f' = f + sum_i k_i (s_i - s_P) b_i,

s_i being the displacement at which spring i is free. So the static solution and the tangent system are those of all
pairs, whatever the patches. Coordinates are the static solution, low tangent modes, and what the tangent structure
answers to loads, monitors and the forces of patches: q = V y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.library.points import LinearModes
from attrito.library.reduced_scene import ReducedScene

# More coordinates than this part of the model's are not worth another basis
WORTH_REDUCING = 0.7
# Tangent modes of the basis: at most so many, up to so many times the highest frequency of the series
MOST_MODES, MODES_BAND = 60, 2.0
# Columns of the basis that depend on others but for this part of them are dropped
DEPENDENT = 1e-9
# The frequency that holds free bodies where columns are solved for, part of the lowest of the band
HOLDING = 0.1


@dataclass(frozen=True)
class StaticState:
    """The static solution of all pairs: displacements `[m]`, sliders `[nc, width]`, closed `[nc]`, force `[m]`."""

    displacements: np.ndarray
    slider: np.ndarray
    closed: np.ndarray
    load: np.ndarray


@dataclass(frozen=True)
class MergedScene:
    """What is solved in place of a scene.

    Parameters
    ----------
    scene : of the patches, in `n` coordinates
    basis : V `[m, n]`; None: the coordinates are the model's own
    partition : patch of each pair `[nc]`
    share : a_i of each pair `[nc]`
    rows : of all pairs in these coordinates `[rows, n]`
    stiffness, damping : the structure's own in these coordinates `[n, n]`; damping None where there is no matrix
    load : all static loads together in these coordinates `[n]`
    """

    scene: ReducedScene
    basis: np.ndarray | None
    partition: np.ndarray
    share: np.ndarray
    rows: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray | None
    load: np.ndarray

    def expand(self, coordinates: np.ndarray) -> np.ndarray:
        """The model's coordinates `[m, nk]` of those that are solved."""
        return coordinates if self.basis is None else self.basis @ coordinates

    def reduce(self, displacements: np.ndarray) -> np.ndarray:
        """The other way round: the nearest."""
        if self.basis is None:
            return displacements
        return np.linalg.lstsq(self.basis, displacements, rcond=None)[0]

    def means(self, values: np.ndarray) -> np.ndarray:
        """Means over patches of values of pairs `[nc, ...]`."""
        result = np.zeros((int(self.partition.max()) + 1, *values.shape[1:]))
        shares = self.share.reshape(-1, *[1] * (values.ndim - 1))
        np.add.at(result, self.partition, shares * values)
        return result


class Merger:
    """Merges the pairs of a scene at its static solution.

    Parameters
    ----------
    scene, state : in the model's coordinates
    stuck : all modes of the stuck system, which a damping ratio is defined on; None without one
    band : lowest frequency of the excitation, and the highest of its harmonics, rad/s
    """

    def __init__(
        self, scene: ReducedScene, state: StaticState, stuck: LinearModes | None, band: tuple[float, float]
    ) -> None:
        self._scene, self._state = scene, state
        tangents = scene.laws["tangents"]
        self._first_row = np.concatenate([[0], np.cumsum(tangents + 1)[:-1]])
        # Of each row: its contact, and its component 0, 1 (tangents) or 2
        self.contact = np.repeat(np.arange(len(tangents)), tangents + 1)
        place = np.arange(len(self.contact)) - self._first_row[self.contact]
        self.component = np.where(place == tangents[self.contact], 2, place)
        normal = self.component == 2
        laws = scene.laws
        self.springs = np.where(
            normal, laws["normal_stiffness"][self.contact], laws["tangential_stiffness"][self.contact]
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            free = np.nan_to_num(laws["gap"] - laws["preload"] / laws["normal_stiffness"])
        self._free = np.where(normal, free[self.contact], state.slider[self.contact, np.minimum(self.component, 1)])
        self._damping_kind, self._damping = self._damping_of(stuck)
        self._own, self._answers = self._columns(band)

    def beside(self, displacement: np.ndarray, merged: MergedScene) -> np.ndarray:
        """Forces of springs that hold what pairs move by beside the means of their patches, `[rows, nk]`.

        `displacement` is that of all rows, `[rows, nk]`.
        """
        stretched = displacement.copy()
        stretched[:, 0] -= self._free
        for component in range(3):
            rows = np.flatnonzero(self.component == component)
            patch = merged.partition[self.contact[rows]]
            mean = np.zeros((int(merged.partition.max()) + 1, displacement.shape[1]))
            np.add.at(mean, patch, merged.share[self.contact[rows], None] * stretched[rows])
            stretched[rows] -= mean[patch]
        springs = np.where(self._state.closed[self.contact], self.springs, 0.0)
        return springs[:, None] * stretched

    def _damping_of(self, stuck: LinearModes | None) -> tuple[str, np.ndarray | None]:
        scene = self._scene
        if scene.damping_kind == "ratio":
            inertia = scene.mass @ stuck.shapes.T
            ratios = scene.damping_value if scene.damping_ratios is None else scene.damping_ratios
            rates = 2.0 * ratios * 2.0 * np.pi * stuck.natural_hz
            return "viscous", (inertia * rates) @ inertia.T
        return scene.damping_kind, scene.damping

    def _columns(self, band: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """What every basis holds `[m, some]`, and answers to unit forces on the rows `[m, rows]`."""
        from scipy.linalg import cho_factor, cho_solve
        from scipy.sparse.linalg import LinearOperator, eigsh

        scene, rows = self._scene, self._scene.directions
        tangent = np.where(self._state.closed[self.contact], self.springs, 0.0)
        stiffness = scene.stiffness + (rows.T * tangent) @ rows
        factor = cho_factor(stiffness + (HOLDING * band[0]) ** 2 * scene.mass)
        count = len(scene.mass)
        modes = np.zeros((count, 0))
        if count > 2:
            size = count, count
            operator = LinearOperator(size, lambda x: cho_solve(factor, x), dtype=float)
            shift = -((HOLDING * band[0]) ** 2)
            wanted = min(MOST_MODES, count - 1)
            squares, shapes = eigsh(stiffness, wanted, scene.mass, sigma=shift, OPinv=operator, v0=np.ones(count))
            modes = shapes[:, squares <= (MODES_BAND * band[1]) ** 2]
        forces = [self._state.load[None], scene.static, scene.harmonic, scene.monitors]
        answers = cho_solve(factor, np.concatenate([*forces, rows]).T)
        known = sum(map(len, forces))
        own = np.column_stack([self._state.displacements, modes, answers[:, :known]])
        return own, answers[:, known:]

    def merge(self, partition: np.ndarray) -> MergedScene:
        """The scene of a partition, with one static load."""
        scene, laws = self._scene, self._scene.laws
        patches = int(partition.max()) + 1
        total = np.bincount(partition, laws["normal_stiffness"], minlength=patches)
        size = np.bincount(partition, minlength=patches)
        first = np.unique(partition, return_index=True)[1]
        share = np.where(size[partition] == 1, 1.0, laws["normal_stiffness"] / total[partition])
        merged = {name: values[first] for name, values in laws.items()}
        for name in ("normal_stiffness", "tangential_stiffness", "preload"):
            merged[name] = np.bincount(partition, laws[name], minlength=patches)
        merged["gap"] = np.bincount(partition, share * laws["gap"], minlength=patches)
        # Rows of patches follow those of pairs: a patch's tangents before its normal.
        offset = np.concatenate([[0], np.cumsum(merged["tangents"] + 1)])
        place = np.where(self.component == 2, laws["tangents"][self.contact], self.component)
        row_of = offset[partition[self.contact]] + place
        weights = np.zeros((offset[-1], len(self.contact)))
        weights[row_of, np.arange(len(row_of))] = share[self.contact]
        basis = self._basis(self._answers @ weights.T)
        rows = scene.directions if basis is None else scene.directions @ basis
        directions = weights @ rows
        inside = self._state.closed[self.contact] & (size[partition[self.contact]] > 1)
        stiffness, mass, damping = (self._projected(a, basis) for a in (scene.stiffness, scene.mass, self._damping))
        # b_i - b_P, weighted: the sum of k_i over a patch of both is that of K'.
        beside = (rows - directions[row_of])[inside]
        springs = self.springs[inside]
        held = stiffness + (beside.T * springs) @ beside
        free = (self._free - (weights @ self._free)[row_of])[inside]
        load = self._projected_rows(self._state.load[None], basis)
        plain = (self._projected_rows(values, basis) for values in (scene.harmonic, scene.monitors))
        reduced = ReducedScene(
            mass,
            np.ascontiguousarray(held),
            self._damping_kind,
            scene.damping_value,
            damping,
            merged,
            np.ascontiguousarray(directions),
            np.ascontiguousarray(load + (springs * free) @ beside),
            *plain,
            scene.monitor_names,
            suspension_hz=scene.suspension_hz,
        )
        return MergedScene(reduced, basis, partition, share, rows, stiffness, damping, load[0])

    def _basis(self, answers: np.ndarray) -> np.ndarray | None:
        """Orthonormal columns V `[m, n]`; None where they would be nearly as many as the model's own coordinates."""
        from scipy.linalg import qr

        columns = np.column_stack([self._own, answers])
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0.0] / size[size > 0.0]
        if columns.shape[1] > WORTH_REDUCING * len(columns):
            return None
        directions, triangle, _ = qr(columns, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangle))
        result: np.ndarray = np.ascontiguousarray(directions[:, diagonal > DEPENDENT * diagonal[0]])
        return result

    @staticmethod
    def _projected(matrix: np.ndarray | None, basis: np.ndarray | None) -> np.ndarray | None:
        if matrix is None or basis is None:
            return matrix
        product = basis.T @ matrix @ basis
        return np.ascontiguousarray(0.5 * (product + product.T))

    @staticmethod
    def _projected_rows(rows: np.ndarray, basis: np.ndarray | None) -> np.ndarray:
        return np.ascontiguousarray(rows if basis is None else rows @ basis)
