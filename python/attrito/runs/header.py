"""What holds for a whole run, written before its first point: where it comes from, contacts, linear responses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from attrito.job.job import Job, model_path
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Solver
from attrito.results.journal import Record
from attrito.runs.recorder import digest
from attrito.scene.friction_margin import Margin, described_margin
from attrito.scene.reduced_model import Rom, coordinates_fingerprint
from attrito.scene.scene import Scene
from attrito.support.version import __version__

REFERENCES = (
    "Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032; Craig & Bampton 1968, doi:10.2514/3.4741; "
    "Cameron & Griffin 1989, doi:10.1115/1.3176036; PETSc, SLEPc, MUMPS, FFTW, HDF5"
)
LINEAR_POINTS = 400
NATURAL_FREQUENCIES = 20
UNITS = {
    "tangential_stiffness": "user force/length",
    "normal_stiffness": "user force/length",
    "gap": "user length",
    "preload": "user force",
    "area": "user area",
    "position": "user length",
}


def linear_responses(solver: Solver, job: Job) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Frequencies, amplitudes and natural frequencies of the linear systems, stuck and frictionless."""
    sweep = job["sweep"]
    given = sweep["frequencies_hz"] or [sweep["start_hz"], sweep["stop_hz"]]
    low, high = min(given), max(given)
    responses = {}
    for name, stuck in (("stuck", True), ("frictionless", False)):
        grid = np.linspace(low, high, LINEAR_POINTS) if high > low else np.array([low])
        natural = solver.linear_response(stuck, grid[:1], NATURAL_FREQUENCIES)[1]
        # Resonances are drawn by points of their own, close enough for the sharpest.
        inside = natural[(natural > low) & (natural < high)]
        near = [inside * (1.0 + sign * width) for width in np.geomspace(1e-5, 1e-2, 16) for sign in (-1, 1)]
        grid = np.unique(np.concatenate([grid, inside, *near]))
        grid = grid[(grid >= low) & (grid <= high)]
        responses[name] = (grid, solver.linear_response(stuck, grid, 0)[0], natural)
    return responses


def first_record(
    job: Job,
    scene: Scene,
    rom: Rom | None,
    reduced: ReducedScene,
    ranks: int,
    linear: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]],
    margin: Margin | None,
) -> Record:
    """The first record of the run's journal.

    Parameters
    ----------
    job, scene, rom, reduced : what is run
    ranks : number of processes
    linear : what `linear_responses` returns
    margin : against wedging, None: not examined
    """
    rom_file = None if rom is None else rom.path
    attributes = {
        "format": "attrito result",
        "format_version": 1,
        "attrito_version": __version__,
        "description": "Steady response of a structure with friction contacts; see docs/files.md of attrito",
        "references": REFERENCES,
        "job": json.dumps(job.tables),
        "job_file": str(Path(job.path).resolve()) if Path(job.path).is_file() else "",
        "model_file": _absolute(model_path(job, rom_file)),
        "rom_file": _absolute(rom_file),
        "rom_fingerprint": reduced.reduction,
        "coordinates_fingerprint": coordinates_fingerprint(reduced),
    }
    texts: dict[str, list[str]] = {}
    arrays: dict[str, np.ndarray] = {}
    series: dict[str, Series] = {}
    for key, values in {**scene.contacts.laws, **scene.contacts.places}.items():
        name = f"contacts/parameters/{key}"
        if values.dtype == object:
            texts[name], values = (part.tolist() if i == 0 else part for i, part in enumerate(_numbered(values)))
        arrays[name], series[name] = values, Series("", key.replace("_", " "), UNITS.get(key, "1"))
    for kind, (frequency, amplitude, natural) in linear.items():
        what = "every contact stuck" if kind == "stuck" else "contacts closed, no friction"
        data = {"frequency_hz": (frequency, "frequency", "Hz"), "natural_hz": (natural, "natural frequencies", "Hz")}
        data |= {
            name: (values, f"amplitude at level 1, {what}", "user length")
            for name, values in zip(reduced.monitor_names, amplitude, strict=True)
        }
        for key, (values, description, unit) in data.items():
            name = f"linear/{kind}/{key}"
            arrays[name], series[name] = values, Series("", description, unit)
    for key, (value, description) in described_margin(margin).items():
        arrays[f"static/{key}"], series[f"static/{key}"] = value, Series("", description, "1")
    note = {"attributes": attributes, "ranks": ranks, "digest": digest(reduced, scene.load_path), "texts": texts}
    note["group_attributes"] = {"static": {"states": "" if margin is None else ",".join(margin.states)}}
    return Record(note, arrays, series)


def _numbered(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The texts that occur, and which of them stands where."""
    texts, places = np.unique(values.astype(str), return_inverse=True)
    return texts, places.astype(np.int32)


def _absolute(path: str | None) -> str:
    return "" if path is None else str(Path(path).resolve())
