"""Derivatives of a job's points by extrapolated differences, and what they are compared with."""

from __future__ import annotations

import copy
import csv
import io
from pathlib import Path

import numpy as np
import pytest
from jobs import Job, attrito_here, write_job

LAW = ("tangential_stiffness", "normal_stiffness", "friction_coefficient", "gap", "preload")
# Step of the differences by events, part of the parameter: two are extrapolated, which leaves its fourth power.
STEP = 1e-3
# By samples forces have a kink wherever a sample changes its regime: few lie within so small a step.
SHORT_STEP = 1e-6


def pressed(job: Job, **law: float) -> Job:
    """The job with preload in its contacts, and other numbers of their laws."""
    return job | {"contact": [contact | {"preload": 30.0} | law for contact in job["contact"]]}


def by_contact(job: Job, keys: tuple[str, ...] = LAW) -> list[str]:
    """All parameters of all contacts, the static load and the level."""
    return [f"contact[{i}].{key}" for i in range(len(job["contact"])) for key in keys] + [
        f"load.{job['load'][0]['name']}",
        "level",
    ]


def with_parameter(job: Job, name: str, change: float) -> tuple[Job, float]:
    """The job with a parameter changed by a part of its scale, and that change."""
    job = copy.deepcopy(job)
    if name == "level":
        job["sweep"]["levels"] = [level + change for level in job["sweep"].get("levels", [1.0])]
        return job, change
    if name in ("damping.ratio", "damping.loss_factor"):
        change *= job["damping"][name[8:]]
        job["damping"][name[8:]] += change
        return job, change
    if name.startswith("damping."):
        value = job["damping"]["rayleigh"]
        value[int(name[-2])] += change * value[int(name[-2])]
        return job, value[int(name[-2])] * change / (1.0 + change)
    if name.startswith("load."):
        loads = [load for load in job["load"] if load.get("name") == name[5:]]
        for load in loads:
            for key in {"dofs", "cosine", "sine"} & set(load):
                load[key] = [[dof, force * (1.0 + change)] for dof, force in load[key]]
        return job, change
    contact = job["contact"][int(name[8])]
    key = name.split(".")[1]
    if key.endswith("]"):
        row = contact["friction_coefficient"][int(key[-2])]
        change *= row[1]
        row[1] += change
        return job, change
    # The gap is zero: its scale is that of forces of some ten newtons.
    scale = contact.get(key) or 30.0 / contact["normal_stiffness"]
    contact[key] = contact.get(key, 0.0) + change * scale
    return job, change * scale


def solved(folder: Path, job: Job, capfd: pytest.CaptureFixture[str], *options: str) -> list[dict[str, str]]:
    """A table of a job's points."""
    done = attrito_here(folder, capfd, "run", write_job(folder, job))
    assert done.returncode == 0, done.stderr
    done = attrito_here(folder, capfd, "table", "result.h5", *options)
    return list(csv.DictReader(io.StringIO(done.stdout)))


def differences(folder: Path, job: Job, name: str, reach: float, capfd: pytest.CaptureFixture[str]) -> np.ndarray:
    """Derivatives of amplitudes and means `[points, 2 monitors]` by extrapolated central differences."""
    monitors = [monitor["name"] for monitor in job["output"]["monitors"]]
    slopes = []
    for step in (reach, 2.0 * reach):
        values = []
        for side in (-1.0, 1.0):
            other, change = with_parameter(job, name, side * step)
            rows = solved(folder, other, capfd)
            values.append([[float(row[f"{m}_{q}"]) for m in monitors for q in ("amplitude", "mean")] for row in rows])
        slopes.append((np.array(values[1]) - np.array(values[0])) / (2.0 * change))
    return (4.0 * slopes[0] - slopes[1]) / 3.0


def compared(
    folder: Path,
    job: Job,
    reach: float,
    tolerance: float,
    capfd: pytest.CaptureFixture[str],
    names: list[str] | None = None,
) -> None:
    """Every derivative, by all parameters unless some are given, is that by differences.

    To a part of the point's largest |p dA/dp|.
    """
    names = names or by_contact(job)
    rows = solved(folder, job | {"sensitivity": {"to": names}}, capfd, "--sensitivities")
    points = 1 + max(int(row["point"]) for row in rows)
    found = np.array([float(row["derivative"]) for row in rows]).reshape(points, -1, len(names))
    errors, sizes = [], []
    for number, name in enumerate(names):
        _, scale = with_parameter(job, name, 1.0)
        expected = differences(folder, job, name, reach, capfd)
        errors.append(np.abs(found[:, :, number] - expected) * abs(scale))
        sizes.append(np.abs(expected) * abs(scale))
    largest = np.max(sizes, axis=(0, 2))
    assert np.all(largest > 0.0)
    worst = np.max(errors, axis=(0, 2)) / largest
    assert np.all(worst < tolerance), f"{dict(zip(names, np.max(errors, axis=(1, 2)) / largest.max(), strict=True))}"
