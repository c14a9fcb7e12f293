"""The file and the picture of a study."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.job.job import Job
from attrito.library.names import OUTCOMES
from attrito.plots.style import BRANCH_COLOURS, STYLE, plain_text, save
from attrito.studies.design import Study
from attrito.studies.sample_peaks import METHODS
from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.version import __version__

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
# Parts of a quantity's range that quantiles are taken over, and the fewest samples in one.
MOST_PARTS, FEWEST = 15, 8


def write_study(
    study: Study, job: Job, values: np.ndarray, found: list[dict[str, Any]], warnings: Sequence[str]
) -> dict[str, int]:
    """Put batches together into the file and picture; returns how many samples have an outcome to report, by name."""
    stops = study.stops(job)
    rows: list[Any] = [None] * study.samples
    for batch in found:
        for sample, row in zip(batch["samples"], batch["rows"], strict=True):
            rows[sample] = row
    shape = (study.samples, len(stops))
    number = {
        name: np.array([[np.nan if one[name] is None else one[name] for one in row] for row in rows]).reshape(shape)
        for name in ("frequency_hz", "amplitude", "level")
    }
    outcome = np.array([[OUTCOMES.index(one["outcome"]) for one in row] for row in rows], dtype=np.int32)
    quantiles = np.nanquantile(number["amplitude"], QUANTILES, axis=0)
    Path(study.file).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(study.file) as file:
        file.attrs["format"], file.attrs["format_version"] = "attrito study", 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = "Resonance peaks over samples of a job's values; see docs/studies.md of attrito"
        file.attrs["job"], file.attrs["study"] = json.dumps(job.tables), json.dumps(study.as_table())
        file.attrs["parameter"] = job["peak"]["parameter"]
        file.attrs["warnings"] = "\n".join(warnings)

        def put(name: str, data: np.ndarray, description: str, unit: str) -> h5py.Dataset:
            return described(file, name, description, unit, data=data)

        put("parameter", np.array(stops), "level or preload of the peaks", "1")
        for i, vary in enumerate(study.vary):
            put(f"values/{vary.name}", values[:, i], ", ".join(vary.keys), "that of the job's key, or a factor on it")
        put("peaks/frequency_hz", number["frequency_hz"], "frequency of the peak, sample by parameter", "Hz")
        put("peaks/amplitude", number["amplitude"], "amplitude of the monitor at the peak", "user length")
        put("peaks/level", number["level"], "factor on the harmonic loads", "1")
        put("peaks/states", np.array([[one["states"] for one in row] for row in rows], dtype=np.int32),
            "contacts stuck, shaken down, slipping, open", "1")  # fmt: skip
        method = np.array([[METHODS.index(one["method"]) for one in row] for row in rows], dtype=np.int32)
        put("peaks/method", method, "how it was found", "1").attrs["names"] = list(METHODS)
        put("peaks/outcome", outcome, "how it ended", "1").attrs["names"] = list(OUTCOMES)
        put("quantiles/amplitude", quantiles, "over the samples, by quantile and parameter", "user length")
        put("quantiles/probability", np.array(QUANTILES), "of the quantiles", "1")
    save(picture(study, stops, values, number["amplitude"], job["peak"]["parameter"]), study.picture)
    names = ("not_converged", "above_tolerance")
    return {name: int((outcome == OUTCOMES.index(name)).any(axis=1).sum()) for name in names}


def picture(study: Study, stops: list[float], values: np.ndarray, amplitude: np.ndarray, parameter: str) -> Figure:
    """Quantile bands of the peak: over the parameter, if there are several values, else over each quantity."""
    with matplotlib.rc_context(STYLE):
        if len(stops) > 1:
            figure = Figure(figsize=(6.4, 4.2), constrained_layout=True)
            axes = figure.subplots()
            _bands(axes, np.array(stops), np.nanquantile(amplitude, QUANTILES, axis=0))
            axes.set(xlabel=f"{parameter.capitalize()} factor", ylabel="Amplitude of the peak")
            axes.legend()
            return figure
        count = len(study.vary)
        figure = Figure(figsize=(4.2 * count, 3.8), constrained_layout=True)
        for axes, vary, column in zip(figure.subplots(1, count, squeeze=False)[0], study.vary, values.T, strict=True):
            axes.plot(column, amplitude[:, 0], ".", color="0.6", markersize=2.5)
            known = np.flatnonzero(np.isfinite(amplitude[:, 0]))
            order = known[np.argsort(column[known])]
            parts = np.array_split(order, min(max(1, len(order) // FEWEST), MOST_PARTS))
            middle = np.array([np.median(column[part]) for part in parts])
            _bands(axes, middle, np.array([np.quantile(amplitude[part, 0], QUANTILES) for part in parts]).T)
            axes.set(xlabel=plain_text(vary.name), ylabel="Amplitude of the peak")
        axes.legend()
    return figure


def _bands(axes, x: np.ndarray, quantiles: np.ndarray) -> None:
    colour = BRANCH_COLOURS[0]
    axes.fill_between(x, quantiles[0], quantiles[4], color=colour, alpha=0.18, linewidth=0, label="5 to 95 %")
    axes.fill_between(x, quantiles[1], quantiles[3], color=colour, alpha=0.35, linewidth=0, label="25 to 75 %")
    axes.plot(x, quantiles[2], color=colour, label="median")
