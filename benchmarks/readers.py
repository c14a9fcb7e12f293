"""What readers of large matrix files cost: entries a second and peak memory, each format in a process of its own.

The matrix has `--dofs` rows with `--band` entries each in one triangle, in runs of three, as nodes of three dofs make.
An entry is one that the file holds: one triangle, but for OUTPUT4, which holds both. CPU time of reading is that of
turning the file into entries; assembling makes the matrix of both triangles of them. Peak memory is that above what the
process needed before, relative to the finished matrix.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

LINES = 200_000


def offsets(band: int) -> np.ndarray:
    """Columns below the diagonal: itself, then runs of three, farther and farther apart."""
    runs = 3 * np.arange(-(-(band - 1) // 3)) ** 2
    return np.concatenate([[0], (1 + runs[:, None] + np.arange(3)).ravel()])[:band]


def columns(dofs: int, band: int, both: bool = False) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Rows, columns and values of some columns at a time, column by column, of the lower triangle or both."""
    below = offsets(band)
    away = np.union1d(below, -below) if both else below
    step = max(1, LINES // len(away))
    for begin in range(0, dofs, step):
        column = np.arange(begin, min(begin + step, dofs))
        row = (column[:, None] + away).ravel()
        column = np.repeat(column, len(away))
        inside = (row >= 0) & (row < dofs)
        row, column = row[inside], column[inside]
        low, high = np.minimum(row, column), np.maximum(row, column)
        value = np.where(row == column, 4.0 * band, np.sin(1.0 + low % 1009 + 17.0 * (high % 1013)) / 3.0)
        yield row, column, value


def filled(form: str, *arrays: np.ndarray) -> str:
    """Lines of one form."""
    flat = [x for record in zip(*(array.tolist() for array in arrays), strict=True) for x in record]
    return (form * len(arrays[0])) % tuple(flat)


def write_calculix(path: Path, dofs: int, band: int) -> None:
    """Lines `row column value` of the upper triangle."""
    with path.open("w") as file:
        for row, column, value in columns(dofs, band):
            file.write(filled("%d %d %.13e\n", column + 1, row + 1, value))


def write_abaqus(path: Path, dofs: int, band: int) -> None:
    """FORMAT=MATRIX INPUT, one triangle."""
    with path.open("w") as file:
        for row, column, value in columns(dofs, band):
            names = (row // 3 + 1, row % 3 + 1, column // 3 + 1, column % 3 + 1)
            file.write(filled("%d,%d, %d,%d, %.14e\n", *names, value))


def write_matrix_market(path: Path, dofs: int, band: int) -> None:
    """The lower triangle, 17 digits."""
    count = sum(len(row) for row, _, _ in columns(dofs, band))
    with path.open("w") as file:
        file.write(f"%%MatrixMarket matrix coordinate real symmetric\n{dofs} {dofs} {count}\n")
        for row, column, value in columns(dofs, band):
            file.write(filled("%d %d %.16e\n", row + 1, column + 1, value))


def write_harwell_boeing(path: Path, dofs: int, band: int) -> None:
    """One number a line, as ANSYS writes them."""
    counts = sum(np.bincount(column, minlength=dofs) for _, column, _ in columns(dofs, band))
    total = int(counts.sum())
    with path.open("w") as file:
        file.write(f"{'benchmark':72s}{'KEY':8s}\n")
        file.write("".join(f"{k:14d}" for k in (dofs + 1 + 2 * total, dofs + 1, total, total, 0)) + "\n")
        file.write(f"{'RSA':14s}" + "".join(f"{k:14d}" for k in (dofs, dofs, total, 0)) + "\n")
        file.write(f"{'(1I14)':16s}{'(1I14)':16s}{'(1D25.15)':20s}\n")
        file.write(filled("%14d\n", np.concatenate([[0], np.cumsum(counts)]) + 1))
        for row, _, _ in columns(dofs, band):
            file.write(filled("%14d\n", row + 1))
        for _, _, value in columns(dofs, band):
            file.write(filled("%25.15E\n", value).replace("E", "D"))


def write_punch(path: Path, dofs: int, band: int) -> None:
    """DMIG in large fields, form 6."""
    with path.open("w") as file:
        file.write(f"DMIG    KAAX    {0:8d}{6:8d}{2:8d}{0:8d}{'':16s}{dofs:8d}\n")
        for row, column, value in columns(dofs, band):
            lines = (
                filled("*       %16d%16d%16.9E\n", row // 3 + 1, row % 3 + 1, value).replace("E", "D").splitlines(True)
            )
            first = np.flatnonzero(np.diff(column, prepend=-1))
            for k in first.tolist():
                head = f"DMIG*   {'KAAX':16s}{column[k] // 3 + 1:16d}{column[k] % 3 + 1:16d}\n"
                lines[k] = head + lines[k]
            file.write("".join(lines))


def runs(row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where strings begin, and where columns begin."""
    new_column = np.diff(column, prepend=-1) != 0
    return np.flatnonzero(new_column | (np.diff(row, prepend=-2) != 1)), np.flatnonzero(new_column)


def write_output4_text(path: Path, dofs: int, band: int) -> None:
    """Bigmat, both triangles."""
    with path.open("w") as file:
        file.write(f"{dofs:8d}{-dofs:8d}{6:8d}{2:8d}{'KAA':8s}1P,3E23.16\n")
        for row, column, value in columns(dofs, band, both=True):
            lines = filled("%23.16E\n", value).split("\n")[:-1]
            starts, first = runs(row, column)
            lengths = np.diff(np.append(starts, len(row)))
            text = {
                k: f"{2 * n + 1:8d}{row[k] + 1:8d}\n" for k, n in zip(starts.tolist(), lengths.tolist(), strict=True)
            }
            words = np.add.reduceat(2 + 2 * lengths, np.searchsorted(starts, first))
            for k, n in zip(first.tolist(), words.tolist(), strict=True):
                text[k] = f"{column[k] + 1:8d}{0:8d}{n:8d}\n" + text[k]
            for k, n in zip(starts.tolist(), lengths.tolist(), strict=True):
                numbers = ["".join(lines[j : min(j + 3, k + n)]) for j in range(k, k + n, 3)]
                file.write(text[k] + "\n".join(numbers) + "\n")
        file.write(f"{dofs + 1:8d}{1:8d}{1:8d}\n{1.0:23.16E}\n")


def write_output4_binary(path: Path, dofs: int, band: int) -> None:
    """Bigmat, both triangles."""

    def record(data: bytes) -> bytes:
        mark = np.int32(len(data)).tobytes()
        return mark + data + mark

    with path.open("wb") as file:
        file.write(record(np.array([dofs, -dofs, 6, 2], np.int32).tobytes() + b"KAA     "))
        for row, column, value in columns(dofs, band, both=True):
            starts, first = runs(row, column)
            lengths = np.diff(np.append(starts, len(row)))
            owner = np.searchsorted(first, starts, side="right") - 1
            parts: list[list[bytes]] = [[] for _ in first]
            for k, n, own in zip(starts.tolist(), lengths.tolist(), owner.tolist(), strict=True):
                parts[own].append(np.array([2 * n + 1, row[k] + 1], np.int32).tobytes() + value[k : k + n].tobytes())
            for k, strings in zip(first.tolist(), parts, strict=True):
                data = b"".join(strings)
                file.write(record(np.array([column[k] + 1, 0, len(data) // 4], np.int32).tobytes() + data))
        file.write(record(np.array([dofs + 1, 1, 2], np.int32).tobytes() + np.ones(1).tobytes()))


FORMATS: dict[str, tuple[Callable[[Path, int, int], None], str]] = {
    "CalculiX": (write_calculix, "k.sti"),
    "Abaqus": (write_abaqus, "k.mtx"),
    "Matrix Market": (write_matrix_market, "k.mm.mtx"),
    "Harwell-Boeing": (write_harwell_boeing, "k.hb"),
    "Nastran punch": (write_punch, "k.pch"),
    "OUTPUT4 text": (write_output4_text, "k.txt.op4"),
    "OUTPUT4 binary": (write_output4_binary, "k.op4"),
}


def measure(path: str) -> dict[str, float]:
    """Read one file in this process."""
    from attrito.importers.dof_numbers import DofNumbers
    from attrito.importers.matrix import open_matrix
    from attrito.library import loading

    loading.load()
    before = _resident()
    numbers = DofNumbers()
    start = time.process_time()
    source = open_matrix(path, "k", "benchmark", numbers)
    read = time.process_time() - start
    if source.numbers is None:
        matrix = source.assembled()
    else:
        used = source.rows(len(numbers)).used
        matrix = source.assembled(int(np.count_nonzero(used)), numbers.order(used)[0])
    assembled = time.process_time() - start - read
    size = matrix.data.nbytes + matrix.indices.nbytes + matrix.indptr.nbytes
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    entries = matrix.nnz if path.endswith(".op4") else (matrix.nnz + matrix.shape[0]) // 2
    return {
        "file_megabytes": Path(path).stat().st_size / 1e6,
        "million_entries": entries / 1e6,
        "read_seconds": read,
        "assemble_seconds": assembled,
        "million_entries_a_second_read": entries / read / 1e6,
        "million_entries_a_second": entries / (read + assembled) / 1e6,
        "matrix_megabytes": size / 1e6,
        "peak_over_matrix": peak / size,
        "trace": float(matrix.diagonal().sum()),
    }


def _resident() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


def main() -> None:
    """Write a file of each format, read it in a process of its own, and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dofs", type=int, default=300_000)
    parser.add_argument("--band", type=int, default=40, help="entries a row in one triangle")
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=list(FORMATS))
    parser.add_argument("--file", help="measure the reading of one file, and nothing else")
    options = parser.parse_args()
    if options.file:
        print(json.dumps(measure(options.file)))
        return
    # Not above: with MPI under way, freed memory stays with the process that is measured, unlike in `attrito import`.
    from common import progress, report

    results = {}
    for name in options.formats:
        write, file = FORMATS[name]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / file
            write(path, options.dofs, options.band)
            progress(f"{name}: {path.stat().st_size / 1e6:.0f} MB")
            command = [sys.executable, __file__, "--file", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        results[name] = json.loads(done.stdout)
    report({"dofs": options.dofs, "band": options.band, "formats": results})


if __name__ == "__main__":
    main()
