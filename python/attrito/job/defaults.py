"""Defaults of a job that depend on its other keys."""

from __future__ import annotations

from attrito.job.job import Job

# Accepted where no tolerance is given, of the amplitude and of what a reduction leaves out
TOLERANCE, MODE_ERROR = 0.01, 1e-3
# Harmonics that modes matter for where they are chosen point by point: beyond, modes that are left out follow at rest
HARMONICS = 5
# Part of the tolerance that the modes left out by a reduction may take
MODES_SHARE = 0.25


def fill_accuracy(job: Job) -> None:
    """What follows from one another: a tolerance chooses what is not given, and harmonics "auto" have a tolerance."""
    balance, reduction = job["balance"], job["reduction"]
    given = balance["tolerance"] is not None
    if balance["harmonics"] is None:
        balance["harmonics"] = "auto"
    if reduction["modes"] == "auto" and reduction["error"] is None:
        reduction["error"] = MODES_SHARE * balance["tolerance"] if given else MODE_ERROR
    if not given and balance["harmonics"] == "auto":
        balance["tolerance"] = TOLERANCE
