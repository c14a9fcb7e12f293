"""Small jobs as dictionaries, written as TOML, and the command `attrito` run on them as a user would."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import synthetic
from scipy.sparse import csr_matrix, diags

from attrito.cli import main
from attrito.model.model import Model
from attrito.model.model_file import write_model

# Seconds until something counts as hung. No test asks how fast a machine is: it waits for a state, or for an end.
TIMEOUT = 600.0
ROOT_HALF = 0.5**0.5
ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    # Tests run side by side: a rank that waits leaves its core to the others, and none is tied to one that is busy.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OPENBLAS_NUM_THREADS": "1",
}

Job = dict[str, Any]


def clean_environment() -> dict[str, str]:
    """For what this MPI process starts and what must not take itself for its descendant."""
    own = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMIX_", "OPAL_"))}
    return own | ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(sys.path)}


def attrito(folder: Path, *arguments: str, ranks: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, under mpirun where a number of ranks is given; a hang is a failure."""
    command = [sys.executable, "-m", "attrito.cli", *arguments]
    if ranks is not None:
        command = ["mpirun", "-n", str(ranks), *command]
    return subprocess.run(
        command, cwd=folder, env=os.environ | ENVIRONMENT, capture_output=True, text=True, timeout=TIMEOUT, check=False
    )


