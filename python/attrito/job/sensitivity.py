"""`[sensitivity]`: the parameters that derivatives are asked for, and what each changes of a scene."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from attrito.job.job import Job
from attrito.job.laws import LAW_KEYS
from attrito.support.errors import Fault

EXPECTED = (
    'one of "contact[0].KEY" or "contact_set[0].KEY", "[*]" for all, KEY one of ' + ", ".join(LAW_KEYS) + ";"
    ' "load.NAME" of a static load; or "level"'
)

STIFFNESSES = ("tangential_stiffness", "normal_stiffness")
BY_STIFFNESS = "no contact stiffness with [damping] ratio, a ratio of the stuck modes: they change with it"


@dataclass(frozen=True)
class Parameter:
    """A parameter of a job.

    Parameters
    ----------
    name : as the job has it
    places : tables and numbers of their entries that have it; none: a load or the level
    key : the key of these, or the load's name
    """

    name: str
    places: tuple[tuple[str, int], ...]
    key: str

    def value(self, job: Job) -> float:
        """Its value in a job; of a load the factor 1, of entries with several values, and of the level, NaN."""
        if not self.places:
            return 1.0 if self.key else np.nan
        values = {float(job[table][number][self.key]) for table, number in self.places}
        return values.pop() if len(values) == 1 else np.nan

    def moved(self, job: Job, change: float) -> Job:
        """A job in which it is larger by `change`."""
        tables = job.tables | {table: list(job[table]) for table in {table for table, _ in self.places}}
        for table, number in self.places:
            entry = tables[table][number]
            tables[table][number] = entry | {self.key: entry[self.key] + change}
        return Job(job.path, tables, job.given)


def parameters_of(job: Job) -> list[Parameter]:
    """The parameters that a checked job asks derivatives for."""
    return [_parameter(job, name) for name in job["sensitivity"]["to"]]


def check_sensitivity(job: Job) -> list[Fault]:
    """What is no parameter of a job, and jobs of a kind that has no derivatives."""
    names = job["sensitivity"]["to"]
    if not names:
        return []
    faults = [
        job.fault(f"[{table}] {key}", job[table][key], f'"{fine}" with [sensitivity]')
        for table, key, fine in (("balance", "approach", "coupled"), ("balance", "contacts", "all"))
        if job[table][key] != fine
    ]
    if "cyclic" in job.given:
        faults.append(
            job.fault("[sensitivity] to", names, "no such key with [cyclic]: derivatives are of whole models")
        )
    for number, name in enumerate(names):
        try:
            found = _parameter(job, name)
            if job["damping"]["ratio"] is not None and found.key in STIFFNESSES and found.places:
                raise ValueError(BY_STIFFNESS)
        except ValueError as error:
            faults.append(job.fault(f"[sensitivity] to[{number}]", name, str(error)))
    return faults


def _parameter(job: Job, name: str) -> Parameter:
    if name == "level":
        return Parameter(name, (), "")
    if (load := re.fullmatch(r"load\.(.+)", name)) is not None:
        static = [keys["name"] for keys in job["load"] if keys["kind"] == "static"]
        if load[1] not in static:
            raise ValueError(f"the name of a static load: {', '.join(map(str, static)) or 'there is none'}")
        return Parameter(name, (), load[1])
    entry = re.fullmatch(r"(contact|contact_set)\[(\d+|\*)\]\.(\w+)", name)
    if entry is None or entry[3] not in LAW_KEYS:
        raise ValueError(EXPECTED)
    table, place, key = entry.groups()
    numbers = range(len(job[table])) if place == "*" else [int(place)]
    if not numbers or max(numbers) >= len(job[table]):
        raise ValueError(f"one of the job's [[{table}]], of which there are {len(job[table])}, counted from 0")
    for number in numbers:
        value = job[table][number][key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"a parameter that is a number; {table}[{number}].{key} is {value!r}")
        if key == "friction_coefficient" and value == 0.0:
            raise ValueError(f"a friction coefficient above 0, where forces have a derivative by it; {table}[{number}]")
    return Parameter(name, tuple((table, number) for number in numbers), key)
