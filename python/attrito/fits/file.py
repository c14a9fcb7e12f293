"""The file of a fit."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from attrito.fits.design import Fit
from attrito.fits.found import Found
from attrito.fits.measured import COLUMNS
from attrito.fits.picture import picture_of_fit
from attrito.fits.table import FORMAT
from attrito.job.job import Job
from attrito.plots.style import save
from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.version import __version__

OWN = "that of the job's key, or a factor on it"


def write_fit(fit: Fit, jobs: list[Job], found: Found) -> None:
    """Write the file and the picture beside it."""
    Path(fit.file).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(fit.file) as file:
        file.attrs["format"], file.attrs["format_version"] = FORMAT, 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = "Parameters of a job from measurements; see docs/how-to/fits.md of attrito"
        file.attrs.update(jobs[0].attributes)
        file.attrs["fit"] = json.dumps(fit.as_table(), default=str)
        file.attrs["warnings"] = "\n".join(found.warnings())
        _write_parameters(file, found)
        for one, solved in zip(fit.data, found.solved, strict=True):
            group = file.create_group(f"data/{one.name}")
            group.attrs["file"], group.attrs["of"] = one.file, one.of
            where, units = COLUMNS[one.of][0], one.units
            described(group, where, "where it was measured", units[where], data=one.measured.at)
            for name, values in one.measured.beside.items():
                unit = "1" if name == "turns" else "user force"
                described(group, name, "as measured, or given", unit, data=values)
            for name, values in one.measured.values.items():
                described(group, f"measured/{name}", "as measured", units[name], data=values)
                deviation = one.measured.deviation(name)
                described(group, f"deviation/{name}", "standard deviation", units[name], data=deviation)
                shown = one.measured.shown(solved, name)
                described(group, f"solved/{name}", "with the parameters found", units[name], data=shown)
    save(picture_of_fit(found, jobs[0].attributes["units"]), fit.picture)


def _write_parameters(file: h5py.File, found: Found) -> None:
    parameters, best = found.fit.parameters, found.best
    names = np.array([one.name for one in parameters], dtype=h5py.string_dtype())
    described(file, "parameters/name", "of the fit's [[parameter]]", data=names)
    keys = np.array([", ".join(one.keys) for one in parameters], dtype=h5py.string_dtype())
    described(file, "parameters/keys", "of the job", data=keys)
    for name, values, words in (
        ("value", found.values, "where the sum of squares is least"),
        ("start", found.start, "where the search began"),
        ("low", np.array([one.low for one in parameters]), "bound"),
        ("high", np.array([one.high for one in parameters]), "bound"),
        ("interval", found.intervals, "of 95 %: lower and upper end, linear about the value"),
        ("profile_interval", found.profile_intervals, "of 95 % by the profile; NaN where it does not close"),
    ):
        described(file, f"parameters/{name}", words, OWN, data=values)
    described(file, "parameters/identified", "1: the data identify it", data=found.identified.astype(np.int32))
    described(file, "parameters/correlation", "between parameters", data=best.correlation)
    described(file, "residuals", "differences over deviations, all data one after another", data=best.residuals)
    described(file, "variance", "s^2 of the residuals; 1 where deviations are given", data=best.variance)
    for parameter, one in zip(parameters, found.profiles, strict=len(found.profiles) == len(parameters)):
        group = f"profiles/{parameter.name}"
        described(file, f"{group}/value", "held", OWN, data=np.array([parameter.value(x) for x in one.x]))
        described(file, f"{group}/sum_of_squares", "of residuals, the other parameters fitted", data=one.cost)
