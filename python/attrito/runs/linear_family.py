"""The linear model of a family at one of its members, and the farthest that it reaches.

Forces F and monitors change with s, the change of -kt w of the free contacts, by F' s. Members of the model are the s
that leave every free contact within its cone,

    |T(t) + T'(t) s| <= mu (N(t) + N'(t) s),

at every instant: a convex set. The largest value of a linear quantity over it comes from linear programs over cutting
planes e . T <= mu N, added where the last solution exceeds the cone (Kelley 1960, doi:10.1137/0108053).
"""

from __future__ import annotations

import functools

import numpy as np

from attrito.library.family import Member
from attrito.library.laws import cone_coefficients
from attrito.support.linear_programs import DualSimplex

# Parts of the forces: how far cones may be exceeded, and what they are drawn in by to make up for it; the longest step.
EXCEEDED = 1e-9
FARTHEST = 10.0
MOST_ROUNDS = 60
# Instants per coefficient among which peaks over the period are looked for, steps that locate them, peaks of a contact.
FINENESS = 8
POLISHES = 3
MOST_PEAKS = 2
# Part of the most mobile monitor's motion below which a monitor's own is rounding.
IMMOBILE = 1e-6


class LinearFamily:
    """A linear model; attributes: `member`, `scale` of forces, and of quantities (as in `values_of`):

    `gradients` by s `[quantities, s]`, and `units`, a typical change by unit force `[quantities]`. `work` counts
    floating-point operations of the linear programs: 4 r n a pivot of r rows and n unknowns, and where cones are looked
    at 2 a coefficient of forces and instant, and 2 a coefficient of their change.

    Parameters
    ----------
    member : where it holds exactly
    moves : contact and tangent of each component of s
    changes : how the member changes with each
    laws : of the contacts, `[nc]` by key
    """

    def __init__(
        self,
        member: Member,
        moves: list[tuple[int, int]],
        changes: list[Member],
        laws: dict[str, np.ndarray],
    ):
        self.member, self.work = member, 0.0
        self.scale = scale_of(member)
        self._moves, self._stiffness = moves, laws["tangential_stiffness"]
        force = np.array([change.force for change in changes])
        monitors = np.array([change.monitors for change in changes])
        self.gradients, self.units = _gradients(member, force, monitors)
        size = len(moves)
        self._rows = np.vstack([np.eye(size), -np.eye(size)])
        self._limits = np.full(2 * size, FARTHEST)
        free = np.unique([contact for contact, _ in moves])
        friction = cone_coefficients(laws)[:, None, None]
        for array in (force, scaled := member.force / self.scale):
            array[..., 2:, :] *= friction
        self._at_rest, self._change = scaled[free], force[:, free]

    def slider(self, step: np.ndarray) -> np.ndarray:
        """Sliders after a step, `[nc, 2]`."""
        slider = self.member.slider.copy()
        for (contact, tangent), change in zip(self._moves, step, strict=True):
            slider[contact, tangent] -= change / self._stiffness[contact]
        return slider

    def farthest(self, gradient: np.ndarray) -> tuple[np.ndarray, bool]:
        """The step s to the largest value of `gradient . s`, and whether only the longest step ends it."""
        nowhere = np.zeros(len(self._moves)), False
        largest = np.abs(gradient).max()
        if largest == 0.0:
            return nowhere
        program = DualSimplex(self._rows, gradient / largest)
        for _ in range(MOST_ROUNDS):
            before = program.pivots
            found = program.maximizer(self._limits)
            if found is None:
                # Nearly equal cuts may set it going round in circles: once more, from the start.
                program, before = DualSimplex(self._rows, gradient / largest), 0
                found = program.maximizer(self._limits)
            if found is None:
                return nowhere
            step, held = found
            self.work += 4.0 * self._rows.size * (1 + program.pivots - before)
            rows, limits = self._cut_off(step)
            if len(rows) == 0:
                break
            program.add(rows)
            self._rows = np.vstack([self._rows, rows])
            self._limits = np.concatenate([self._limits, limits])
        return self.scale * step, bool((held < 2 * len(step)).any())

    def _cut_off(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Planes between a step and the cones that it exceeds."""
        force = self._at_rest + np.tensordot(step, self._change, 1)
        self.work += 2.0 * FINENESS * force.shape[-1] * force.size + 2.0 * self._change.size
        contact, theta = _peaks(force)
        basis = basis_at(theta, force.shape[-1])
        at_rest, change = self._at_rest[contact], self._change[:, contact]
        reached = np.einsum("prk,pk->pr", force[contact], basis)
        size = np.hypot(reached[:, 0], reached[:, 1])
        plane = np.where(
            size[:, None] > 0.0, reached / np.maximum(size, np.finfo(float).tiny)[:, None], [1.0, 0.0, 0.0]
        )
        plane[:, 2] = -1.0
        exceeded = size - reached[:, 2] > EXCEEDED
        rows = np.einsum("npr,pr->pn", np.einsum("nprk,pk->npr", change, basis), plane)
        room = -np.einsum("pr,pr->p", np.einsum("prk,pk->pr", at_rest, basis), plane)
        # The member is one, whatever rounding and sampling make of its limits.
        return rows[exceeded], np.maximum(room[exceeded] - EXCEEDED, 0.0)


def values_of(member: Member) -> np.ndarray:
    """Mean forces t1, t2, n of each contact, means and amplitudes of the monitors: `[quantities]`."""
    return np.concatenate([member.force[:, :, 0].ravel(), member.monitors[:, 0], member.amplitude])


def scale_of(member: Member) -> float:
    """Sum of the largest forces' coefficients."""
    return float(np.abs(member.force).sum(axis=(1, 2)).max())


def basis_at(theta: np.ndarray, coefficients: int) -> np.ndarray:
    """Values of 1, cos, sin, cos 2, ... at instants, `[instants, coefficients]`."""
    angles = np.multiply.outer(theta, np.arange(1, coefficients // 2 + 1))
    basis = np.ones((len(theta), coefficients))
    basis[:, 1::2], basis[:, 2::2] = np.cos(angles), np.sin(angles)
    return basis


def _gradients(member: Member, force: np.ndarray, monitors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of `values_of` by s; and their units."""
    moves, _, coefficients = monitors.shape
    means = force[..., 0].reshape(moves, -1)
    grid, basis = _grid(coefficients)
    values = member.monitors @ basis.T
    ends = [
        basis_at(_polished(side * _as_force(member.monitors), grid[(side * values).argmax(axis=1)]), coefficients)
        for side in (1.0, -1.0)
    ]
    amplitudes = 0.5 * np.einsum("nmk,mk->nm", monitors, ends[0] - ends[1])
    mobility = np.abs(monitors).max(axis=(0, 2))
    mobility = np.maximum(mobility, IMMOBILE * mobility.max(initial=0.0))
    units = np.concatenate([np.ones(means.shape[1]), mobility, mobility])
    return np.hstack([means, monitors[..., 0], amplitudes]).T, units


def _as_force(polynomials: np.ndarray) -> np.ndarray:
    """Polynomials as what presses where nothing rubs: |T| - mu N is each of them."""
    zero = np.zeros_like(polynomials)
    return np.stack([zero, zero, -polynomials], axis=1)


@functools.cache
def _grid(coefficients: int) -> tuple[np.ndarray, np.ndarray]:
    """Instants among which peaks are looked for, and the basis there."""
    count = FINENESS * coefficients
    theta = 2.0 * np.pi * np.arange(count) / count
    return theta, basis_at(theta, coefficients)


def _peaks(force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Instants at which |T| - mu N of contacts, `[contacts, 3, coefficients]`, is greatest: contact and angle."""
    instants, basis = _grid(force.shape[-1])
    t1, t2, n = np.moveaxis(force @ basis.T, 1, 0)
    excess = np.hypot(t1, t2) - n
    falls = np.diff(excess, axis=1, append=excess[:, :1]) < 0.0
    top = falls & ~np.roll(falls, 1, axis=1)
    # A constant has no top.
    top[~top.any(axis=1), 0] = True
    order = np.argsort(np.where(top, -excess, np.inf), axis=1)[:, :MOST_PEAKS]
    contact, rank = np.nonzero(np.take_along_axis(top, order, axis=1))
    return contact, _polished(force[contact], instants[order[contact, rank]])


def _polished(force: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Maxima over the period of |T| - mu N, `[p, 3, coefficients]`, near angles `[p]`, by Newton's method."""
    order = np.arange(1, force.shape[-1] // 2 + 1)
    slope, bend = np.zeros_like(force), np.zeros_like(force)
    slope[..., 1::2], slope[..., 2::2] = order * force[..., 2::2], -order * force[..., 1::2]
    bend[..., 1::2], bend[..., 2::2] = -(order**2) * force[..., 1::2], -(order**2) * force[..., 2::2]
    jet = np.stack([force, slope, bend])
    reach = 2.0 * np.pi / (FINENESS * force.shape[-1])
    start = theta
    for _ in range(POLISHES):
        basis = basis_at(theta, force.shape[-1])
        t, dt, ddt = np.einsum("dprk,pk->drp", jet, basis)
        size = np.hypot(t[0], t[1])
        e = np.where(size > 0.0, t[:2] / np.maximum(size, np.finfo(float).tiny), 0.0)
        along = (e * dt[:2]).sum(axis=0)
        across = (dt[:2] ** 2).sum(axis=0) - along**2
        curvature = (e * ddt[:2]).sum(axis=0) + across / np.where(size > 0.0, size, np.inf) - ddt[2]
        move = (along - dt[2]) / np.where(curvature < 0.0, curvature, -np.inf)
        theta = np.clip(theta - move, start - reach, start + reach)
    return theta
