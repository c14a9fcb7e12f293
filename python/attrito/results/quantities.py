"""What a file of attrito holds, as arrays that know their names, units and descriptions.

with attrito.open("result.h5") as result:
    result.points.frequency_hz               # Quantity [64] in Hz
    result.monitors["tip"].amplitude.max()
    result.points.outcome.labels             # what integers stand for
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from attrito.job.reference import as_job
from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import check_sums
from attrito.support.hdf5_reading import UNREADABLE, as_text, check_datasets, spoilt


class Quantity(NDArrayOperatorsMixin):
    """An array with a unit, a description and, where its integers stand for something, their names.

    It computes like a numpy array and gives plain arrays: what the unit of a product is, nobody here works out.

    Parameters
    ----------
    values : the array, `[...]`
    unit : `Hz`, `user length` (the user's own), `1` for pure numbers
    description : one line
    names : what the values 0, 1, 2, ... stand for; empty where they are numbers

    Examples
    --------
    >>> stiffness = Quantity([1.0, 2.0], "user force/length", "of two springs")
    >>> 2 * stiffness
    array([2., 4.])
    >>> stiffness[1:]
    Quantity([2.], 'user force/length')
    """

    def __init__(self, values: Any, unit: str = "1", description: str = "", names: tuple[str, ...] = ()) -> None:
        self.values = np.asarray(values)
        self.unit, self.description, self.names = unit, description, names

    @property
    def labels(self) -> np.ndarray:
        """The names that the values stand for, `[...]` of text; empty text for a value without one."""
        if not self.names:
            raise InputError(Fault("Quantity", "labels", self.description, "values that stand for names"))
        table = np.array([*self.names, ""], dtype=object)
        known = (self.values >= 0) & (self.values < len(self.names))
        found: np.ndarray = table[np.where(known, self.values, len(self.names))]
        return found

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths along the axes."""
        return self.values.shape

    def __array__(self, dtype: Any = None) -> np.ndarray:
        return np.asarray(self.values, dtype=dtype)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        plain = [item.values if isinstance(item, Quantity) else item for item in inputs]
        return getattr(ufunc, method)(*plain, **kwargs)

    def __getattr__(self, name: str) -> Any:
        """Methods of arrays: `max()`, `mean(axis=0)`, ..."""
        if name.startswith("_") or name == "values":
            raise AttributeError(name)
        return getattr(self.values, name)

    def __getitem__(self, key: Any) -> Any:
        part = self.values[key]
        return Quantity(part, self.unit, self.description, self.names) if isinstance(part, np.ndarray) else part

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    def __bool__(self) -> bool:
        return bool(self.values)

    def __float__(self) -> float:
        return float(self.values)

    def __int__(self) -> int:
        return int(self.values)

    def __str__(self) -> str:
        return str(self.values)

    def __repr__(self) -> str:
        shown = np.array2string(self.values, threshold=20, separator=", ")
        return f"Quantity({shown}, {self.unit!r})"


class Group(Mapping):
    """A group of a file: its members by name, as attributes or by index; data are read when asked for."""

    def __init__(self, group: h5py.Group, path: str) -> None:
        self._group, self._path = group, path

    def __getitem__(self, name: str) -> Quantity | Group:
        found = self._group.get(name)
        if isinstance(found, h5py.Group):
            return Group(found, self._path)
        if not isinstance(found, h5py.Dataset):
            raise self._absent(name)
        return _quantity(found)

    def __getattr__(self, name: str) -> Quantity | Group:
        if name.startswith("_") or name not in self._group:
            raise AttributeError(f"{self._group.name} of {self._path} has no {name!r}; it has {', '.join(self)}")
        return self[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __iter__(self) -> Iterator[str]:
        return iter(self._group)

    def __len__(self) -> int:
        return len(self._group)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._group

    def dataset(self, name: str) -> h5py.Dataset:
        """A dataset unread, to take slices of: of `/points/coordinates`, say, which can be large."""
        if not isinstance(self._group.get(name), h5py.Dataset):
            raise self._absent(name)
        return self._group[name]

    def _absent(self, name: str) -> InputError:
        key = f"{self._group.name.rstrip('/')}/{name}"
        return InputError(Fault(self._path, key, "absent", "one of " + (", ".join(self) or "none")))

    @property
    def attributes(self) -> dict[str, str]:
        """What the group says of itself, as text."""
        return {name: as_text(value) for name, value in self._group.attrs.items()}

    def __repr__(self) -> str:
        return f"<{self._group.name} of {self._path}: {', '.join(self)}>"


class File(Group):
    """An open file of attrito, model, reduced model or result; close it, or use it in a `with` block.

    The members of a result are `points`, `monitors`, `contacts`, `linear` and, where the job asked for them,
    `multipliers`, `stability`, `integration`: docs/reference/files.md describes each dataset.

    Parameters
    ----------
    path : the file

    Raises
    ------
    InputError : not there, or not a file of attrito
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        name = str(path)
        if not Path(path).is_file():
            raise InputError(Fault(name, "file", "absent", "a file of attrito"))
        try:
            opened = h5py.File(path, "r")
        except OSError as error:
            raise InputError(Fault(name, "file", "not HDF5", "a file of attrito")) from error
        form = as_text(opened.attrs.get("format", "absent"))
        if not form.startswith("attrito "):
            opened.close()
            raise InputError(Fault(name, "format", form, "a file of attrito"))
        try:
            check_datasets(opened, name)
            check_sums(opened, name)
        except UNREADABLE as error:
            opened.close()
            raise spoilt(name, error, "a file of attrito") from error
        except InputError:
            opened.close()
            raise
        super().__init__(opened, name)

    @property
    def path(self) -> str:
        """The file's name as it was given."""
        return self._path

    def __fspath__(self) -> str:
        """It stands for its file: `attrito.plot(result)`."""
        return self._path

    @property
    def job(self) -> dict[str, Any]:
        """The job without what is at its default, ready to be run again; empty in a file without one."""
        return tomllib.loads(as_job(self.resolved_job)) if self.resolved_job else {}

    @property
    def resolved_job(self) -> dict[str, Any]:
        """The job with every table and every key; None for what has no value."""
        tables: dict[str, Any] = json.loads(self.attributes.get("job", "{}"))
        return tables

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        if self._group:
            self._group.file.close()

    def __enter__(self) -> File:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _quantity(dataset: h5py.Dataset) -> Quantity:
    values = dataset[()]
    if isinstance(values, np.ndarray) and values.dtype == object:
        values = np.array([as_text(value) for value in values.ravel()], dtype=object).reshape(values.shape)
    names = dataset.attrs.get("names", ())
    if isinstance(names, str | bytes):
        names = as_text(names).split(",")
    unit, description = (
        as_text(dataset.attrs.get(name, default)) for name, default in (("unit", "1"), ("description", ""))
    )
    return Quantity(values, unit, description, tuple(as_text(name).strip() for name in names))
