"""A wedge whose contact slips, and a fit of its stiffness and friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jobs import Job, run, table, toml, wedge, write_job

STIFFNESS, FRICTION = 3.0e5, 0.5
FREQUENCIES = np.linspace(110.0, 140.0, 9).tolist()
KEYS = {
    "contact stiffness": ["contact[*].tangential_stiffness", "contact[*].normal_stiffness"],
    "friction coefficient": ["contact[*].friction_coefficient"],
}


def rubbing(force: float = 30.0) -> Job:
    """A wedge whose contact slips at most of the frequencies."""
    job = wedge(STIFFNESS, force)
    job["contact"] = [contact | {"preload": 30.0} for contact in job["contact"]]
    job["balance"] = {"harmonics": 3}
    job["sweep"] = {"frequencies_hz": FREQUENCIES}
    return job


def write_fit(folder: Path, **keys: object) -> str:
    """A fit of both parameters from half of their values, to `measured.csv`."""
    given = {
        "job": "job.toml",
        "parameter": [
            {"name": name, "keys": KEYS[name], "low": 0.1 * value, "high": 10.0 * value, "start": 0.5 * value}
            for name, value in zip(KEYS, (STIFFNESS, FRICTION), strict=True)
        ],
        "data": [{"name": "response", "file": "measured.csv", "monitor": "x"}],
    } | keys
    (folder / "fit.toml").write_text(toml(given))
    return str(folder / "fit.toml")


def measured(folder: Path, job: Job, noise: float = 0.0, monitor: str = "x") -> None:
    """The job's own response as a measurement."""
    write_job(folder, job)
    run(folder, job)
    random = np.random.default_rng(7)
    with open(folder / "measured.csv", "w") as stream:
        stream.write(f"# made by a test\nfrequency_hz,{monitor}_amplitude\n")
        for row in table(folder):
            factor = np.exp(noise * random.standard_normal())
            stream.write(f"{row['frequency_hz']},{factor * float(row[f'{monitor}_amplitude']):.15g}\n")
