"""The file of a study, and its picture."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from attrito.job.job import Job
from attrito.library.names import OUTCOMES
from attrito.studies.design import Study
from attrito.studies.sample_peaks import METHODS
from attrito.studies.statistics import QUANTILES, moments_of, quantiles_of
from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.units import axis_unit
from attrito.support.version import __version__


@dataclass(frozen=True)
class Kind:
    """What a file holds of each sample.

    Parameters
    ----------
    parameter : what the values are at which each sample was located
    parameter_unit : of those
    numbers : of each sample and value: description and unit
    once : of each sample alone
    quantiles : numbers whose quantiles over the samples are written
    """

    parameter: str
    parameter_unit: str
    numbers: dict[str, tuple[str, str]]
    once: dict[str, tuple[str, str]]
    quantiles: tuple[str, ...]


KINDS = {
    "peaks": Kind(
        "level or preload of the peaks",
        "1",
        {
            "frequency_hz": ("frequency of the peak, sample by parameter", "Hz"),
            "amplitude": ("amplitude of the monitor at the peak", "user length"),
            "level": ("factor on the harmonic loads", "1"),
            "amplitude_error": ("estimated relative error of the amplitude; NaN: not known", "1"),
            "frequency_error": ("estimated relative error of the frequency; NaN: not known", "1"),
        },
        {},
        ("amplitude",),
    ),
    "modes": Kind(
        "amplitude Q of the modes",
        "user length (user mass)^0.5",
        {
            "frequency_hz": ("frequency of the mode, sample by amplitude", "Hz"),
            "damping_ratio": ("of the contacts", "1"),
            "damping_ratio_structure": ("of the structure's own damping", "1"),
            "dissipated_energy": ("work of all contacts a period", "user energy"),
        },
        {
            "tangent_hz": ("natural frequency of the tangent mode, by sample", "Hz"),
            "tangent_damping_ratio": ("of the tangent mode, by sample", "1"),
        },
        ("frequency_hz", "damping_ratio"),
    ),
}


def write_study(
    study: Study,
    job: Job,
    values: np.ndarray,
    found: list[dict[str, Any]],
    warnings: Sequence[str],
    solved: int,
    errors: Mapping[str, np.ndarray],
) -> dict[str, int]:
    """Put batches together into the file and picture; returns how many samples have an outcome to report, by name.

    Parameters
    ----------
    found, solved : batches of all samples, and how many of these have been solved
    errors : of a model, by the names of numbers, largest of solved samples `[stops]`
    """
    kind, stops = KINDS[study.of], study.stops(job)
    rows: list[Any] = [None] * study.samples
    for batch in found:
        for sample, row in zip(batch["samples"], batch["rows"], strict=True):
            rows[sample] = row
    numbers = {name: _numbers(rows, name) for name in kind.numbers}
    outcome = np.array([[OUTCOMES.index(one["outcome"]) for one in row] for row in rows], dtype=np.int32)
    Path(study.file).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(study.file) as file:
        file.attrs["format"], file.attrs["format_version"] = "attrito study", 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = (
            f"Resonance {study.of} over samples of a job's values; see docs/how-to/studies.md of attrito"
        )
        file.attrs.update(job.attributes)
        file.attrs["study"], file.attrs["solved"] = json.dumps(study.as_table()), solved
        file.attrs["parameter"] = job["peak"]["parameter"] if study.of == "peaks" else "amplitude"
        file.attrs["warnings"] = "\n".join(warnings)

        def put(name: str, data: np.ndarray, description: str, unit: str) -> h5py.Dataset:
            return described(file, name, description, unit, data=data)

        put("parameter", np.array(stops), kind.parameter, kind.parameter_unit)
        for i, vary in enumerate(study.vary):
            put(f"values/{vary.name}", values[:, i], ", ".join(vary.keys), "that of the job's key, or a factor on it")
        for name, what in kind.numbers.items():
            put(f"{study.of}/{name}", numbers[name], *what)
        for name, what in kind.once.items():
            put(f"{study.of}/{name}", _numbers(rows, name)[:, 0], *what)
        for name, error in errors.items():
            of = "part of the largest" if name == "damping_ratio" else "relative"
            put(f"model_error/{name}", error, f"of the model, largest of solved samples, {of}", "1")
        put(f"{study.of}/states", np.array([[one["states"] for one in row] for row in rows], dtype=np.int32),
            "contacts stuck, shaken down, slipping, open", "1")  # fmt: skip
        if study.of == "peaks":
            method = np.array([[METHODS.index(one["method"]) for one in row] for row in rows], dtype=np.int32)
            put("peaks/method", method, "how it was found", "1").attrs["names"] = list(METHODS)
        put(f"{study.of}/outcome", outcome, "how it ended", "1").attrs["names"] = list(OUTCOMES)
        for name in kind.quantiles:
            quantiles = quantiles_of(numbers[name])
            put(f"quantiles/{name}", quantiles, "over the samples, by quantile and parameter", kind.numbers[name][1])
            for moment, words in (("mean", "mean"), ("deviation", "standard deviation")):
                found_moment = moments_of(numbers[name])[moment]
                put(f"{moment}/{name}", found_moment, f"{words} over the samples, by parameter", kind.numbers[name][1])
        put("quantiles/probability", np.array(QUANTILES), "of the quantiles", "1")
    if study.draws:
        _draw(study, job, values, numbers)
    names = ("not_converged", "above_tolerance")
    return {name: int((outcome == OUTCOMES.index(name)).any(axis=1).sum()) for name in names}


def _draw(study: Study, job: Job, values: np.ndarray, numbers: dict[str, np.ndarray]) -> None:
    """The picture; what draws takes longer to import than a small study."""
    from attrito.plots.style import save
    from attrito.studies.picture import picture_of_modes, picture_of_peaks

    kind, stops, units = KINDS[study.of], study.stops(job), job.attributes["units"]
    if study.of == "peaks":
        unit = axis_unit(kind.numbers["amplitude"][1], units)
        names, is_grid = [vary.name for vary in study.vary], study.design == "grid"
        parameter = job["peak"]["parameter"]
        figure = picture_of_peaks(names, stops, values, numbers["amplitude"], parameter, unit, is_grid)
    else:
        unit = axis_unit(kind.parameter_unit, units)
        figure = picture_of_modes(stops, numbers["frequency_hz"], numbers["damping_ratio"], unit)
    save(figure, study.picture)


def _numbers(rows: list[Any], name: str) -> np.ndarray:
    """A number of every sample and value, NaN where there is none."""
    return np.array([[np.nan if one[name] is None else one[name] for one in row] for row in rows], dtype=float)
