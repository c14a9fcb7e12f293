"""Loads that are accelerations, weight and motion of the base: which axes they may have where the structure turns."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from attrito.job.cyclic import SAME_AXIS, beside, excited_diameter, is_cyclic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from attrito.job.job import Job
    from attrito.support.errors import Fault

BASE_KEYS = ("base_cosine", "base_sine")
# By the key, what it is across an axis of rotation, in axes that turn with the structure
ACROSS = {"gravity": "weight across is not steady"} | dict.fromkeys(BASE_KEYS, "motion across has other frequencies")
KINDS = {"gravity": "static"} | dict.fromkeys(BASE_KEYS, "harmonic")


def is_vector(acceleration: list[Any]) -> bool:
    """Whether an acceleration is given along x, y, z, and not dof by dof."""
    return not isinstance(acceleration[0], tuple)


def moves_base(load: dict[str, Any]) -> bool:
    """Whether a `[[load]]` has motion of the base."""
    return any(load[key] is not None for key in BASE_KEYS)


def check_accelerations(job: Job) -> list[Fault]:
    """Accelerations that are none, across an axis of rotation, or that no travelling wave has."""
    axes = _axes(job)
    faults = []
    for place, key, value in _given(job):
        if is_vector(value) and not any(value):
            faults.append(job.fault(place, value, "an acceleration that is not zero"))
            continue
        if key in BASE_KEYS and is_cyclic(job):
            faults += _check_diameter(job, place, value)
        across = (name for name, axis in axes.items() if is_vector(value) and _leads_away(value, axis))
        if name := next(across, None):
            expected = f"along {axes[name]}, the axis of {name}: in axes that turn, {ACROSS[key]}"
            faults.append(job.fault(place, value, expected))
    return faults


def _given(job: Job) -> Iterator[tuple[str, str, list[Any]]]:
    """Place, key and value of every acceleration."""
    for i, load in enumerate(job["load"]):
        for key, kind in KINDS.items():
            if load[key] is not None and load["kind"] == kind:
                yield f"load[{i}] {key}", key, load[key]


def _leads_away(acceleration: list[float], axis: list[float]) -> bool:
    return beside(acceleration, axis) > SAME_AXIS * math.hypot(*acceleration)


def _axes(job: Job) -> dict[str, list[float]]:
    """Axes of rotation by what gives them."""
    given = {
        f"load[{i}]": load["axis_direction"] for i, load in enumerate(job["load"]) if load["kind"] == "centrifugal"
    }
    if is_cyclic(job):
        given["[cyclic]"] = job["cyclic"]["axis_direction"]
    return {name: axis for name, axis in given.items() if axis is not None and any(axis)}


def _check_diameter(job: Job, place: str, value: list[Any]) -> list[Fault]:
    """A base takes all sectors along at the same time, which is a wave of nodal diameter 0."""
    sectors, order = job["cyclic"]["sectors"], job["cyclic"]["engine_order"]
    if sectors is None or order is None or excited_diameter(sectors, order) == 0:
        return []
    expected = f"[cyclic] engine_order 0, not {order}: the base takes all sectors along at the same time"
    return [job.fault(place, value, expected)]
