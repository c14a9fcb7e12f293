"""Matrices of a model or a reduced model for other programs: Matrix Market, MATLAB, Nastran (DMIG), Abaqus.

Beside the matrices goes a table of dofs, `BASE.dof`: lines `node.direction`, which `attrito import --dofs` reads.
Coordinates without a place in space, such as the fixed-interface modes of a reduced model, are generalised ones: scalar
points in Nastran, dof 1 of nodes of their own in Abaqus, direction 0 in the table. Those that have no number yet are
numbered beyond the node ids of the model.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from scipy.sparse import csc_matrix, csr_matrix

from attrito.model.model import Model
from attrito.model.model_file import FORMAT as MODEL
from attrito.model.model_file import read_model
from attrito.support.atomic_files import whole_file
from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import checked
from attrito.support.hdf5_reading import stored
from attrito.support.overwrite_check import check_spared

ROM = "attrito rom"
# What a comment of Abaqus's files says of generalised coordinates; `importers.abaqus` reads it.
GENERALISED = "** GENERALISED COORDINATES: NODES {} TO {}"
# Numbers of generalised coordinates begin after a multiple of this.
ROUND = 1000
# Lines that are made at once
LINES = 100_000


@dataclass(frozen=True)
class Matrices:
    """Matrices by name `[m, m]`, node and direction of each row `[m]`, and the files that they were read from."""

    matrices: dict[str, csr_matrix]
    node: np.ndarray
    direction: np.ndarray
    files: list[str]


def export_matrices(path: str | Path, kind: str, output: str | Path | None, model: str | Path | None) -> list[str]:
    """Write the matrices of a file.

    Parameters
    ----------
    path : model.h5 or rom.h5
    kind : a name of `KINDS`
    output : what the names of files begin with; None: the name of the file without its ending
    model : of a reduced model, which names its dofs; None: `model.h5` or the like beside it, as its job says

    Returns
    -------
    the files written, with what they hold
    """
    read = read_matrices(str(path), None if model is None else str(model))
    base = str(Path(path).with_suffix("") if output is None else output)
    write, names = KINDS[kind]
    written = [f"{base}{name}" for name in names(read)]
    check_spared("export", "-o", [*written, f"{base}.dof"], read.files)
    try:
        Path(base).parent.mkdir(parents=True, exist_ok=True)
        write(base, read)
        with whole_file(f"{base}.dof") as place, open(place, "w") as file:
            for part in range(0, len(read.node), LINES):
                rows = zip(read.node[part : part + LINES], read.direction[part : part + LINES], strict=True)
                file.write("".join(f"{node}.{direction}\n" for node, direction in rows))
    except OSError as error:
        raise InputError(Fault("export", "-o", base, f"a place to write to ({error.strerror or error})")) from error
    generalised = int(np.count_nonzero(read.direction == 0))
    what = f"{len(read.node)} rows, {generalised} of them generalised coordinates"
    return [*written, f"{base}.dof: {what}"]


def read_matrices(path: str, model: str | None = None) -> Matrices:
    """Of model.h5 or rom.h5: the matrices, and what their rows are."""
    with stored(path, "a model.h5 or rom.h5, an HDF5 file") as file:
        kind = file.attrs.get("format")
        if kind == ROM:
            return _of_rom(file, path, model)
    if kind != MODEL:
        raise InputError(Fault(path, "format", kind or "missing", f'"{MODEL}" or "{ROM}"'))
    read = read_model(path)
    matrices = {"stiffness": read.stiffness, "mass": read.mass, "damping": read.damping}
    node, direction = _names(read, np.arange(read.size), 0)
    return Matrices({name: x for name, x in matrices.items() if x is not None}, node, direction, [path])


def _of_rom(file: h5py.File, path: str, model: str | None) -> Matrices:
    there = [name for name in ("stiffness", "mass", "damping") if name in file]
    matrices = {name: csr_matrix(checked(file[name], path)[()]) for name in there}
    boundary, rows = file["boundary/dof"][()], len(file["coordinates/kind"])
    given = model or next((place for place in _places(file, path) if Path(place).is_file()), None)
    if given is None:
        raise InputError(Fault(path, "model", "not found", "the model that it was made of: --model model.h5"))
    read = read_model(given, matrices=False)
    dofs = file["vectors/full"].shape[1]
    if read.size != dofs:
        raise InputError(Fault(given, "dofs", read.size, f"{dofs}, those of the model that {path} was made of"))
    node, direction = _names(read, boundary, rows - len(boundary))
    return Matrices(matrices, node, direction, [path, given])


def _places(file: h5py.File, path: str) -> Iterator[str]:
    """Where the model of a reduced model may be: beside it, or where its job says."""
    try:
        named = json.loads(file.attrs.get("job", "{}")).get("model", {}).get("file")
    except (ValueError, AttributeError):
        named = None
    if isinstance(named, str):
        yield from (str(Path(path).parent / named), named, str(Path(path).parent / Path(named).name))
    yield str(Path(path).with_suffix(".model.h5"))
    yield str(Path(path).with_name("model.h5"))


def _names(model: Model, dofs: np.ndarray, more: int) -> tuple[np.ndarray, np.ndarray]:
    """Node and direction of some dofs, and of `more` generalised coordinates after them."""
    ids = [np.zeros(1, np.int64)]
    if model.dof_node is None or model.dof_direction is None:
        # Dofs that are only numbered have no place, either: points from 1 on.
        node, direction = dofs + 1, np.zeros(len(dofs), np.int64)
        ids.append(np.array([model.size]))
    else:
        node, direction = model.dof_node[dofs].copy(), model.dof_direction[dofs].astype(np.int64)
        ids += [model.dof_node, *([] if model.node_ids is None else [model.node_ids])]
    first = (int(max(part.max(initial=0) for part in ids)) // ROUND + 1) * ROUND + 1
    internal = np.flatnonzero(node < 0)
    node[internal] = first + np.arange(len(internal))
    node = np.append(node, first + len(internal) + np.arange(more))
    return node, np.append(direction, np.zeros(more, np.int64))


def _lower(matrix: csr_matrix) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Rows, columns and values of the lower triangle, column by column, some at a time."""
    entries = csc_matrix(matrix).tocoo()
    low = entries.row >= entries.col
    row, column, value = entries.row[low], entries.col[low], entries.data[low]
    order = np.lexsort((row, column))
    for part in range(0, len(order), LINES):
        some = order[part : part + LINES]
        yield row[some], column[some], value[some]


