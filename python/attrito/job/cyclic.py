"""`[cyclic]`: keys that do not go with one another or with a sector of a wheel, and which commands do not take one."""

from __future__ import annotations

import math
from typing import Any

from attrito.job.job import Job
from attrito.support.errors import Fault, InputError

# Relative difference of directions, and of points, that count as one
SAME_AXIS = 1e-9


def is_cyclic(job: Job) -> bool:
    """Whether the model is one of N equal sectors."""
    return "cyclic" in job.given


def nodal_diameter(sectors: int, engine_order: int, harmonic: int = 1) -> int:
    """That of a harmonic of the travelling wave, h EO mod N: 0 to N - 1; n above N/2 is N - n running backward."""
    return (harmonic * engine_order) % sectors


def folded_diameter(sectors: int, engine_order: int) -> int:
    """The nodal diameter 0 ... N/2 that an engine order excites, whichever way it runs."""
    number = nodal_diameter(sectors, engine_order)
    return min(number, sectors - number)


def excited_diameter(sectors: int, engine_order: int) -> int:
    """The nodal diameter that an engine order excites, below 0 of a wave running backward."""
    number = nodal_diameter(sectors, engine_order)
    return number - sectors if 2 * number > sectors else number


def nodal_diameter_in_words(sectors: int, engine_order: int) -> str:
    """The nodal diameter of the first harmonic, and which way it runs."""
    number = nodal_diameter(sectors, engine_order)
    if number == 0:
        return "nodal diameter 0: all sectors move alike"
    if 2 * number == sectors:
        return f"nodal diameter {number}: a standing wave, neighbours against each other"
    return f"nodal diameter {min(number, sectors - number)}, running {'back' if 2 * number > sectors else 'for'}ward"


def check_cyclic(job: Job) -> list[Fault]:
    """Keys of a sector that are missing, that contradict one another, or that nothing here takes yet."""
    across = [f"contact[{i}] {key}" for i, contact in enumerate(job["contact"]) for key in _next_keys(contact)]
    across += [f"contact_set[{i}] across" for i, keys in enumerate(job["contact_set"]) if keys["across"]]
    if not is_cyclic(job):
        return [job.fault(key, "given", "a table [cyclic], which says what the next sector is") for key in across]
    checks = (_check_boundary, _check_interface, _check_axis, _check_rotation, _check_next_rows, _check_sets_across)
    faults = [fault for check in checks for fault in check(job)]
    for table, key, refused, expected in _not_with_a_sector(job):
        if refused:
            faults.append(job.fault(f"[{table}] {key}", job[table][key], f"{expected} with [cyclic]"))
    return faults


def take_no_sector(job: Job, command: str) -> None:
    """Refuse one sector of a wheel, for a command that cannot take it.

    Raises
    ------
    InputError : the model is a sector
    """
    if is_cyclic(job):
        expected = f"no such table: attrito {command} does not take one sector of a wheel"
        raise InputError(job.fault("[cyclic]", "given", expected))


def _not_with_a_sector(job: Job) -> list[tuple[str, str, bool, str]]:
    """Table, key, whether it is at fault, and what is expected."""
    suspended = job["model"]["suspension_hz"] is not None
    return [
        ("model", "suspension_hz", suspended, "no such key: a wheel is held,"),
        ("stability", "orbit", job["stability"]["orbit"] == "exact", '"balance" or "auto", which here is the same,'),
    ]


def _next_keys(contact: dict[str, Any]) -> list[str]:
    return [key for key in ("normal_next", "tangents_next") if contact[key] is not None]


def _check_boundary(job: Job) -> list[Fault]:
    """Both sides or none, of one kind, of equal length, no dof twice."""
    lower, upper = job["cyclic"]["lower"], job["cyclic"]["upper"]
    if isinstance(lower, str) and job["cyclic"]["on_axis"]:
        expected = "no such key beside node sets, whose nodes on the axis are found by their places"
        return [job.fault("[cyclic] on_axis", "given", expected)]
    if not isinstance(lower, str) and job["cyclic"]["tolerance"] is not None:
        return [job.fault("[cyclic] tolerance", job["cyclic"]["tolerance"], "no such key without node sets")]
    if (lower is None) != (upper is None):
        missing, other = ("lower", "upper") if lower is None else ("upper", "lower")
        return [job.fault(f"[cyclic] {missing}", "missing", f"this key, to go with {other}")]
    if lower is None:
        return []
    if isinstance(lower, str) != isinstance(upper, str):
        return [job.fault("[cyclic] upper", upper, "a node set or a list of dofs, as lower is")]
    if isinstance(lower, str):
        return [job.fault("[cyclic] upper", upper, "a node set other than lower")] if lower == upper else []
    faults = []
    if len(lower) != len(upper):
        expected = f"{len(lower)} dofs, one for each of lower"
        faults.append(job.fault("[cyclic] upper", f"{len(upper)} dofs", expected))
    for name, dofs in (("lower", lower), ("upper", upper)):
        twice = [dof for i, dof in enumerate(dofs) if dof in dofs[:i]]
        if twice:
            faults.append(job.fault(f"[cyclic] {name}", _shown(twice[0]), "dofs that differ"))
    both = [dof for dof in upper if dof in lower]
    if both:
        expected = "dofs that are not in lower; those of a node on the axis go into on_axis"
        faults.append(job.fault("[cyclic] upper", _shown(both[0]), expected))
    return faults


