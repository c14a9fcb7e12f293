"""Reading `result.h5`."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import wraps
from html import escape
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import h5py
import numpy as np

from attrito.library.names import NO_SOLUTION
from attrito.results.journal import is_journal
from attrito.results.result_file import fill_result
from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import check_sums
from attrito.support.hdf5_reading import UNREADABLE, as_text, check_datasets, spoilt
from attrito.support.units import axis_unit

P = ParamSpec("P")
Value = TypeVar("Value")
PathLike = str | os.PathLike[str]

# Formats of the files of `attrito linear-modes`, `attrito mode` and `attrito campbell`, which are read as results are
RESULT, LINEAR_MODES = "attrito result", "attrito linear modes"
MODE, CAMPBELL = "attrito mode", "attrito campbell diagram"
# Shapes of what is known of each contact, where it is more than a number.
OF_A_CONTACT = {"position": (3,), "frame": (3, 3)}


class Result:
    """An open `result.h5`; data are read when asked for.

    Parameters
    ----------
    path : the file, or the journal of a run that is not over

    Raises
    ------
    InputError : not there, not a result, or without a dataset that was asked for
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        if not Path(path).is_file():
            begun = f"{self.path}.partial"
            hint = f"; {begun} holds the points so far of a run that is not over, and is read, too"
            raise InputError(
                Fault(self.path, "file", "absent", "a result of `attrito run`" + hint * Path(begun).is_file())
            )
        try:
            self._file = _open(self.path)
        except UNREADABLE as error:
            raise InputError(Fault(self.path, "file", "not HDF5", "a result of `attrito run`")) from error
        try:
            self._check()
        except UNREADABLE as error:
            self.close()
            raise spoilt(self.path, error, "a result of `attrito run`") from error
        except InputError:
            self.close()
            raise

    def _check(self) -> None:
        """It is a result, and its series have an entry for each point and contact."""
        form = self.attribute("format") or "absent"
        if "result" not in form and form not in (LINEAR_MODES, MODE, CAMPBELL):
            made_by = "`attrito run`, `mode`, `linear-modes` or `campbell`"
            expected = f"a result of {made_by} (`attrito info` describes other files)"
            raise InputError(Fault(self.path, "format", form, expected))
        check_datasets(self._file, self.path)
        if not is_journal(self.path):
            check_sums(self._file, self.path)
        points = self._file.get("points/frequency_hz")
        if not isinstance(points, h5py.Dataset):
            return
        faults = []
        for place in ("points", "monitors", "contacts"):
            for path, stored in _datasets(self._file.get(place), place):
                wanted: tuple[int, ...] = (len(points), self.contacts) if place == "contacts" else (len(points),)
                if path.startswith("contacts/parameters/"):
                    wanted = (self.contacts, *OF_A_CONTACT.get(path.rsplit("/", 1)[1], ()))
                kinds, what = ("SO", "texts") if path == "contacts/parameters/set" else ("iuf", "numbers")
                if stored.dtype.kind not in kinds or stored.shape[: len(wanted)] != wanted:
                    value = f"{stored.dtype} of shape {stored.shape}"
                    faults.append(Fault(self.path, path, value, f"{what}, an entry for each of {wanted}"))
        if faults:
            raise InputError(*faults)

    def __enter__(self) -> Result:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __fspath__(self) -> str:
        """It stands for its file: `attrito.plot(result)`."""
        return self.path

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        self._file.close()

    def has(self, path: str) -> bool:
        """Whether the dataset or group is in the file."""
        return path in self._file

    def dataset(self, path: str) -> h5py.Dataset:
        """A dataset, unread."""
        if not isinstance(self._file.get(path), h5py.Dataset):
            raise InputError(Fault(self.path, path, "absent", "a dataset of a complete result"))
        return self._file[path]

    def array(self, path: str) -> np.ndarray:
        """A whole dataset."""
        try:
            values: np.ndarray = self.dataset(path)[()]
        except UNREADABLE as error:
            raise spoilt(self.path, error, f"a result of `attrito run` with {path}") from error
        return values

    def names(self, path: str) -> list[str]:
        """What the integers of a dataset stand for: its attribute `names`."""
        names = self.dataset(path).attrs.get("names")
        if names is None:
            raise InputError(Fault(self.path, f"{path}@names", "absent", "the names of its values"))
        if isinstance(names, str | bytes):
            return [name.strip() for name in as_text(names).split(",")]
        return [as_text(name) for name in names]

    def unit(self, path: str) -> str:
        """Unit of a dataset for an axis label: `length, user units`; empty for pure numbers."""
        return axis_unit(as_text(self.dataset(path).attrs.get("unit", "1")))

    def attribute(self, name: str) -> str:
        """A root attribute as text; empty if absent."""
        return as_text(self._file.attrs.get(name, ""))

    def attributes(self, path: str) -> dict[str, str]:
        """Attributes of a group or dataset as text; none where it is absent."""
        found = self._file.get(path)
        return {} if found is None else {name: as_text(value) for name, value in found.attrs.items()}

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.dataset("/points/frequency_hz"))

    @property
    def contacts(self) -> int:
        """Number of contacts, nc; 0 for a model without."""
        shape: tuple[int, ...] = self.dataset("/contacts/state").shape if self.has("/contacts/state") else ()
        return shape[1] if len(shape) == 2 else 0

    @property
    def outcome(self) -> list[str]:
        """Name of each point's outcome."""
        return self.named("/points/outcome")

    def named(self, path: str) -> list[str]:
        """Name of each entry of a series of whole numbers that stand for names, flat; empty for -1."""
        names, found = self.names(path), self.array(path).ravel()
        if np.any((found < -1) | (found >= len(names))):
            raise InputError(Fault(self.path, path, found.tolist(), f"numbers from 0 to {len(names) - 1}"))
        return [names[int(index)] if index >= 0 else "" for index in found]

    @property
    def converged(self) -> np.ndarray:
        """bool [np], whether the point holds a solution (be it unstable or indeterminate)."""
        return np.array([name not in NO_SOLUTION for name in self.outcome], dtype=bool)

    @property
    def monitors(self) -> list[str]:
        """Names of the monitors, in the job's order."""
        stored = list(self._file["/monitors"]) if self.has("/monitors") else []
        try:
            asked = [monitor["name"] for monitor in json.loads(self.attribute("job"))["output"]["monitors"]]
        except (ValueError, KeyError, TypeError):
            asked = []
        return sorted(stored, key=lambda name: (asked.index(name) if name in asked else len(asked), name))

    def monitor(self, name: str, quantity: str) -> np.ndarray:
        """`amplitude`, `mean`, `low`, `high` [np] or `harmonics` [np, nk] of a monitor."""
        if name not in self.monitors:
            known = ", ".join(self.monitors) or "none"
            raise InputError(Fault(self.path, "monitor", name, f"a monitor of this result ({known})"))
        return self.array(f"/monitors/{name}/{quantity}")

    def sensitivity(self, parameter: str, monitor: str, quantity: str = "amplitude") -> np.ndarray:
        """Derivative by one of `[sensitivity] to`, `[np]`, per unit of it.

        Parameters
        ----------
        parameter : as the job names it
        monitor : whose `amplitude` or `mean`; or one of `[sensitivity] of`, as the job names it
        quantity : of the monitor

        Raises
        ------
        InputError : the job did not ask for it, or there is no such monitor or quantity
        """
        asked = json.loads(self.attribute("job"))["sensitivity"] if self.has("/sensitivity/value") else {"to": []}
        names, others = asked["to"], asked.get("of", [])
        for what, given, known in (
            ("sensitivity", parameter, names),
            ("monitor", monitor, [*self.monitors, *others]),
            ("quantity", quantity, ("amplitude", "mean")),
        ):
            if given not in known:
                expected = f"one of {', '.join(known)}" if known else "a job with [sensitivity] to"
                raise InputError(Fault(self.path, what, given, expected))
        if monitor in self.monitors:
            return self.array(f"/sensitivity/{quantity}")[:, names.index(parameter), self.monitors.index(monitor)]
        return self.array("/sensitivity/quantities")[:, names.index(parameter), others.index(monitor)]

    def to_dataframe(self) -> Any:
        """The table of `attrito table` as a frame of pandas, which must be installed; one row a point.

        Columns that are empty for what was not examined are numbers with NaN, or of pandas's own types with NA.
        """
        try:
            import pandas
        except ImportError:
            raise InputError(Fault("to_dataframe", "pandas", "absent", "pandas, of Debian python3-pandas")) from None
        data: dict[str, Any] = {}
        for name in ("branch", "level", "frequency_hz", "period", "iterations", "estimate"):
            data[name] = self.array(f"/points/{name}")
        data["converged"], data["outcome"] = self.converged, self.outcome
        for name in ("stable", "unique"):
            values = self.array(f"/points/{name}")
            data[name] = pandas.array([None if value < 0 else bool(value) for value in values], dtype="boolean")
        for monitor in self.monitors:
            for quantity in ("amplitude", "mean", "low", "high"):
                data[f"{monitor}_{quantity}"] = self.monitor(monitor, quantity)
        frame = pandas.DataFrame(data)
        frame.index.name = "point"
        return frame

    def summary(self) -> dict[str, str]:
        """What the file holds, in words: points, frequencies, levels, outcomes, monitors, contacts."""
        found = {"file": self.path, "written by": f"attrito {self.attribute('attrito_version')}"}
        if job := self.attribute("job_file"):
            found["job"] = job
        if not self.has("/points/outcome"):
            return found
        found["points"] = f"{self.points}"
        frequency, level = (self.array(f"/points/{name}") for name in ("frequency_hz", "level"))
        if self.points:
            found["frequencies"] = f"{frequency.min():.6g} to {frequency.max():.6g} Hz"
            levels = [f"{value:.4g}" for value in np.unique(level)]
            found["levels"] = ", ".join(levels) if len(levels) <= 8 else f"{len(levels)}, {levels[0]} to {levels[-1]}"
            outcomes = self.outcome
            found["outcomes"] = ", ".join(f"{outcomes.count(name)} {name}" for name in dict.fromkeys(outcomes))
        found["contacts"] = f"{self.contacts}"
        for name in self.monitors:
            amplitude = self.monitor(name, "amplitude")
            if np.isfinite(amplitude).any():
                place = int(np.nanargmax(amplitude))
                at = f"{frequency[place]:.6g} Hz, level {level[place]:.4g}"
                found[f"monitor {name}"] = (
                    f"at most {amplitude[place]:.5g} ({self.unit(f'/monitors/{name}/amplitude')}) at {at}"
                )
        return found

    def __repr__(self) -> str:
        return f"<attrito.Result {self.path}: {self.points if self.has('/points/frequency_hz') else 0} points>"

    def _repr_html_(self) -> str:
        """The summary as a table, which notebooks show."""
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in self.summary().items()
        )
        return f"<table>{rows}</table>"

    def linear(self, kind: str, monitor: str) -> tuple[np.ndarray, np.ndarray] | None:
        """Frequencies (Hz) and amplitudes at level 1 of a linear response, one of `REFERENCES`, if stored."""
        path = f"/linear/{kind}"
        if not (self.has(f"{path}/frequency_hz") and self.has(f"{path}/{monitor}")):
            return None
        frequency, amplitude = self.array(f"{path}/frequency_hz"), self.array(f"{path}/{monitor}")
        if amplitude.shape != frequency.shape or frequency.ndim != 1:
            expected = f"one amplitude for each of the {frequency.size} frequencies of {path}"
            raise InputError(Fault(self.path, f"{path}/{monitor}", f"shape {amplitude.shape}", expected))
        return frequency, amplitude

    def check_point(self, point: int) -> None:
        """Raise unless `point` is one of the result's, counted from 0."""
        if not 0 <= point < self.points:
            raise InputError(Fault(self.path, "point", point, f"a number from 0 to {self.points - 1}"))


