"""Matrices and meshes written as FE codes write them, from their manuals; shares nothing with the readers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sparse

LABELS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")


def triplets(matrix: sparse.csr_matrix, triangle: str = "lower") -> Iterator[tuple[int, int, float]]:
    """Rows and columns from 0, by rows."""
    part = {"lower": sparse.tril, "upper": sparse.triu, "both": sparse.csr_matrix}[triangle](matrix).tocsr().tocoo()
    yield from zip(part.row.tolist(), part.col.tolist(), part.data.tolist(), strict=True)


def write_calculix(job: Path, stiffness: sparse.csr_matrix, mass: sparse.csr_matrix) -> None:
    """Both have the entries of either, zeros too."""
    pattern = sparse.triu(abs(stiffness) + abs(mass)).tocoo()
    for ending, matrix in (("sti", stiffness), ("mas", mass)):
        values = np.ravel(matrix[pattern.row, pattern.col])
        rows = zip(pattern.row + 1, pattern.col + 1, values, strict=True)
        job.with_suffix(f".{ending}").write_text("".join(f"{i} {j} {x:.13e}\n" for i, j, x in rows))


def write_dofs(path: Path, node: np.ndarray, direction: np.ndarray) -> None:
    path.write_text("".join(f"{k}.{d}\n" for k, d in zip(node.tolist(), direction.tolist(), strict=True)))


def write_abaqus(
    path: Path, matrix: sparse.csr_matrix, node: np.ndarray, direction: np.ndarray, triangle: str = "lower"
) -> None:
    """FORMAT=MATRIX INPUT."""
    names = [f"{k},{d}" for k, d in zip(node.tolist(), direction.tolist(), strict=True)]
    path.write_text("".join(f"{names[i]}, {names[j]}, {x: .14e}\n" for i, j, x in triplets(matrix, triangle)))


def write_abaqus_coordinate(path: Path, matrix: sparse.csr_matrix) -> None:
    """FORMAT=COORDINATE."""
    path.write_text("".join(f"{i + 1:8d}{j + 1:8d} {x: .16e}\n" for i, j, x in triplets(matrix, "both")))


def write_harwell_boeing(path: Path, matrix: sparse.csr_matrix, symmetric: bool = True) -> None:
    """By columns, several numbers a line, no blanks between them."""
    part = sparse.csc_matrix(sparse.tril(matrix) if symmetric else matrix)
    pointers = _lines([f"{k + 1:10d}" for k in part.indptr.tolist()], 8)
    rows = _lines([f"{k + 1:10d}" for k in part.indices.tolist()], 8)
    values = _lines([f"{x:25.16E}" for x in part.data.tolist()], 3)
    counts = [len(pointers), len(rows), len(values)]
    size = matrix.shape[0]
    head = [
        f"{'a matrix':72s}{'KEY':8s}",
        "".join(f"{k:14d}" for k in (sum(counts), *counts, 0)),
        f"{'RSA' if symmetric else 'RUA':14s}" + "".join(f"{k:14d}" for k in (size, size, part.nnz, 0)),
        f"{'(8I10)':16s}{'(8I10)':16s}{'(1P,3E25.16)':20s}{'':20s}",
    ]
    path.write_text("\n".join([*head, *pointers, *rows, *values]) + "\n")


def write_mapping(path: Path, node: np.ndarray, direction: np.ndarray) -> None:
    """Beside HBMAT's matrix."""
    rows = enumerate(zip(node.tolist(), direction.tolist(), strict=True), start=1)
    lines = [f"{k:10d}{n:10d}  {LABELS[d - 1]}" for k, (n, d) in rows]
    path.write_text("\n".join(["Matrix Eqn      Node  DOF", *lines]) + "\n")


def write_dmig(
    path: Path,
    matrices: dict[str, sparse.csr_matrix],
    node: np.ndarray,
    direction: np.ndarray,
    fields: str = "large",
    form: int = 6,
) -> None:
    """A punch file: `large` fields as Nastran punches, `small` ones, or `free` ones with all digits."""
    lines = ["$TITLE   = A TEST", "BEGIN BULK"]
    names = list(zip(node.tolist(), direction.tolist(), strict=True))
    for name, matrix in matrices.items():
        if fields == "free":
            lines.append(f"DMIG,{name},0,{form},2,0,,,{matrix.shape[0]}")
        else:
            lines.append(f"DMIG    {name:8s}{0:8d}{form:8d}{2:8d}{0:8d}{'':16s}{matrix.shape[0]:8d}")
        # One column after the other: those of the lower triangle, or all.
        columns = sparse.csc_matrix(sparse.tril(matrix) if form == 6 else matrix)
        for j in range(matrix.shape[0]):
            part = slice(columns.indptr[j], columns.indptr[j + 1])
            entries = [
                (*names[i], x) for i, x in zip(columns.indices[part].tolist(), columns.data[part].tolist(), strict=True)
            ]
            if entries:
                lines += _dmig_column(name, names[j], entries, fields)
    path.write_text("\n".join(lines) + "\n")


