"""Good input made bad by chance: values of a job, lines of a text, bytes, datasets of an HDF5 file."""

from __future__ import annotations

import copy
import random
import tomllib
from pathlib import Path

import h5py
import numpy as np
from edited import edited
from jobs import Job, toml

# What values, lines and numbers are replaced by.
VALUES = [
    0, -1, 1, 2**31, 2**63, 10**30, -(10**18), 1e308, -1e308, 5e-324, float("nan"), float("inf"), True, "", "x", "\n",
    "é\u202e", "a" * 5000, "../../../../../../proc/version", "/dev/zero", "/dev/full", "/proc/self/mem", ".", "nul\0l",
    [], [[]], [1, [2, [3]]],
    [[0, 1.0]] * 2000, {}, {"x": 1}, ["node", 1, "x"], "auto", "none", "1e400", "0x10",
]  # fmt: skip
TOKENS = [
    "-1", "0", "99999999999", "1" * 400, "nan", "inf", "1e999", "x", "1.5", "-", "%", "*NODE", "\0", "é", ",,,,",
    "1,2,3",
]  # fmt: skip


def spoil(path: Path, kind: str, chance: random.Random) -> None:
    """Spoil a file as a job, as text, as HDF5 or as bytes."""
    if kind == "job":
        path.write_text(toml(spoil_job(tomllib.loads(path.read_text()), chance)), errors="replace")
    elif kind == "hdf5":
        spoil_hdf5(path, chance)
    elif kind == "text" and chance.random() < 0.7:
        path.write_text(spoil_lines(path.read_text(errors="replace"), chance), errors="replace")
    else:
        path.write_bytes(spoil_bytes(path.read_bytes(), chance))


def spoil_job(job: Job, chance: random.Random) -> Job:
    """One to three values replaced, keys taken away or added."""
    job = copy.deepcopy(job)
    for _ in range(chance.randint(1, 3)):
        places: list[tuple] = []
        _walk(job, places)
        holder, key = chance.choice(places)
        how = chance.random()
        if how < 0.7:
            holder[key] = copy.deepcopy(chance.choice(VALUES))
        elif how < 0.85 and isinstance(holder, dict):
            del holder[key]
        elif isinstance(holder, dict):
            holder[chance.choice(["modes", "file", "unknown", "start", "stiffness", "frequencies_hz"])] = chance.choice(
                VALUES
            )
    # A table is a table, at the top of a file that can be written.
    return {name: table for name, table in job.items() if isinstance(table, dict | list) and table}


def _walk(thing: dict | list, places: list[tuple]) -> None:
    for key, value in list(thing.items() if isinstance(thing, dict) else enumerate(thing)):
        places.append((thing, key))
        if isinstance(value, dict | list):
            _walk(value, places)


def spoil_lines(text: str, chance: random.Random) -> str:
    """Lines taken away, doubled, swapped, joined, or a word of one replaced."""
    lines = text.split("\n")
    for _ in range(chance.randint(1, 3)):
        i = chance.randrange(len(lines))
        how = chance.randrange(6)
        if how == 0:
            del lines[i]
        elif how == 1:
            lines.insert(i, lines[i])
        elif how == 2:
            j = chance.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
        elif how == 3:
            lines[i] = lines[i][: chance.randint(0, len(lines[i]))]
        elif how == 4:
            words = lines[i].split(" ")
            words[chance.randrange(len(words))] = chance.choice(TOKENS)
            lines[i] = " ".join(words)
        else:
            lines = lines[: i + 1]
        lines = lines or [""]
    return "\n".join(lines)


def spoil_bytes(data: bytes, chance: random.Random) -> bytes:
    """Cut off, bytes changed, put in, taken out, or emptied."""
    how = chance.randrange(5)
    spoilt = bytearray(data)
    if how == 0:
        return bytes(spoilt[: chance.randrange(len(spoilt) + 1)])
    for _ in range(chance.choice([1, 4, 40])):
        i = chance.randrange(max(len(spoilt), 1))
        if how == 1:
            spoilt[i : i + 1] = bytes([chance.randrange(256)])
        elif how == 2:
            spoilt[i:i] = bytes(chance.randrange(256) for _ in range(chance.choice([1, 8])))
        elif how == 3:
            del spoilt[i : i + chance.choice([1, 8])]
        else:
            spoilt[i : i + 8] = chance.choice([b"\xff" * 8, bytes(8), b"\x7f" + b"\xff" * 7])
    return bytes(spoilt)


def spoil_hdf5(path: Path, chance: random.Random) -> None:
    """Something of another shape, type, size or kind, not there, or another attribute."""
    with edited(path) as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(chance.choice([1, 1, 2])):
            name = chance.choice(names)
            if name not in file:
                continue
            thing = file[name]
            how = chance.randrange(8)
            if how == 0:
                del file[name]
            elif how == 1 and file.attrs:
                key = chance.choice(list(file.attrs))
                file.attrs[key] = chance.choice(["", "x", 7, b"\xff", "{", "{}", "[]", [1, 2], "/etc/passwd"])
            elif how == 2 and thing.attrs:
                del thing.attrs[chance.choice(list(thing.attrs))]
            elif isinstance(thing, h5py.Dataset):
                _spoil_dataset(file, name, how, chance)


def _spoil_dataset(file: h5py.File, name: str, how: int, chance: random.Random) -> None:
    shape, kind, values = file[name].shape, file[name].dtype, file[name][()]
    attributes = dict(file[name].attrs)
    del file[name]
    if how == 3:
        file.create_group(name)
        return
    if how == 4:
        # Far more than there is memory for, in a file of a few bytes.
        huge = tuple(chance.choice([2**40, 2**61, n or 2**40]) for n in shape) or (2**40,)
        file.create_dataset(name, huge, np.int8 if kind.hasobject else kind, chunks=tuple(1 for _ in huge))
    elif how == 5:
        file.create_dataset(name, data=np.full(shape, "text", dtype=h5py.string_dtype()))
    elif how == 6 and kind.kind in "if" and np.size(values):
        spoilt = np.array(values).reshape(-1)
        hostile = [np.nan, np.inf, -np.inf, 1e300] if kind.kind == "f" else [-1, np.iinfo(kind).max, np.iinfo(kind).min]
        spoilt[chance.randrange(spoilt.size)] = chance.choice(hostile)
        file.create_dataset(name, data=spoilt.reshape(shape))
    else:
        file.create_dataset(name, data=values[: chance.randrange(shape[0] + 1)] if shape else [values, values])
    file[name].attrs.update(attributes)
