"""Motion of the base as a harmonic load: which axes it may have where the structure turns or is a sector of a wheel."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from attrito.job.cyclic import SAME_AXIS, beside, excited_diameter, is_cyclic

if TYPE_CHECKING:
    from attrito.job.job import Job
    from attrito.support.errors import Fault

BASE_KEYS = ("base_cosine", "base_sine")


def is_vector(acceleration: list[Any]) -> bool:
    """Whether an acceleration is given along x, y, z, and not dof by dof."""
    return not isinstance(acceleration[0], tuple)


def moves_base(load: dict[str, Any]) -> bool:
    """Whether a `[[load]]` has motion of the base."""
    return any(load[key] is not None for key in BASE_KEYS)


def check_base_motion(job: Job) -> list[Fault]:
    """Accelerations that are no vector, or across an axis of rotation, in whose frame they have another frequency."""
    faults = []
    axes = _axes(job)
    for i, load in enumerate(job["load"]):
        for key in BASE_KEYS:
            value, place = load[key], f"load[{i}] {key}"
            if value is None or load["kind"] != "harmonic":
                continue
            if is_vector(value) and not any(value):
                faults.append(job.fault(place, value, "an acceleration that is not zero"))
                continue
            if is_cyclic(job):
                faults += _check_diameter(job, place, value)
            if not is_vector(value):
                continue
            for name, axis in axes.items():
                if beside(value, axis) > SAME_AXIS * math.hypot(*value):
                    expected = (
                        f"along {axis}, the axis of {name}: in axes that turn, motion across has other frequencies"
                    )
                    faults.append(job.fault(place, value, expected))
                    break
    return faults


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
