"""A job in other units, and results told in those of before."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import h5py
import numpy as np
from jobs import Job

HERTZ = (("sweep", ("start_hz", "stop_hz", "frequencies_hz")), ("integrate", ("frequency_hz",)), ("peak", ("near_hz",)))


@dataclass(frozen=True)
class Units:
    """What numbers of time, length and mass are multiplied by."""

    time: float = 1.0
    length: float = 1.0
    mass: float = 1.0

    def factor(self, unit: str) -> float:
        """What numbers of a dataset's unit are multiplied by: `user force*time/length`."""
        force = self.mass * self.length / self.time**2
        names = {
            "time": self.time,
            "length": self.length,
            "mass": self.mass,
            "force": force,
            "energy": force * self.length,
            "area": self.length**2,
            "Hz": 1.0 / self.time,
        }
        return eval(unit.replace("user ", "").replace("^", "**") or "1", {"rad": 1.0, "s": self.time} | names)

    def job(self, job: Job) -> Job:
        """The same job in these units."""
        job = copy.deepcopy(job)
        stiffness = self.factor("force/length")
        model = {"mass": self.mass, "stiffness": stiffness, "damping": stiffness * self.time}
        law = {"tangential_stiffness": stiffness, "normal_stiffness": stiffness}
        law |= {"gap": self.length, "preload": self.factor("force")}
        for table, factors in ((job["model"], model), *((contact, law) for contact in job["contact"])):
            for key in factors.keys() & table.keys():
                table[key] = (np.array(table[key]) * factors[key]).tolist()
        if "rayleigh" in job.get("damping", {}):
            alpha, beta = job["damping"]["rayleigh"]
            job["damping"]["rayleigh"] = [alpha / self.time, beta * self.time]
        for load in job["load"]:
            for key in {"dofs", "cosine", "sine"} & load.keys():
                load[key] = [[dof, value * self.factor("force")] for dof, value in load[key]]
        for name, keys in HERTZ:
            table = job.get(name, {})
            for key in set(keys) & table.keys():
                table[key] = (np.array(table[key]) / self.time).tolist()
        return job


def numbers(path, units: Units | None = None) -> dict[str, np.ndarray]:
    """All numbers of a result by their path, in the units of before."""
    found = {}

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
            factor = (units or Units()).factor(item.attrs.get("unit", "1"))
            found[name] = np.asarray(item[()], dtype=float) / factor

    with h5py.File(path) as file:
        file.visititems(note)
    return found
