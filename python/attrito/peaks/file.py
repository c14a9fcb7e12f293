"""The file of `attrito peak`: peaks along a curve, as HDF5 and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.job.job import Job
from attrito.library.names import OUTCOMES, STATES
from attrito.library.reduced_scene import ReducedScene
from attrito.peaks.curve import KINDS, Found, elasticity, ending_of, jumps
from attrito.support.atomic_files import whole_hdf5
from attrito.support.csv_text import cell
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, is_of_format, stored
from attrito.support.hdf5_writing import described
from attrito.support.version import __version__

if TYPE_CHECKING:
    import h5py

REFERENCES = "Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032"
FORMAT = "attrito peaks"


COLUMNS = {
    "level": ("factor on the harmonic loads", "1"),
    "preload": ("factor on the static loads", "1"),
    "frequency_hz": ("frequency of the peak", "Hz"),
    "amplitude": ("amplitude of the monitor at the peak", "user length"),
    "response": ("amplitude by level", "user length"),
    "elasticity": (
        "relative change by relative change of the parameter: of response, or of amplitude (preload); NaN at a corner",
        "1",
    ),
    "curvature": (
        "second derivative of the amplitude by frequency; negative at a maximum, NaN at a corner",
        "user length/Hz^2",
    ),
    "residual": ("relative residual of the balance", "1"),
    "estimate": ("estimated relative error of the point by truncation", "1"),
    "amplitude_error": ("estimated relative error of the peak's amplitude; NaN: not known", "1"),
    "frequency_error": ("estimated relative error of the peak's frequency; NaN: not known", "1"),
}
COUNTS = {
    "iterations": "Newton steps, failed steps included",
    "evaluations": "of the balance since the start, static path included",
    "unique": "1 yes, 0 no, -1 not examined",
    "jump": "1: not on the curve of the peak before, another one was found between; 0: on it",
    "corner": "1: the response rises to the peak on one side and falls on the other, with a corner; 0: it is smooth",
}

# By name of its dataset what is differentiated: in short, in words, and its unit
SENSITIVITY = {
    "sensitivity": (
        "amplitude",
        "derivative of the peak's amplitude by each of [sensitivity] to",
        "user length by parameter",
    ),
    "sensitivity_frequency": (
        "frequency",
        "derivative of the peak's frequency by each of [sensitivity] to",
        "Hz by parameter",
    ),
}
NO_SENSITIVITY = "NaN at a corner, by samples (frequency), or without a peak"
# Of sweeps for a higher peak
BESIDE = {
    "higher_frequency_hz": (
        "frequency of the highest peak, where it is higher than this one; NaN: none, or not swept",
        "Hz",
    ),
    "higher_amplitude": ("its amplitude", "user length"),
    "swept_low_hz": ("lowest frequency to which the band was swept for a higher peak; NaN: not swept", "Hz"),
    "swept_high_hz": ("highest frequency of that sweep", "Hz"),
}
# Of columns, those that not every file has: errors of peaks are not in files of attrito 0.2
ERRORS = ("amplitude_error", "frequency_error")
OPTIONAL = (*BESIDE, *ERRORS)


def columns(found: list[Found], parameter: str) -> dict[str, np.ndarray]:
    """Every column of the table by name; NaN where there is no peak."""
    rows: dict[str, list[Any]] = {name: [] for name in [*COLUMNS, *COUNTS]}
    for one in found:
        peak = one.peak
        known = one.converged
        values = {
            "level": peak.level,
            "preload": peak.parameter if parameter == "preload" else 1.0,
            "frequency_hz": peak.frequency_hz if known else np.nan,
            "amplitude": peak.amplitude if known else np.nan,
            "response": peak.response if known else np.nan,
            "elasticity": elasticity(peak, parameter) if known else np.nan,
            # By angular frequency in the library.
            "curvature": (2.0 * np.pi) ** 2 * peak.curvature if known else np.nan,
            "residual": peak.point.residual,
            "estimate": peak.point.estimate,
            "amplitude_error": peak.amplitude_error if known else np.nan,
            "frequency_error": peak.frequency_error if known else np.nan,
            "iterations": peak.point.iterations,
            "evaluations": peak.evaluations,
            "unique": int(peak.point.unique),
            "corner": int(peak.at_corner),
        }
        for name, value in values.items():
            rows[name].append(value)
    data = {name: np.array(values) for name, values in rows.items() if name != "jump"}
    height = data["response" if parameter == "level" else "amplitude"]
    # There is no peak before the first.
    moved = [one.moved and i > 0 for i, one in enumerate(found)]
    return data | {"jump": (jumps(data[parameter], height, data["elasticity"]) | moved).astype(int)}


def jumps_in_words(found: list[Found], parameter: str) -> list[str]:
    """A warning for each place at which the curve leaves one peak for another."""
    data = columns(found, parameter)
    value, frequency = data[parameter], data["frequency_hz"]
    return [
        f"between {parameter} {value[i - 1]:.5g} and {value[i]:.5g} the peak at {frequency[i - 1]:.5g} Hz is left, and"
        f" another one at {frequency[i]:.5g} Hz is followed: beside either there may be a higher one"
        for i in np.flatnonzero(data["jump"])
    ]


def beside(found: list[Found]) -> dict[str, np.ndarray]:
    """What sweeps found beside each peak; NaN where none was made."""
    known = [
        (np.nan,) * 4 if one.higher is None else (one.higher.frequency_hz, one.higher.amplitude, *one.higher.swept_hz)
        for one in found
    ]
    return dict(zip(BESIDE, np.array(known, dtype=float).reshape(-1, 4).T, strict=True))


def higher_in_words(found: list[Found], parameter: str) -> list[str]:
    """Warnings of peaks that are higher than the one followed, and of where none was looked for."""
    swept = [(one.peak, one.higher) for one in found if one.higher is not None]
    above = [
        f"{peak.parameter:.5g} (at {higher.frequency_hz:.5g} Hz, {higher.amplitude / peak.amplitude:.3g} times as high)"
        for peak, higher in swept
        if higher.exists
    ]
    partly = [
        f"{peak.parameter:.5g} ({higher.swept_hz[0]:.5g} to {higher.swept_hz[1]:.5g} Hz)"
        for peak, higher in swept
        if not higher.whole
    ]
    words = []
    if above:
        words.append(f"the peak that is followed is not the highest of the band at {parameter} {', '.join(above)}")
    if partly:
        words.append(f"a higher peak was looked for in a part of the band only at {parameter} {', '.join(partly)}")
    return words


def write(
    path: str,
    job: Job,
    scene: ReducedScene,
    found: list[Found],
    warnings: Sequence[str] = (),
) -> None:
    """Write the peaks and what was warned of; the file appears when it is complete."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(path) as file:
        _write_attributes(file, job, scene, found, warnings)
        _write_columns(file, columns(found, job["peak"]["parameter"]), found)
        _write_monitors(file, scene.monitor_names, found)
        if parameters := job["sensitivity"]["to"]:
            _write_slopes(file, parameters, found)
        if any(one.higher is not None for one in found):
            for name, values in beside(found).items():
                _put(file, name, values, *BESIDE[name])


