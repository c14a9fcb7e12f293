"""A wedge whose contact slips, and a fit of its stiffness and friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jobs import Job, toml, wedge

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
    job["balance"] = {"harmonics": 3, "quadrature": "event"}
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