def _dmig_column(name: str, column: tuple[int, int], entries: list, fields: str) -> list[str]:
    g, c = column
    if fields == "large":
        lines = [f"DMIG*   {name:16s}{g:16d}{c:16d}"]
        return lines + [f"*       {i:16d}{d:16d}{f'{x:.9E}'.replace('E', 'D'):>16s}" for i, d, x in entries]
    if fields == "free":
        (i, d, x), *rest = entries
        return [f"DMIG,{name},{g},{c},,{i},{d},{x!r}"] + [f",{i},{d},{x!r}" for i, d, x in rest]
    (i, d, x), *rest = entries
    lines = [f"DMIG    {name:8s}{g:8d}{c:8d}{'':8s}{i:8d}{d:8d}{short_real(x):>8s}"]
    for k in range(0, len(rest), 2):
        lines.append("+       " + "".join(f"{i:8d}{d:8d}{short_real(x):>8s}{'':8s}" for i, d, x in rest[k : k + 2]))
    return lines


def short_real(x: float) -> str:
    """At most 8 characters, the exponent without its letter."""
    mantissa, exponent = f"{x:.2E}".split("E")
    return f"{mantissa}{int(exponent):+d}"


def write_op4_text(path: Path, matrices: dict[str, sparse.csr_matrix], layout: str) -> None:
    """`dense`, `sparse` or `bigmat`; double precision."""
    lines = []
    for name, matrix in matrices.items():
        rows, size = matrix.shape
        form = 6 if rows == size else 2
        lines.append(f"{size:8d}{-rows if layout == 'bigmat' else rows:8d}{form:8d}{2:8d}{name:8s}1P,3E23.16")
        for j, runs in _columns(matrix, layout):
            if layout == "dense":
                row, values = runs[0]
                lines.append(f"{j + 1:8d}{row + 1:8d}{len(values):8d}")
                lines += _lines([f"{x:23.16E}" for x in values], 3)
                continue
            words = sum((2 if layout == "bigmat" else 1) + 2 * len(values) for _, values in runs)
            lines.append(f"{j + 1:8d}{0:8d}{words:8d}")
            for row, values in runs:
                length = 2 * len(values)
                head = f"{length + 1:8d}{row + 1:8d}" if layout == "bigmat" else f"{65536 * (length + 1) + row + 1:12d}"
                lines += [head, *_lines([f"{x:23.16E}" for x in values], 3)]
        lines += [f"{size + 1:8d}{1:8d}{1:8d}", f"{1.0:23.16E}"]
    path.write_text("\n".join(lines) + "\n")


