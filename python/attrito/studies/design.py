"""What a study varies: its file, the values of its samples, and batches of neighbours among them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from attrito.job.checks import Check, boolean, choice, dataset_name, integer, listing, number, text
from attrito.job.job import Job, files_read, rom_path
from attrito.job.reading import read_job
from attrito.job.varied import checked, faults_of_keys, is_of_model, read_keys, with_values
from attrito.studies.statistics import latin_hypercube
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared


@dataclass(frozen=True)
class Vary:
    """One quantity: the keys of the job that have its value, or (`factor`) are multiplied by it.

    Uniform between `low` and `high`, or one of `values` (a grid's nodes; else drawn from them).
    """

    name: str
    keys: tuple[str, ...]
    low: float | None
    high: float | None
    values: tuple[float, ...]
    factor: bool

    def rate(self, value: float) -> float:
        """What a step from a value is a part of: the width between both bounds."""
        return self.high - self.low


@dataclass(frozen=True)
class Study:
    """A checked study; `job` is the job file, or the job, and `of` one of `peaks`, `modes` and `response`.

    `hessian`: what a model of second order is made of; None: gradients where they are exact. `draws`: a picture?
    """

    path: str
    job: str | Job
    of: str
    file: str
    design: str
    samples: int
    seed: int
    batch: int
    ranks_per_group: int
    hessian: str | None
    draws: bool
    vary: tuple[Vary, ...]

    @property
    def is_excited(self) -> bool:
        """Whether jobs need harmonic loads and a sweep."""
        return self.of != "modes"

    @property
    def picture(self) -> str:
        """The picture that goes beside the file."""
        return f"{os.path.splitext(self.file)[0]}.png"

    def sample(self) -> np.ndarray:
        """Values of all samples, `[samples, quantities]`; the same for the same study."""
        if self.design == "grid":
            return np.array(list(product(*(vary.values for vary in self.vary))), dtype=float)
        count = len(self.vary)
        if self.design != "random":
            unit = latin_hypercube(self.samples, count, self.seed)
        else:
            unit = np.random.default_rng(self.seed).random((self.samples, count))
        columns = []
        for part, vary in zip(unit.T, self.vary, strict=True):
            if vary.values:
                columns.append(np.array(vary.values)[(part * len(vary.values)).astype(int)])
            else:
                columns.append(vary.low + part * (vary.high - vary.low))
        return np.array(columns).T

    @property
    def is_modelled(self) -> bool:
        """Whether most samples come from a model through few that are solved."""
        return self.design in MODELLED

    def places(self, values: np.ndarray) -> np.ndarray:
        """Values of samples between their bounds, from -1 to 1."""
        low, high = self.bounds
        return np.asarray((2.0 * values - low - high) / (high - low))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest value of each quantity, where there are."""
        return np.array([vary.low for vary in self.vary]), np.array([vary.high for vary in self.vary])

    @property
    def middle(self) -> np.ndarray:
        """Between the least and the largest value of each quantity."""
        ends = [(min(vary.values), max(vary.values)) if vary.values else (vary.low, vary.high) for vary in self.vary]
        return 0.5 * np.sum(np.array(ends, dtype=float), axis=1)

    def stops(self, job: Job) -> list[float]:
        """Values of the job's parameter at which each sample's peak is located, or amplitudes of its mode."""
        if self.of == "modes":
            from attrito.modes.nonlinear import amplitudes

            return amplitudes(job).tolist()
        keys = job["peak"]
        last = [] if keys["stop"] is None else [keys["stop"]]
        rising = not last or last[0] > keys["start"]
        return [keys["start"], *sorted(keys["values"], reverse=not rising), *last]

    def as_table(self) -> dict[str, Any]:
        """All that the samples' values depend on."""
        table = asdict(self)
        return {name: table[name] for name in ("of", "design", "samples", "seed", "batch", "hessian", "vary")}

    def changed(self, job: Job, row: np.ndarray) -> Job:
        """The job with the values of a sample, checked as a job is."""
        return with_values(job, list(zip(self.vary, row.tolist(), strict=True)), self.path, "vary", self.is_excited)

    def keeps_places(self, job: Job) -> bool:
        """Whether samples differ in contacts' laws and what is not of the model, so that they share what was read."""
        return not any(is_of_model(key) for vary in self.vary for key in vary.keys)

    def check(self, job: Job) -> None:
        """Raise unless every key is a number of the job that can be varied, and takes the values asked for."""
        faults = self._faults_of_job(job)
        for i, vary in enumerate(self.vary):
            faults += faults_of_keys(job, vary.keys, self.path, f"vary[{i}] keys")
        if faults:
            raise InputError(*faults)
        read = [self.path, *files_read(job), *filter(None, [rom_path(job)])]
        check_spared(self.path, "file", [self.file, self.picture], read)
        for vary in self.vary:
            for value in vary.values or (vary.low, vary.high):
                try:
                    with_values(job, [(vary, value)], self.path, "vary", self.is_excited)
                except InputError as error:
                    faults += error.faults
        if faults:
            raise InputError(*faults)

    def _faults_of_job(self, job: Job) -> list[Fault]:
        """Of what is located for each sample."""
        if self.of == "modes":
            from attrito.modes.nonlinear import check_mode

            try:
                check_mode(job)
            except InputError as error:
                return list(error.faults)
            return []
        faults = []
        if job["peak"]["start"] is None:
            faults.append(job.fault("[peak] start", "missing", "the level or preload at which a study locates peaks"))
        if job["sweep"]["start_hz"] is None:
            faults.append(job.fault("[sweep] start_hz", "missing", "start_hz and stop_hz, the band of the peaks"))
        if self.of == "response" and not faults and len(self.stops(job)) > 1:
            expected = "start alone: a response has one level and preload"
            faults.append(job.fault("[peak] stop, values", self.stops(job)[1:], expected))
        return faults


# Designs whose samples come from a model through few that are solved
MODELLED = ("first_order", "second_order")
CHECKS: dict[str, tuple[Check, Any]] = {
    "job": (text, None),
    "of": (choice("peaks", "modes", "response"), "peaks"),
    "file": (text, "study.h5"),
    "design": (choice("random", "latin_hypercube", "grid", *MODELLED), "random"),
    "samples": (integer(1), None),
    "seed": (integer(0), 1),
    "batch": (integer(1), 20),
    "ranks_per_group": (integer(1), 1),
    "hessian": (choice("values", "gradients", "central_gradients"), None),
    "picture": (boolean, True),
}
VARY_CHECKS: dict[str, tuple[Check, Any]] = {
    "name": (dataset_name, None),
    "keys": (listing(text, 1), None),
    "low": (number(), None),
    "high": (number(), None),
    "values": (listing(number(), 1), ()),
    "factor": (boolean, False),
}


def read_study(
    source: str | os.PathLike[str] | Mapping[str, Any] | Study, folder: str | os.PathLike[str] = "."
) -> Study:
    """Read and check a study; raises `InputError` with all faults together.

    Parameters
    ----------
    source : a study file, or its keys as a dictionary, whose job may be one, too; a study that is checked stays
    folder : what file names of a dictionary are relative to
    """
    if isinstance(source, Study):
        return source
    return read_keys(
        source,
        folder,
        "study",
        _check_study,
        lambda study, job: replace(study, job=read_job(job, folder, excited=study.is_excited)),
    )


def _check_study(raw: dict[str, Any], path: str) -> Study:
    """Check the keys of a study that is called `path`."""
    faults: list[Fault] = []
    rows = raw.pop("vary", [])
    keys = checked(path, "", raw, CHECKS, faults)
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise InputError(*faults, Fault(path, "vary", "missing", "at least one table [[vary]]"))
    varies = []
    for i, row in enumerate(rows):
        one = checked(path, f"vary[{i}] ", row, VARY_CHECKS, faults)
        if bool(one["values"]) == (one["low"] is not None and one["high"] is not None):
            faults.append(Fault(path, f"vary[{i}] values", one["values"] or "missing", "either values or low and high"))
        if keys["design"] == "grid" and not one["values"]:
            faults.append(Fault(path, f"vary[{i}] values", "missing", "the nodes of the grid"))
        if keys["design"] in MODELLED and one["values"]:
            expected = f'low and high with design = "{keys["design"]}"'
            faults.append(Fault(path, f"vary[{i}] values", one["values"], expected))
        if one["name"] is None or one["keys"] is None:
            faults.append(Fault(path, f"vary[{i}]", "missing", "name and keys"))
            continue
        varies.append(
            Vary(one["name"], tuple(one["keys"]), one["low"], one["high"], tuple(one["values"]), one["factor"])
        )
    names = [vary.name for vary in varies]
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.append(Fault(path, "vary name", name, "names that differ"))
    if keys["job"] is None:
        faults.append(Fault(path, "job", "missing", "the job file whose keys are varied"))
    if keys["hessian"] is not None and keys["design"] != "second_order":
        faults.append(Fault(path, "hessian", keys["hessian"], 'no such key but with design = "second_order"'))
    if (keys["samples"] is None) != (keys["design"] == "grid"):
        faults.append(Fault(path, "samples", keys["samples"], "a number of samples, but none of a grid"))
    if faults:
        raise InputError(*faults)
    count = int(np.prod([len(vary.values) for vary in varies])) if keys["design"] == "grid" else keys["samples"]
    folder = Path(path).parent
    job, file = (os_path(folder, keys[name]) for name in ("job", "file"))
    rest = (keys[name] for name in ("seed", "batch", "ranks_per_group", "hessian", "picture"))
    return Study(path, job, keys["of"], file, keys["design"], count, *rest, tuple(varies))


def os_path(folder: Path, name: str) -> str:
    """A file name of the study, relative to its folder."""
    return os.path.normpath(folder / name)


def batches(study: Study, values: np.ndarray) -> list[np.ndarray]:
    """Samples in batches of neighbours: halved across their widest quantity until short, then from next to next."""
    width = np.ptp(values, axis=0)
    scaled = values / np.where(width > 0.0, width, 1.0)
    done: list[np.ndarray] = []
    waiting = [np.arange(len(values))]
    while waiting:
        samples = waiting.pop(0)
        if len(samples) <= study.batch:
            done.append(_from_next_to_next(samples, scaled))
            continue
        widest = int(np.argmax(np.ptp(scaled[samples], axis=0)))
        samples = samples[np.argsort(scaled[samples, widest], kind="stable")]
        waiting += [samples[: len(samples) // 2], samples[len(samples) // 2 :]]
    return done


def _from_next_to_next(samples: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    left, order = list(samples[1:]), [samples[0]]
    while left:
        distance = np.linalg.norm(scaled[left] - scaled[order[-1]], axis=1)
        order.append(left.pop(int(np.argmin(distance))))
    return np.array(order)
