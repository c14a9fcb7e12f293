"""Good input made bad in ways that no reader has in mind: one procedure a kind, by chance.

Each takes the folder of a case, the file to spoil and what it is (`good_input.Source`), and spoils it in place. Some
give other arguments to the command instead, and return them.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import socket
import struct
import tomllib
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from edited import edited
from jobs import toml

Arguments = tuple[str, ...]
NAMES = [
    "$x$", "$", "\\alpha", "$\\frac{", "=1+1", "+1", "-1", "@SUM(A1)", '"', "''", "x,y", ".", "..", "a/b", "a.b", "%s",
    "\ud800", "\u0000", "a\nb", "\t=1", "frequency_hz", " x", "x" * 300, "é" * 40, "\U0001f4a9", "<b>", "&amp;",
]  # fmt: skip


def nested(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Far deeper than anything nests."""
    depth = chance.choice([500, 2000, 100_000])
    opening, closing = chance.choice([("[", "]"), ("{a=", "}")])
    path.write_text(path.read_text() + f"\n[deep]\nx = {opening * depth}1{closing * depth}\n")


def named(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Names that mean something to what they go into: HDF5, CSV, HTML, TeX, a format."""
    job = tomllib.loads(path.read_text())
    name = chance.choice(NAMES)
    if "vary" in job:
        job["vary"][-1]["name"] = chance.choice([name, job["vary"][0]["name"]])
    else:
        where = chance.choice(["monitor", "load", "file", "set", "both"])
        if where == "monitor" or "contact_set" not in job and where == "set":
            job["output"]["monitors"][0]["name"] = name
        elif where == "load":
            job["load"][0]["name"] = name
        elif where == "file":
            job["output"]["file"] = f"{name}/{name}.h5"
        elif where == "set":
            job["contact_set"][0]["a"] = name
        else:
            job["output"]["monitors"] *= 2
    path.write_text(toml(job), errors="surrogatepass")


def encoded(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Text in another encoding, or with what no text holds."""
    text = path.read_text(errors="replace")
    how = chance.randrange(6)
    if how < 3:
        path.write_bytes(text.encode(["utf-16", "utf-32", "cp037"][how], errors="replace"))
    elif how == 3:
        path.write_bytes(b"\xef\xbb\xbf" * 2 + text.encode())
    elif how == 4:
        path.write_bytes(text.replace("\n", "\r").encode())
    else:
        path.write_bytes(b"\x1b[2J\x00" + text.encode())


def no_file(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """No file in its place, but something that has a name."""
    path.unlink()
    how = chance.randrange(6)
    if how == 0:
        os.mkfifo(path)
    elif how == 1:
        path.mkdir()
    elif how == 2:
        path.symlink_to(path.name)
    elif how == 3:
        path.symlink_to(chance.choice(["/dev/zero", "/dev/tty", "/dev/random", "nowhere"]))
    elif how == 4:
        # Names of sockets are short.
        with socket.socket(socket.AF_UNIX) as end, contextlib.chdir(folder):
            end.bind(path.name)
    else:
        path.touch()
        os.truncate(path, 2**33)


def huge(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Sizes declared that there is no memory for."""
    size = chance.choice([10**8, 2 * 10**9, 2**31 - 1, 2**31, 10**12, 2**62, 2**64, 10**30])
    if path.suffix == ".mtx":
        lines = path.read_text().splitlines()
        place = next(i for i, line in enumerate(lines) if not line.startswith("%"))
        count = lines[place].split()[-1]
        lines[place] = chance.choice([f"{size} {size} {count}", f"{size} {size} {size}", f"3 3 {size}"])
        path.write_text("\n".join(lines) + "\n")
    elif path.suffix == ".petsc":
        data = bytearray(path.read_bytes())
        place = chance.choice([4, 8, 12])
        data[place : place + 4] = struct.pack(">i", min(size, 2**31 - 1))
        path.write_bytes(bytes(data))
    else:
        text = path.read_text(errors="replace").split()
        numbers = [i for i, word in enumerate(text) if word.isdecimal()]
        text[chance.choice(numbers or [0])] = str(size)
        path.write_text("\n".join(" ".join(text[i : i + 3]) for i in range(0, len(text), 3)))


def overflowing(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Numbers each of which is fine, and whose products are not."""
    job = tomllib.loads(path.read_text())
    big = chance.choice([1e155, 1e300, 1.7e308])
    how = chance.randrange(5)
    contact = (job.get("contact") or job.get("contact_set"))[0]
    if how == 0:
        contact["normal_stiffness"] = contact["tangential_stiffness"] = big
    elif how == 1:
        load = next(load for load in job["load"] if load["kind"] == "static")
        load["dofs"] = [[place, chance.choice([-1, 1]) * big] for place, _ in load["dofs"]] * 2
    elif how == 2:
        job["output"]["monitors"][0]["dofs"] = [[place, big] for place, _ in job["output"]["monitors"][0]["dofs"]] * 2
    elif how == 3:
        job.pop("damping", None)
        job["damping"] = {"rayleigh": [big, big]}
    else:
        job["sweep"] = {"frequencies_hz": [big]}
    path.write_text(toml(job))


def forged(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Records of a journal whose sums are right, and whose contents are not."""
    from attrito.results.journal import _HEAD, _MARK, MAGIC

    data, place, out = path.read_bytes(), len(MAGIC), [MAGIC]
    while place + _HEAD.size <= len(data):
        _, header_bytes, payload_bytes, _ = _HEAD.unpack(data[place : place + _HEAD.size])
        place += _HEAD.size
        header, payload = json.loads(data[place : place + header_bytes]), data[place + header_bytes :][:payload_bytes]
        place += header_bytes + payload_bytes
        _forge(header, chance)
        text = json.dumps(header).encode()
        out.append(_HEAD.pack(_MARK, len(text), len(payload), zlib.crc32(payload, zlib.crc32(text))) + text + payload)
    path.write_bytes(b"".join(out))


def _forge(header: dict, chance: random.Random) -> None:
    how = chance.randrange(8)
    if how == 0:
        header["note"] = chance.choice([[], None, "x", 7, {"place": 3}, {}])
    elif how == 1 and "place" in header["note"]:
        header["note"]["place"][chance.choice(list(header["note"]["place"]))] = chance.choice([None, "x", -1, 10**30])
    elif how == 2 and "attributes" in header["note"]:
        key = chance.choice(list(header["note"]["attributes"]))
        header["note"]["attributes"][key] = chance.choice([None, [1], {"a": 1}, "[" * 100_000, 10**400])
    elif how == 3 and header["arrays"]:
        header["arrays"][0][0] = chance.choice([".", "/", "../x", "a" * 70_000, "points", "\u0000"])
    elif how == 4 and header["arrays"]:
        chance.choice(header["arrays"])[2][:] = chance.choice([[-1], [0], [2**40], [1] * 40])
    elif how == 5 and header["series"]:
        header["series"] = {}
    elif how == 6 and header["series"]:
        name = chance.choice(list(header["series"]))
        header["series"][name] = chance.choice([["x"], ["real64", "a", "b", ["é"]], [1, 2, 3, [4]]])
    elif how == 7 and header["arrays"]:
        del header["arrays"][chance.randrange(len(header["arrays"]))]


def linked(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> None:
    """Links in an HDF5 file that lead to nothing, to themselves, to other files; datasets of other classes."""
    with edited(path) as file:
        names: list[str] = []
        file.visit(names.append)
        name = chance.choice(names)
        del file[name]
        how = chance.randrange(7)
        if how == 0:
            file[name] = h5py.SoftLink(f"/{name}")
        elif how == 1:
            file[name] = h5py.SoftLink("/nowhere")
        elif how == 2:
            file[name] = h5py.ExternalLink(chance.choice(["nowhere.h5", "/etc/passwd", path.name]), f"/{name}")
        elif how == 3:
            file[name] = np.zeros(3, dtype=[("a", "f8"), ("b", "i4")])
        elif how == 4:
            file.create_dataset(name, (2,), dtype=h5py.vlen_dtype(np.float64))
        elif how == 5:
            file[name] = file["/"].ref
        else:
            file[name] = h5py.Empty("f8")
        if chance.random() < 0.3:
            file.attrs["job"] = chance.choice(["[" * 100_000, "{}", '{"output": 7}', "\ud800".encode(errors="replace")])


def asked(folder: Path, path: Path, arguments: Arguments, chance: random.Random) -> Arguments:
    """Options out of any range, and files of the command that are others."""
    odd = ["-1", "99999999999999999999", "nan", "inf", "1e999", "", "$x$", "é", "x" * 5000, "../../..", "\n"]
    options = {
        "run": ["--max-seconds"],
        "table": ["--contacts"],
        "plot": ["--monitor", "--point", "--width", "--font-size", "--dpi", "--font", "--output", "--map"],
        "report": ["--point", "--output"],
        "export": ["--points", "--phases", "--scale", "--output", "--format", "--monitor"],
        "import": ["--spin-hz", "--holds", "--mesh", "--dofs", "--damping", "--geometric-stiffness"],
    }.get(arguments[0], [])
    option = chance.choice(options or ["--output"])
    return (*arguments, f"{option}={chance.choice(odd)}")


Kind = Callable[[Path, Path, Arguments, random.Random], Arguments | None]
# By how a file is made (`good_input.Source.kind`, and its name).
JOBS: list[Kind] = [nested, named, encoded, no_file, overflowing]
TEXTS: list[Kind] = [encoded, no_file]
STORED: list[Kind] = [linked, no_file, asked]


def kinds_for(path: Path, kind: str, arguments: Arguments) -> list[Kind]:
    """The kinds that a file can be spoilt by."""
    if path.name.endswith(".toml"):
        if arguments[0] == "study" and path.name == "study.toml":
            return [nested, named, encoded, no_file]
        return JOBS
    if path.name.endswith(".partial"):
        return [forged, forged, no_file]
    if path.suffix == ".h5":
        return STORED
    return [*TEXTS, asked, *([huge, huge] if path.suffix in (".mtx", ".petsc", ".hb", ".op4") else [])]
