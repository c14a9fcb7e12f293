"""Bounds of points that are not unique: the family over the free start sliders.

Where every contact sticks on its one tangent, the harmonics do not depend on the sliders w, and the mean contact forces
do so linearly. With K~ the stuck system, R = B K~^-1 B^T, and a change s of -kt w of every contact,

    T_0 = T_0* + (1 - kt R_tt) s,        N_0 = N_0* - kn R_nt s,        q_0 = q_0* - K~^-1 B_t^T s,

where * is the member that the load path chose. The members are the s for which every contact sticks at every instant,

    +-T_0 + max_t (+-T~(t) - mu N~(t)) <= mu N_0,        N_0 + min_t N~(t) >= 0,

a polytope, and the bounds of mean T and N of every contact, and of the monitors' means, are linear programs. Amplitudes
are the same in all members. Elsewhere, where some contacts slip or have two tangents, members are visited one by one
(`attrito.runs.bounds_by_members`). Members of a sector's motion are waves: all its sectors start alike. See
docs/explanation/uniqueness.md, "Points that are not unique".
"""

from __future__ import annotations

import json

import h5py
import numpy as np

from attrito.library.kernels import extrema
from attrito.library.laws import cone_coefficients
from attrito.library.reduced_scene import ReducedScene, all_alike
from attrito.runs.bounds_by_members import Hull
from attrito.runs.bounds_of_levels import HOLDING, Sampler
from attrito.runs.linear_family import IMMOBILE
from attrito.support.hdf5_writing import described
from attrito.support.linear_programs import DualSimplex

SOLVED = ("converged", "unstable", "indeterminate", "above_tolerance")
# How the bounds of a point came about, by number.
KINDS = ("none", "exact", "sampled", "not_examined")
# Of the forces: what residual (1e-10), extrema and linear programs leave, with a margin of two orders.
SINGLE_VALUED = 1e-8
ROUNDING = 1e-12
# Parts of the largest: what all sliders together change of forces if they are free; what a quantity feels of that.
FREE = 1e-9
FELT = 1e-6
DIRECTIONS = ("t1", "t2", "n")


def write_bounds(file: h5py.File, scene: ReducedScene, sampler: Sampler) -> None:
    """Fill in the bounds of a result file's points.

    Parameters
    ----------
    file : result file with its points, open for writing
    scene : the reduced scene that was solved
    sampler : has visited every point
    """
    _write_mean_bounds(file)
    kinds = np.where(file["/points/unique"][:] == 1, KINDS.index("exact"), KINDS.index("none"))
    points = _families(file) if sampler.programs else np.empty(0, dtype=int)
    if len(points):
        _write_exact(file, scene, points)
        kinds[points] = KINDS.index("exact")
    if sampler.gives_up:
        kinds[_families(file)] = KINDS.index("not_examined")
    if sampler.lacks_cones:
        kinds[file["/points/unique"][:] == 0] = KINDS.index("not_examined")
    kinds[sampler.omitted] = KINDS.index("not_examined")
    for point, hull in sampler.hulls.items():
        _write_sampled(file, scene, point, hull)
        kinds[point] = KINDS.index("sampled" if hull.complete else "not_examined")
    _write_change(file, scene, sampler)
    words = "where the bounds come from: index into the attribute names"
    described(file, "/points/bounds", words, names=KINDS, data=kinds.astype(np.int32))


def _write_change(file: h5py.File, scene: ReducedScene, sampler: Sampler) -> None:
    """How far amplitudes of the members visited differ, at most, as a part of the monitor's.

    Where every contact sticks the equations of the harmonics are linear, and the same for all members.
    """
    unique = file["/points/unique"][:]
    states = list(np.char.strip(_names(file["/contacts/state"])))
    sticks = np.isin(file["/contacts/state"][:], [states.index(name) for name in HOLDING]).all(axis=1)
    change = np.where((unique == 1) | ((unique == 0) & sticks), 0.0, np.nan)
    for point, hull in sampler.hulls.items():
        own = np.array([file[f"/monitors/{name}/amplitude"][point] for name in scene.monitor_names])
        moves = own > IMMOBILE * own.max(initial=0.0)
        if hull.members > 1 and moves.any():
            low, high = np.minimum(hull.visited[0], own), np.maximum(hull.visited[1], own)
            change[point] = np.max((high - low)[moves] / own[moves])
    words = "largest part of its amplitude by which a monitor's differs between the members visited"
    described(file, "/points/amplitude_change", words, data=change)


