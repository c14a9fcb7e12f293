"""A static load path by increments, sharing nothing with the library: small models, sliders by other formulas."""

from __future__ import annotations

import numpy as np

from attrito.library.reduced_scene import ReducedScene


def follow(scene: ReducedScene, path: np.ndarray, steps: int) -> np.ndarray:
    """Displacements at the end of a path `[corners, loads]` from rest, in so many increments from corner to corner.

    A slider slips from where it leaves the friction disc, and moves along the mean of its directions at onset and end:
    of second order. Increments in which a contact lands are halved ten times, until where it lands is sure.
    """
    contacts = _contacts(scene)
    q = np.zeros(len(scene.stiffness))
    sliders = [np.zeros(len(law[0]) - 1) for law in contacts]
    before = np.zeros(path.shape[1])
    for corner in path:
        for part in np.arange(1, steps + 1) / steps if np.any(corner != before) else []:
            start, end = ((before + s * (corner - before)) @ scene.static for s in (part - 1.0 / steps, part))
            q, sliders = _stretch(scene.stiffness, contacts, q, sliders, start, end)
        before = corner
    return q


def _stretch(stiffness, contacts, start, sliders, load, end, halvings=10):
    q, moved = _increment(stiffness, contacts, start, sliders, end)
    if halvings == 0 or not any(_normal(law, law[0] @ start) < 0.0 < _normal(law, law[0] @ q) for law in contacts):
        return q, moved
    middle = 0.5 * (load + end)
    half = _stretch(stiffness, contacts, start, sliders, load, middle, halvings - 1)
    return _stretch(stiffness, contacts, *half, middle, end, halvings - 1)


def _normal(law, place):
    _, _, kn, _, gap, preload = law
    return preload + kn * (place[-1] - gap)


def _contacts(scene: ReducedScene) -> list[tuple]:
    laws = scene.laws
    found, first = [], 0
    for i, tangents in enumerate(laws["tangents"]):
        rows = scene.directions[first : first + tangents + 1]
        first += tangents + 1
        names = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
        found.append((rows, *(float(laws[name][i]) for name in names)))
    return found


def _increment(stiffness, contacts, start, sliders, load):
    """Newton's method, its Jacobian by differences."""
    q = start.copy()
    for _ in range(50):
        residual, matrix, moved = stiffness @ q - load, stiffness.copy(), []
        for law, slider in zip(contacts, sliders, strict=True):
            rows = law[0]
            force, after = _force(law, rows @ start, rows @ q, slider)
            moved.append(after)
            residual += rows.T @ force
            matrix += rows.T @ _jacobian(law, rows @ start, rows @ q, slider) @ rows
        if np.linalg.norm(residual) <= 1e-10 * np.linalg.norm(load):
            return q, moved
        q = q - np.linalg.solve(matrix, residual)
    raise AssertionError("the reference finds no equilibrium")


def _jacobian(law, start, end, slider):
    step = 1e-7 * max(np.abs(end).max(), 1e-12)
    columns = []
    for i in range(len(end)):
        ends = [end + side * step * np.eye(len(end))[i] for side in (1.0, -1.0)]
        above, below = (_force(law, start, place, slider)[0] for place in ends)
        columns.append((above - below) / (2.0 * step))
    return np.array(columns).T


def _force(law, start, end, slider):
    """Forces of a contact where an increment takes it, and its slider there."""
    kt, mu = law[1], law[3]
    before, normal = _normal(law, start), _normal(law, end)
    u_a, u = start[:-1], end[:-1]
    if normal < 0.0:
        return np.zeros(len(end)), u.copy()
    if before < 0.0:
        u_a = u_a - before / (normal - before) * (u - u_a)
        slider, before = u_a, 0.0
    radius, z = mu * normal / kt, u - slider
    if np.linalg.norm(z) > radius:
        z = _slip(u_a - slider, z, mu * before / kt, radius)
    return np.append(kt * z, normal), u - z


def _slip(z_a, z, r_a, r):
    """Displacement less slider where the disc of the end holds it."""
    if len(z) == 1 or np.linalg.norm(z_a) <= 1e-14 * r:
        return r * z / np.linalg.norm(z)
    d, dr = z - z_a, r - r_a
    a, b, c = d @ d - dr**2, z_a @ d - r_a * dr, min(z_a @ z_a - r_a**2, 0.0)
    root = np.sqrt(max(b**2 - a * c, 0.0))
    onset = -c / max(b + root, 1e-300) if b >= 0.0 else (root - b) / a
    e = z_a + min(max(onset, 0.0), 1.0) * d
    e /= np.linalg.norm(e)
    way = (z @ z - r**2) / (2.0 * (r + z @ e))
    return r * (z - way * e) / (r + way)
