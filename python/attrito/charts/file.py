"""What `attrito chart` finds: ways to solve a scene with their error and cost, as a table and as chart.h5."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np

from attrito.support.atomic_files import whole_hdf5
from attrito.support.csv_text import cell
from attrito.support.hdf5_reading import as_text, is_of_format, stored
from attrito.support.hdf5_writing import described
from attrito.support.version import __version__

FORMAT = "attrito chart"
SERIES = {
    "tolerance": "harmonics by tolerance",
    "event": "by events, H fixed",
    "sampled": "by samples, H and J fixed (of older charts)",
    "uncoupled": "uncoupled, H fixed",
    "modes": "fewer modes of the reduction",
    "curve": "points of the drawn curve",
    "wheel": "the whole wheel, H fixed",
    "uncondensed": "Newton's method on all coordinates (work by formula)",
    "integration": "time integration by steps, to the steady state",
    "events in time": "time integration by located events",
    "epmc": "periodic motion (EPMC), H fixed",
    "quasi_static": "cycles of quasi-static loading",
    "points": "points of contact on faces",
    "meshes": "the same structure on another mesh",
}
# Points that a way may be charted by: stability is not examined, and the error is what is charted
SOLVED = ("converged", "above_tolerance")
# Attributes that say where ways were compared
PLACES = ("frequency_hz", "level", "tolerance", "amplitude")
# As the estimate has it: `attrito_accuracy_error_control`
LEAST_SHARE = 1e-3


@dataclass(frozen=True)
class Way:
    """One way to solve the scene, and what came of it.

    `error` is NaN where it was not solved, and `note` then says why; settings that do not apply are 0. `too_long`: it
    was not begun, since it would have taken longer than was asked for. `own`: it is the one that the job asks for.
    """

    series: str
    label: str
    harmonics: int = 0
    samples: int = 0
    modes: int = 0
    steps: int = 0
    contacts: int = 0
    points: int = 0
    frequency_hz: float = np.nan
    tolerance: float = 0.0
    error: float = np.nan
    estimate: float = np.nan
    seconds: float = np.nan
    work: float = np.nan
    note: str = ""
    too_long: bool = False
    own: bool = False


@dataclass(frozen=True)
class Chart:
    """All ways to solve a scene.

    Parameters
    ----------
    places : where they were compared: attributes of the file
    title : the same in words
    quantity : what the error is of
    reference : what they were compared with; its estimate is its own error
    """

    ways: list[Way]
    places: dict[str, float]
    title: str
    quantity: str
    reference: Way

    def efficient(self) -> np.ndarray:
        """Which ways no other beats in both time and error, `[ways]`."""
        error, seconds = (np.array([getattr(way, name) for way in self.ways]) for name in ("error", "seconds"))
        # The error of a drawn curve is not that of its peak
        error[[way.series == "curve" for way in self.ways]] = np.nan
        beaten = [
            np.any(((error < e) & (seconds <= s)) | ((error <= e) & (seconds < s)))
            for e, s in zip(error, seconds, strict=True)
        ]
        return ~np.array(beaten, dtype=bool) & np.isfinite(error) & np.isfinite(seconds)

    def chosen(self) -> int | None:
        """The way that the job asks for; None while it has not been gone."""
        own = [way.own for way in self.ways]
        return own.index(True) if any(own) else None


COLUMNS = {
    "harmonics": ("harmonics at the peak", "1"),
    "samples": ("samples a period; 0: none needed", "1"),
    "modes": ("fixed-interface modes, where they are varied", "1"),
    "steps": ("steps a period of time integration", "1"),
    "contacts": ("contacts, where they are varied", "1"),
    "points": ("points of the sweep, where they are varied", "1"),
    "frequency_hz": ("frequency of the peak, where each way has its own", "Hz"),
    "tolerance": ("relative error accepted, where that chooses", "1"),
    "error": (
        "relative error against the reference: of the peak's amplitude, of a mode's frequency and damping, or of the"
        " drawn curve",
        "1",
    ),
    "estimate": ("the error that the run itself estimates", "1"),
    "seconds": ("processor time, without the static load path", "s"),
    "work": ("floating-point operations by formulas", "1"),
}


def table(chart: Chart) -> str:
    """CSV, a line a way."""
    efficient, chosen = chart.efficient(), chart.chosen()
    lines = [",".join(["series", "setting", *COLUMNS, "efficient", "chosen", "note"])]
    for i, way in enumerate(chart.ways):
        values = [getattr(way, name) for name in COLUMNS]
        numbers = ["" if value != value or value == 0 else f"{value:.6g}" for value in values]
        flags = ["true" if flag else "false" for flag in (efficient[i], i == chosen)]
        lines.append(",".join([way.series, f'"{way.label}"', *numbers, *flags, _quoted(way.note)]))
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A sentence as one cell, quoted whatever it holds."""
    safe = cell(text)
    return safe if safe.startswith('"') else f'"{safe}"'


def write(chart: Chart, path: str, job: str) -> None:
    """`chart.h5`: a dataset a column, an entry a way."""
    with whole_hdf5(path) as file:
        file.attrs["format"], file.attrs["attrito_version"], file.attrs["job_file"] = FORMAT, __version__, job
        file.attrs["description"] = (
            "error against cost of the ways to solve a scene; see docs/evidence/charts.md of attrito"
        )
        for name, value in chart.places.items():
            file.attrs[name] = value
        file.attrs["reference_harmonics"] = chart.reference.harmonics
        file.attrs["reference_estimate"] = chart.reference.estimate
        file.attrs["title"], file.attrs["quantity"] = chart.title, chart.quantity
        data = {name: (np.array([getattr(way, name) for way in chart.ways]), *what) for name, what in COLUMNS.items()}
        data["efficient"] = chart.efficient().astype(np.int8), "1: no way is both cheaper in time and nearer", "1"
        for name in ("series", "label", "note"):
            texts = np.array([getattr(way, name) for way in chart.ways], dtype=h5py.string_dtype())
            data[name] = texts, {"series": "kind of way", "label": "its setting", "note": "why not solved"}[name], "1"
        for name, (values, description, unit) in data.items():
            described(file, name, description, unit, data=values)
        chosen = chart.chosen()
        file["label"].attrs["chosen"] = -1 if chosen is None else chosen


def holds_chart(path: str) -> bool:
    """Whether a file is that of a chart."""
    return is_of_format(path, FORMAT)


def read(path: str) -> Chart:
    """The chart that a file holds; columns that older files have not are 0, and their title says little."""
    with stored(path, "a file of `attrito chart`") as file:
        count = len(file["label"])
        columns = {name: file[name][()] if name in file else np.zeros(count) for name in COLUMNS}
        texts = {name: [as_text(text) for text in file[name][()]] for name in ("series", "label", "note")}
        chosen = int(file["label"].attrs["chosen"])
        title, quantity = (as_text(file.attrs.get(name, "Relative error")) for name in ("title", "quantity"))
        estimate, harmonics = float(file.attrs["reference_estimate"]), int(file.attrs["reference_harmonics"])
        places = {name: float(file.attrs[name]) for name in PLACES if name in file.attrs}
    ways = [
        Way(
            **{name: texts[name][i] for name in texts},
            **{name: values[i].item() for name, values in columns.items()},
            own=i == chosen,
        )
        for i in range(count)
    ]
    return Chart(ways, places, title, quantity, Way("reference", "", harmonics=harmonics, estimate=estimate))


def stored_table(path: str) -> str:
    """The table of a chart that is in a file: CSV, a line a way."""
    return table(read(path))
