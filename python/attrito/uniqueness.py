"""Bounds of points that are not unique: the family over the free start sliders, where every contact sticks.

Then the harmonics do not depend on the sliders w, and the mean contact forces do so linearly. With K~ the stuck system,
R = B K~^-1 B^T, and a change s of -kt w of every contact,

    T_0 = T_0* + (1 - kt R_tt) s,        N_0 = N_0* - kn R_nt s,        q_0 = q_0* - K~^-1 B_t^T s,

where * is the member that the load path chose. The members are the s for which every contact sticks at every instant,

    +-T_0 + max_t (+-T~(t) - mu N~(t)) <= mu N_0,        N_0 + min_t N~(t) >= 0,

a polytope, and the bounds of mean T and N of every contact, and of the monitors' means, are linear programs. Amplitudes
are the same in all members. Points where some contacts slip and others are free, contacts with two tangents and the
uncoupled approach are not examined: their bounds stay NaN. See docs/method.md, "Points that are not unique".
"""

from __future__ import annotations

import json

import h5py
import numpy as np

from attrito.linear_programs import DualSimplex
from attrito.solver import ReducedScene, extrema

EXAMINED = ("stuck", "shaken_down")
SOLVED = ("converged", "unstable", "indeterminate")
# More contacts than this would cost more than the solve.
MOST_CONTACTS = 120
# Of the forces: what residual (1e-10), extrema and linear programs leave, with a margin of two orders.
SINGLE_VALUED = 1e-8
ROUNDING = 1e-12


def write_bounds(path: str, scene: ReducedScene) -> None:
    """Fill in the bounds of a result file's points that are one of a family with every contact stuck.

    Parameters
    ----------
    path : result file with its points, closed
    scene : the reduced scene that was solved
    """
    with h5py.File(path, "r+") as file:
        _write_mean_bounds(file)
        points = _families(file, scene)
        if len(points) == 0 or len(scene.laws["tangents"]) > MOST_CONTACTS:
            return
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


class _Family:
    """The members of some points: maps from s, `[contacts]`, to means, and the limits on s at each point."""

    def __init__(self, file: h5py.File, scene: ReducedScene, points: np.ndarray):
        kt, kn = scene.laws["tangential_stiffness"], scene.laws["normal_stiffness"]
        friction = scene.laws["friction_coefficient"]
        tangents, normals = scene.directions[0::2], scene.directions[1::2]
        stuck = scene.stiffness + tangents.T @ (kt[:, None] * tangents) + normals.T @ (kn[:, None] * normals)
        response = np.linalg.solve(stuck, tangents.T)
        self.tangential = np.eye(len(kt)) - kt[:, None] * _product(tangents, response)
        self.normal = -kn[:, None] * _product(normals, response)
        self.monitors = -_product(scene.monitors, response)
        # With friction |T| <= mu N says that N >= 0.
        bare = friction <= 0.0
        rubbed = friction[:, None] * self.normal
        self._rows = np.vstack([self.tangential - rubbed, -self.tangential - rubbed, -self.normal[bare]])
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
            for sign, values in zip((-1.0, 1.0), change, strict=True):
                # Monitors' means are lengths: the program sees numbers of order one.
                program = DualSimplex(self._rows, sign * row / scale)
                values[:, i] = [sign * scale * program.maximum(limit) for limit in self._limits]
        return change[0], change[1]


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A B without what is only rounding: directions that do not feel each other then have no room at all."""
    product = a @ b
    product[np.abs(product) <= ROUNDING * (np.abs(a) @ np.abs(b))] = 0.0
    return product


def _families(file: h5py.File, scene: ReducedScene) -> np.ndarray:
    """Points that are solved and not unique, with every contact stuck on its one tangent."""
    if json.loads(file.attrs["job"])["balance"]["approach"] != "coupled" or np.any(scene.laws["tangents"] != 1):
        return np.empty(0, dtype=int)
    outcomes, states = (list(np.char.strip(_names(file[name]))) for name in ("/points/outcome", "/contacts/state"))
    solved = np.isin(file["/points/outcome"][:], [outcomes.index(name) for name in SOLVED])
    sticks = np.isin(file["/contacts/state"][:], [states.index(name) for name in EXAMINED]).all(axis=1)
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
            stored = monitor.create_dataset(side, data=np.where(unique, monitor["mean"][:], np.nan))
            stored.attrs["description"], stored.attrs["unit"] = f"{what} bound of the mean", "user length"