def write_op4_binary(
    path: Path, matrices: dict[str, sparse.csr_matrix], layout: str, order: str = "<", width: int = 4, kind: int = 2
) -> None:
    """`dense`, `sparse` or `bigmat`, of either byte order, with integers of 4 or 8 bytes, single (1) or double (2)."""
    integer, real = f"{order}i{width}", f"{order}f{8 if width == 8 or kind == 2 else 4}"
    per_value = np.dtype(real).itemsize // width

    def integers(*numbers: int) -> bytes:
        return np.array(numbers, integer).tobytes()

    with path.open("wb") as file:

        def record(data: bytes) -> None:
            mark = np.array([len(data)], f"{order}i4").tobytes()
            file.write(mark + data + mark)

        for name, matrix in matrices.items():
            rows, size = matrix.shape
            label = name.ljust(2 * width).encode()
            form = 6 if rows == size else 2
            record(integers(size, -rows if layout == "bigmat" else rows, form, kind) + label)
            for j, runs in _columns(matrix, layout):
                parts = []
                for row, values in runs:
                    length = per_value * len(values)
                    if layout == "sparse":
                        parts.append(integers(65536 * (length + 1) + row + 1))
                    elif layout == "bigmat":
                        parts.append(integers(length + 1, row + 1))
                    parts.append(np.array(values, real).tobytes())
                data = b"".join(parts)
                first = runs[0][0] + 1 if layout == "dense" else 0
                record(integers(j + 1, first, len(data) // width) + data)
            record(integers(size + 1, 1, per_value) + np.array([1.0], real).tobytes())


def _columns(matrix: sparse.csr_matrix, layout: str) -> Iterator[tuple[int, list[tuple[int, list[float]]]]]:
    """Runs of each column that is not empty: first row and values; one run from first to last if dense."""
    by_column = sparse.csc_matrix(matrix)
    for j in range(matrix.shape[1]):
        part = slice(by_column.indptr[j], by_column.indptr[j + 1])
        rows, values = by_column.indices[part], by_column.data[part]
        if len(rows) == 0:
            continue
        if layout == "dense":
            column = np.zeros(rows[-1] - rows[0] + 1)
            column[rows - rows[0]] = values
            yield j, [(int(rows[0]), column.tolist())]
        else:
            cuts = np.flatnonzero(np.diff(rows) > 1) + 1
            runs = zip(np.split(rows, cuts), np.split(values, cuts), strict=True)
            yield j, [(int(r[0]), v.tolist()) for r, v in runs]


def petsc_bytes(matrix: np.ndarray | sparse.csr_matrix, integer: str = ">i4", number: str = ">f8") -> bytes:
    """A sparse matrix as PETSc's MatView writes it."""
    rows = sparse.csr_matrix(matrix)
    head = [1211216, *rows.shape, rows.nnz, *np.diff(rows.indptr), *rows.indices]
    return np.array(head, integer).tobytes() + rows.data.astype(number).tobytes()


def write_matlab_73(path: Path, matrices: dict[str, sparse.csr_matrix | np.ndarray]) -> None:
    """HDF5 behind a header of 512 bytes; sparse matrices as groups, full ones with their axes swapped."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, matrix in matrices.items():
            if sparse.issparse(matrix):
                by_column = sparse.csc_matrix(matrix)
                group = file.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(matrix.shape[0])
                group.attrs["MATLAB_class"] = np.bytes_("double")
                group["data"] = by_column.data
                group["ir"], group["jc"] = (x.astype(np.uint64) for x in (by_column.indices, by_column.indptr))
            else:
                file[name] = np.asarray(matrix).T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_matlab(path: Path, matrices: dict[str, object]) -> None:
    scipy.io.savemat(path, matrices)


def write_cdb(path: Path, ids: np.ndarray, points: np.ndarray, elements: dict, sets: dict[str, np.ndarray]) -> None:
    """An archive of SOLID187 or SOLID186 elements with node components."""
    lines = ["/PREP7", "ET,1,187", f"NBLOCK,6,SOLID,{ids.max():9d},{len(ids):9d}", "(3i9,6e21.13e3)"]
    lines += [
        f"{n:9d}{0:9d}{0:9d}" + "".join(_e3(x) for x in p) for n, p in zip(ids.tolist(), points.tolist(), strict=True)
    ]
    lines.append("N,R5.3,LOC,       -1,")
    count = sum(len(numbers) for numbers, _ in elements.values())
    lines += [f"EBLOCK,19,SOLID,{count:9d},{count:9d}", "(19i9)"]
    for numbers, connectivity in elements.values():
        for number, nodes in zip(numbers.tolist(), connectivity.tolist(), strict=True):
            words = [1, 1, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
            lines += _lines([f"{k:9d}" for k in words], 19)
    lines.append("       -1")
    for name, nodes in sets.items():
        lines += [f"CMBLOCK,{name:8s},NODE,{len(nodes):8d}", "(8i10)", *_lines([f"{k:10d}" for k in nodes.tolist()], 8)]
    path.write_text("\n".join(lines) + "\n")


def _e3(x: float) -> str:
    mantissa, exponent = f"{x:.13E}".split("E")
    return f"{mantissa}E{int(exponent):+04d}".rjust(21)


def write_bdf(path: Path, ids: np.ndarray, points: np.ndarray, elements: dict, sets: dict[str, np.ndarray]) -> None:
    """GRID in large fields, CTETRA in small ones, SET1 1, 2, ... in the order of the sets."""
    lines = ["SOL 103", "CEND", "BEGIN BULK"]
    for n, p in zip(ids.tolist(), points.tolist(), strict=True):
        x, y, z = (f"{x:16.9E}" for x in p)
        lines += [f"GRID*   {n:16d}{'':16s}{x}{y}*", f"*       {z}"]
    for kind, (numbers, connectivity) in elements.items():
        name = {"C3D4": "CTETRA", "C3D10": "CTETRA", "C3D8": "CHEXA", "C3D20": "CHEXA"}[kind]
        for number, nodes in zip(numbers.tolist(), connectivity.tolist(), strict=True):
            if kind == "C3D20":
                nodes = [*nodes[:12], *nodes[16:], *nodes[12:16]]
            lines += _card(name, [number, 1, *nodes])
    for k, nodes in enumerate(sets.values(), start=1):
        lines += _card("SET1", [k, *nodes.tolist()])
    lines.append("ENDDATA")
    path.write_text("\n".join(lines) + "\n")


def _card(name: str, words: list) -> list[str]:
    rows = [words[k : k + 8] for k in range(0, len(words), 8)]
    starts = [name] + ["+"] * (len(rows) - 1)
    return [f"{start:8s}" + "".join(f"{word:>8}" for word in row) for start, row in zip(starts, rows, strict=True)]


def write_deck(path: Path, ids: np.ndarray, points: np.ndarray, elements: dict, sets: dict[str, np.ndarray]) -> None:
    lines = [
        "*NODE",
        *(f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in zip(ids.tolist(), points.tolist(), strict=True)),
    ]
    for kind, (numbers, connectivity) in elements.items():
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET=body")
        for number, nodes in zip(numbers.tolist(), connectivity.tolist(), strict=True):
            words = [str(word) for word in (number, *nodes)]
            rows = [", ".join(words[k : k + 11]) for k in range(0, len(words), 11)]
            lines += [row + "," for row in rows[:-1]] + rows[-1:]
    for name, nodes in sets.items():
        lines += [f"*NSET, NSET={name}", *_lines([f"{k}," for k in nodes.tolist()], 8)]
    path.write_text("\n".join(lines) + "\n")


def _lines(words: list[str], count: int) -> list[str]:
    return ["".join(words[k : k + count]) for k in range(0, len(words), count)]
