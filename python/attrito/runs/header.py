"""What holds for a whole run, written before its first point: where it comes from, contacts, linear references."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from attrito.job.job import Job, model_path
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.results.journal import Record
from attrito.results.result import RESULT
from attrito.runs.linear_references import MEANINGS, LinearReference
from attrito.runs.recorder import digest
from attrito.scene.friction_margin import Margin, described_margin
from attrito.scene.reduced_model import coordinates_fingerprint
from attrito.scene.reduced_sector import attributes_of_sector, axes_of_sector
from attrito.scene.rom_file import Rom
from attrito.scene.scene import Scene
from attrito.support.version import __version__

REFERENCES = (
    "Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032; Craig & Bampton 1968, doi:10.2514/3.4741; "
    "Cameron & Griffin 1989, doi:10.1115/1.3176036; PETSc, SLEPc, MUMPS, FFTW, HDF5"
)
# Another one whenever a journal can't be gone on from bit for bit
JOURNAL = 3
UNITS = {
    "tangential_stiffness": "user force/length",
    "normal_stiffness": "user force/length",
    "gap": "user length",
    "preload": "user force",
    "area": "user area",
    "position": "user length",
    "clearance": "user length",
}


def first_record(
    job: Job,
    scene: Scene,
    rom: Rom | None,
    reduced: ReducedScene,
    ranks: int,
    linear: dict[str, LinearReference],
    margin: Margin | None,
) -> Record:
    """The first record of the run's journal.

    Parameters
    ----------
    job, scene, rom, reduced : what is run
    ranks : number of processes
    linear : what `linear_references` returns
    margin : against wedging, None: not examined
    """
    rom_file = None if rom is None else rom.path
    attributes = {
        "format": RESULT,
        "format_version": 1,
        "attrito_version": __version__,
        "description": "Steady response of a structure with friction contacts; see docs/reference/files.md of attrito",
        "references": REFERENCES,
        **job.attributes,
        "job_file": str(Path(job.path).resolve()) if Path(job.path).is_file() else "",
        "model_file": _absolute(model_path(job, rom_file)),
        "rom_file": _absolute(rom_file),
        "rom_fingerprint": reduced.reduction,
        "coordinates_fingerprint": coordinates_fingerprint(reduced),
        **attributes_of_sector(reduced.sector),
    }
    record = Record(
        {
            "attributes": attributes,
            "ranks": ranks,
            "journal": JOURNAL,
            "digest": digest(reduced, scene.load_path),
        },
        {},
        {},
    )
    record.note["texts"] = _add_contacts(record, scene)
    for kind, one in linear.items():
        _add_linear(record, kind, one, reduced.monitor_names)
    for key, (value, description) in described_margin(margin).items():
        _add(record, f"static/{key}", value, description)
    for key, (value, description) in axes_of_sector(reduced.sector).items():
        _add(record, key, value, description)
    record.note["group_attributes"] = {
        "static": {"states": "" if margin is None else ",".join(margin.states)},
        **{f"linear/{kind}": {"rigid_body_modes": one.rigid} for kind, one in linear.items()},
    }
    return record


def _add(record: Record, name: str, values: np.ndarray, description: str, unit: str = "1") -> None:
    record.arrays[name], record.series[name] = values, Series("", description, unit)


def _add_contacts(record: Record, scene: Scene) -> dict[str, list[str]]:
    """Laws and places of the contacts; texts go as numbers. The texts of these."""
    texts: dict[str, list[str]] = {}
    for key, values in {**scene.contacts.laws, **scene.contacts.places}.items():
        name = f"contacts/parameters/{key}"
        if values.dtype == object:
            occurring, values = _numbered(values)
            texts[name] = occurring.tolist()
        _add(record, name, values, key.replace("_", " "), UNITS.get(key, "1"))
    return texts


def _add_linear(record: Record, kind: str, one: LinearReference, monitors: list[str]) -> None:
    """A linear reference: frequencies, natural frequencies and the monitors' amplitudes."""
    _add(record, f"linear/{kind}/frequency_hz", one.frequency_hz, "frequency", "Hz")
    _add(record, f"linear/{kind}/natural_hz", one.natural_hz, "natural frequencies of elastic modes", "Hz")
    for name, values in zip(monitors, one.amplitude, strict=True):
        _add(record, f"linear/{kind}/{name}", values, f"amplitude at level 1, {MEANINGS[kind]}", "user length")


def _numbered(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The texts that occur, and which of them stands where."""
    texts, places = np.unique(values.astype(str), return_inverse=True)
    return texts, places.astype(np.int32)


def _absolute(path: str | None) -> str:
    return "" if path is None else str(Path(path).resolve())