def _write_exact(file: h5py.File, scene: ReducedScene, points: np.ndarray) -> None:
    """Every contact sticks on its one tangent: linear programs."""
    family = _Family(file, scene, points)
    _put(file, "/contacts/t1", points, family.bounds(family.tangential))
    _put(file, "/contacts/n", points, family.bounds(family.normal))
    _put_unique(file, points, family.accuracy)
    means = family.bounds(family.monitors)
    for i, name in enumerate(scene.monitor_names):
        monitor = file[f"/monitors/{name}"]
        for side in ("low", "high"):
            monitor[side][points] = monitor["amplitude"][points]
        for side, values in zip(("mean_low", "mean_high"), means, strict=True):
            monitor[side][points] = monitor["mean"][points] + values[:, i]


def _write_sampled(file: h5py.File, scene: ReducedScene, point: int, hull: Hull) -> None:
    """The hull of the members visited, which the member shown is one of; NaN where their search was cut off."""
    for row, direction in enumerate(DIRECTIONS):
        applies = scene.laws["tangents"] == 2 if direction == "t2" else np.full(hull.force.shape[1], True)
        shown = file[f"/contacts/{direction}_mean"][point]
        for side, merge, values in zip(("low", "high"), (np.minimum, np.maximum), hull.force[:, :, row], strict=True):
            file[f"/contacts/{direction}_{side}"][point] = np.where(applies, merge(values, shown), np.nan)
    for i, name in enumerate(scene.monitor_names):
        monitor = file[f"/monitors/{name}"]
        for prefix, shown, values in (("mean_", "mean", hull.mean), ("", "amplitude", hull.amplitude)):
            for side, merge, bound in zip(("low", "high"), (np.minimum, np.maximum), values[:, i], strict=True):
                monitor[f"{prefix}{side}"][point] = merge(bound, monitor[shown][point])
    # What no member visited shows to be several-valued may be so all the same.
    wide = (hull.force[1] - hull.force[0] > hull.accuracy).any(axis=1)
    file["/contacts/unique"][point] = np.where(wide, 0, -1).astype(np.int32)