def _write_attributes(
    file: h5py.File, job: Job, scene: ReducedScene, found: list[Found], warnings: Sequence[str]
) -> None:
    """Where the peaks come from, what was asked, and how the curve ends."""
    keys = job["peak"]
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = 1
    file.attrs["attrito_version"] = __version__
    file.attrs["description"] = "A resonance peak followed in a parameter; see docs/how-to/peaks.md of attrito"
    file.attrs["references"] = REFERENCES
    file.attrs.update(job.attributes)
    file.attrs["warnings"] = "\n".join(warnings)
    file.attrs["parameter"] = keys["parameter"]
    file.attrs["amplitude"] = keys["amplitude"]
    ending = ending_of(found, keys["parameter"], keys["stop"])
    file.attrs["ending"] = ending.kind
    file.attrs["ending_in_words"] = ending.words
    file.attrs["monitor"] = keys["monitor"] or scene.monitor_names[0]


def _put(
    file: h5py.File, name: str, values: np.ndarray, description: str, unit: str = "1", names: tuple[str, ...] = ()
) -> None:
    """A column of the peaks; `names`: of its numbers, or of its columns."""
    stored = described(file, f"peaks/{name}", description, unit, data=values)
    if names:
        stored.attrs["names"] = list(names)


def _write_columns(file: h5py.File, data: dict[str, np.ndarray], found: list[Found]) -> None:
    """What `columns` has of the peaks, and why each is there, how it ended, and its contacts' states."""
    for name, (description, unit) in COLUMNS.items():
        _put(file, name, data[name], description, unit)
    for name, description in COUNTS.items():
        _put(file, name, data[name].astype(np.int32), description)
    kinds = np.array([KINDS.index(one.kind) for one in found], dtype=np.int32)
    _put(file, "kind", kinds, "why it is there", names=KINDS)
    outcomes = np.array([OUTCOMES.index(one.peak.outcome) for one in found], dtype=np.int32)
    _put(file, "outcome", outcomes, "how it ended", names=OUTCOMES)
    states = np.array([one.peak.point.states for one in found], dtype=np.int32)
    _put(file, "states", states, "contacts in each state", names=STATES)