def reading(work: Callable[Concatenate[Result, P], Value]) -> Callable[Concatenate[Result | PathLike, P], Value]:
    """What is done with an open result, done with a file's name or what `attrito.run` returns, too."""

    @wraps(work)
    def done(result: Result | PathLike, *others: P.args, **named: P.kwargs) -> Value:
        if isinstance(result, Result):
            return work(result, *others, **named)
        with Result(result) as own:
            return work(own, *others, **named)

    # The first argument may be named, too, which Concatenate cannot say.
    return cast(Callable[Concatenate[Result | PathLike, P], Value], done)


def _open(path: str) -> h5py.File:
    """The file; of a run that is not over, what its journal holds so far."""
    if is_journal(path):
        file = h5py.File(path, "w", driver="core", backing_store=False)
        try:
            fill_result(file, path)
        except BaseException:
            file.close()
            raise
        return file
    return h5py.File(path, "r")


def _datasets(group: h5py.Group | None, place: str) -> list[tuple[str, h5py.Dataset]]:
    """All datasets below a group, by their path."""
    found: list[tuple[str, h5py.Dataset]] = []

    def look(name: str, thing: h5py.Group | h5py.Dataset) -> None:
        if isinstance(thing, h5py.Dataset):
            found.append((f"{place}/{name}", thing))

    if isinstance(group, h5py.Group):
        group.visititems(look)
    return found
