"""`attrito study`: a job solved for many values of its keys, over groups of ranks, into one HDF5 file.

Samples are put into batches of neighbours. A batch is solved by one group and written when it is complete. Every batch
begins at a linear peak or mode, so what it gives depends neither on the number of groups nor on where a study was
interrupted; one that is started again goes on from the batches that are there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.fewer_contacts import take_all_contacts
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.runs.progress import Progress
from attrito.scene import cautions
from attrito.scene.reduced_model import Rom
from attrito.scene.scene import Scene
from attrito.studies.design import Study, batches, read_study
from attrito.studies.file import write_study
from attrito.studies.sample_modes import SampleModes
from attrito.studies.sample_peaks import SamplePeaks
from attrito.studies.samples import shared_scene
from attrito.studies.second_order import ACCEPTED, MOST_CHECKED, largest_difference, rows_of
from attrito.support.errors import UnsolvedError
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# What is located for each sample
LOCATED = {"peaks": SamplePeaks, "modes": SampleModes}


def run_study(comm: Comm, path: str | Study) -> str:
    """Solve a study's samples; returns the file's path. Raises `UnsolvedError` at the end if some were not solved."""
    progress = Progress(comm)
    study = on_root(comm, lambda: read_study(path))
    job = on_root(comm, lambda: read_job(study.job, excited=study.is_excited))
    on_root(comm, lambda: study.check(job))
    on_root(comm, lambda: take_all_contacts(job, "study"))
    with writing_alone(comm, study.file):
        failed = _solve_samples(comm, job, study, progress)
    progress.say(study.file)
    complaints = []
    if failed["not_converged"]:
        missing = {"peaks": "have no peak", "modes": "have no mode at some amplitude"}[study.of]
        complaints.append(f"{failed['not_converged']} of {study.samples} samples {missing}; they are in the file")
    if failed["above_tolerance"]:
        complaints.append(
            f"peaks of {failed['above_tolerance']} of {study.samples} samples have an estimated error above"
            f" [balance] tolerance = {job['balance']['tolerance']:g}; they are in the file with outcome above_tolerance"
        )
    if complaints:
        raise UnsolvedError(study.file, "; ".join(complaints))
    return study.file


def _solve_samples(comm: Comm, job: Job, study: Study, progress: Progress) -> dict[str, int]:
    """Solve the batches that are missing and write the study; how many samples ended how, of those to be reported."""
    values = study.sample()
    solved = study.solved(values)
    order = batches(study, solved)
    folder = Path(f"{study.file}.parts") / _fingerprint(study, job)
    groups = max(1, comm.size // study.ranks_per_group)
    color = min(comm.rank // study.ranks_per_group, groups - 1)
    reads = comm.rank == color * study.ranks_per_group
    base, rom = shared_scene(comm, job, study.keeps_places(job), progress, reads)
    on_root(comm, lambda: folder.mkdir(parents=True, exist_ok=True))
    missing = on_root(comm, lambda: [i for i in range(len(order)) if not _part(folder, i).exists()])
    what = f"{study.samples} samples" if len(solved) == len(values) else f"{len(solved)} of {study.samples} samples"
    progress.say(f"{what} in {len(order)} batches, {len(order) - len(missing)} of them there already")
    group = comm.Split(color, comm.rank)
    try:
        for i in missing[color::groups]:
            rows = _solve_batch(group, job, base, rom, study, solved[order[i]])
            on_root(group, lambda i=i, rows=rows: _keep(_part(folder, i), order[i], rows))
            progress.say(f"batch {i}: {len(rows)} samples")
    finally:
        group.Free()
    comm.Barrier()

    def finish() -> dict[str, int]:
        found = [json.loads(_part(folder, i).read_text()) for i in range(len(order))]
        rows = [row for batch in found for row in batch["rows"]]
        # Batches that an earlier version left do not say.
        untouched = sum(not all(one.get("touches", True) for one in row) for row in rows)
        progress.warn(cautions.of_static_solutions(untouched, len(solved)))
        if study.design == "second_order":
            found = _modelled(study, values, found, progress)
        failed = write_study(study, job, values, found, progress.warnings)
        _remove_parts(folder.parent)
        return failed

    return on_root(comm, finish)


def _modelled(
    study: Study, values: np.ndarray, found: list[dict[str, Any]], progress: Progress
) -> list[dict[str, Any]]:
    """All samples by the second-order model through its nodes, as one batch; says how far it is from solved ones."""
    rows = dict(pair for batch in found for pair in zip(batch["samples"], batch["rows"], strict=True))
    count = len(rows) - min(MOST_CHECKED, study.samples)
    at_nodes = [rows[node] for node in range(count)]
    lost = [one for row in at_nodes for one in row if one["outcome"] == "not_converged"]
    if lost:
        raise UnsolvedError(
            study.file,
            f"{len(lost)} of {count} nodes of the second-order model are without a solution: take another design",
        )
    modelled = rows_of(at_nodes, study.places(values))
    checked = [rows[sample] for sample in range(count, len(rows))]
    name = "amplitude" if study.of == "peaks" else "frequency_hz"
    difference = largest_difference(checked, modelled[: len(checked)], name)
    words = f"second-order model: {name} within {100.0 * difference:.2g} % of {len(checked)} other solved samples"
    progress.say(words)
    if difference > ACCEPTED:
        progress.warn([f'{words}; it does not hold: take design = "latin_hypercube"'])
    return [{"samples": list(range(study.samples)), "rows": modelled}]


def _remove_parts(folder: Path) -> None:
    """Remove the batches of this study and of older ones of its name, and nothing else."""
    for path in folder.iterdir():
        if re.fullmatch("[0-9a-f]{16}", path.name) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
    with contextlib.suppress(OSError):
        folder.rmdir()


def _solve_batch(
    comm: Comm, job: Job, base: Scene | None, rom: Rom | None, study: Study, values: np.ndarray
) -> list[list[dict]]:
    """Peaks of the samples of one batch, `[samples][values of the parameter]`, or modes, `[samples][amplitudes]`."""
    with contextlib.closing(LOCATED[study.of](comm, base, rom)) as located:
        jobs = [study.changed(job, row) for row in values]
        return [located.of(changed, study.stops(changed)) for changed in jobs]


def _part(folder: Path, batch: int) -> Path:
    return folder / f"batch_{batch:06d}.json"


def _keep(path: Path, samples: np.ndarray, rows: list) -> None:
    """Write a batch; the file appears when it is complete, whatever ends the program."""
    partial = path.with_suffix(".partial")
    with open(partial, "w") as stream:
        json.dump({"samples": samples.tolist(), "rows": rows}, stream)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(partial, path)


def _fingerprint(study: Study, job: Job) -> str:
    """Of all that the samples depend on."""
    text = json.dumps([study.as_table(), job.tables], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
