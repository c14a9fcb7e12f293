"""What commands on a job warn of: scenes that can be solved, but are probably not what was meant.

Each warning is one sentence, printed once and kept in the file that is written (its attribute `warnings`); a run's are
in the report, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from attrito.job.accelerations import BASE_KEYS
from attrito.job.job import Job
from attrito.library.reduced_scene import ReducedScene, all_alike
from attrito.model.held_mass import MISSED, SharedMass
from attrito.model.rigidity import resisted_rotation
from attrito.model.solid_shapes import KINDS
from attrito.scene.scene import Contacts, Scene
from attrito.scene.sector import wheel_axis

# Sine of the angle between two rows of a contact up to which they are parallel.
PARALLEL = 1e-6
# Distance of paired nodes over the extent of their interface, and the rotation that slip and moment are of, rad.
FAR_APART = 1e-3
ROTATION = 1e-3
# Part of the largest modal damping that is rounding.
ROUNDING = 1e-10
NOTHING_TOUCHES = "no contact touches at the static solution"
TO_CHECK = (
    "points begin from the structure without contacts;"
    " check gap, the sign of the static loads and that of the contacts' normals"
)


def of_scene(job: Job, scene: Scene) -> list[str]:
    """Warnings on keys without an effect, the model, where its contacts lie, and what is not examined of them."""
    contacts = scene.contacts
    found = [*job.notes, *_parallel_rows(job, contacts), *_distant_pairs(job, scene), *_unexamined(job, contacts)]
    found += _lost_at_supports(job, scene)
    resists = resisted_rotation(scene.model)
    return found if resists is None else [resists, *found]


def _lost_at_supports(job: Job, scene: Scene) -> list[str]:
    """Loads by mass, of which what free nodes share with held ones is missing, as the mesh does not tell it."""
    by_mass = [
        f"load[{i}]"
        for i, load in enumerate(job["load"])
        if load["kind"] == "centrifugal" or any(load.get(name) is not None for name in ("gravity", *BASE_KEYS))
    ]
    if not by_mass or not scene.model.has_mesh:
        return []
    shared, found = SharedMass(scene.model), []
    if (share := shared.unknown_share) > MISSED:
        found.append(
            f"{', '.join(by_mass)}: matrices without held dofs lack {share:.2%} of the mass, which nodes next to"
            " supports share with them, and so does the load, since the mesh does not tell it: finer elements at the"
            " supports share less"
        )
    if kinds := shared.kinds_not_told:
        found.append(
            f"{', '.join(by_mass)}: what nodes of elements {', '.join(kinds)} share with supports is neither in the"
            f" matrices nor in the load: shape functions are known of {', '.join(KINDS)} alone"
        )
    return found


def of_damping(scene: ReducedScene) -> list[str]:
    """A warning where damping feeds a mode x of the stuck or the frictionless system, x^T C x < 0.

    Only a damping matrix can do that.
    """
    if scene.damping is None or _is_positive(scene.damping):
        return []
    from scipy.linalg import eigh

    found = []
    scene = all_alike(scene)
    tangents = np.asarray(scene.laws["tangents"])
    for name, along in (("stuck", 1.0), ("frictionless", 0.0)):
        springs = np.concatenate(
            [
                [along * kt] * count + [kn]
                for count, kt, kn in zip(
                    tangents, scene.laws["tangential_stiffness"], scene.laws["normal_stiffness"], strict=True
                )
            ]
        )
        stiffness = scene.stiffness + scene.directions.T @ (springs[:, None] * scene.directions)
        squares, modes = eigh(stiffness, scene.mass)
        omega = np.sqrt(np.maximum(squares, 0.0))
        rate = np.einsum("im,ij,jm->m", modes, scene.damping, modes, optimize=True)
        negative = np.flatnonzero(rate < -ROUNDING * np.abs(rate).max())
        if len(negative):
            worst = negative[np.argmin(rate[negative])]
            more = f" and that of {len(negative) - 1} more" if len(negative) > 1 else ""
            found.append(
                f"damping is negative: it feeds the {name} mode at {omega[worst] / (2 * np.pi):.5g} Hz"
                f" (x^T C x = {rate[worst]:.3g} at unit modal mass){more}; motion of such a mode grows by itself:"
                " check the sign of the damping matrix"
            )
    return found


def _is_positive(matrix: np.ndarray) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue but by rounding: at a tenth of the cost of finding them."""
    largest = np.abs(matrix).max()
    try:
        np.linalg.cholesky(matrix + ROUNDING * largest * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        return largest == 0.0
    return True


def of_static_solution(states: Sequence[int]) -> list[str]:
    """A warning where no contact touches; `states` counts those stuck, shaken down, slipping and open."""
    return [] if sum(states) == 0 or states[3] < sum(states) else [f"{NOTHING_TOUCHES}: {TO_CHECK}"]


def of_static_solutions(untouched: int, samples: int) -> list[str]:
    """A warning where in some samples of a study no contact touches."""
    return [f"{NOTHING_TOUCHES} of {untouched} of {samples} samples: {TO_CHECK}"] if untouched else []


def _unexamined(job: Job, contacts: Contacts) -> Iterator[str]:
    """Hill's problem knows slip along one tangent."""
    method, two = job["stability"]["method"], int(np.count_nonzero(contacts.laws["tangents"] == 2))
    if method in ("hill", "both") and two:
        instead = "is not examined" if method == "hill" else "is examined by the monodromy alone"
        yield (
            f"[stability] method = {method}: Hill's problem knows slip along one tangent, and {two} contacts have two;"
            f" a point at which one of these slips or opens {instead}"
        )


def _parallel_rows(job: Job, contacts: Contacts) -> Iterator[str]:
    """Directions of one explicit contact that are the same motion."""
    explicit = len(job["contact"])
    first = np.concatenate([[0], np.cumsum(contacts.laws["tangents"] + 1)])
    for contact in np.flatnonzero(contacts.tables < explicit):
        own = slice(first[contact], first[contact + 1])
        rows = contacts.rows[own].toarray()
        if contacts.next_rows is not None:
            rows = np.hstack([rows, contacts.next_rows[own].toarray()])
        names = [*(f"tangents[{i}]" for i in range(len(rows) - 1)), "normal"]
        # Without a normal displacement its row is empty.
        rows = rows[rows.any(axis=1)]
        rows = rows / np.linalg.norm(rows, axis=1)[:, None]
        for i, j in combinations(range(len(rows)), 2):
            cosine = rows[i] @ rows[j]
            if np.linalg.norm(rows[i] - cosine * rows[j]) <= PARALLEL:
                yield (
                    f"contact[{contacts.tables[contact]}]: {names[i]} is parallel to {names[j]}: both are the same"
                    " motion of the model; right only where the body is guided so"
                )


def _distant_pairs(job: Job, scene: Scene) -> Iterator[str]:
    """Node pairs whose distance is a lever arm: their rows make strain, and a moment, of a rigid rotation."""
    contacts, model = scene.contacts, scene.model
    explicit = len(job["contact"])
    for i, keys in enumerate(job["contact_set"]):
        mine = np.flatnonzero(contacts.tables == explicit + i)
        node_a, node_b = contacts.places["node_a"][mine], contacts.places["node_b"][mine]
        # Contacts on faces carry the faces' rotation times the lever arm.
        if keys["pairing"] == "face" or not len(mine) or (node_b < 0).any():
            continue
        order = np.argsort(model.node_ids)
        place_a, place_b = (
            model.coordinates[order[np.searchsorted(model.node_ids, nodes, sorter=order)]] for nodes in (node_a, node_b)
        )
        if keys["across"]:
            place_b = wheel_axis(job).turned(place_b, 2.0 * np.pi / job["cyclic"]["sectors"])
        arm = place_a - place_b
        extent = float(np.linalg.norm(np.ptp(np.vstack([place_a, place_b]), axis=0)))
        farthest = float(np.linalg.norm(arm, axis=1).max())
        if farthest <= FAR_APART * extent:
            continue
        # Strain of each row by a unit rotation about each axis e: frame (e x arm) = (arm x frame) e.
        strain = np.cross(arm[:, None, :], contacts.places["frame"][mine])
        kt, kn = (contacts.laws[name][mine] for name in ("tangential_stiffness", "normal_stiffness"))
        springs = np.stack([kt, kt if keys["tangents"] == 2 else 0.0 * kt, kn], axis=1)
        moment = np.linalg.eigvalsh(np.einsum("cr,cri,crj->ij", springs, strain, strain))[-1]
        yield (
            f"contact_set[{i}]: its nodes lie up to {farthest:.3g} apart, {100 * farthest / extent:.2g} % of the"
            f" interface: when the whole model rotates rigidly by {ROTATION:g} rad they move against each other by up"
            f" to {ROTATION * farthest:.3g}, and stuck contacts resist by a moment of {ROTATION * moment:.3g}; take"
            ' pairing = "face", or close the gap in the mesh and give it as gap'
        )
