"""Coriolis forces: which keys ask for them, what they need, and what does not take them."""

from __future__ import annotations

from typing import Any

from attrito.job.job import Job
from attrito.support.errors import Fault, InputError

# What all refusals of a command or a key have in common
WITH_CORIOLIS = "without Coriolis forces"


def asking_key(job: Job) -> str | None:
    """The key that asks for Coriolis forces; None: there are none."""
    if job["cyclic"]["coriolis"] and "cyclic" in job.given:
        return "[cyclic] coriolis"
    for i, load in enumerate(job["load"]):
        if load["kind"] == "centrifugal" and load["coriolis"]:
            return f"load[{i}] coriolis"
    return "[model] gyroscopic" if job["model"]["gyroscopic"] is not None else None


def turning_load(job: Job) -> dict[str, Any] | None:
    """The centrifugal load whose rotation the Coriolis forces are of; None where there is none."""
    turning = [load for load in job["load"] if load["kind"] == "centrifugal"]
    asked = [load for load in turning if load["coriolis"]]
    return next(iter(asked or turning), None)


def check_coriolis(job: Job) -> list[Fault]:
    """What Coriolis forces lack, and what does not take them."""
    key = asking_key(job)
    given, speed = job["model"]["gyroscopic"], job["model"]["gyroscopic_hz"]
    if key is None:
        expected = "no such key without gyroscopic"
        return [] if speed is None else [job.fault("[model] gyroscopic_hz", speed, expected)]
    faults = []
    if "cyclic" in job.given and not job["cyclic"]["coriolis"]:
        faults.append(job.fault("[cyclic] coriolis", False, f"true, to go with {key}"))
    if given is not None:
        if key.startswith("load"):
            faults.append(job.fault(key, True, "false beside [model] gyroscopic, which has the Coriolis forces"))
    elif speed is not None:
        faults.append(job.fault("[model] gyroscopic_hz", speed, "no such key without gyroscopic"))
    else:
        faults += _check_load(job, key)
    refused = [
        (
            "mode",
            "method",
            "mode" in job.given,
            job["mode"]["method"],
            f"no table [mode]: modes are followed {WITH_CORIOLIS}",
        ),
        (
            "sensitivity",
            "to",
            bool(job["sensitivity"]["to"]),
            job["sensitivity"]["to"],
            f"no such key: derivatives are {WITH_CORIOLIS}",
        ),
    ]
    return faults + [
        job.fault(f"[{table}] {name}", value, words) for table, name, wrong, value, words in refused if wrong
    ]


def _check_load(job: Job, key: str) -> list[Fault]:
    """One load says how fast what turns; the speed is that of its factor 1."""
    turning = [(i, load) for i, load in enumerate(job["load"]) if load["kind"] == "centrifugal"]
    if not turning:
        expected = "false without a [[load]] of kind centrifugal, whose speed they are of, or [model] gyroscopic"
        return [job.fault(key, True, expected)]
    if len(turning) > 1:
        place = f"load[{turning[1][0]}] kind"
        return [job.fault(place, "centrifugal", "one centrifugal load with Coriolis forces, which are of its speed")]
    (_, load), path = turning[0], job["static"]["load_path"]
    if load["name"] is None:
        return []
    factor = path[-1].get(load["name"], 0.0) if isinstance(path[-1], dict) else path[-1]
    if factor == 1.0:
        return []
    expected = f"1 at the end for {load['name']}: the Coriolis forces are of its speed_hz"
    return [job.fault(f"[static] load_path[{len(path) - 1}]", factor, expected)]


def take_no_coriolis(job: Job, command: str) -> None:
    """Refuse Coriolis forces, for a command that does not know them.

    Raises
    ------
    InputError : the job asks for them
    """
    key = asking_key(job)
    if key is not None:
        raise InputError(job.fault(key, "given", f"no Coriolis forces with attrito {command}"))
