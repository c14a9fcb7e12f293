"""Good input made bad in what it says, not in how it is written: readers get files of the right form.

One procedure a kind, as in `spoil_further.py`: each takes the folder of a case, the file to spoil, the command and a
random generator; some give other arguments to the command instead, and return them.
"""

from __future__ import annotations

import json
import random
import re
import shutil
import struct
import tomllib
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sparse
from edited import edited
from jobs import toml
from spoil_further import Arguments, Kind

# Of a record of a journal: mark, bytes of header and payload, sum.
_HEAD, _MARK, _MAGIC = struct.Struct("<4sIQI"), b"REC\n", b"attrito journal 1\n"
ODD_IDS = [0, -1, 1, 2**31, 2**40, 10**30, -(2**31)]
ODD_NUMBERS = ["nan", "inf", "-inf", "1e400", "1.0D+05x", "", "0x1p3", "1_000", "--1", "1e", "1,5", "+"]


# Jobs.


def typed(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Values of types that TOML has and a job has no use for: times, dates, other bases, mixed lists."""
    lines = path.read_text().splitlines()
    places = [i for i, line in enumerate(lines) if "=" in line]
    for i in chance.sample(places, min(2, len(places))):
        values = ["1979-05-27T07:32:00Z", "07:32:00", "1979-05-27", "0xDEADBEEF", "0o755", "0b1101", "-nan", "+inf",
                  "9_223_372_036_854_775_807",
                  "[1, 'a', 2.0, [true]]", '"""\nlines\n"""', "{ a.b.c = 1 }", "''"]  # fmt: skip
        lines[i] = f"{lines[i].split('=')[0]}= {chance.choice(values)}"
    path.write_text("\n".join(lines) + "\n")


def repeated(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Keys, tables and lists of tables given twice, or one for another."""
    text = path.read_text()
    tables = re.findall(r"^\[+[a-z_]+\]+$", text, flags=re.MULTILINE) or ["[output]"]
    table = chance.choice(tables)
    how = chance.randrange(4)
    if how == 0:
        text += f"\n{table}\n"
    elif how == 1:
        text = text.replace(table, f"[{table}]" if not table.startswith("[[") else table[1:-1], 1)
    elif how == 2:
        lines = text.splitlines()
        lines.insert(chance.randrange(len(lines)), chance.choice(lines))
        text = "\n".join(lines) + "\n"
    else:
        text = f"{table[1:-1].strip('[]')} = 3\n" + text
    path.write_text(text)


def pointed(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Dofs, nodes, sets, loads and monitors that are not there, or are of another kind."""
    job = tomllib.loads(path.read_text())
    if "load" not in job:
        job["vary"][0]["keys"] = [
            chance.choice(["contact[9].gap", "load.x", "contact[*]", "a..b", "[0]", "model.mass"])
        ]
        path.write_text(toml(job))
        return
    dof = chance.choice([-1, 2, 10**9, 2**31, 1.5, True, "0", ["node", -1, "x"], ["node", 2**40, "y"], ["node", 1, "w"],
                         ["set", "top", "x"], [], [0]])  # fmt: skip
    how = chance.randrange(5)
    if how == 0:
        job["output"]["monitors"][0]["dofs"] = [[dof, 1.0]]
    elif how == 1:
        job["load"][-1]["cosine"] = [[dof, 1.0]]
    elif how == 2:
        job["load"][0]["dofs"] = [[dof, 1.0], [dof, -1.0]]
    elif how == 3 and "contact" in job:
        job["contact"][0]["normal"] = [[dof, 1.0]]
    elif how == 3:
        job["contact_set"][0][chance.choice("ab")] = chance.choice(["nowhere", "ground", "tip"])
    else:
        job["static"] = {"load_path": [{chance.choice(["nothing", "excitation", ""]): 1.0}]}
    path.write_text(toml(job))


def degenerate(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Numbers that are fine by themselves and describe no structure, contact or way through it."""
    job = tomllib.loads(path.read_text())
    how = chance.randrange(9)
    contact = (job.get("contact") or job.get("contact_set") or [{}])[0]
    if how == 0 and "mass" in job["model"]:
        n = len(job["model"]["mass"])
        matrix = chance.choice([np.zeros((n, n)), -np.eye(n), np.ones((n, n)), np.triu(np.ones((n, n))), np.eye(n + 1)])
        job["model"][chance.choice(["mass", "stiffness", "damping"])] = matrix.tolist()
    elif how == 1:
        rows = "normal" if "normal" in contact else "a"
        contact[rows] = [[0, 0.0]] if rows == "normal" else contact["b"]
    elif how == 2:
        contact["tangents"] = [contact.get("normal", [[0, 1.0]])] * 3
    elif how == 3:
        job["load"] = [load for load in job["load"] if load["kind"] != chance.choice(["static", "harmonic"])]
    elif how == 4:
        job["static"] = {"load_path": chance.choice([[], [0.0], [1e300, -1e300], [[1.0]], [1.0] * 20_000])}
    elif how == 5:
        job["balance"] = {
            "harmonics": chance.choice([0, 10**6, 2**31 - 1]),
            "samples": chance.choice([0, 1, 2**31 - 1]),
        }
    elif how == 6:
        job["continuation"] = {
            "max_points": chance.choice([0, -1]),
            "start": chance.choice(["point:0", "point:x", "x"]),
        }
    elif how == 7:
        job["reduction"] = {"modes": chance.choice([-1, 10**9, 2**31 - 1, 0.5, "all"])}
    else:
        job["output"]["monitors"] = [{"name": "a", "dofs": []}]
    path.write_text(toml({name: table for name, table in job.items() if table}))


def mistaken(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> Arguments | None:
    """One file of the program for another, or an output that is an input."""
    others = [one.name for one in folder.iterdir() if one.is_file() and one.name != path.name]
    if path.suffix == ".toml" and "model" in (job := tomllib.loads(path.read_text())):
        where = chance.choice(["model", "output", "reduction", "start"])
        other = chance.choice([*others, path.name, "."])
        if where == "model":
            job["model"] = {"file": other}
        elif where == "output":
            job["output"]["file"] = chance.choice([path.name, other, "nowhere/\0", "a.txt", "/proc/x.h5", "/dev/full"])
        elif where == "reduction":
            job["reduction"] = {"modes": 1, "file": other}
        else:
            job["continuation"] = {"start": "point:0", "start_file": other}
        try:
            path.write_text(toml(job))
        except (ValueError, UnicodeError):
            path.write_text("[output]\nfile = 3\n")
        return None
    if others:
        shutil.copyfile(folder / chance.choice(others), path)
    else:
        path.write_text("another file")
    return None


# Meshes and matrices as text.


def numbered(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Ids that are taken twice, negative, huge or of nothing, in nodes, elements, sets or matrices."""
    _replace(path, r"(?<![\d.+-])\d+(?![\d.])", lambda: str(chance.choice(ODD_IDS)), chance)


def unreadable_numbers(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Coordinates and entries that are no numbers, or none that an engineer means."""
    _replace(path, r"[-+]?\d+\.\d*(?:[eEdD]?[-+]\d+)?", lambda: chance.choice(ODD_NUMBERS), chance)


def ranges(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Sets that are generated without end, hold themselves, or have no members; files that include themselves."""
    far = chance.choice([10**7, 10**12, 2**63])
    added = {
        ".inp": [f"*NSET, NSET=far, GENERATE\n1, {far}, 1", "*NSET, NSET=none, GENERATE\n1, 9, 0",
                 "*NSET, NSET=a\na, b",
                 "*NSET, NSET=back, GENERATE\n9, 1, -1", f"*INCLUDE, INPUT={path.name}", "*INCLUDE, INPUT=/dev/zero",
                 "*NSET, NSET=empty", "*ELEMENT, TYPE=C3D99\n9, 1, 2", "*ELEMENT, TYPE=C3D10\n9, 40, 7", "*NODE\n9,",
                 "*NSET", f"*NSET, NSET={'x' * 70_000}\n7", "*NODE, INPUT=nodes.txt"],
        ".cdb": [f"CMBLOCK,FAR     ,NODE,       2\n(8i10)\n         1{-far:10d}", "CMBLOCK,LONG,NODE,99999999\n(8i10)",
                 "/INPUT,two_springs,cdb", "NBLOCK,6,SOLID,99999999999,99999999999\n(3i9,6e21.13e3)",
                 "NBLOCK,6,SOLID\n(3i0,6e0.0)", "EBLOCK,19,SOLID,1,1\n(19i9)\n        1", "ET,1,999"],
        ".bdf": [f"SET1,9,1,THRU,{far}", "SET1,9,7,THRU", "SET1,9,9,THRU,1", "INCLUDE 'two_springs_mesh.bdf'",
                 "CTETRA,9,1", "GRID,9,99", "CHEXA,9,1,40,7,12,1000", "+,+,+,+",
                 "CORD2R,5,5,0.,0.,0.,0.,0.,0.,\n,0.,0.,0."],
    }  # fmt: skip
    lines = path.read_text(errors="replace").splitlines()
    lines.insert(
        chance.randrange(len(lines) + 1), chance.choice(added.get(path.suffix, ["1 1 1", "%%", "*MATRIX", "$"]))
    )
    path.write_text("\n".join(lines) + "\n")


def shuffled(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """All lines or all fields in another order, or half of the file twice."""
    lines = path.read_text(errors="replace").splitlines()
    how = chance.randrange(4)
    if how == 0:
        chance.shuffle(lines)
    elif how == 1:
        lines = lines[::-1]
    elif how == 2:
        lines = [" ".join(line.split()[::-1]) for line in lines]
    else:
        lines = lines + lines[len(lines) // 2 :]
    path.write_text("\n".join(lines) + "\n")


def _replace(path: Path, pattern: str, new, chance: random.Random) -> None:
    text = path.read_text(errors="replace")
    found = list(re.finditer(pattern, text))
    for one in sorted(chance.sample(found, min(len(found), chance.choice([1, 1, 3]))), key=lambda one: -one.start()):
        text = text[: one.start()] + new() + text[one.end() :]
    path.write_text(text)


# Matrices of MATLAB and SciPy.


def kinds_of_matrices(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Variables that are no real matrix: cells, structures, text, booleans, three axes, nothing, shapes that differ."""
    odd = [
        np.zeros((0, 0)), np.zeros((3, 3, 3)), np.eye(3, dtype=np.int64), np.eye(3) > 0, "text", np.array("x", object),
        {"a": np.eye(3)}, np.eye(3) * 1j, np.full((3, 3), np.nan), np.ones((3, 4)), np.zeros((1, 1)),
        sparse.eye(3) * 1j, sparse.csc_matrix((3, 3), dtype=bool), np.array([[1, "a"], [2.0, None]], object),
        np.eye(3, dtype=np.uint8),
    ]  # fmt: skip
    value = chance.choice(odd)
    if path.suffix == ".npz":
        data = dict(np.load(path))
        part = chance.choice(["indices", "indptr", "format", "shape", "data"])
        change = [[], -1, [2**40] * 4, "csr", b"evil", np.array([None], object), np.array([np.nan]), [3, 3, 3], [-3, 3]]
        data[part] = np.array(chance.choice(change))
        np.savez(path, **data)
        if chance.random() < 0.3:
            _bomb(path)
        return
    try:
        scipy.io.savemat(path, {chance.choice(["K", "_k", "k" * 31]): value}, format=chance.choice(["4", "5"]))
    except (TypeError, ValueError, KeyError, AttributeError):
        # Of what a version of the format has no form for.
        scipy.io.savemat(path, {"K": "text"})


def _bomb(path: Path) -> None:
    """Gigabytes of zeros in some kilobytes."""
    with zipfile.ZipFile(path, "a", compression=zipfile.ZIP_DEFLATED) as archive, archive.open("bomb.npy", "w") as file:
        file.write(np.lib.format.magic(1, 0))
        for _ in range(64):
            file.write(bytes(1 << 20))


def broken_index(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Rows and columns of a sparse matrix that fall, are negative or lie beyond it, in an intact file."""
    bad = chance.choice([[-1], [2**31], [2**62], [0, 3, 1, 4], [], [5, 5, 5, 5]])
    if path.name == "K73.mat":
        with edited(path) as file:
            part = chance.choice(["ir", "jc", "data"])
            del file["K"][part]
            file["K"][part] = np.array(
                bad, chance.choice([np.int64, np.float64, np.uint64]) if min(bad, default=0) >= 0 else int
            )
        return
    matrix = sparse.csc_matrix(np.eye(3))
    setattr(matrix, chance.choice(["indices", "indptr"]), np.array(bad, np.int64))
    parts = {
        "indices": matrix.indices,
        "indptr": matrix.indptr,
        "format": np.array(b"csc"),
        "shape": (3, 3),
        "data": matrix.data,
    }
    if path.suffix == ".npz":
        np.savez(path, **parts)
    else:
        scipy.io.savemat(path, {"K": parts})


# HDF5.


def retyped(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Datasets of the right shape and of another type of number, or with other axes."""
    with edited(path) as file:
        name = chance.choice(_datasets(file))
        values, attributes = file[name][()], dict(file[name].attrs)
        del file[name]
        how = chance.randrange(6)
        if how == 0:
            new = np.asarray(values).astype(chance.choice(["f2", ">f8", "i1", "u8", "?", "c16"]), casting="unsafe") \
                if np.asarray(values).dtype.kind in "iuf" else np.zeros(np.shape(values), "f2")  # fmt: skip
        elif how == 1:
            new = np.asarray(values, object).astype(str).astype("S") if np.size(values) < 1e4 else np.zeros(3)
        elif how == 2:
            new = np.asarray(values)[None]
        elif how == 3:
            new = np.asarray(values).T if np.ndim(values) > 1 else np.asarray(values).reshape(-1, 1)
        elif how == 4:
            new = np.asarray(values).reshape(-1)[:0]
        else:
            new = np.concatenate([np.asarray(values).reshape(-1)] * 2)
        if new.dtype.kind in "OU":
            new = np.zeros(new.shape)
        file.create_dataset(name, data=new).attrs.update(attributes)


def exchanged(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Two datasets of a file in one another's place."""
    with edited(path) as file:
        first, second = chance.sample(_datasets(file), 2)
        file.move(first, "between")
        file.move(second, first)
        file.move("between", second)


def renumbered(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Whole numbers that no longer point to what is there, and numbers that are none, in intact datasets."""
    with edited(path) as file:
        whole = [name for name in _datasets(file) if file[name].dtype.kind in "iuf" and file[name].size]
        for name in chance.sample(whole, min(len(whole), chance.choice([1, 1, 4]))):
            values = file[name][()]
            shape, flat = np.shape(values), np.array(values).reshape(-1)
            how = chance.randrange(5)
            if how == 0:
                flat = flat[::-1].copy()
            elif how == 1:
                flat[:] = chance.choice([0, -1, 1])
            elif how == 2:
                flat[chance.randrange(len(flat))] = -2 if flat.dtype.kind != "u" else 250
            elif how == 3:
                flat[:] = np.arange(len(flat)) % 251
            elif flat.dtype.kind == "f":
                flat[:] = chance.choice([np.nan, np.inf, 1e308, 5e-324])
            else:
                flat[:] = np.iinfo(flat.dtype).max
            file[name][...] = flat.reshape(shape)


def attributed(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Attributes of other types and versions, and what they say of another file."""
    with edited(path) as file:
        things = [file, *(file[name] for name in _datasets(file))]
        thing = file if chance.random() < 0.6 else chance.choice(things)
        keys = list(thing.attrs) or ["format"]
        key = chance.choice(keys)
        value = chance.choice([
            -1, 99, 1.5, np.nan, np.array([1, 2]), np.array([], "f8"), h5py.Empty("S1"), b"\xff\xfe", "x" * 60_000,
            "[]", '{"output": {"monitors": []}}', "null", "1e999", "attrito model", "attrito result",
            "attrito reduced model",
            np.array(["a", "b"], "S1"), file.ref, "../../../../etc/passwd",
        ])  # fmt: skip
        thing.attrs[key] = value


def filtered(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Chunks that do not unpack, sums that are wrong, and data that lies in other files that are not there."""
    with edited(path) as file:
        name = chance.choice([one for one in _datasets(file) if file[one].size and not file[one].dtype.hasobject])
        values, attributes = np.atleast_1d(file[name][()]), dict(file[name].attrs)
        del file[name]
        how = chance.randrange(4)
        if how < 2:
            options = {"compression": "gzip"} if how == 0 else {"fletcher32": True}
            stored = file.create_dataset(name, data=values, chunks=values.shape, **options)
            stored.id.write_direct_chunk((0,) * values.ndim, bytes(chance.randrange(256) for _ in range(64)))
        elif how == 2:
            where = chance.choice(["nowhere.bin", "/etc/hostname", "/dev/zero", path.name])
            stored = file.create_dataset(name, values.shape, values.dtype, external=[(where, 0, values.nbytes)])
        else:
            layout = h5py.VirtualLayout(values.shape, values.dtype)
            layout[...] = h5py.VirtualSource(chance.choice(["nowhere.h5", path.name]), f"/{name}", values.shape)
            stored = file.create_virtual_dataset(name, layout)
        stored.attrs.update(attributes)


def _datasets(file: h5py.File) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, thing: names.append(name) if isinstance(thing, h5py.Dataset) else None)
    return names


# Journals.


def reordered(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Whole records in another order, twice, or without the first; journals one behind the other; other versions."""
    records, how = _records(path.read_bytes()), chance.randrange(7)
    magic = _MAGIC
    if how == 0:
        chance.shuffle(records)
    elif how == 1:
        records = records[1:]
    elif how == 2:
        records = records * 2
    elif how == 3:
        records.append(_MAGIC + records[0])
    elif how == 4:
        magic = chance.choice([b"attrito journal 2\n", b"attrito journal\n", b"attrito journal 1\r\n", b"\n"])
    elif how == 5:
        records.append(
            _HEAD.pack(_MARK, *chance.choice([(2**32 - 1, 2**64 - 1, 0), (0, 0, 0), (2, 0, zlib.crc32(b"{}"))])) + b"{}"
        )
    else:
        records = records[:1]
    path.write_bytes(magic + b"".join(records))


def renumbered_journal(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Numbers of a record that are others, its sum right."""
    records = _records(path.read_bytes())
    i = chance.randrange(len(records))
    _, header_bytes, payload_bytes, _ = _HEAD.unpack(records[i][: _HEAD.size])
    header, payload = records[i][_HEAD.size :][:header_bytes], bytearray(records[i][_HEAD.size + header_bytes :])
    if payload_bytes:
        how = chance.randrange(3)
        if how == 0:
            payload = bytearray(chance.choice([b"\xff", b"\x00", b"\x7f"]) * payload_bytes)
        elif how == 1:
            place = chance.randrange(max(1, payload_bytes // 8)) * 8
            payload[place : place + 8] = struct.pack("<d", chance.choice([np.nan, np.inf, -1.0, 1e300]))[
                : payload_bytes - place
            ]
        else:
            header = json.dumps(json.loads(header) | {"note": {}}).encode()
    else:
        header = chance.choice([b"[]", b"3", b"{}", b'{"note": {}}', b"null", b"\xff"])
    sums = zlib.crc32(bytes(payload), zlib.crc32(header))
    records[i] = _HEAD.pack(_MARK, len(header), len(payload), sums) + header + bytes(payload)
    path.write_bytes(_MAGIC + b"".join(records))


def _records(data: bytes) -> list[bytes]:
    place, found = len(_MAGIC), []
    while place + _HEAD.size <= len(data):
        _, header, payload, _ = _HEAD.unpack(data[place : place + _HEAD.size])
        end = place + _HEAD.size + header + payload
        found.append(data[place:end])
        place = end
    return found


def kinds_for(path: Path, kind: str, arguments: Arguments) -> list[Kind]:
    """The kinds that a file can be spoilt by."""
    if path.name == "study.toml":
        return [typed, repeated, pointed]
    if path.suffix == ".toml":
        return [typed, repeated, pointed, degenerate, mistaken]
    if path.name.endswith(".partial"):
        return [reordered, reordered, renumbered_journal, mistaken]
    if path.suffix == ".h5":
        return [retyped, exchanged, renumbered, attributed, filtered, mistaken]
    if path.suffix in (".mat", ".npz"):
        return [kinds_of_matrices, broken_index, mistaken]
    if path.suffix == ".petsc":
        return [mistaken]
    if path.suffix in (".inp", ".cdb", ".bdf"):
        return [numbered, unreadable_numbers, ranges, ranges, shuffled, mistaken]
    return [numbered, unreadable_numbers, shuffled, mistaken]
