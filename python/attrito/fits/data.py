"""One set of measurements, and what it is of: the tables [[data]] of a fit, checked."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from attrito.fits.measured import COLUMNS, Measured
from attrito.fits.reading import Layout, known_columns, read_measured
from attrito.job.checks import Check, boolean, choice, dataset_name, frequency, number, text
from attrito.job.job import Job
from attrito.job.varied import checked
from attrito.modes.nonlinear import check_mode
from attrito.support.errors import Fault, InputError

# Standard deviations of measurements that say none: relative ones of amplitudes, frequencies and damping ratios, of
# phases in degrees, of a loop's columns part of half their range
USUAL = {"amplitude": 0.05, "frequency": 1e-3, "damping": 0.1, "phase": 5.0, "force": 0.02, "displacement": 0.02}
# What a backbone was made by, and the mode's numbers that it is compared with: frequency, and damping by the contacts
RULES = {"cycle": ("frequency_hz", "damping_ratio"), "masing": ("masing_hz", "masing_damping_ratio")}
# What an amplitude is of: half the range of a monitor; of its first harmonic, by (power of omega, whether it is over
# the force)
RANGE = "range"
HARMONIC = {
    "displacement": (0, False),
    "velocity": (1, False),
    "acceleration": (2, False),
    "receptance": (0, True),
    "mobility": (1, True),
    "accelerance": (2, True),
}
# Of each kind of measurements: its own keys
OWN = {
    "response": ("monitor", "level", "quantity", "force", "decibel", "phase", "amplitude_deviation", "phase_deviation"),
    "mode": ("monitor", "quantity", "rule", "frequency_deviation", "damping_deviation"),
    "loop": (
        *("contact", "normal_force", "area", "closed", "force_deviation"),
        *("frequency_hz", "level", "monitor", "displacement_deviation"),
    ),
}


def _table(check: Check, words: str) -> Check:
    """A table of what a check takes, by names of columns."""

    def taken(value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise ValueError(words)
        try:
            return {str(name): check(entry) for name, entry in value.items()}
        except ValueError as error:
            raise ValueError(f"{words}; {error}") from None

    return taken


CHECKS: dict[str, tuple[Check, Any]] = {
    "name": (dataset_name, None),
    "of": (choice(*COLUMNS), "response"),
    "file": (text, None),
    "job": (text, None),
    "weight": (number(0, above=True), 1.0),
    "columns": (_table(text, 'names of the file by those of columns, as { amplitude = "Mag (g)" }'), {}),
    "factors": (_table(number(), "numbers by names of columns, as { amplitude = 9.81 }"), {}),
    "monitor": (text, None),
    "level": (number(0, above=True), 1.0),
    "quantity": (choice(RANGE, *HARMONIC), RANGE),
    "force": (number(0, above=True), None),
    "decibel": (boolean, False),
    "phase": (boolean, False),
    "rule": (choice(*RULES), "cycle"),
    "contact": (text, None),
    "normal_force": (number(0, above=True), None),
    "area": (number(0, above=True), None),
    "closed": (boolean, True),
    "frequency_hz": (frequency(), None),
} | {f"{name}_deviation": (number(0, above=True), value) for name, value in USUAL.items()}


@dataclass(frozen=True)
class Data:
    """Measurements of one kind, and what they are of.

    Parameters
    ----------
    name, of : how it is called; a name of `COLUMNS`
    file, job : of the measurements; the job whose solution they are compared with
    weight : on all of its residuals
    keys : the kind's own, of `OWN`
    measured : the numbers
    """

    name: str
    of: str
    file: str
    job: str | Job
    weight: float
    keys: dict[str, Any]
    measured: Measured

    @property
    def is_excited(self) -> bool:
        """Whether its job needs harmonic loads and a sweep."""
        return self.of == "response" or self.keys.get("frequency_hz") is not None

    def as_table(self) -> dict[str, Any]:
        """All but the job and the numbers."""
        return {name: value for name, value in vars(self).items() if name not in ("measured", "job")}

    @property
    def units(self) -> dict[str, str]:
        """Units by column, of where it was measured and of what is compared, in words of `support/units.py`."""
        known = {"frequency_hz": "Hz", "frequency_ratio": "1", "damping_ratio": "1", "phase_deg": "degree"}
        if self.of == "loop":
            return {"displacement": "user length", "tangential_force": "user force"}
        if self.of == "mode" and self.keys["monitor"] is None:
            return known | {"amplitude": "user length (user mass)^0.5"}
        power, over_force = HARMONIC.get(self.keys["quantity"], (0, False))
        length = "user length" + ("", "/user time", "/user time^2")[power]
        per = "/(user time^2 user force)" if power == 2 else "/(user time user force)" if power else "/user force"
        return known | {"amplitude": "user length" + per if over_force else length}

    def faults_of_job(self, path: str, job: Job) -> list[Fault]:
        """What of its job does not go with it; `path` of the fit."""
        return FAULTS[self.of](self, path, job)

    def place(self) -> tuple[str, int]:
        """Table and index of a loop's contact."""
        table, index = re.fullmatch(r"(\w+)\[(\d+)\]", self.keys["contact"]).groups()  # type: ignore[union-attr]
        return table, int(index)


