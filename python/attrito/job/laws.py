"""What contact laws ask of a job: their own keys, the numbers that the library makes them of, who takes them.

A contact law has one entry in `RULES`, by its name in `attrito.library.names.LAWS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from attrito.job.job import Job
from attrito.support.errors import Fault

Keys = dict[str, Any]
TABLES = ("contact", "contact_set")
# Numbers of every law
LAW_KEYS = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# Further ones, of some laws
FURTHER_KEYS = ("chi", "beta")


@dataclass(frozen=True)
class Rules:
    """What one law asks for.

    Parameters
    ----------
    own : keys that only contacts of this law have, by table name or for both ("")
    needs : of these what is expected where one is missing; others may be
    numbers : what the library makes the law of, in the order of its constructor there, from the keys and a pair's area
    is_proportional : whether the limit of friction is proportional to N, as stability and events in time need
    by_pressure : whether the friction coefficient is a table by pressure
    one_element : whether a contact has one slider, as integration in time needs, or several in parallel
    """

    own: dict[str, tuple[str, ...]] = field(default_factory=dict)
    needs: dict[str, str] = field(default_factory=dict)
    numbers: Callable[[Keys, float], list[float]] = lambda keys, area: []
    is_proportional: bool = True
    by_pressure: bool = False
    one_element: bool = True


def _pressure_numbers(keys: Keys, area: float) -> list[float]:
    return [keys.get("area") or area, *(number for pair in keys["friction_coefficient"] for number in pair)]


def _iwan_numbers(keys: Keys, area: float) -> list[float]:
    return [keys["chi"], keys["beta"], SLIDERS if keys["sliders"] is None else keys["sliders"]]


# Of Iwan's model unless given
SLIDERS = 20

RULES = {
    "coulomb": Rules(),
    "pressure": Rules(
        own={"contact": ("area",)},
        needs={"area": "the contact area"},
        numbers=_pressure_numbers,
        is_proportional=False,
        by_pressure=True,
    ),
    "iwan": Rules(
        own={"": ("chi", "beta", "sliders")},
        needs={"chi": "a number above -1, below 0", "beta": "a number of at least 0"},
        numbers=_iwan_numbers,
        one_element=False,
    ),
}


def laws_of(job: Job) -> dict[str, str]:
    """Laws of a job's contacts by the keys that ask for them."""
    keys = {f"{name}[{i}] law": keys.get("law") for name in TABLES for i, keys in enumerate(job[name])}
    return {key: law for key, law in keys.items() if law is not None}


def laws_beside_coulomb(job: Job) -> dict[str, str]:
    """Contact laws without friction cones, by the keys that ask for them."""
    return {key: law for key, law in laws_of(job).items() if law != "coulomb"}


def laws_not_proportional(job: Job) -> dict[str, str]:
    """Contact laws whose limit is no multiple of the normal force, by the keys that ask for them."""
    return {key: law for key, law in laws_of(job).items() if not RULES[law].is_proportional}


def laws_in_parallel(job: Job) -> dict[str, str]:
    """Contact laws of several elements in parallel, by the keys that ask for them."""
    return {key: law for key, law in laws_of(job).items() if not RULES[law].one_element}


def check_laws(job: Job) -> list[Fault]:
    """Keys that do not go with a contact's law, and engines that do not take it."""
    faults = []
    for name in TABLES:
        for i, keys in enumerate(job[name]):
            if keys["law"] is not None:
                faults += _check_keys(job, name, f"{name}[{i}]", keys)
    for key, law in laws_beside_coulomb(job).items():
        if job["stability"]["method"] != "none":
            faults.append(job.fault(key, law, '"coulomb" where stability is examined, or [stability] method = "none"'))
        if job["static"]["bounds"] == "sampled":
            faults.append(job.fault(key, law, '"coulomb" where bounds are sampled, or [static] bounds = "none"'))
    return faults


def _check_keys(job: Job, name: str, place: str, keys: Keys) -> list[Fault]:
    """One contact's, or one set's."""
    faults = []
    law, friction = keys["law"], keys["friction_coefficient"]
    by_pressure = RULES[law].by_pressure
    if friction is not None and isinstance(friction, list) != by_pressure:
        expected = f'{"[[pressure, coefficient], ...]" if by_pressure else "a number"} with law = "{law}"'
        faults.append(job.fault(f"{place} friction_coefficient", friction, expected))
    for other, rules in RULES.items():
        for key in (*rules.own.get(name, ()), *rules.own.get("", ())):
            if other != law and keys[key] is not None:
                faults.append(job.fault(f"{place} {key}", keys[key], f'no such key but with law = "{other}"'))
            if other == law and key in rules.needs and keys[key] is None:
                faults.append(job.fault(f"{place} {key}", "missing", f'{rules.needs[key]}, with law = "{law}"'))
    return faults
