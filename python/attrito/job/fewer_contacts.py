"""`[balance] contacts = "auto"`: what it does not go with, and which commands do not take it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from attrito.job.job import Job
from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


def check_contacts(job: Job) -> list[Fault]:
    """Keys that ask for what patches of pairs do not give."""
    if job["balance"]["contacts"] == "all":
        return []
    merged = 'with [balance] contacts = "auto"'
    refused = [
        ("[balance] approach", job["balance"]["approach"] == "uncoupled", f'"coupled" {merged}'),
        (
            "[static] bounds",
            job["static"]["bounds"] == "sampled",
            f'"auto" or "none" {merged}: members are of all pairs',
        ),
        ("[continuation] branches", job["continuation"]["branches"] > 1, f"1 {merged}"),
        ("[continuation] start", job["continuation"]["start"] is not None, f"no such key {merged}"),
        ("[stability] method", job["stability"]["method"] != "none", f'"none" {merged}: stability is of all pairs'),
        ("[damping] loss_factor", job["damping"]["loss_factor"] is not None, f"another kind of damping {merged}"),
    ]
    found = []
    for place, at_fault, expected in refused:
        if at_fault:
            table, key = place.strip("[").split("] ")
            found.append(job.fault(place, job[table][key], expected))
    return found


def check_one_process(comm: Comm, job: Job) -> None:
    """Refuse to merge contacts on several processes."""
    if comm.size > 1:
        raise InputError(job.fault("[balance] contacts", "auto", f'"all" on {comm.size} processes, or one process'))


def take_all_contacts(job: Job, command: str) -> None:
    """Refuse a job that merges contacts, for a command that cannot.

    Raises
    ------
    InputError : contacts are merged
    """
    if job["balance"]["contacts"] == "auto":
        expected = f'"all": attrito {command} does not merge contacts'
        raise InputError(job.fault("[balance] contacts", "auto", expected))