def data_of(path: str, i: int, row: dict[str, Any], job: str | None, faults: list[Fault]) -> Data | None:
    """One table [[data]] of a fit and its measurements; what is not fine goes to the faults, and nothing comes back.

    Parameters
    ----------
    path, i, row : of the fit; place of the table, and its keys
    job : of the fit
    """
    where, folder = f"data[{i}]", Path(path).parent
    before = len(faults)
    one = checked(path, f"{where} ", row, CHECKS, faults)
    own = one["job"] or job
    if own is None:
        faults.append(Fault(path, f"{where} job", "missing", "a job file, here or for all data"))
    if one["name"] is None or one["file"] is None:
        faults.append(Fault(path, where, "missing", "name and file"))
        return None
    of = one["of"]
    faults += _faults_of_keys(path, where, row, one)
    if len(faults) > before:
        return None
    file = os.path.normpath(folder / one["file"])
    deviations = {name: one[f"{name}_deviation"] for name in USUAL}
    names = "columns", "factors", "decibel", "phase", "monitor", "normal_force", "closed", "frequency_hz"
    try:
        measured = read_measured(file, of, Layout(*(one[name] for name in names)), deviations)
    except InputError as error:
        faults += error.faults
        return None
    keys = {name: one[name] for name in OWN[of]}
    return Data(one["name"], of, file, os.path.normpath(folder / (own or "job")), one["weight"], keys, measured)


def _faults_of_keys(path: str, where: str, row: dict[str, Any], one: dict[str, Any]) -> list[Fault]:
    """Keys and columns of another kind of measurements, and those that ask for others."""
    of, faults = one["of"], []
    for name in row:
        kinds = [kind for kind, names in OWN.items() if name in names]
        if kinds and of not in kinds:
            expected = " or ".join(f'of = "{kind}"' for kind in kinds)
            faults.append(Fault(path, f"{where} {name}", row[name], f"no such key but with {expected}"))
    known = known_columns(of)
    for key in ("columns", "factors"):
        for name in one[key]:
            deviation = key == "columns" and name.endswith("_deviation")
            if name.removesuffix("_deviation" if deviation else "") not in known:
                faults.append(Fault(path, f"{where} {key}", name, f"one of {', '.join(known)}"))
    if of == "loop" and (one["contact"] is None or not re.fullmatch(r"contact(_set)?\[\d+\]", one["contact"])):
        expected = 'the contact whose law it is of, such as "contact[0]" or "contact_set[1]"'
        faults.append(Fault(path, f"{where} contact", one["contact"] or "missing", expected))
    if of == "loop":
        solved = one["frequency_hz"] is not None
        for name in ("normal_force", "area", "closed") if solved else ("monitor", "level", "displacement_deviation"):
            if name in row:
                expected = f"no such key {'beside' if solved else 'without'} frequency_hz"
                faults.append(Fault(path, f"{where} {name}", row[name], expected))
    over_force = HARMONIC.get(one["quantity"], (0, False))[1]
    if of == "mode" and one["quantity"] != RANGE and (over_force or one["monitor"] is None):
        expected = f"one of {RANGE}, displacement, velocity, acceleration, of a monitor"
        faults.append(Fault(path, f"{where} quantity", one["quantity"], expected))
    elif over_force != (one["force"] is not None):
        expected = "the amplitude of the force that the response was divided by" if over_force else _no_force()
        faults.append(Fault(path, f"{where} force", one["force"] or "missing", expected))
    if one["phase"] and one["quantity"] == RANGE:
        expected = f"one of {', '.join(HARMONIC)} with phase = true: a range has no phase"
        faults.append(Fault(path, f"{where} quantity", RANGE, expected))
    return faults


def _no_force() -> str:
    divided = ", ".join(name for name, (_, over_force) in HARMONIC.items() if over_force)
    return f"no such key but with quantity one of {divided}"


def _faults_of_response(one: Data, path: str, job: Job) -> list[Fault]:
    names = [monitor["name"] for monitor in job["output"]["monitors"]]
    monitor = one.keys["monitor"]
    if monitor is not None and monitor not in names:
        return [Fault(path, f"data {one.name}: monitor", monitor, f"one of {', '.join(names)}")]
    return []


def _faults_of_mode(one: Data, path: str, job: Job) -> list[Fault]:
    try:
        check_mode(job)
    except InputError as error:
        return list(error.faults)
    if faults := _faults_of_response(one, path, job):
        return faults
    if one.keys["rule"] == "masing" and job["mode"]["method"] != "quasi_static":
        expected = '"quasi_static" with rule = "masing", which is of the first loading'
        return [job.fault("[mode] method", job["mode"]["method"], expected)]
    return []


def _faults_of_loop(one: Data, path: str, job: Job) -> list[Fault]:
    table, index = one.place()
    contact, area = one.keys["contact"], one.keys["area"]
    if index >= len(job[table]):
        expected = f"a [[{table}]] of the job, which has {len(job[table])}"
        return [Fault(path, f"data {one.name}: contact", contact, expected)]
    keys = job[table][index]
    if one.is_excited:
        return _faults_of_response(one, path, job)
    has_area = keys.get("stiffness_per") == "area" or (table == "contact_set" and keys["law"] == "pressure")
    if has_area != (area is not None):
        of_area = 'the area of the contact that was measured: stiffness_per = "area", or friction by pressure'
        expected = of_area if has_area else "no such key where stiffnesses are not per area"
        return [Fault(path, f"data {one.name}: area", area or "missing", expected)]
    return []


FAULTS: dict[str, Callable[[Data, str, Job], list[Fault]]] = {
    "response": _faults_of_response,
    "mode": _faults_of_mode,
    "loop": _faults_of_loop,
}
