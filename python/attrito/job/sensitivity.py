"""`[sensitivity]`: the parameters that derivatives are asked for, and the quantities they are of beside monitors."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from attrito.job.job import Job
from attrito.job.laws import LAW_KEYS
from attrito.support.errors import Fault, InputError

# Numbers that Iwan's law has beside those of every law
IWAN_KEYS = ("chi", "beta")
# Of contacts, as `attrito table --contacts` names them
OF_CONTACTS = ("dissipated_energy", "t1_mean", "t2_mean", "n_mean")
EXPECTED = (
    'one of "contact[0].KEY" or "contact_set[0].KEY", "[*]" for all, KEY one of '
    + ", ".join((*LAW_KEYS, *IWAN_KEYS))
    + ', or "friction_coefficient[0]" of a table by pressure; "load.NAME"; "damping.ratio", "damping.loss_factor",'
    ' "damping.rayleigh[0]" or "[1]"; or "level"'
)
EXPECTED_QUANTITY = (
    'one of "contact[0].NAME" or "contact_set[0].NAME", "[*]" for all of these, or "NAME" of all contacts, NAME one of '
    + ", ".join(OF_CONTACTS)
)

STIFFNESSES = ("tangential_stiffness", "normal_stiffness")
BY_STIFFNESS = "no contact stiffness with [damping] ratio, a ratio of the stuck modes: they change with it"
# Parameters of damping, in the order of the library
DAMPING = ("damping.rayleigh[0]", "damping.rayleigh[1]", "damping.ratio", "damping.loss_factor")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a job.

    Parameters
    ----------
    name : as the job has it
    places : tables and numbers of their entries that have it; none: a load, damping or the level
    key : the key of these, or the load's name
    row : of a table by pressure; None: the key is a number
    """

    name: str
    places: tuple[tuple[str, int], ...]
    key: str
    row: int | None = None

    def value(self, job: Job) -> float:
        """Its value in a job; of a load the factor 1, of entries with several values, and of the level, NaN."""
        if self.name in DAMPING:
            key = re.fullmatch(r"damping\.(\w+)(?:\[(\d)\])?", self.name)
            assert key is not None
            given = job["damping"][key[1]]
            return float(given if key[2] is None else given[int(key[2])])
        if not self.places:
            return 1.0 if self.key else np.nan
        values = {self._number(job[table][number]) for table, number in self.places}
        return values.pop() if len(values) == 1 else np.nan

    def _number(self, entry: dict[str, object]) -> float:
        value = entry[self.key]
        if self.row is not None:
            assert isinstance(value, list)
            value = value[self.row][1]
        assert isinstance(value, int | float)
        return float(value)

    def moved(self, job: Job, change: float) -> Job:
        """A job in which it is larger by `change`; of laws alone."""
        tables = job.tables | {table: list(job[table]) for table in {table for table, _ in self.places}}
        for table, number in self.places:
            entry = tables[table][number]
            value = self._number(entry) + change
            if self.row is not None:
                rows = [list(pair) for pair in entry[self.key]]
                rows[self.row][1] = value
                tables[table][number] = entry | {self.key: rows}
            else:
                tables[table][number] = entry | {self.key: value}
        return Job(job.path, tables, job.given, job.settings)


@dataclass(frozen=True)
class Quantity:
    """What is differentiated beside monitors: a sum over contacts.

    Parameters
    ----------
    name : as the job has it
    kind : one of `OF_CONTACTS`
    table, number : which entry's contacts; None: all
    """

    name: str
    kind: str
    table: str | None = None
    number: int | None = None

    def factors(self, job: Job, tables: np.ndarray) -> np.ndarray:
        """On each contact, `[nc]`; `tables`: which entry of `[[contact]]` and `[[contact_set]]` each comes from."""
        explicit = len(job["contact"])
        if self.table is None:
            return np.ones(len(tables))
        own = tables < explicit if self.table == "contact" else tables >= explicit
        if self.number is not None:
            own &= tables == self.number + (0 if self.table == "contact" else explicit)
        return own.astype(float)


def parameters_of(job: Job) -> list[Parameter]:
    """The parameters that a checked job asks derivatives for."""
    return [_parameter(job, name) for name in job["sensitivity"]["to"]]


def quantities_of(job: Job) -> list[Quantity]:
    """The quantities beside monitors that a checked job asks derivatives of."""
    return [_quantity(job, name) for name in job["sensitivity"]["of"]]