def attrito_here(folder: Path, capfd: pytest.CaptureFixture[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """The same without a process of its own, which is quick; what is not caught is raised here."""
    with contextlib.chdir(folder):
        code = main(arguments)
    out, err = capfd.readouterr()
    return subprocess.CompletedProcess(arguments, code, out, err)


def without_lines(said: str) -> str:
    """What was said of a job, without the numbers of its lines."""
    return re.sub(r"(\.toml):\d+: ", r"\1: ", said)


def wait_for(ready: Callable[[], bool], running: subprocess.Popen | None = None) -> None:
    """Until something holds; a hang is a failure, and so is the end of what is running before."""
    end = time.monotonic() + TIMEOUT
    while not ready():
        assert running is None or running.poll() is None, "it ended too soon"
        assert time.monotonic() < end, "it hangs"
        time.sleep(0.01)


def toml(job: Job) -> str:
    """A job as TOML: tables, and lists of tables."""
    lines = []
    for name, table in job.items():
        rows = table if isinstance(table, list) else [table]
        for row in rows:
            if not isinstance(row, dict):
                lines.insert(0, f"{name} = {_value(table)}")
                break
            lines.append(f"[[{name}]]" if isinstance(table, list) else f"[{name}]")
            lines += [f"{key} = {_value(value)}" for key, value in row.items()]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


def write_job(folder: Path, job: Job, name: str = "job.toml") -> str:
    """Write a job into a folder; returns its name there."""
    (folder / name).write_text(toml(job))
    return name


def run(folder: Path, job: Job, ranks: int | None = None, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run a job that is expected to end with an exit code."""
    done = attrito(folder, "run", write_job(folder, job), ranks=ranks)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def table(folder: Path, *options: str, result: str = "result.h5") -> list[dict[str, str]]:
    """The rows of `attrito table`."""
    done = attrito(folder, "table", result, *options)
    assert done.returncode == 0, done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


def wedge(stiffness: float = 3.0e5, force: float = 5.0) -> Job:
    """The wedge of docs and paper at 45 degrees, unrounded parameters, at 132 Hz; force along the contact's tangent."""
    omega_x, omega_y = 2 * np.pi * 100.0, 2 * np.pi * 250.0
    damping = float(20 * np.pi)
    return {
        "model": {
            "mass": [[1.0, 0.0], [0.0, 1.0]],
            "stiffness": [[omega_x**2, 0.0], [0.0, omega_y**2]],
            "damping": [[damping, 0.0], [0.0, damping]],
        },
        "contact": [
            {
                "normal": [[0, ROOT_HALF], [1, ROOT_HALF]],
                "tangents": [[[0, -ROOT_HALF], [1, ROOT_HALF]]],
                "tangential_stiffness": stiffness,
                "normal_stiffness": stiffness,
                "friction_coefficient": 0.5,
            }
        ],
        "load": [
            {"name": "preload", "kind": "static", "dofs": [[1, 420.0]]},
            {
                "name": "excitation",
                "kind": "harmonic",
                "cosine": [[0, -force * ROOT_HALF], [1, force * ROOT_HALF]],
            },
        ],
        "static": {},
        "balance": {"harmonics": 5},
        "sweep": {"frequencies_hz": [132.0]},
        "output": {
            "file": "result.h5",
            "monitors": [{"name": "x", "dofs": [[0, 1.0]]}, {"name": "y", "dofs": [[1, 1.0]]}],
        },
    }


def everything(folder: Path, job: Job, ranks: int | None = None) -> dict[str, Any]:
    """Arrays of a job's result by their path."""
    run(folder, job, ranks)
    data: dict[str, Any] = {}
    with h5py.File(folder / "result.h5") as file:
        file.visititems(lambda name, item: data.update({name: item[()]} if isinstance(item, h5py.Dataset) else {}))
    return data


def chain(contacts: int = 3, tangents: int = 1) -> Job:
    """A chain of masses in space, every one of them pressed against a wall and rubbing on it, driven at its end."""
    masses = contacts
    size = (tangents + 1) * masses
    spring, ground = 2.0e5, 1.0e5
    ladder = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    stiffness = np.kron(np.eye(tangents + 1), spring * ladder) + ground * np.eye(size)
    law = {"tangential_stiffness": 1.5e5, "normal_stiffness": 3.0e5, "friction_coefficient": 0.4}
    normal = [tangents * masses + i for i in range(masses)]
    # A little of the tangential motion presses, so that the normal load varies.
    tilt = 0.2
    return {
        "model": {"mass": np.eye(size).tolist(), "stiffness": stiffness.tolist()},
        "damping": {"ratio": 0.01},
        "contact": [
            {
                "normal": [[normal[i], 1.0], [i, tilt]],
                "tangents": [[[t * masses + i, 1.0], [normal[i], -tilt]] for t in range(tangents)],
                **law,
            }
            for i in range(masses)
        ],
        "load": [
            {"name": "press", "kind": "static", "dofs": [[dof, 40.0 + 10.0 * i] for i, dof in enumerate(normal)]},
            {
                "name": "shake",
                "kind": "harmonic",
                "cosine": [[0, 12.0]],
                "sine": [[(tangents - 1) * masses, 6.0]],
            },
        ],
        "static": {},
        "balance": {"harmonics": 3},
        "sweep": {"start_hz": 85.0, "stop_hz": 70.0},
        "output": {"file": "result.h5", "monitors": [{"name": "end", "dofs": [[0, 1.0]]}]},
    }


def by_pressure(job: Job) -> Job:
    """The job with one coefficient for all pressures: the same friction by another law."""
    for contact in job["contact"]:
        contact |= {"law": "pressure", "friction_coefficient": [[1.0, contact["friction_coefficient"]]], "area": 1.0}
    return job


def write_blocks(path: Path, *, floating: bool = False, **sets: list[int]) -> Model:
    """A model file: two boxes, one on the other, on springs; sets `top` and `bottom` meet, `tip` is one node.

    The nodes of the lowest layer are held (`held`); `floating` cuts the highest layer off from everything.
    """
    model = synthetic.joint("C3D8", held=lambda points: points[:, 2] < 1e-9)
    points, ids = model.coordinates, model.node_ids
    model.node_sets["tip"] = ids[np.lexsort(points.T)[-1:]]
    model.node_sets["held"] = ids[points[:, 2] < 1e-9]
    model.node_sets["empty"] = np.empty(0, dtype=np.int64)
    model.node_sets |= {name: np.array(nodes, dtype=np.int64) for name, nodes in sets.items()}
    place = np.argsort(ids)[np.searchsorted(np.sort(ids), model.dof_node)]
    ground = np.full(model.size, 1.0e5)
    highest = points[place][:, 2] > 1.5
    if floating:
        ground[highest] = 0.0
    # Springs between neighbours of one box, the same in every direction.
    distance = np.linalg.norm(points[place][:, None] - points[place][None, :], axis=2)
    upper = place >= len(ids) // 2
    linked = (distance > 1e-9) & (distance < 1.01) & (upper[:, None] == upper[None, :])
    linked &= model.dof_direction[:, None] == model.dof_direction[None, :]
    if floating:
        linked &= highest[:, None] == highest[None, :]
    springs = 1.0e6 * (np.diag(linked.sum(axis=1)) - linked) + diags(ground).toarray()
    model.stiffness, model.mass = csr_matrix(springs), csr_matrix(np.eye(model.size))
    write_model(path, model, [])
    return model


def blocks() -> Job:
    """A job on the model of `write_blocks`, reduced."""
    return {
        "model": {"file": "model.h5"},
        "damping": {"ratio": 0.01},
        "reduction": {"modes": 5},
        "contact_set": [
            {
                "a": "top",
                "b": "bottom",
                "tolerance": 1.0e-3,
                "tangents": 2,
                "normal_stiffness": 1.0e6,
                "tangential_stiffness": 1.0e6,
                "friction_coefficient": 0.3,
            }
        ],
        "load": [
            {
                "name": "press",
                "kind": "static",
                "dofs": [[["node", "tip", "z"], -500.0], [["node", "tip", "x"], 100.0]],
            },
            {"name": "shake", "kind": "harmonic", "cosine": [[["node", "tip", "x"], 50.0]]},
        ],
        "balance": {"harmonics": 1},
        "sweep": {"frequencies_hz": [60.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "tip", "dofs": [[["node", "tip", "x"], 1.0]]}]},
    }


def examined(job: Job, method: str = "both", **keys: Any) -> Job:
    """The job with its stability examined."""
    job["stability"] = {"method": method, **keys}
    return job


def stiff_wedge(frequencies: list[float], harmonics: int = 10) -> Job:
    """Stiff contacts, 20 N of preload, 60 N along x: half the orbits over 85 to 140 Hz are unstable."""
    job = wedge(stiffness=3.0e6)
    job["load"][0]["dofs"] = [[1, 20.0]]
    job["load"][1]["cosine"] = [[0, 60.0]]
    job["balance"]["harmonics"] = harmonics
    job["sweep"] = {"frequencies_hz": frequencies}
    return job


def swept(job: Job, start: float, stop: float, /, **continuation: object) -> Job:
    """The job as a sweep."""
    job["sweep"] = {"start_hz": start, "stop_hz": stop}
    job["continuation"] = continuation
    return job


def peak_of_wedge(**peak: Any) -> Job:
    """The wedge's peak followed over levels from 1 to 20."""
    made = wedge(force=1.0)
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["peak"] = {"start": 1.0, "stop": 20.0, "values": [6.0, 12.0]} | peak
    return made