class _Family:
    """The members of some points: maps from s, `[contacts]`, to means, and the limits on s at each point."""

    def __init__(self, file: h5py.File, scene: ReducedScene, points: np.ndarray):
        kt, kn = scene.laws["tangential_stiffness"], scene.laws["normal_stiffness"]
        friction = cone_coefficients(scene.laws)
        # The mean of a wave is that of sectors that are all alike.
        scene = all_alike(scene)
        tangents, normals = scene.directions[0::2], scene.directions[1::2]
        stuck = scene.stiffness + tangents.T @ (kt[:, None] * tangents) + normals.T @ (kn[:, None] * normals)
        response = np.linalg.solve(stuck, tangents.T)
        self.tangential = np.eye(len(kt)) - kt[:, None] * _product(tangents, response)
        self.normal = -kn[:, None] * _product(normals, response)
        self.monitors = -_product(scene.monitors, response)
        # With friction |T| <= mu N says that N >= 0.
        bare = friction <= 0.0
        rubbed = friction[:, None] * self.normal
        rows = np.vstack([self.tangential - rubbed, -self.tangential - rubbed, -self.normal[bare]])
        # Sliders of a body that only contacts hold may move together, which no force feels: a direction without limits.
        sizes, span = np.linalg.svd(rows)[1:]
        self._span = span[: np.count_nonzero(sizes > FREE * sizes.max(initial=0.0))].T
        self._rows = rows @ self._span
        force = file["/contacts/force"][points][:, :, [0, 2], :]
        alternating = force.copy()
        alternating[..., 0] = 0.0
        t, n = alternating[:, :, 0], alternating[:, :, 1]
        rubbing = friction[None, :, None] * n
        peaks = [extrema(t - rubbing)[..., 1], extrema(-t - rubbing)[..., 1], -extrema(n[:, bare])[..., 0]]
        t_mean, n_mean = force[..., 0, 0], force[..., 1, 0]
        means = [t_mean - friction * n_mean, -t_mean - friction * n_mean, -n_mean[:, bare]]
        # Between samples the shown member may exceed its limits by what sampling costs: it is a member all the same.
        self._limits = np.maximum(-np.concatenate(peaks, axis=1) - np.concatenate(means, axis=1), 0.0)
        self.accuracy = SINGLE_VALUED * np.abs(force).sum(axis=(2, 3)).max(axis=1)

    def bounds(self, quantities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest change from the shown member, `[points, quantities]` each, of rows linear in s."""
        change = np.zeros((2, len(self._limits), len(quantities)))
        for i, row in enumerate(quantities):
            scale = np.abs(row).max()
            if scale == 0.0:
                continue
            # Monitors' means are lengths: the program sees numbers of order one.
            felt = row / scale @ self._span
            if np.linalg.norm(row / scale - self._span @ felt) > FELT:
                change[0, :, i], change[1, :, i] = -np.inf, np.inf
                continue
            for sign, values in zip((-1.0, 1.0), change, strict=True):
                program = DualSimplex(self._rows, sign * felt)
                values[:, i] = [sign * scale * program.maximum(limit) for limit in self._limits]
        return change[0], change[1]


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A B without what is only rounding: directions that do not feel each other then have no room at all."""
    product = a @ b
    product[np.abs(product) <= ROUNDING * (np.abs(a) @ np.abs(b))] = 0.0
    return product


def _families(file: h5py.File) -> np.ndarray:
    """Points that are solved and not unique, with every contact stuck on its one tangent."""
    if json.loads(file.attrs["job"])["balance"]["approach"] != "coupled":
        return np.empty(0, dtype=int)
    outcomes, states = (list(np.char.strip(_names(file[name]))) for name in ("/points/outcome", "/contacts/state"))
    solved = np.isin(file["/points/outcome"][:], [outcomes.index(name) for name in SOLVED])
    sticks = np.isin(file["/contacts/state"][:], [states.index(name) for name in HOLDING]).all(axis=1)
    return np.flatnonzero(solved & sticks & (file["/points/unique"][:] == 0))


def _names(dataset: h5py.Dataset) -> np.ndarray:
    return np.array([name.decode() if isinstance(name, bytes) else str(name) for name in dataset.attrs["names"]])


def _put(file: h5py.File, name: str, points: np.ndarray, change: tuple[np.ndarray, np.ndarray]) -> None:
    for side, values in zip(("low", "high"), change, strict=True):
        file[f"{name}_{side}"][points] = file[f"{name}_mean"][points] + values


def _put_unique(file: h5py.File, points: np.ndarray, accuracy: np.ndarray) -> None:
    """A contact is unique where neither mean force has room; only there, since NaN compares false."""
    single = np.ones((len(points), file["/contacts/unique"].shape[1]), dtype=bool)
    for name in ("n", "t1"):
        width = file[f"/contacts/{name}_high"][points] - file[f"/contacts/{name}_low"][points]
        single &= width <= accuracy[:, None]
    file["/contacts/unique"][points] = single.astype(np.int32)


def _write_mean_bounds(file: h5py.File) -> None:
    """Bounds of the monitors' means: the mean itself where the point is unique, NaN elsewhere until examined."""
    unique = file["/points/unique"][:] == 1
    for monitor in file["/monitors"].values():
        for side, what in (("mean_low", "lower"), ("mean_high", "upper")):
            values = np.where(unique, monitor["mean"][:], np.nan)
            described(monitor, side, f"{what} bound of the mean", "user length", data=values)