def check_sensitivity(job: Job) -> list[Fault]:
    """What is no parameter or quantity of a job, and jobs of a kind that has no derivatives."""
    names, quantities = job["sensitivity"]["to"], job["sensitivity"]["of"]
    if not names:
        if quantities:
            return [job.fault("[sensitivity] of", quantities, "no such key without to, the parameters")]
        return []
    faults = []
    if job["balance"]["approach"] != "coupled":
        expected = '"coupled" with [sensitivity]'
        faults.append(job.fault("[balance] approach", job["balance"]["approach"], expected))
    if "cyclic" in job.given and "damping.ratio" in names:
        expected = "no ratio of the stuck modes with [cyclic]: they are those of each nodal diameter"
        faults.append(job.fault(f"[sensitivity] to[{names.index('damping.ratio')}]", "damping.ratio", expected))
    for number, name in enumerate(names):
        try:
            found = _parameter(job, name)
            if job["damping"]["ratio"] is not None and found.key in STIFFNESSES and found.places:
                raise ValueError(BY_STIFFNESS)
        except ValueError as error:
            faults.append(job.fault(f"[sensitivity] to[{number}]", name, str(error)))
    monitors = [monitor["name"] for monitor in job["output"]["monitors"]]
    taken = {f"{name}{end}" for name in monitors for end in ("", "_amplitude", "_mean")}
    for number, name in enumerate(quantities):
        try:
            _quantity(job, name)
            if name in taken:
                raise ValueError("a quantity that no monitor is named like: tables name both alike")
        except ValueError as error:
            faults.append(job.fault(f"[sensitivity] of[{number}]", name, str(error)))
    return faults


def refuse_for_sectors(job: Job, what: str) -> None:
    """Raise where derivatives of something are asked for that are of whole models alone."""
    names = job["sensitivity"]["to"]
    if names and "cyclic" in job.given:
        raise InputError(
            job.fault(
                "[sensitivity] to", names, f"no such key with [cyclic]: derivatives of {what} are of whole models"
            )
        )


def _parameter(job: Job, name: str) -> Parameter:
    if name == "level":
        return Parameter(name, (), "")
    if name in DAMPING:
        if job["damping"][name.split(".")[1].split("[")[0]] is None:
            raise ValueError("a damping that the job gives")
        if name == "damping.ratio" and isinstance(job["damping"]["ratio"], list):
            raise ValueError("one ratio of all modes: there are no derivatives by a list")
        return Parameter(name, (), name)
    if (load := re.fullmatch(r"load\.(.+)", name)) is not None:
        _check_load(job, load[1])
        return Parameter(name, (), load[1])
    entry = re.fullmatch(r"(contact|contact_set)\[(\d+|\*)\]\.(\w+)(?:\[(\d+)\])?", name)
    if entry is None or entry[3] not in (*LAW_KEYS, *IWAN_KEYS) or (entry[4] and entry[3] != "friction_coefficient"):
        raise ValueError(EXPECTED)
    table, _, key, row = entry.groups()
    numbers = _entries(job, table, entry[2])
    for number in numbers:
        _check_number(job[table][number], f"{table}[{number}]", key, None if row is None else int(row))
    return Parameter(name, tuple((table, number) for number in numbers), key, None if row is None else int(row))


def _entries(job: Job, table: str, place: str) -> list[int]:
    numbers = list(range(len(job[table]))) if place == "*" else [int(place)]
    if not numbers or max(numbers) >= len(job[table]):
        raise ValueError(f"one of the job's [[{table}]], of which there are {len(job[table])}, counted from 0")
    return numbers


def _check_number(entry: dict[str, object], place: str, key: str, row: int | None) -> None:
    """Raise where an entry's key is no number that forces have a derivative by."""
    value = entry[key]
    if key in ("normal_stiffness", "gap") and entry.get("normal", ...) is None:
        raise ValueError(f"a contact with normal; {place} has a constant normal force")
    if row is not None:
        if not isinstance(value, list) or row >= len(value):
            raise ValueError(f"a row, from 0, of a table by pressure; {place}.{key} is {value!r}")
        value = value[row][1]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"a parameter that is a number; {place}.{key} is {value!r}")
    if key == "friction_coefficient" and value == 0.0:
        raise ValueError(f"a friction coefficient above 0, where forces have a derivative by it; {place}")
    if key == "beta" and value == 0.0:
        raise ValueError(f"beta above 0, where forces have a derivative by it; {place}")


def _check_load(job: Job, name: str) -> None:
    """Raise unless a name is of a static load, or of the one harmonic load of a harmonic."""
    static = [keys["name"] for keys in job["load"] if keys["kind"] == "static"]
    harmonic = {keys["name"]: keys["harmonic"] for keys in job["load"] if keys["kind"] == "harmonic" and keys["name"]}
    if name not in (*static, *harmonic):
        known = ", ".join(map(str, (*static, *harmonic)))
        raise ValueError(f"the name of a load: {known or 'there is none'}")
    beside = [keys for keys in job["load"] if keys["kind"] == "harmonic" and keys["harmonic"] == harmonic.get(name)]
    if len(beside) > 1:
        raise ValueError(f"a harmonic load that has its harmonic, {harmonic[name]}, alone")


def _quantity(job: Job, name: str) -> Quantity:
    if name in OF_CONTACTS:
        return Quantity(name, name)
    entry = re.fullmatch(r"(contact|contact_set)\[(\d+|\*)\]\.(\w+)", name)
    if entry is None or entry[3] not in OF_CONTACTS:
        raise ValueError(EXPECTED_QUANTITY)
    table, place, kind = entry.groups()
    _entries(job, table, place)
    return Quantity(name, kind, table, None if place == "*" else int(place))
