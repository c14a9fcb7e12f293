"""Contacts that are so much stiffer than the structure that rounding hides what it does, or leaves nothing of it.

A contact's row b is compared with what moves the structure along it, or more,

    ratio = k |b|^4 / (b^T (K + omega^2 M) b).

Where rounding of the contact's elastic force, of the order of `ratio` times the precision, is all of it, the stuck
system's matrix holds no digit of the structure's, and any motion would solve it. A body that only its contact holds has
no stiffness that could be hidden: b^T K b is no more than K rounds beside the highest frequency of the dofs,

    b^T K b <= m eps max_i (K_ii / M_ii) b^T M b,      m the number of dofs,

and its inertia counts only where the contact slips: next to zero frequency it does not, and nothing is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.job.defaults import TOLERANCE
from attrito.support.errors import InputError

if TYPE_CHECKING:
    from attrito.job.job import Job
    from attrito.library.reduced_scene import ReducedScene

PRECISION = np.finfo(float).eps
# Rounding leaves two digits of the structure.
MOST = TOLERANCE / PRECISION
REMEDY = "give them less normal_stiffness and tangential_stiffness"


def contact_stiffness_ratio(scene: ReducedScene, highest_hz: float, held: bool = False) -> float:
    """Largest stiffness of a contact by that of the structure along it; `held`: of rows along which K holds it."""
    tangents = np.asarray(scene.laws["tangents"])
    along, normal = (np.asarray(scene.laws[f"{name}_stiffness"]) for name in ("tangential", "normal"))
    springs = np.repeat(along, tangents + 1)
    springs[np.cumsum(tangents + 1) - 1] = normal
    rows = scene.directions
    elastic, inert = (np.einsum("rm,rm->r", rows @ matrix, rows) for matrix in (scene.stiffness, scene.mass))
    blocked = elastic + (2.0 * np.pi * highest_hz) ** 2 * inert
    # What has neither stiffness nor mass hides no friction.
    counts = blocked > 0.0
    if held:
        stiffness, mass = np.diag(scene.stiffness), np.diag(scene.mass)
        highest = np.max(stiffness[mass > 0.0] / mass[mass > 0.0], initial=0.0)
        counts &= elastic > len(mass) * PRECISION * highest * inert
    rows, springs, blocked = rows[counts], springs[counts], blocked[counts]
    return float(np.max(springs * np.einsum("rm,rm->r", rows, rows) ** 2 / blocked, initial=0.0))


def of_stiff_contacts(scene: ReducedScene, highest_hz: float, tolerance: float) -> str:
    """What to say where points were not solved to a relative `tolerance`, of contacts whose rounding is more; or ""."""
    ratio, rigid = contact_stiffness_ratio(scene, highest_hz), tolerance / PRECISION
    if ratio <= rigid:
        return ""
    return (
        f" (contacts are up to {ratio:.1e} times as stiff as the structure at them, and from {rigid:.0e} times on"
        f" rounding may hide friction: {REMEDY})"
    )


def highest_hz(job: Job) -> float:
    """Of the sweep; 0 without one."""
    sweep = job["sweep"]
    return max([0.0, *(sweep["frequencies_hz"] or [sweep["start_hz"] or 0.0, sweep["stop_hz"] or 0.0])])


def of_hidden_inertia(scene: ReducedScene, highest_hz: float) -> list[str]:
    """A warning of contacts that hide all inertia of a body which only they hold: where they stick, nothing is lost."""
    ratio = contact_stiffness_ratio(scene, highest_hz) if highest_hz else 0.0
    if ratio < MOST:
        return []
    return [
        f"contacts are up to {ratio:.1e} times as stiff as the inertia of what only they hold, and rounding hides its"
        f" motion where they slip: {REMEDY}"
    ]


def refuse_stiffer(job: Job, scene: ReducedScene) -> None:
    """Refuse contacts that leave less than two digits of what holds itself; without a frequency none is known to."""
    if not (hz := highest_hz(job)) or (ratio := contact_stiffness_ratio(scene, hz, held=True)) < MOST:
        return
    expected = f"less than {MOST:.1e}: rounding leaves two digits of the structure there: {REMEDY}"
    raise InputError(job.fault("contacts", f"{ratio:.1e} times as stiff as the structure at them", expected))
