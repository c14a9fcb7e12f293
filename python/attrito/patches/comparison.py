"""All pairs at the motion of a point that was solved for with their patches: what the patches leave out there.

The motion of the point moves all pairs; their forces at that motion, evaluated once, are what the balance of all pairs
lacks there,

    phi_h = f_h - Z_h q_h - B^T lambda_h(B q),    Z_h = K - (h omega)^2 M + i h omega C,

and what phi changes of the monitors, to first order with the patches' Jacobian, is the estimated error by patches.
See docs/method.md, "Fewer contacts".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.library.points import Point
from attrito.library.series import Series
from attrito.patches.merged_scene import MergedScene, Merger

# Contacts that lose less than this part of what the loads put in are measured against it
LEAST_LOSS, LEAST_LOSS_OF_MODE = 1e-3, 0.1
# Error of the dissipation, at most so many times what pairs dissipate beside their shares; measured on the lap joint:
# 0.02 to 3.3 times
BY_SHARES = 2.0
# Part of the loads' work that an error of the dissipation is taken to change the amplitude by, at least
PART_OF_LOSS = 2.0 / 3.0

Heard = dict[str, tuple[Series, np.ndarray]]


@dataclass(frozen=True)
class Comparison:
    """All pairs at a point of the patches.

    Parameters
    ----------
    force, lacking : of all rows, and what they are more than the patches stand for `[rows, nk]`
    indicated : of each pair, complex: what its force lacks, times its motion, all harmonics `[nc]`
    states : of each pair `[nc]`
    work, missing_work : what all pairs dissipate a period, and by how much that is more than what the patches do
    beside_shares : sum over pairs of what each dissipates beside its share of what its patch does, in moduli, since
        pairs that lose more and pairs that lose less cancel by chance
    """

    force: np.ndarray
    lacking: np.ndarray
    indicated: np.ndarray
    states: np.ndarray
    work: float
    missing_work: float
    beside_shares: float


def compare(merger: Merger, merged: MergedScene, motion: np.ndarray, of_pairs: Heard, of_patches: Heard) -> Comparison:
    """All pairs beside their patches.

    Parameters
    ----------
    merger, merged : of the patches
    motion : coordinates of the patches' scene `[n, nk]`
    of_pairs, of_patches : what the sessions of both report of the point, at this motion
    """
    contact = merger.contact
    force = of_pairs["/contacts/force"][1][contact, merger.component]
    displacement = merged.rows @ motion
    lacking = force - _assumed(merger, merged, of_patches, displacement)
    # The motion itself weighs, as the dual solution does at a resonance.
    work = _complex(lacking) * np.conj(_complex(displacement))
    indicated = np.zeros(len(merged.partition), dtype=complex)
    np.add.at(indicated, contact, work.sum(axis=1))
    own, theirs = (np.nan_to_num(one["/contacts/dissipated_energy"][1]) for one in (of_pairs, of_patches))
    beside = np.abs(own - merged.share * theirs[merged.partition])
    states = of_pairs["/contacts/state"][1].astype(int)
    return Comparison(
        force, lacking, indicated, states, float(own.sum()), float(own.sum() - theirs.sum()), float(beside.sum())
    )


def errors_of_point(found: Comparison, change: float, loss: float) -> tuple[float, float]:
    """Errors by patches of a forced point's amplitude, and of what its contacts dissipate.

    Parameters
    ----------
    change : relative change of the monitors' amplitudes by what the balance of all pairs lacks
    loss : work of the loads a period
    """
    loss = max(loss, np.finfo(float).tiny)
    missing = BY_SHARES * found.beside_shares
    return max(change, PART_OF_LOSS * missing / loss), missing / max(found.work, LEAST_LOSS * loss)


def errors_of_mode(
    found: Comparison, omega: float, kinetic: float, structural_ratio: float, change: np.ndarray
) -> tuple[float, float]:
    """Errors by patches of a nonlinear mode's frequency, and of what its contacts dissipate.

    Parameters
    ----------
    omega, kinetic : angular frequency, rad/s; sum_h h^2 q_h^H M q_h
    structural_ratio : damping ratio by the structure
    change : of omega and xi by what the balance of all pairs lacks, rad/s; NaN where it is not known
    """
    energy = omega**2 * kinetic
    # Pairs may cancel by chance to first order, and so may what is in phase and what is in quadrature.
    error = float(np.abs(found.indicated).sum()) / (2.0 * energy)
    loss = found.work + 2.0 * np.pi * structural_ratio * energy
    # A period takes pi xi omega sum_h h^2 q_h^H M q_h.
    missing = max(abs(found.missing_work), np.pi * omega * kinetic * abs(np.nan_to_num(change[1])))
    error = max(error, abs(np.nan_to_num(change[0])) / omega)
    return error, missing / max(found.work, LEAST_LOSS_OF_MODE * loss)


def work_of_loads(merged: MergedScene, point: Point, motion: np.ndarray) -> float:
    """Work of the harmonic loads a period: what contacts and structure lose."""
    loads = point.level * merged.scene.harmonic
    loaded = min((len(loads) - 1) // 2, motion.shape[1] // 2)
    return float(
        sum(
            np.pi * h * (loads[2 * h - 1] @ motion[:, 2 * h] - loads[2 * h] @ motion[:, 2 * h - 1])
            for h in range(1, loaded + 1)
        )
    )


def unbalanced(merged: MergedScene, point: Point, motion: np.ndarray, force: np.ndarray) -> np.ndarray:
    """phi in the coordinates that are solved, `[n, nk]`, for the forces of all rows `[rows, nk]`."""
    scene = merged.scene
    omega = 2.0 * np.pi * point.frequency_hz
    result = -merged.stiffness @ motion - merged.rows.T @ force
    inertia = scene.mass @ motion
    damping = scene.damping_value * inertia if scene.damping_kind == "mass" else np.zeros_like(motion)
    if merged.damping is not None:
        damping = merged.damping @ motion
    for h in range(1, motion.shape[1] // 2 + 1):
        cosine, sine = 2 * h - 1, 2 * h
        result[:, [cosine, sine]] += (h * omega) ** 2 * inertia[:, [cosine, sine]]
        result[:, cosine] -= h * omega * damping[:, sine]
        result[:, sine] += h * omega * damping[:, cosine]
    result[:, 0] += merged.load
    loaded = min(len(scene.harmonic), motion.shape[1])
    result[:, :loaded] += point.level * scene.harmonic[:loaded].T
    return result


def lacking_load(merged: MergedScene, found: Comparison) -> np.ndarray:
    """phi of a point without loads, whose patches are in balance, in the coordinates that are solved `[n, nk]`."""
    load: np.ndarray = -merged.rows.T @ found.lacking
    return load


def _assumed(merger: Merger, merged: MergedScene, of_patches: Heard, displacement: np.ndarray) -> np.ndarray:
    """Forces of all pairs' rows that the patches stand for, `[rows, nk]`."""
    contact = merger.contact
    patch = merged.partition[contact]
    own = merged.share[contact, None] * of_patches["/contacts/force"][1][patch, merger.component]
    return own + merger.beside(displacement, merged)


def _complex(coefficients: np.ndarray) -> np.ndarray:
    """Harmonics from 1 of rows `[rows, 2 H + 1]` as complex numbers `[rows, H]`."""
    return coefficients[:, 1::2] - 1j * coefficients[:, 2::2]