def _matrix_market(base: str, read: Matrices) -> None:
    for name, matrix in read.matrices.items():
        with whole_file(f"{base}_{name}.mtx") as place, open(place, "w") as file:
            count = sum(len(row) for row, _, _ in _lower(matrix))
            size = len(read.node)
            file.write(f"%%MatrixMarket matrix coordinate real symmetric\n{size} {size} {count}\n")
            for part in _lower(matrix):
                rows = zip(*part, strict=True)
                file.write("".join(f"{i + 1} {j + 1} {value:.16e}\n" for i, j, value in rows))


def _matlab(base: str, read: Matrices) -> None:
    letters = {"stiffness": "K", "mass": "M", "damping": "C"}
    parts = {letters[name]: csc_matrix(matrix) for name, matrix in read.matrices.items()}
    table = np.column_stack([read.node, read.direction]).astype(float)
    with whole_file(f"{base}.mat") as place, open(place, "wb") as file:
        scipy.io.savemat(file, {**parts, "dofs": table}, do_compression=True)


def _dmig(base: str, read: Matrices) -> None:
    """Form 6, large fields, ten digits, as Nastran punches them; scalar points as `SPOINT`."""
    letters = {"stiffness": "KAAX", "mass": "MAAX", "damping": "BAAX"}
    with whole_file(f"{base}.pch") as place, open(place, "w") as file:
        file.write("$ K2GG = KAAX, M2GG = MAAX, B2GG = BAAX in case control\n")
        for number in read.node[read.direction == 0].tolist():
            file.write(f"SPOINT  {number:8d}\n" if number < 10**8 else f"SPOINT* {number:16d}\n")
        for name, matrix in read.matrices.items():
            file.write(f"DMIG    {letters[name]:8s}{0:8d}{6:8d}{2:8d}{0:8d}\n")
            last = -1
            for part in _lower(matrix):
                lines = []
                for i, j, value in zip(*(x.tolist() for x in part), strict=True):
                    if j != last:
                        lines.append(f"DMIG*   {letters[name]:16s}{read.node[j]:16d}{read.direction[j]:16d}\n")
                        last = j
                    number = f"{value:16.9E}".replace("E", "D")
                    lines.append(f"*       {read.node[i]:16d}{read.direction[i]:16d}{_short(number)}\n")
                file.write("".join(lines))


def _short(number: str) -> str:
    """A number in 16 characters: an exponent of three digits goes without its letter."""
    return number if len(number) <= 16 else number.replace("D", "")


def _abaqus(base: str, read: Matrices) -> None:
    """Lines of `*MATRIX INPUT`; generalised coordinates are dof 1 of nodes of their own."""
    numbers = read.node[read.direction == 0]
    dof = np.where(read.direction == 0, 1, read.direction)
    for name, matrix in read.matrices.items():
        with whole_file(f"{base}_{_PARTS[name]}.mtx") as place, open(place, "w") as file:
            for first, last in _ranges(numbers):
                file.write(f"{GENERALISED.format(first, last)}\n")
            for i, j, value in _lower(matrix):
                names = zip(read.node[i], dof[i], read.node[j], dof[j], value, strict=True)
                file.write("".join(f"{a},{b}, {c},{d}, {x:.16e}\n" for a, b, c, d, x in names))


def _ranges(numbers: np.ndarray) -> list[tuple[int, int]]:
    """First and last of runs of numbers one after another."""
    numbers = np.sort(numbers)
    ends = np.flatnonzero(np.diff(numbers) != 1)
    if len(numbers) == 0:
        return []
    firsts, lasts = numbers[np.append(0, ends + 1)], numbers[np.append(ends, len(numbers) - 1)]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def _each(pattern: str, names: dict[str, str]) -> Callable[[Matrices], list[str]]:
    return lambda read: [pattern.format(names[name]) for name in read.matrices]


_SAME = {name: name for name in ("stiffness", "mass", "damping")}
_PARTS = {"stiffness": "STIF1", "mass": "MASS1", "damping": "DMPV1"}
# What writes each kind, and what the names of its files end with
KINDS: dict[str, tuple[Callable[[str, Matrices], None], Callable[[Matrices], list[str]]]] = {
    "matrix-market": (_matrix_market, _each("_{}.mtx", _SAME)),
    "matlab": (_matlab, lambda _: [".mat"]),
    "dmig": (_dmig, lambda _: [".pch"]),
    "abaqus": (_abaqus, _each("_{}.mtx", _PARTS)),
}
