"""`attrito study`: a job solved for many values of its keys, over groups of ranks, into one HDF5 file.

Samples are put into batches of neighbours. A batch is solved by one group and written when it is complete. Every batch
begins at a linear peak or mode, so what it gives depends neither on the number of groups nor on where a study was
interrupted; one that is started again goes on from the batches that are there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.results.journal import Record, keep_record, kept_record
from attrito.runs.progress import Progress
from attrito.scene import cautions
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.studies.design import Study, batches, read_study
from attrito.studies.file import write_study
from attrito.studies.modelled import Nodes
from attrito.studies.sample_peaks import SamplePeaks
from attrito.studies.samples import shared_scene
from attrito.studies.sloped_peaks import SlopedPeaks
from attrito.studies.table import FORMAT
from attrito.support.errors import Fault, InputError, UnsolvedError
from attrito.support.locks import writing_alone
from attrito.support.own_folders import remove_folder, take_folder
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.studies.sample_modes import SampleModes
    from attrito.studies.sample_responses import Reference
    from attrito.studies.sloped_modes import SlopedModes


def run_study(comm: Comm, path: str | Study) -> str:
    """Solve a study's samples; returns the file's path. Raises `UnsolvedError` at the end if some were not solved."""
    progress = Progress(comm)
    study = on_root(comm, lambda: read_study(path))
    job = on_root(comm, lambda: read_job(study.job, excited=study.is_excited))
    on_root(comm, lambda: study.check(job))
    with writing_alone(comm, study.file, *[study.picture] * study.draws):
        failed = _solve_samples(comm, job, study, progress)
    progress.say(study.file)
    complaints = []
    if failed["not_converged"]:
        missing = {
            "peaks": "have no peak",
            "response": "have no response at some frequency",
            "modes": "have no mode at some amplitude",
        }[study.of]
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
    parts = f"{study.file}.parts"
    folder = Path(parts) / _fingerprint(study, job)
    groups = max(1, comm.size // study.ranks_per_group)
    color = min(comm.rank // study.ranks_per_group, groups - 1)
    reads = comm.rank == color * study.ranks_per_group
    base, rom = shared_scene(comm, job, study.keeps_places(job), progress, reads)
    nodes = _nodes_of(comm, job, study, base, rom, progress)
    # How many of the samples have derivatives: the nodes, which are the first
    sloped = len(nodes.places) if nodes is not None and nodes.sloped else 0
    located = partial(_located, job=job, base=base, rom=rom, study=study, sloped=sloped > 0)
    solved = values if nodes is None else nodes.solved(values)
    order = batches(study, solved)
    # Batches of a study of other values stay until this one has ended: it may be the one that is asked for by mistake.
    on_root(comm, lambda: take_folder(parts, FORMAT))
    on_root(comm, lambda: folder.mkdir(exist_ok=True))
    missing = on_root(comm, lambda: [i for i in range(len(order)) if kept_record(_part(folder, i)) is None])
    what = f"{study.samples} samples" if len(solved) == len(values) else f"{len(solved)} of {study.samples} samples"
    progress.say(f"{what} in {len(order)} batches, {len(order) - len(missing)} of them there already")
    group = comm.Split(color, comm.rank)
    try:
        reference = None
        if study.of == "response":
            # Of a group: sums over other numbers of ranks round differently.
            with contextlib.closing(located(group)) as responses:
                reference = comm.bcast(responses.find_reference())
            found_at = f"peak in the middle at {reference.peak_hz:.6g} Hz"
            progress.say(f"{len(reference.frequencies_hz)} frequencies, {found_at}")
        for i in missing[color::groups]:
            with contextlib.closing(located(group, reference)) as one:
                rows = [one.at(solved[sample], sample < sloped) for sample in order[i]]
            batch = Record({"samples": order[i].tolist(), "rows": rows})
            on_root(group, lambda i=i, batch=batch: keep_record(_part(folder, i), batch))
            progress.say(f"batch {i}: {len(rows)} samples")
    finally:
        group.Free()
    comm.Barrier()

    def finish() -> dict[str, int]:
        found = [_note_of(_part(folder, i)) for i in range(len(order))]
        rows = [row for batch in found for row in batch["rows"]]
        # Batches that an earlier version left do not say.
        untouched = sum(not all(one.get("touches", True) for one in row) for row in rows)
        progress.warn(cautions.of_static_solutions(untouched, len(solved)))
        if reference is not None:
            from attrito.studies.responses import gather, write_responses

            responses = gather(study, nodes, reference, values, found, progress)
            failed = write_responses(study, job, values, reference, responses, progress, len(solved))
            remove_folder(parts)
            return failed
        errors: dict[str, np.ndarray] = {}
        if nodes is not None:
            found, errors = nodes.rows(values, found, progress)
        failed = write_study(study, job, values, found, progress.warnings, len(solved), errors)
        remove_folder(parts)
        return failed

    return on_root(comm, finish)


def _nodes_of(
    comm: Comm, job: Job, study: Study, base: Scene | None, rom: Rom | None, progress: Progress
) -> Nodes | None:
    """What is solved of a study whose samples come from a model; None where all are solved. Collective."""
    if not study.is_modelled:
        return None
    unknown = [vary.name for vary in study.vary]
    if study.hessian != "values":
        kind = _sloped_modes if study.of == "modes" else SlopedPeaks
        with contextlib.closing(kind(comm, base, rom, study, job)) as samples:
            unknown = samples.unknown()
    if not unknown:
        return Nodes(study, True, tuple(study.stops(job)))
    if study.design == "first_order" or (study.hessian or "values") != "values":
        of = 'modes by method = "epmc" of whole structures' if study.of == "modes" else "peaks"
        shown, expected = ", ".join(unknown), f"{of}, and quantities that they have exact derivatives by"
        raise InputError(Fault(study.path, "design" if study.hessian is None else "hessian", shown, expected))
    if study.hessian is None:
        progress.say(f"no exact derivatives by {', '.join(unknown)}: the model is made of values alone")
    return Nodes(study, False, tuple(study.stops(job)))


class _AtValues:
    """Samples by what is varied."""

    def __init__(self, samples: SamplePeaks | SampleModes, study: Study, job: Job):
        self._samples, self._study, self._job = samples, study, job

    def at(self, values: np.ndarray, sloped: bool) -> list[dict[str, Any]]:
        """What is located at values of the quantities; not `sloped`, as derivatives are none of it."""
        assert not sloped
        changed = self._study.changed(self._job, values)
        return self._samples.of(changed, self._study.stops(changed))

    def close(self) -> None:
        """End the session."""
        self._samples.close()


def _sloped_modes(comm: Comm, base: Scene | None, rom: Rom | None, study: Study, job: Job) -> _SlopedModes:
    """Modes with derivatives."""
    from attrito.studies.sloped_modes import SlopedModes

    return _SlopedModes(SlopedModes(comm, base, rom, study.vary, partial(study.changed, job)), study, job)


class _SlopedModes:
    """Modes by what is varied, with derivatives where they are asked for."""

    def __init__(self, modes: SlopedModes, study: Study, job: Job):
        self._modes, self._study, self._job = modes, study, job

    def unknown(self) -> list[str]:
        """Names of the quantities that there are no exact derivatives by, in the middle of all. Collective."""
        known = self._modes.known(self._study.middle)
        return [vary.name for vary, is_known in zip(self._study.vary, known, strict=True) if not is_known]

    def at(self, values: np.ndarray, sloped: bool) -> list[dict[str, Any]]:
        """The mode at values of the quantities. Collective."""
        stops = self._study.stops(self._study.changed(self._job, values))
        rows = self._modes.at(values, stops, sloped)
        for row in rows:
            row |= {"slopes": {name: slopes.tolist() for name, slopes in row.get("slopes", {}).items()}}
        return rows

    def close(self) -> None:
        """End the session."""
        self._modes.close()


def _located(
    comm: Comm,
    reference: Reference | None = None,
    *,
    job: Job,
    base: Scene | None,
    rom: Rom | None,
    study: Study,
    sloped: bool,
) -> _AtValues | _SlopedModes | SlopedPeaks:
    """What solves samples at values of what is varied; what is not asked for is not imported, which takes time."""
    if study.of == "modes" and sloped:
        return _sloped_modes(comm, base, rom, study, job)
    if study.of == "modes":
        from attrito.studies.sample_modes import SampleModes

        return _AtValues(SampleModes(comm, base, rom), study, job)
    if study.of == "response":
        from attrito.studies.sample_responses import SampleResponses

        responses = SampleResponses(comm, base, rom, study, job)
        responses.reference = reference
        return responses
    return SlopedPeaks(comm, base, rom, study, job) if sloped else _AtValues(SamplePeaks(comm, base, rom), study, job)


def _part(folder: Path, batch: int) -> str:
    return str(folder / f"batch_{batch:06d}")


def _note_of(path: str) -> dict[str, Any]:
    """What was kept of a batch, which this study has seen whole."""
    record = kept_record(path)
    if record is None:
        raise InputError(Fault(path, "file", "changed", "what this study has written: start it again"))
    return record.note


def _fingerprint(study: Study, job: Job) -> str:
    """Of all that the samples depend on."""
    text = json.dumps([study.as_table(), job.tables], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
