"""The preload at which the wedge's peak is least."""

from __future__ import annotations

import tomllib
from pathlib import Path

from jobs import Job, toml

PRELOAD = 420.0


def wedge_peak() -> Job:
    """The wedge under 1 N, the peak in its level."""
    job = tomllib.loads((Path(__file__).resolve().parents[2] / "input" / "wedge_peak.toml").read_text())
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-12}
    job["output"]["file"] = "result.h5"
    return job


def write_optimum(folder: Path, **keys: object) -> str:
    """The preload from 5 to 100 times the force."""
    given = {
        "job": "job.toml",
        "parameter": [
            {"name": "preload", "keys": ["static.load_path[1]"], "low": 5.0 / PRELOAD, "high": 100.0 / PRELOAD}
        ],
    } | keys
    (folder / "optimum.toml").write_text(toml(given))
    return str(folder / "optimum.toml")