def _check_interface(job: Job) -> list[Fault]:
    """Interface modes are of a boundary, and of a reduced model."""
    asked = job["cyclic"]["interface_modes"]
    if asked == "all" or ("reduction" in job.given and job["cyclic"]["lower"] is not None):
        return []
    return [job.fault("[cyclic] interface_modes", asked, '"all" without [reduction] or without lower and upper')]


def _shown(dof: Any) -> Any:
    return list(dof) if isinstance(dof, tuple) else dof


def _check_axis(job: Job) -> list[Fault]:
    """Node sets are paired by a rotation about the axis; between dofs nothing is turned."""
    cyclic = job["cyclic"]
    faults = []
    turns = isinstance(cyclic["lower"], str) or any(keys["across"] for keys in job["contact_set"])
    for key in ("axis_point", "axis_direction"):
        if turns and cyclic[key] is None:
            faults.append(
                job.fault(f"[cyclic] {key}", "missing", "this key, since node sets are turned about the axis")
            )
    if cyclic["axis_direction"] is not None and not any(cyclic["axis_direction"]):
        faults.append(job.fault("[cyclic] axis_direction", cyclic["axis_direction"], "a vector that is not zero"))
    return faults


def _check_rotation(job: Job) -> list[Fault]:
    """A wheel turns about its own axis: about another the sectors' loads are not the same."""
    point, direction = job["cyclic"]["axis_point"], job["cyclic"]["axis_direction"]
    if point is None or direction is None or not any(direction):
        return []
    faults = []
    for i, load in enumerate(job["load"]):
        other, way = load["axis_point"], load["axis_direction"]
        if load["kind"] != "centrifugal" or other is None or way is None:
            continue
        if beside(way, direction) > SAME_AXIS * math.hypot(*way):
            expected = f"{direction}, the axis_direction of [cyclic], or its opposite: the sectors' loads are the same"
            faults.append(job.fault(f"load[{i}] axis_direction", way, expected))
        arm = [mine - its for mine, its in zip(other, point, strict=True)]
        if beside(arm, direction) > SAME_AXIS * (math.hypot(*other) + math.hypot(*point)):
            expected = f"a point of the axis of [cyclic], which goes through {point}"
            faults.append(job.fault(f"load[{i}] axis_point", other, expected))
    return faults


def beside(vector: list[float], direction: list[float]) -> float:
    """How far a vector leads away from a line."""
    (a, b, c), (d, e, f) = vector, direction
    return math.hypot(b * f - c * e, c * d - a * f, a * e - b * d) / math.hypot(d, e, f)


def _check_next_rows(job: Job) -> list[Fault]:
    faults = []
    for i, contact in enumerate(job["contact"]):
        given = _next_keys(contact)
        missing = "tangents_next" if given == ["normal_next"] else "normal_next"
        if len(given) == 1 and (missing == "tangents_next" or contact["normal"] is not None):
            faults.append(job.fault(f"contact[{i}] {missing}", "missing", f"this key, to go with {given[0]}"))
        elif given and contact["tangents"] and len(contact["tangents_next"]) != len(contact["tangents"]):
            count = len(contact["tangents"])
            expected = f"{count}, one for each of tangents"
            faults.append(job.fault(f"contact[{i}] tangents_next", len(contact["tangents_next"]), expected))
    return faults


def _check_sets_across(job: Job) -> list[Fault]:
    return [
        job.fault(f"contact_set[{i}] across", True, "false on the ground, which is of no sector")
        for i, keys in enumerate(job["contact_set"])
        if keys["across"] and keys["b"] == "ground"
    ]