def _write_monitors(file: h5py.File, names: list[str], found: list[Found]) -> None:
    """Harmonics and amplitudes of the monitors at the peaks."""
    for i, name in enumerate(names):
        harmonics = np.array([one.peak.point.harmonics[i] for one in found])
        _put(file, f"monitors/{name}/harmonics", harmonics, "mean, cos 1, sin 1, cos 2, ...", "user length")
        ranges = np.array([one.peak.point.amplitude[i] for one in found])
        _put(file, f"monitors/{name}/amplitude", ranges, "half the range over the period", "user length")


def _write_slopes(file: h5py.File, parameters: list[str], found: list[Found]) -> None:
    """Derivatives of the peaks by parameters."""
    file.attrs["sensitivity_to"] = parameters
    slopes = np.array([one.derivatives for one in found])
    for i, (name, (_, words, unit)) in enumerate(SENSITIVITY.items()):
        _put(file, name, np.ascontiguousarray(slopes[:, i]), f"{words}; {NO_SENSITIVITY}", unit)


def read_peaks(path: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Columns of a file of peaks, and its attributes."""
    with stored(path, "peaks of `attrito peak`") as file:
        if file.attrs.get("format") != FORMAT:
            raise InputError(Fault(path, "format", file.attrs.get("format", "absent"), "peaks of `attrito peak`"))
        names = [*COLUMNS, *COUNTS, "kind", "outcome", "states", *OPTIONAL]
        missing = {name for name in OPTIONAL if name not in file["peaks"]}
        data = {name: file[f"peaks/{name}"][()] for name in dict.fromkeys(names) if name not in missing}
        for name, (short, *_) in SENSITIVITY.items():
            if name not in file["peaks"]:
                continue
            for i, parameter in enumerate(file.attrs.get("sensitivity_to", ())):
                data[f"{short} by {as_text(parameter)}"] = file[f"peaks/{name}"][:, i]
        return data, dict(file.attrs)


def holds_peaks(path: str) -> bool:
    """Whether a file is one of `attrito peak`; False too where it is no file that can be read."""
    return is_of_format(path, FORMAT)


def table(path: str) -> str:
    """The peaks as CSV."""
    data, _ = read_peaks(path)
    numbers = [name for name in data if name in COLUMNS or name in OPTIONAL or " by " in name]
    names = ["kind", *numbers, *COUNTS, *STATES, "outcome"]
    lines = [",".join(map(cell, names))]
    for i in range(len(data["level"])):
        row = [KINDS[data["kind"][i]], *(f"{data[name][i]:.12g}" for name in numbers)]
        row += [str(data[name][i]) for name in COUNTS] + [str(count) for count in data["states"][i]]
        lines.append(",".join([*row, OUTCOMES[data["outcome"][i]]]))
    return "\n".join(lines) + "\n"


def smooth_curve(parameter: np.ndarray, amplitude: np.ndarray, power: np.ndarray, count: int = 24) -> np.ndarray:
    """The curve between peaks by their exact slopes, `[2, points]`: cubic Hermite pieces in logarithms.

    Parameters
    ----------
    parameter, amplitude : at the peaks in the order of the curve
    power : d log(amplitude)/d log(parameter) there; NaN where the response has a corner
    """
    from scipy.interpolate import CubicHermiteSpline

    x, y = np.log(parameter), np.log(amplitude)
    pieces = []
    for i in range(len(x) - 1):
        first, last = (i, i + 1) if x[i] < x[i + 1] else (i + 1, i)
        if x[first] == x[last]:
            continue
        secant = (y[last] - y[first]) / (x[last] - x[first])
        slopes = [secant if np.isnan(power[at]) else power[at] for at in (first, last)]
        piece = CubicHermiteSpline([x[first], x[last]], [y[first], y[last]], slopes)
        at = np.linspace(x[i], x[i + 1], count)
        pieces.append(np.array([at, piece(at)]))
    return np.exp(np.concatenate(pieces, axis=1)) if pieces else np.array([parameter, amplitude])
